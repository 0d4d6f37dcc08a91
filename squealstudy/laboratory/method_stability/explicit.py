"""Central differences on one mode that a stuck contact point damps: the limit of its step.

Modal damping is implicit and costs nothing. Friction sees a velocity of the past: with c_s the
rate k_t A T^2 of a stuck point, the sign-changing solution z = -1 of the recurrence stands at

    (h w)^2 + 2 h c_s = 4  for the velocity of half a step before,
    (h w)^2 + 4 h c_s = 4  for the extrapolated one,

and beyond it the motion grows by a factor every step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from squealstudy.laboratory.integrators.explicit import CentralDifference
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    FAILED,
    WRONG,
    Case,
    Cell,
    Knob,
)
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.doubts import energy_drift
from squealstudy.motion.integrator import DRIFT_LIMIT
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

STEPS = 4000
START = 1e-6  # m/s
BOUND = 1e6  # N, what friction holds
HUGE = 1e8  # times the energy at the start: it has grown, and may soon slip
GROWS = 1e-4  # a step: more than a beat of the energy
PARTS = 4

KNOBS = (
    Knob("step", "time step h", 1e-5, low=1e-9, high=1.0, unit="s"),
    Knob("frequency", "of the mode", 1e3, low=1e-3, high=1e7, unit="Hz"),
    Knob("damping_ratio", "modal, implicit", 0.0, low=0.0, high=0.9),
    Knob("stick_rate", "damping by the stuck point, k_t A T^2", 0.0, low=0.0, high=1e9, unit="1/s"),
    Knob("lagged", "1: friction sees the velocity of half a step before", 1.0, low=0.0, high=1.0),
)


def measure(knobs: Mapping[str, float]) -> Cell:
    """`measured` is the growth of the amplitude a step, 1 where it is bounded."""
    with np.errstate(all="ignore"):
        result = swing(knobs)
        growth = rate(result)
        drift = energy_drift(result)
    predicted = limit_number(knobs)
    said = result.outcome != "ok"
    cost = result.mean_iterations
    if growth <= 1.0 + GROWS and not said:
        return Cell(outcome=CONVERGED, predicted=predicted, measured=growth, cost=cost)
    if said:
        return Cell(
            outcome=FAILED,
            predicted=predicted,
            measured=growth,
            cost=cost,
            by=result.outcome,
            flagged=True,
        )
    flagged = not drift <= DRIFT_LIMIT
    by = f"energy drift {drift:.1e}" if flagged else ""
    return Cell(
        outcome=WRONG, predicted=predicted, measured=growth, cost=cost, by=by, flagged=flagged
    )


def limit_number(knobs: Mapping[str, float]) -> float:
    """1 at the limit of the step."""
    h, omega = knobs["step"], 2 * np.pi * knobs["frequency"]
    weight = 2.0 if knobs["lagged"] >= 0.5 else 4.0
    return float(np.sqrt((h * omega) ** 2 + weight * h * knobs["stick_rate"]) / 2)


def swing(knobs: Mapping[str, float]) -> Motion:
    """The mode from a small velocity on, every step saved."""
    omega = 2 * np.pi * knobs["frequency"]
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    system = ModalSystem(
        omega2=np.array([omega**2]),
        N=none,
        T1=one,
        T2=none,
        area=one[0],
        frictional=one[0],
        radius=one[0],
        gap=none[0],
        k_ref=none[0],
        force=np.zeros((1, 3)),
    )
    law = contact_law("exponential", p0=BOUND, lam=1e12)
    friction = FrictionLaw(1.0, max(knobs["stick_rate"], np.finfo(float).tiny))
    design = MotionPoint(law, friction, 0.0, np.array([2 * knobs["damping_ratio"] * omega]))
    method = CentralDifference(velocity="lagged" if knobs["lagged"] >= 0.5 else "extrapolated")
    settings = MotionSettings(STEPS * knobs["step"], knobs["step"], 1, method)
    return simulate(system, [replace(design, v0=np.array([START]))], settings)[0]


def rate(result: Motion) -> float:
    """Growth of the amplitude a step, 1 where it stays bounded."""
    energy = result.history["modal_energy"]
    beyond = np.flatnonzero(~(energy < HUGE * energy[0]))
    if len(energy) < PARTS or (len(beyond) and beyond[0] <= 1):
        return np.inf  # gone within a step or two
    if len(beyond):
        last = beyond[0] - 1  # what is beyond may slip, or be no number
        middle = last // 2
        return float((energy[last] / energy[middle]) ** (0.5 / max(last - middle, 1)))
    # the largest of a part: the energy of the scheme is not this one and beats with it
    *_, before, end = (part.max() for part in np.array_split(energy, PARTS))
    return max(1.0, float((end / before) ** (0.5 * PARTS / len(energy))))


EXPLICIT = Case(
    name="explicit",
    title="central differences, one mode and a stuck point",
    boundary="h omega = 2, less with a stuck point: (h omega)^2 + 2 or 4 h c_s = 4",
    settings=KNOBS,
    measure=measure,
)
