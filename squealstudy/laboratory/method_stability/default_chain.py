"""The default chain of helps: which of them a run needed, and whether its final state is right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from squealstudy.laboratory.method_stability.contact_models import (
    CONTACT_KNOBS,
    ContactState,
    rough_state,
)
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    RECOVERED,
    SLOW,
    WRONG,
    CaseResult,
    StabilityCase,
    failed,
)
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.level_errors import energy_drift
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import (
    CLOSING_LIMIT,
    STICK_LIMIT,
    closing_number,
    stick_number,
)

N_STEPS = 20
SLOW_PASSES = 10.0  # passes in a step above which a run is slow: five times a squealing brake's
# sub-steps in a step of the reference for runs that halved steps: as many as halvings allow
REFERENCE_SUBSTEPS = 16
MAX_REL_STATE_ERROR = 0.05  # a final state at a larger relative distance is wrong
ENERGY = "energy drift"


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the largest number of passes in a step, over that at which it is halved.

    `error` is the distance to the same steps solved to a tolerance of 1e-10; where a step had to be
    halved, to steps of 1 / REFERENCE_SUBSTEPS of its length. `flagged` may be a false alarm: the
    run is shorter than an impact, inside which the energy balance is off.
    """
    state = rough_state(knobs)
    settings = chain_settings(knobs["step"])
    with np.errstate(over="ignore", invalid="ignore"):
        run_result = run(state, settings)
        predicted = predict(state, knobs["step"])
        measured = run_result.max_iterations / settings.max_iterations
        cost = run_result.mean_iterations
        if run_result.outcome != "ok":
            return failed(run_result.outcome, predicted=predicted, measured=measured, cost=cost)
        error = deviation(state, settings, run_result)
        by = help_needed(state, settings, run_result)
    outcome = RECOVERED if by else SLOW if cost > SLOW_PASSES else CONVERGED
    flagged = not energy_drift(run_result) <= ExactFreeMotion.drift_limit
    if error > MAX_REL_STATE_ERROR:
        outcome, by = WRONG, ENERGY if flagged else by
    return CaseResult(
        outcome=outcome,
        predicted=predicted,
        measured=measured,
        error=error,
        cost=cost,
        by=by,
        flagged=flagged,
    )


def chain_settings(step: float, chain: ExactFreeMotion | None = None) -> MotionSettings:
    """A few steps with the defaults for many contact points, or with another `chain` of helps.

    Such steps are not cut where a contact point meets a corner of its law.
    """
    method = (chain or ExactFreeMotion()).model_copy(update={"corner_halvings": 0})
    return MotionSettings(N_STEPS * step, step, 1, method, tolerance=method.tolerance)


def run(state: ContactState, settings: MotionSettings) -> Motion:
    """Integrate the case from its initial state."""
    return simulate(state.system, [state.design], settings)[0]


def predict(state: ContactState, step: float) -> float:
    """The larger of the stick number and the closing number, each over its limit."""
    system, design = state.system, state.design
    velocity = float(np.abs(system.N @ design.start(system.n)[1]).max())
    return max(
        stick_number(system, design, step) / STICK_LIMIT,
        closing_number(design.contact, velocity, step) / CLOSING_LIMIT,
    )


def help_needed(state: ContactState, settings: MotionSettings, result: Motion) -> str:
    """Last help of the chain that the run needed not to fail; empty if it needed none."""
    if result.newton_steps:
        return "newton"
    if result.halvings:
        return "halving"
    unaided = chain_settings(settings.step, ExactFreeMotion(tangential_damping="never"))
    if not _needs_no_help(run(state, unaided)):
        return "tangential damping"
    plain = chain_settings(settings.step, ExactFreeMotion(tangential_damping="never", aitken=False))
    return "" if _needs_no_help(run(state, plain)) else "aitken"


def _needs_no_help(result: Motion) -> bool:
    return result.outcome == "ok" and not result.halvings and not result.newton_steps


def deviation(state: ContactState, settings: MotionSettings, result: Motion) -> float:
    """Relative distance of a run's final state to that of steps solved to a tolerance of 1e-10.

    NaN where one of the runs fails.
    """
    sharp = replace(settings, tolerance=1e-10, max_iterations=400)
    reference = run(state, sharp)
    if not result.halvings and not reference.halvings:
        return distance(state, result, reference)
    return distance(
        state, result, run(state, replace(sharp, step=settings.step / REFERENCE_SUBSTEPS))
    )


def distance(state: ContactState, a: Motion, b: Motion) -> float:
    """Distance of two final states in the energy norm, relative to b; NaN where one run failed."""
    if "ok" not in (a.outcome, b.outcome) or a.outcome != b.outcome:
        return float("nan")
    omega = state.system.frequencies
    change = np.concatenate([a.v - b.v, omega * (a.q - b.q)])
    size = np.linalg.norm(np.concatenate([b.v, omega * b.q]))
    return float(np.linalg.norm(change) / size)


DEFAULT_CHAIN = StabilityCase(
    name="default_chain",
    title="default chain of helps, six modes and eight points",
    boundary=(
        f"friction's slope h k_t |T|^2 / 2 = {STICK_LIMIT:g}, or closing contact "
        f"lambda h v = {CLOSING_LIMIT:g}"
    ),
    settings=tuple(k for k in CONTACT_KNOBS if k.name != "contact_factor"),
    measure=measure,
)
