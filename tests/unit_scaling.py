"""The same study in other units of mass, length and time, and the dimensions of what it gives."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.laws import FRICTION_CURVES, contact_law, friction_curve
from squealstudy.models.catalogue import MODELS
from squealstudy.models.operating import contact_parameters
from squealstudy.study.definition import ResolvedStudy, parse_study

Dimension = tuple[int, int, int]  # powers of mass, length and time
DIMENSIONS: dict[str, Dimension] = {
    "": (0, 0, 0),
    "deg": (0, 0, 0),
    "kg": (1, 0, 0),
    "s": (0, 0, 1),
    "Hz": (0, 0, -1),
    "1/s": (0, 0, -1),
    "m/s": (0, 1, -1),
    "N": (1, 1, -2),
    "J": (1, 2, -2),
    "N/m": (1, 0, -2),
    # per area, and a minimal model's areas are stiffness / 5e11: a damper over a stiffness
    "N s/m3": (0, 0, 1),
    "Pa/m^n": (0, 0, 0),  # for the same reason
    "Pa": (1, -1, -2),
    "1/m": (0, -1, 0),
    "s/m": (0, -1, 1),
}


@dataclass(frozen=True)
class Units:
    """How many of the new units make an old one."""

    mass: float = 1.0
    length: float = 1.0
    time: float = 1.0

    def factor(self, unit: str) -> float:
        """What turns a number in old units into one in new units."""
        m, ell, t = DIMENSIONS[unit]
        return float(self.mass**m * self.length**ell * self.time**t)


def parameter_units(model: str) -> dict[str, str]:
    """Unit of every parameter of a model of the catalogue."""
    return {p.name: p.unit for p in MODELS[model].parameters}


def scaled_text(
    model: str,
    kind: str,
    units: Units,
    sweep: tuple[str, list[float]] | None,
    given: dict[str, float] | None = None,
    band: tuple[float, float] = (10.0, 1e3),
    sections: dict[str, dict[str, tuple[object, str]]] | None = None,
) -> str:
    """A study of a minimal model, every number of it in the new units.

    `sections` holds further keys with their units, by section.
    """
    of = parameter_units(model)
    of_laws = *contact_parameters(), *FRICTION_CURVES.parameters()
    acting = contact_law("bilateral").names + friction_curve("exponential_fall").names
    idle = {p.name for p in of_laws} - set(acting)
    values = {k: v for k, v in MODELS[model].defaults().items() if k not in idle} | (given or {})
    name = None if sweep is None else sweep[0]
    tables: dict[str, dict[str, object]] = {
        "study": {"name": "scaled", "kind": kind},
        "model": {"name": model},
        "parameters": {k: v * units.factor(of[k]) for k, v in values.items() if k != name},
        "modes": {"band": [f * units.factor("Hz") for f in band]},
    }
    for section, keys in (sections or {}).items():
        scaled = {
            k: v * units.factor(unit) if isinstance(v, float) else v
            for k, (v, unit) in keys.items()
        }
        tables[section] = tables.get(section, {}) | scaled
    lines = []
    for section, keys in tables.items():
        lines.append(f"[{section}]")
        for key, value in keys.items():
            lines.append(f'"{key}" = {_toml(value)}')
    if sweep is not None:
        levels = [float(v) * units.factor(of[sweep[0]]) for v in sweep[1]]
        lines += ["[[sweep]]", f'parameter = "{sweep[0]}"', f"values = {levels}"]
    return "\n".join(lines)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return repr(value if isinstance(value, int | list) else float(value))


def study_of(text: str) -> ResolvedStudy:
    return parse_study(text, Path("scaled.toml"))


def solved(text: str, directory: Path) -> Results:
    """The results of a study in one process."""
    run_study(Plan(study_of(text)), directory, 1)
    return Results.open(directory)


def same_table(
    scaled: pd.DataFrame,
    base: pd.DataFrame,
    columns: dict[str, str],
    units: Units,
    rtol: float,
) -> None:
    """Columns of both tables are equal up to their units; without one, exactly."""
    assert len(scaled) == len(base)
    for name, unit in columns.items():
        a, b = scaled[name].to_numpy(), base[name].to_numpy()
        if np.issubdtype(b.dtype, np.number) and unit != "exact":
            factor = units.factor(unit)
            np.testing.assert_allclose(
                a.astype(float), b.astype(float) * factor, rtol=rtol, atol=0, err_msg=name
            )
        else:
            assert list(a) == list(b), name
