"""Contact forces from an observation matrix in single precision: round-off and cancellation.

A mass slides along a surface in a motion of two modes: N q = n1 q1 + n2 q2 vanishes for
q = a (n2, -n1) cos(w t), so that only the round-off of n1 and n2 is left. Both are nearly as far
as possible from numbers of single precision, u = 2^-24, on different sides. The gap then errs by
2 u a n1 n2, and the pressure p0 exp(-lambda g) by lambda times that. The contact is so light that
it does not change the motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from squealstudy.laboratory.method_stability.contact_models import pressed
from squealstudy.laboratory.method_stability.contract import (
    CaseResult,
    Knob,
    StabilityCase,
    alarm,
    failed,
    judged,
)
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.level_errors import MAX_STORAGE_CHANGE, storage_number
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

FLOAT32_ROUND_OFF = 2.0**-24  # round-off of single precision
ROWS = 1.0 + FLOAT32_ROUND_OFF * np.array([0.9, 1.1])  # rounded down to 1 and up to 1 + 2 u
OMEGA = 2 * np.pi * 500.0
N_PERIODS, STEPS_PER_PERIOD = 1, 100
FORCE_N = 1e-6  # contact force on 1 m2, N

KNOBS = (
    Knob("amplitude", "motion along the surface", 1e-4, low=1e-12, high=1.0, unit="m"),
    Knob("lambda", "exponent of the contact law", 5e5, low=1e3, high=1e9, unit="1/m"),
    Knob("single", "1: single-precision storage, 0: double", 1.0, low=0.0, high=1.0),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is `storage_number`, `error` the largest relative error of the contact force."""
    single = knobs["single"] >= 0.5
    system, design = light_touch(knobs["lambda"])
    step = 2 * np.pi / OMEGA / STEPS_PER_PERIOD
    q0 = knobs["amplitude"] * np.array([ROWS[1], -ROWS[0]])
    settings = MotionSettings(N_PERIODS * STEPS_PER_PERIOD * step, step, 1)
    methods = Newmark(single_storage=single), Newmark()
    with np.errstate(over="ignore"):
        stored, exact = (
            simulate(system, [replace(design, q0=q0)], replace(settings, integrator=method))[0]
            for method in methods
        )
    predicted = predict(knobs) if single else 0.0
    cost = stored.mean_iterations
    if stored.outcome != "ok":
        return failed(stored.outcome, predicted=predicted, cost=cost)
    force, truth = (r.history["normal_force"] for r in (stored, exact))
    error = float(np.abs(force / truth - 1.0).max())
    energy = float(stored.history["modal_energy"].max())
    number = storage_number(system, design, energy) if single else 0.0
    return judged(
        error > MAX_STORAGE_CHANGE,
        alarm("storage number", number, MAX_STORAGE_CHANGE),
        predicted=predicted,
        measured=number,
        error=error,
        cost=cost,
    )


def light_touch(lam: float) -> tuple[ModalSystem, MotionPoint]:
    """Two modes of the same frequency, and a contact point that can slide in their motion."""
    rows = np.zeros((3, 1, 2))
    rows[0] = ROWS
    system = pressed(np.full(2, OMEGA**2), rows, np.ones(1), np.array([FORCE_N]), lam)
    law = contact_law("exponential", lam=lam)
    return system, MotionPoint(law, FrictionLaw(0.0, 1.0), 0.0, np.zeros(2))


def predict(knobs: Mapping[str, float]) -> float:
    """Bound of the pressure's relative error by round-off, over the limit."""
    return float(
        knobs["lambda"]
        * 2
        * FLOAT32_ROUND_OFF
        * np.prod(ROWS)
        * knobs["amplitude"]
        / MAX_STORAGE_CHANGE
    )


STORAGE = StabilityCase(
    name="storage",
    title="contact force by an observation matrix in single precision",
    boundary="lambda 2 u |n1 n2| a = 1e-3, u = 2^-24",
    settings=KNOBS,
    measure=measure,
)
