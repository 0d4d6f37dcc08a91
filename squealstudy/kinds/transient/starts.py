"""Starts of runs: steady sliding of each design point, its unstable modes, and its perturbation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from squealstudy.engine.cache import NewGaps, known_gap, prepared_model
from squealstudy.errors import ParameterError
from squealstudy.kinds.transient.batch import BatchTask
from squealstudy.kinds.transient.section import STUCK
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.motion_points import motion_at, motions_at
from squealstudy.motion.point import perturbed
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.motion.stuck_start import stuck
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint

Failure = tuple[str, str]  # status and message


def set_up(task: BatchTask, point: DesignPoint, gaps: NewGaps) -> MotionPoint | Failure:
    """A design point ready to be run from its perturbed start, or status and message of failure."""
    return set_up_all(task, [point], gaps)[0]


def set_up_all(
    task: BatchTask, points: Sequence[DesignPoint], gaps: NewGaps
) -> list[MotionPoint | Failure]:
    """Set up design points of the task's structure, in their order."""
    resolved = [_resolved(task, point) for point in points]
    sliding = [point for point in resolved if isinstance(point, DesignPoint)]
    motions = iter(_steady_motions(task, sliding, gaps))
    return [
        _started(task, point, next(motions)) if isinstance(point, DesignPoint) else point
        for point in resolved
    ]


def _resolved(task: BatchTask, point: DesignPoint) -> DesignPoint | Failure:
    """The point with the slope of friction that its schedule needs, or why it cannot be run."""
    schedules, values = task.schedules, point.values
    if schedules is None:
        return point
    try:
        schedules.check(values, task.section.start)
        return point.with_values(schedules.with_slope(values))
    except ParameterError as error:
        return "parameter", f"{error.key}: {error.message}"
    except FAILURES as error:
        return reason(error)


def _steady_motions(
    task: BatchTask, points: Sequence[DesignPoint], gaps: NewGaps
) -> list[MotionPoint | Failure]:
    """Points of one structure about their steady sliding, or why one has none."""
    if not points:
        return []
    key, reference = points[0].structure, task.reference
    known_gaps = [known_gap(key, point) for point in points]
    steady_motions = motions_at(
        reference,
        prepared_model(key),
        points,
        task.section.friction,
        task.band_hz,
        task.tolerance,
        known_gaps,
        None if task.hybrid else task.settings(),
    )
    motions: list[MotionPoint | Failure] = []
    for point, gap, steady_motion in zip(points, known_gaps, steady_motions, strict=True):
        if isinstance(steady_motion, ParameterError):
            motions.append(("parameter", f"{steady_motion.key}: {steady_motion.message}"))
        elif isinstance(steady_motion, Exception):
            motions.append(reason(steady_motion))
        else:
            steady, motion_start = steady_motion
            motions.append(motion_start)
            if gap is None:
                gaps.add(key, point, steady.gap)
    return motions


def _started(
    task: BatchTask, point: DesignPoint, motion_start: MotionPoint | Failure
) -> MotionPoint | Failure:
    """A point with its schedule and its perturbed start; failures pass through."""
    if not isinstance(motion_start, MotionPoint):
        return motion_start
    section, reference, schedules = task.section, task.reference, task.schedules
    motion_start = replace(motion_start, continued=task.start is not None)
    if schedules is not None:
        turning = None if task.hybrid else reference.damping.turning_at(point.state())
        over_time = schedules.of(point.values, reference.load, turning)
        motion_start = replace(motion_start, schedule=over_time)
    system = reference.system
    kicked = perturbed(system, motion_start, task.perturbation, section.perturb_modes)
    try:
        return stuck(system, kicked) if section.start == STUCK else kicked
    except ParameterError as error:
        return "parameter", f"{error.key}: {error.message}"


def steady_motion(
    reference: SharedModes,
    point: DesignPoint,
    friction_kind: str,
    band_hz: tuple[float, float] | None,
    tolerance: float,
    gaps: NewGaps,
    settings: MotionSettings | None = None,
) -> tuple[WorkingPoint, MotionPoint]:
    """Working point of a design point, and the design point about it in shared modes.

    Without `band_hz` its unstable modes are not sought. Without `settings` the effect of the time
    step on these modes is not computed.

    Raises
    ------
    ParameterError
        A value that cannot be used.
    ConvergenceError, or another of FAILURES
        Where there is no working point.
    """
    cached_gap = known_gap(point.structure, point)
    prepared = prepared_model(point.structure)
    steady, motion_start = motion_at(
        reference, prepared, point, friction_kind, band_hz, tolerance, cached_gap, settings=settings
    )
    if cached_gap is None:
        gaps.add(point.structure, point, steady.gap)
    return steady, motion_start
