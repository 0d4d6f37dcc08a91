"""Small contact models on which Newmark's iteration is tried, and states from which a step starts.

Both are modal systems at a reference (mean pressure `REFERENCE_PRESSURE`, exponent
`REFERENCE_LAMBDA`), whose contact tangent is in the fixed Jacobian. The design point has another
pressure and law, as in a sweep on shared modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.linalg as la

from squealstudy.laboratory.method_stability.contract import Knob
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.system import ModalSystem, MotionPoint

REFERENCE_PRESSURE = 1e6  # Pa
REFERENCE_LAMBDA = 5e5  # 1/m
DAMPING_RATIO = 0.01
SEED = 3
N_MODES, N_POINTS = 6, 8
# points that carry almost no pressure, and their pressure over that of the reference
NEARLY_OPEN, NEARLY_OPEN_PRESSURE_SHARE = (0, 5), 1e-3
GAP_DISTURBANCE_RATIO = 1e-5  # disturbance of the gap, over 1 / lambda
STUCK_POINTS = (2, 6)  # points that stick in the initial state

CONTACT_KNOBS = (
    Knob("step", "time step h", 1e-6, low=1e-8, high=1e-2, unit="s"),
    Knob("contact_factor", "k_c over the static contact tangent", 1.0, low=0.0, high=1e3),
    Knob(
        "kt", "slope of friction at zero sliding, per area", 3e7, low=1e3, high=1e15, unit="N s/m3"
    ),
    Knob("lambda", "exponent of the contact law", REFERENCE_LAMBDA, low=1e3, high=1e9, unit="1/m"),
    Knob("friction", "friction coefficient", 0.5, low=0.0, high=5.0),
    Knob("sliding_speed", "imposed sliding speed", 0.5, low=1e-4, high=1e3, unit="m/s"),
    Knob("preload", "contact pressure over that of the reference", 1.0, low=1e-4, high=1e4),
)


@dataclass(frozen=True)
class ContactState:
    """A model, and a design point on it with its initial state."""

    system: ModalSystem
    design: MotionPoint


@cache
def rough_model() -> tuple[ModalSystem, np.ndarray]:
    """A random model of six modes and eight contact points; its reference pressures (nc,), Pa."""
    rng = np.random.default_rng(SEED)
    w2 = (2 * np.pi * np.sort(rng.uniform(800.0, 9e3, N_MODES))) ** 2
    area = rng.uniform(0.5, 1.5, N_POINTS) * 1e-2 / N_POINTS
    p = rng.uniform(0.5, 1.5, N_POINTS) * REFERENCE_PRESSURE
    k = area * p * REFERENCE_LAMBDA
    rows = rng.normal(size=(3, N_POINTS, N_MODES)) * np.sqrt(0.3 * w2.mean() / (k.sum() * N_MODES))
    values, phi = la.eigh(np.diag(w2) + rows[0].T @ (k[:, None] * rows[0]))
    return pressed(values, rows @ phi, area, p), p


@cache
def single_point() -> tuple[ModalSystem, np.ndarray]:
    """One mass with a contact point, at 1 kHz in both directions without it; pressure (1,), Pa."""
    area, p = np.array([1e-3]), np.array([REFERENCE_PRESSURE])
    k = float(area[0] * p[0] * REFERENCE_LAMBDA)
    mass = k / (2 * np.pi * 1e3) ** 2
    rows = np.array([[[1.0, 0.0]], [[0.0, 1.0]], [[0.0, 0.0]]]) / np.sqrt(mass)
    omega_squared = (2 * np.pi * 1e3) ** 2
    return pressed(np.array([omega_squared + k / mass, omega_squared]), rows, area, p), p


def pressed(
    omega2: np.ndarray,
    rows: np.ndarray,
    area: np.ndarray,
    p: np.ndarray,
    lam: float = REFERENCE_LAMBDA,
    **others: float,
) -> ModalSystem:
    """Modal system whose contact points have an exponential law and pressures p (nc,) [Pa].

    `omega2` (n,) has the contact tangent, `rows` (3, nc, n) are gaps and displacements along and
    across the sliding direction, `area` (nc,) is in m2, `others` are the law's parameters beside
    its exponent. Every point has friction and an arm of 1 m.
    """
    law, nc = contact_law("exponential", lam=lam, **others), len(area)
    return ModalSystem(
        omega2=omega2,
        N=rows[0],
        T1=rows[1],
        T2=rows[2],
        area=area,
        frictional=np.ones(nc),
        radius=np.ones(nc),
        gap=np.array([law.gap_at(float(x)) for x in p]),
        k_ref=area * p * lam,
        force=np.column_stack([area * p, 0 * p, 0 * p]),
    )


def rough_state(values: Mapping[str, float]) -> ContactState:
    """State of six modes and eight points: two stick, two are nearly open, the others slide."""
    system, p_ref = rough_model()
    share = np.ones(N_POINTS)
    share[list(NEARLY_OPEN)] = NEARLY_OPEN_PRESSURE_SHARE
    design = _design(system, p_ref * share, values)
    stuck_rows = np.vstack([system.T1[list(STUCK_POINTS)], system.T2[list(STUCK_POINTS)]])
    stop = np.repeat([-values["sliding_speed"], 0.0], len(STUCK_POINTS))
    v0 = np.linalg.lstsq(stuck_rows, stop, rcond=None)[0]
    return ContactState(system, replace(design, v0=v0))


def sliding_state(values: Mapping[str, float]) -> ContactState:
    """State of one sliding point, so near to equilibrium that its tangents are those there."""
    system, p_ref = single_point()
    closer = -GAP_DISTURBANCE_RATIO / (values["lambda"] * system.N[0, 0])
    design = _design(system, p_ref, values)
    return ContactState(system, replace(design, q0=np.array([closer, 0.0])))


def _design(system: ModalSystem, p_ref: np.ndarray, values: Mapping[str, float]) -> MotionPoint:
    """Design point in steady sliding, with its own law and a multiple of reference pressures."""
    law = contact_law("exponential", lam=values["lambda"])
    p, mu = values["preload"] * p_ref, values["friction"]
    normal = system.area * p
    speed = values["sliding_speed"]
    drag = -system.area * np.minimum(mu * p, values["kt"] * speed)
    return MotionPoint(
        law,
        FrictionLaw(mu, values["kt"]),
        speed,
        2 * DAMPING_RATIO * np.sqrt(system.omega2),
        gap=np.array([law.gap_at(float(x)) for x in p]),
        force=np.column_stack([normal, drag, 0 * p]),
    )
