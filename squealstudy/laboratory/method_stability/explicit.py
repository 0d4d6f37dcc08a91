"""Central differences on a mode that a stuck contact point damps: the largest stable step.

Modal damping is implicit and does not change that step. Friction sees an earlier velocity. With the
rate c_s = k_t A T^2 of a stuck point, the recurrence has its sign-changing solution z = -1 at

    (h w)^2 + 2 h c_s = 4  for the velocity of half a step before,
    (h w)^2 + 4 h c_s = 4  for the extrapolated one,

and beyond that the motion grows by a factor in every step.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from squealstudy.laboratory.integrators.explicit import CentralDifference
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
from squealstudy.motion.integrator import DRIFT_LIMIT
from squealstudy.motion.level_errors import energy_drift
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import MotionPoint

N_STEPS = 4000
START_VELOCITY = 1e-6  # m/s
FRICTION_BOUND_N = 1e6  # N, largest friction force
LAMBDA = 1e12  # 1/m; the mode does not move the contact in its normal direction
GROWN_ENERGY_RATIO = 1e8  # energy over that at the start up to which growth is read: then it slips
MIN_GROWTH_PER_STEP = 1e-4  # growth in a step that is more than the energy's beating
N_PARTS = 4  # parts of a run, whose largest energies are compared

KNOBS = (
    Knob("step", "time step h", 1e-5, low=1e-9, high=1.0, unit="s"),
    Knob("frequency", "of the mode", 1e3, low=1e-3, high=1e7, unit="Hz"),
    Knob("damping_ratio", "modal, implicit", 0.0, low=0.0, high=0.9),
    Knob("stick_rate", "damping by the stuck point, k_t A T^2", 0.0, low=0.0, high=1e9, unit="1/s"),
    Knob("lagged", "1: friction sees the velocity of half a step before", 1.0, low=0.0, high=1.0),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the factor by which the amplitude grows in a step; 1 where it is bounded."""
    with np.errstate(all="ignore"):
        motion = swing(knobs)
        growth = rate(motion)
        drift = energy_drift(motion)
    numbers = {
        "predicted": limit_number(knobs),
        "measured": growth,
        "cost": motion.mean_iterations,
    }
    if motion.outcome != "ok":
        return failed(motion.outcome, **numbers)
    wrong = growth > 1.0 + MIN_GROWTH_PER_STEP
    return judged(wrong, alarm("energy drift", drift, DRIFT_LIMIT), **numbers)


def limit_number(knobs: Mapping[str, float]) -> float:
    """The step over the largest stable one."""
    h, omega = knobs["step"], 2 * np.pi * knobs["frequency"]
    weight = 2.0 if knobs["lagged"] >= 0.5 else 4.0
    return float(np.sqrt((h * omega) ** 2 + weight * h * knobs["stick_rate"]) / 2)


def swing(knobs: Mapping[str, float]) -> Motion:
    """Motion of the mode from a small velocity, with every step saved."""
    omega = 2 * np.pi * knobs["frequency"]
    along, one = np.array([[[0.0]], [[1.0]], [[0.0]]]), np.ones(1)
    system = pressed(
        np.array([omega**2]), along, one, FRICTION_BOUND_N * one, LAMBDA, p0=FRICTION_BOUND_N
    )
    law = contact_law("exponential", p0=FRICTION_BOUND_N, lam=LAMBDA)
    friction = FrictionLaw(1.0, max(knobs["stick_rate"], np.finfo(float).tiny))
    damping = np.array([2 * knobs["damping_ratio"] * omega])
    design = MotionPoint(law, friction, 0.0, damping, v0=np.array([START_VELOCITY]))
    method = CentralDifference(velocity="lagged" if knobs["lagged"] >= 0.5 else "extrapolated")
    settings = MotionSettings(N_STEPS * knobs["step"], knobs["step"], 1, method)
    return simulate(system, [design], settings)[0]


def rate(result: Motion) -> float:
    """Factor by which the amplitude grows in a step; 1 where it stays bounded."""
    energy = result.history["modal_energy"]
    beyond = np.flatnonzero(~(energy < GROWN_ENERGY_RATIO * energy[0]))
    if len(energy) < N_PARTS or (len(beyond) and beyond[0] <= 1):
        return np.inf  # too fast to be read
    if len(beyond):
        last = beyond[0] - 1  # later rows may slip, or not be finite
        middle = last // 2
        return float((energy[last] / energy[middle]) ** (0.5 / max(last - middle, 1)))
    # the largest of each part: this energy is not the one that the scheme conserves, and beats
    *_, before, end = (part.max() for part in np.array_split(energy, N_PARTS))
    return max(1.0, float((end / before) ** (0.5 * N_PARTS / len(energy))))


EXPLICIT = StabilityCase(
    name="explicit",
    title="central differences, one mode and a stuck point",
    boundary="h omega = 2, less with a stuck point: (h omega)^2 + 2 or 4 h c_s = 4",
    settings=KNOBS,
    measure=measure,
)
