"""Pencils of Hulten's and Hoffmann's models by numpy alone, and their roots, of random values.

M = m I, K(mu) of the closed forms in `squealstudy/models/catalogue`, C of modal damping of modes
without friction, of damping proportional to the stiffness, and of friction that falls with speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

HZ = 2.0 * np.pi
MODELS = ("hulten", "hoffmann")
STRUCTURE = {
    "hulten": ("frequency_1", "frequency_2", "mass"),
    "hoffmann": ("k1", "k2", "contact_stiffness", "mass", "alpha1", "alpha2"),
}
STATE = ("friction", "sliding_speed", "damping_ratio", "stiffness_damping")
FALL = ("friction_law.static_ratio", "friction_law.decay_speed")
OWN_DAMPING = ("modes[1].damping_ratio", "modes[2].damping_ratio")


@dataclass(frozen=True)
class SmallModel:
    """One of MODELS with all its values in the units of a study file."""

    name: str
    given: Mapping[str, float]

    def roots(self, **changes: float) -> np.ndarray:
        """Roots (m,) of positive imaginary part, rad/s; changes are new values (dots as in files).

        The modes keep damping ratios of their own where `modes[i].damping_ratio` is among them.
        """
        v = {**self.given, **changes}
        M, C, K = self.matrices(v)
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K / M, -C / M]])
        lam = np.linalg.eigvals(A)
        return lam[lam.imag > 0]

    def matrices(self, v: Mapping[str, float]) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, damping and stiffness at steady sliding."""
        m, load, speed = v["mass"], v["normal_force"], v["sliding_speed"]
        fall = v["friction"] * (v[FALL[0]] - 1.0) * np.exp(-speed / v[FALL[1]])
        mu, slope = v["friction"] + fall, -fall / v[FALL[1]]
        if self.name == "hulten":
            k = m * (HZ * np.array([v["frequency_1"], v["frequency_2"]])) ** 2
            even, skew = np.diag(k), np.array([[0.0, -k[1]], [k[0], 0.0]])
            press = load * np.array([1.0 - mu, 1.0 + mu]) / (1.0 + mu**2)
            falling = slope * np.diag(press)
        else:
            angle = np.deg2rad([v["alpha1"], v["alpha2"]])
            along = np.array([np.cos(angle), np.sin(angle)])
            even = (along * [v["k1"], v["k2"]]) @ along.T
            even[1, 1] += v["contact_stiffness"]
            skew = np.array([[0.0, -v["contact_stiffness"]], [0.0, 0.0]])
            q = np.linalg.solve(even + mu * skew, [0.0, -load])
            falling = slope * np.diag([-v["contact_stiffness"] * q[1], 0.0])
        squares, modes = np.linalg.eigh(even / m)
        zeta = np.array([v.get(name, v["damping_ratio"]) for name in OWN_DAMPING])
        omega = np.sqrt(squares)
        modal = m * (modes * (2.0 * zeta * omega + v["stiffness_damping"] * squares)) @ modes.T
        return m, modal + falling, even + mu * skew

    def parameters(self) -> str:
        """The [parameters] of a study file."""
        return "[parameters]\n" + "".join(f"{n} = {float(x)!r}\n" for n, x in self.given.items())


def random_model(rng: np.random.Generator, name: str) -> SmallModel:
    """Values by chance: friction on both sides of lock-in, falling with speed in every third."""
    falls = rng.random() < 1.0 / 3.0
    values = {
        "friction": rng.uniform(0.05, 0.9),
        "sliding_speed": rng.uniform(0.1, 2.0),
        "damping_ratio": rng.uniform(0.001, 0.03),
        "stiffness_damping": float(rng.choice([0.0, 2e-5])),
        FALL[0]: rng.uniform(1.05, 1.5) if falls else 1.0,
        FALL[1]: rng.uniform(0.3, 1.0),
        "mass": rng.uniform(0.5, 2.0),
        "normal_force": rng.uniform(20.0, 300.0),
    }
    if falls:  # friction that falls acts as damping of either sign: far from contacts that pull
        values["friction"] *= 0.6
    if name == "hulten":
        values |= {"frequency_1": rng.uniform(80, 120), "frequency_2": rng.uniform(60, 100)}
    else:
        values |= {
            "k1": rng.uniform(1e5, 4e5),
            "k2": rng.uniform(2e6, 3e6),
            "contact_stiffness": rng.uniform(1e6, 1.6e6),
            "alpha1": rng.uniform(140.0, 160.0),
            "alpha2": rng.uniform(25.0, 35.0),
        }
    return SmallModel(name, {k: float(v) for k, v in values.items()})
