"""Design points of a batch: set up about their steady sliding, and integrated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from squealstudy.engine.cache import NewGaps, known_gap, prepared_model
from squealstudy.engine.rows import FAILURES, reason
from squealstudy.errors import ParameterError
from squealstudy.kinds.transient.batch import BatchTask, sensed_modes
from squealstudy.kinds.transient.hybrid_motions import hybrid_motions
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.modes.point import state_working_point
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.settling import known_outcome
from squealstudy.motion.point import friction_law, motion_point, perturbed
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.system import MotionPoint
from squealstudy.study.design import DesignPoint

LOOKS = 20  # at a run, evenly over its duration

Failure = tuple[str, str]  # status and message


def set_up(task: BatchTask, point: DesignPoint, gaps: NewGaps) -> MotionPoint | Failure:
    """Working point, forecast and perturbed start of a design point, or why there is none."""
    prepared, state, reference = (
        prepared_model(point.structure),
        point.state(),
        task.reference,
    )
    values, section = point.values, task.section
    try:
        known = known_gap(point.structure, point)
        steady = state_working_point(prepared, state, known)
        if known is None:
            gaps.add(point.structure, point, steady.gap)
        slope, saturation = values[SLOPE.name], values[REGULARISATION_SPEED.name]
        friction = friction_law(state, steady, slope, saturation, section.friction)
        made = motion_point(reference, steady, state, friction, task.band_hz, task.tolerance)
    except ParameterError as error:
        return "parameter", f"{error.key}: {error.message}"
    except FAILURES as error:
        return reason(error)
    made = replace(made, continued=task.start is not None)
    return perturbed(reference.system, made, task.perturbation, section.perturb_modes)


def integrate(
    task: BatchTask, chosen: Sequence[DesignPoint], points: Sequence[MotionPoint]
) -> list[Motion]:
    """Motions of design points that were set up, in the representation of the study.

    Raises
    ------
    ModelError
        Modes of the hybrid representation that do not correspond to those of the modal one.
    """
    return hybrid_motions(task, chosen, points) if task.hybrid else _modal_motions(task, points)


def final_state(task: BatchTask, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Where a motion ended (n,), in coordinates that another run can start from."""
    if task.hybrid:
        return motion.q, motion.v
    final = task.reference.phi @ np.stack([motion.q, motion.v], axis=1)
    return final[:, 0], final[:, 1]


def _modal_motions(task: BatchTask, points: Sequence[MotionPoint]) -> list[Motion]:
    reference, settings = task.reference, task.settings()
    omega2 = reference.system.omega2[: reference.n_exact]
    system = replace(reference.system, sensed=sensed_modes(task.section, omega2, task.band_hz))
    if task.start is not None:
        q, v = (reference.phi.T @ x for x in task.start.read())
        starts = [point.start(system.n) for point in points]
        points = [
            replace(point, q0=q0 + q, v0=v0 + v)
            for point, (q0, v0) in zip(points, starts, strict=True)
        ]
    return simulate(system, points, settings, _watch(task, settings, len(points)))


def _watch(task: BatchTask, settings: MotionSettings, count: int) -> Watch | None:
    """Stops runs whose outcome is known, where the study asks for that."""
    section = task.section
    if section.stop == "end":
        return None

    def judge(_: int, motion: Motion) -> str:
        return known_outcome(motion, section.duration, section.settle_tolerance)

    return Watch([max(1, settings.n_steps // LOOKS)] * count, judge)
