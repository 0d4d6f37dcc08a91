"""Random small designs whose tables `column_truth` holds against the independent judge.

All models, contact laws, regularisations, kicks, dampings, speeds and steps; a share of the designs
lies near the onset of instability, on both sides.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from event_reference import SmallDesign, friction_at, roots, steady

BAND = (10.0, 1000.0)  # Hz
CONTACTS = {
    "belt": ("bilateral",),
    "hoffmann": ("bilateral", "unilateral", "power", "exponential", "cubic"),
    "hulten": ("bilateral", "cubic"),
}
MODELS = ("belt", "hoffmann", "hoffmann", "hulten")  # hoffmann has most laws
NORMAL_FORCE, AREA_STIFFNESS = 100.0, 5e11  # N; Pa/m: of hoffmann and hulten
SATURATES = {False: 1.0, True: 5.0}  # k_t s over the bound, by regularisation
KINDS = ("transient", "limit_cycles", "design")


@dataclass(frozen=True)
class Case:
    """A study of one design point and what it says of it, by kind."""

    kind: str
    number: int
    design: SmallDesign
    section: dict[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The study file."""
        d = self.design
        lines = ["[study]", f'name = "case_{self.number}"', f'kind = "{self.kind}"', "[model]"]
        lines += [f'name = "{d.model}"']
        if d.model != "belt":
            lines += [f'contact_law = "{d.contact_law}"']
        lines += ["[parameters]", *(f'"{k}" = {float(v)!r}' for k, v in d.values.items())]
        lines += ["[modes]", f"band = [{BAND[0]}, {BAND[1]}]"]
        for name, section in self.sections.items():
            lines += [name, *(f"{k} = {_toml(v)}" for k, v in section.items())]
        return "\n".join(lines) + "\n"

    @property
    def sections(self) -> dict[str, dict[str, Any]]:
        """Tables of the file beyond those of every study, by their headings."""
        if self.kind != "design":
            return {f"[{self.kind}]": self.section}
        goal = {"margin": self.section["margin"], "scan": 0}
        bounds = {"parameter": "damping_ratio", "bounds": [0.0, 0.2], "cost": 1.0}
        law = "smooth" if self.design.smooth else "regularised"
        cycles = {"reach": 1.0, "friction": law}
        return {"[[variable]]": bounds, "[goal]": goal, "[limit_cycles]": cycles}


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _decades(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10 ** rng.uniform(low, high))


def _of_law(rng: np.random.Generator, law: str, stiffness: float) -> dict[str, float]:
    """Parameters of a contact law about the tangent that the model has by default."""
    p = NORMAL_FORCE / stiffness * AREA_STIFFNESS  # about the pressure of steady sliding
    tangent = AREA_STIFFNESS * rng.uniform(0.5, 2.0)
    if law == "exponential":
        return {"contact.lambda": tangent / p, "contact.p0": p * _decades(rng, -3, 0)}
    if law == "power":
        n = float(rng.choice([1.0, 1.5, 2.0, 3.0]))
        return {"contact.exponent": n, "contact.stiffness": p / (n * p / tangent) ** n}
    if law == "cubic":
        depth = p / AREA_STIFFNESS
        return {"contact.cubic_stiffness": AREA_STIFFNESS / depth**2 * rng.uniform(-0.12, 1.0)}
    return {}


def _values(rng: np.random.Generator, model: str, law: str) -> dict[str, float]:
    """Parameters of a design."""
    if model == "belt":
        return {
            "damping_ratio": _decades(rng, -3, -1),
            "sliding_speed": _decades(rng, -1.3, 0.3),
            "friction": rng.uniform(0.2, 0.6),
            "friction_law.static_ratio": rng.uniform(1.2, 2.2),
            "friction_law.decay_speed": _decades(rng, -1.0, 0.0),
        }
    values = {
        "damping_ratio": _decades(rng, -3, -1.3),
        "sliding_speed": _decades(rng, -1.3, 0.7) * float(rng.choice([1.0, 1.0, 1.0, -1.0])),
        "friction_law.static_ratio": float(rng.choice([1.0, 1.0, 1.3])),
    }
    if model == "hulten":
        values["friction"] = rng.uniform(0.15, 0.75)
        stiffness = (2 * np.pi * 100.0) ** 2
    else:
        values["friction"] = rng.uniform(0.6, 1.1)
        stiffness = 4e6 / 3
    return values | _of_law(rng, law, stiffness)


def small_design(rng: np.random.Generator) -> SmallDesign:
    """A design that has a steady sliding state of closed contact with modes in the band."""
    while True:
        model = str(rng.choice(MODELS))
        law = str(rng.choice(CONTACTS[model]))
        values = {k: float(f"{v:.6g}") for k, v in _values(rng, model, law).items()}
        smooth = bool(rng.random() < 0.3)
        d = SmallDesign(model, values, law, smooth)
        try:
            _, p, _ = steady(d)
            lam, _ = roots(d)
        except (ValueError, np.linalg.LinAlgError):
            continue
        hz = abs(lam) / (2 * np.pi)
        inside = (hz > 2 * BAND[0]) & (hz < 0.9 * BAND[1])
        if not (p > 0).all() or inside.sum() != (1 if model == "belt" else 2):
            continue
        if not -300.0 < lam[inside][0].real < 300.0:
            continue
        speed = abs(d["sliding_speed"])
        share = _decades(rng, -2.7, -1.3) / SATURATES[smooth]
        corner = float(f"{share * speed * friction_at(d, 0.0) / friction_at(d, speed):.4g}")
        return d.with_values(**{"contact.regularisation_speed": corner})


def case_of_kind(kind: str, number: int, seed: int) -> Case:
    """The case of a number, the same whatever other cases there are."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    d = small_design(rng)
    hz = np.sort(abs(roots(d)[0])[abs(roots(d)[0]) < 2 * np.pi * BAND[1]]) / (2 * np.pi)
    speed, law = abs(d["sliding_speed"]), "smooth" if d.smooth else "regularised"
    if kind == "transient":
        periods, steps = rng.uniform(25, 120), _decades(rng, 1.9, 2.9)
        section = {
            "duration": float(f"{periods / hz[0]:.3g}"),
            "step": float(f"{1 / (hz[-1] * steps):.3g}"),
            "perturbation": float(f"{min(speed, 1.0) * _decades(rng, -3, 0.5):.3g}"),
            "save_every": int(rng.choice([1, 3, 10, 20])),
            "friction": law,
        }
    elif kind == "limit_cycles":
        reach = float(rng.choice([1.0, 2.0, 4.0]))
        section = {"reach": reach, "friction": law, "kick_along_mode": True}
    else:
        section = {"margin": {"damping_ratio": float(f"{_decades(rng, -3.3, -2):.2g}")}}
    return Case(kind, number, d, section)
