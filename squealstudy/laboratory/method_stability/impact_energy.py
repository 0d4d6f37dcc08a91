"""An undamped mass that hits an exponential contact, and gains energy by the integrator.

The trapezoidal rule integrates the work of the contact force over a step. Where the stiffness
changes by its own size within a step, the energy that an impact stores differs from the energy that
it returns (Hughes 1976). The largest tangent stiffness that a motion of energy E meets is
k = lambda p at the penetration d where all of E is potential, (p - p0) / lambda + w^2 d^2 / 2 = E.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from squealstudy.laboratory.integrators.alpha_methods import DiscreteGradient
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
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.level_errors import energy_drift
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import MotionPoint

N_IMPACTS = 30
# h omega_peak below which 1 % of random cells gain more than MAX_REL_ENERGY_GAIN; above 2 all do
STEP_LIMIT = 1.26
MAX_REL_ENERGY_GAIN = 1e-2  # a result with a larger relative change of energy is wrong
P_0 = 1e-2  # Pa, contact pressure at zero gap: far smaller than in an impact

KNOBS = (
    Knob("step", "time step h", 1e-5, low=1e-9, high=1e-2, unit="s"),
    Knob("lambda", "exponent of the contact law", 1e5, low=1e3, high=1e8, unit="1/m"),
    Knob(
        "velocity",
        "of the mass of 1 kg as it meets the contact",
        1.0,
        low=1e-3,
        high=1e2,
        unit="m/s",
    ),
    Knob("frequency", "of the mass on its spring", 500.0, low=1.0, high=1e4, unit="Hz"),
    Knob("gradient", "1: the discrete gradient instead of Newmark", 0.0, low=0.0, high=1.0),
    Knob("exact", "1: exact free motion instead of Newmark's", 0.0, low=0.0, high=1.0),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the largest energy in free flight over that at the start."""
    # the discrete gradient's contact force is a difference quotient of its potential: exact
    predicted = 0.0 if knobs["gradient"] >= 0.5 else peak_number(knobs) / STEP_LIMIT
    with np.errstate(over="ignore", invalid="ignore"):
        motion = fly(knobs)
    cost = motion.mean_iterations
    if motion.outcome != "ok":
        return failed(motion.outcome, predicted=predicted, cost=cost)
    free = motion.history["normal_force"] < P_0
    stored = motion.history["stored"]
    ratio = float(stored[free].max() / stored[0])
    error = float(np.abs(stored[free] / stored[0] - 1.0).max())
    limit = (ExactFreeMotion if knobs["exact"] >= 0.5 else Newmark).drift_limit
    warning = alarm("energy drift", energy_drift(motion), limit)
    return judged(
        error > MAX_REL_ENERGY_GAIN,
        warning,
        predicted=predicted,
        measured=ratio,
        error=error,
        cost=cost,
    )


def peak_number(knobs: Mapping[str, float]) -> float:
    """Product of the step h and omega_peak at the deepest penetration, for a mass of 1 kg."""
    lam, energy = knobs["lambda"], knobs["velocity"] ** 2 / 2
    omega_squared = (2 * np.pi * knobs["frequency"]) ** 2

    def missing(depth: float) -> float:
        return P_0 / lam * np.expm1(lam * depth) + omega_squared * depth**2 / 2 - energy

    deepest = np.log1p(energy * lam / P_0) / lam
    depth = brentq(missing, 0.0, deepest, xtol=1e-9 / lam)
    return knobs["step"] * float(np.sqrt(lam * P_0 * np.exp(lam * depth)))


def fly(knobs: Mapping[str, float]) -> Motion:
    """Motion over N_IMPACTS half periods, with every step saved."""
    omega = 2 * np.pi * knobs["frequency"]
    directions, ones, zeros = np.array([[[1.0]], [[0.0]], [[0.0]]]), np.ones(1), np.zeros(1)
    law = contact_law("exponential", p0=P_0, lam=knobs["lambda"])
    system = pressed(np.array([omega**2]), directions, ones, P_0 * ones, knobs["lambda"], p0=P_0)
    free = replace(system, k_ref=zeros, force=np.zeros((1, 3)))  # the law has the whole contact
    v0 = np.array([knobs["velocity"]])
    design = MotionPoint(law, FrictionLaw(0.0, 1.0), 0.0, zeros, v0=v0)
    duration = max(N_IMPACTS * np.pi / omega, 2 * knobs["step"])
    method: Integrator = ExactFreeMotion() if knobs["exact"] >= 0.5 else Newmark()
    if knobs["gradient"] >= 0.5:
        method = DiscreteGradient()
    settings = MotionSettings(duration, knobs["step"], 1, method, tolerance=1e-8)
    return simulate(free, [design], settings)[0]


IMPACT_ENERGY = StabilityCase(
    name="impact_energy",
    title="energy of an impact oscillator under average acceleration",
    boundary="h omega_peak = 1.26, omega_peak^2 the largest tangent stiffness met over mass",
    settings=KNOBS,
    measure=measure,
)
