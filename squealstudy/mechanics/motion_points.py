"""Steady sliding of design points and motion about it, in modes that these points share."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import numpy as np

from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import (
    REGULARISATION_SPEED,
    SLOPE,
    DesignState,
    ModeKey,
    OperatingPoint,
)
from squealstudy.modes.point import state_working_point
from squealstudy.motion.point import friction_law, unwatched_point, watched_point
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import SharedModes, shared_modes
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.working_point import WorkingPoint, with_less_friction
from squealstudy.stacked.modes import MOST_COORDINATES
from squealstudy.stacked.motion_points import SlidingPoint, watched_points


def reference_modes(
    prepared: PreparedModel, operating: OperatingPoint, component_modes: Sequence[ModeKey]
) -> SharedModes:
    """Modes at the nominal working point, which the design points of a structure share."""

    def modes(reference: OperatingPoint) -> SharedModes:
        state = DesignState(reference)
        point = state_working_point(prepared, state)
        return shared_modes(prepared.model, point, state, tuple(component_modes))

    return with_less_friction(modes, operating)


def motion_at(
    reference: SharedModes,
    prepared: PreparedModel,
    point: ModelPoint,
    regularisation: str,
    band_hz: tuple[float, float] | None,
    tolerance: float,
    gap: np.ndarray | None = None,
    start_gap: np.ndarray | None = None,
    settings: MotionSettings | None = None,
) -> tuple[WorkingPoint, MotionPoint]:
    """Steady sliding of a design point, and its motion about steady sliding in shared modes.

    Parameters
    ----------
    regularisation : str
        Friction at low speed: ``regularised`` or ``smooth``.
    band_hz : (low, high) or None
        Band [Hz] in which unstable modes are followed; None: none are.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    gap : ndarray (nc,) or None
        Gaps of the working point, if it has been solved before.
    start_gap : ndarray (nc,) or None
        Gaps of a nearby design's working point, from which the solution starts.
    settings : MotionSettings or None
        Settings of its run, whose time step changes the roots of the modes that are followed.

    Raises
    ------
    ParameterError
        Where the slope of friction at zero speed is so small that sliding is not steady.
    ConvergenceError
        Where there is no steady sliding.
    """
    sliding = _sliding(reference, prepared, point, regularisation, gap, start_gap)
    if band_hz is None:
        return sliding.steady, sliding.motion
    return sliding.steady, _followed(reference, sliding, band_hz, tolerance, settings)


def motions_at(
    reference: SharedModes,
    prepared: PreparedModel,
    points: Sequence[ModelPoint],
    regularisation: str,
    band_hz: tuple[float, float],
    tolerance: float,
    gaps: Sequence[np.ndarray | None],
    settings: MotionSettings | None = None,
) -> list[tuple[WorkingPoint, MotionPoint] | Exception]:
    """`motion_at` of each design point, or the error, one of FAILURES, that it ended in.

    Growing modes of a small model's points are computed at once, as arrays. `gaps` are those (nc,)
    [m] of each working point, or None where it is not solved yet; other parameters as in
    `motion_at`.
    """
    sliding_or_error: list[SlidingPoint | Exception] = []
    for point, gap in zip(points, gaps, strict=True):
        try:
            sliding_or_error.append(_sliding(reference, prepared, point, regularisation, gap))
        except FAILURES as error:
            sliding_or_error.append(error)
    sliding_points = [
        sliding_point
        for sliding_point in sliding_or_error
        if isinstance(sliding_point, SlidingPoint)
    ]
    followed = iter(_all_followed(reference, sliding_points, band_hz, tolerance, settings))
    return [s if isinstance(s, Exception) else next(followed) for s in sliding_or_error]


def _all_followed(
    reference: SharedModes,
    sliding_points: Sequence[SlidingPoint],
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> list[tuple[WorkingPoint, MotionPoint] | Exception]:
    """Add growing modes to points: to all at once as arrays where that works, else one by one."""
    if len(sliding_points) > 1 and reference.system.n <= MOST_COORDINATES:
        with contextlib.suppress(np.linalg.LinAlgError):
            motions = watched_points(reference.system, sliding_points, band_hz, tolerance, settings)
            pairs = zip(sliding_points, motions, strict=True)
            return [(sliding.steady, motion) for sliding, motion in pairs]
    followed: list[tuple[WorkingPoint, MotionPoint] | Exception] = []
    for sliding in sliding_points:
        try:
            motion = _followed(reference, sliding, band_hz, tolerance, settings)
            followed.append((sliding.steady, motion))
        except FAILURES as error:
            followed.append(error)
    return followed


def _followed(
    reference: SharedModes,
    sliding: SlidingPoint,
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> MotionPoint:
    """The start of a run with the complex modes that it follows."""
    return watched_point(
        reference.system,
        sliding.motion,
        sliding.steady,
        sliding.state,
        band_hz,
        tolerance,
        settings,
    )


def _sliding(
    reference: SharedModes,
    prepared: PreparedModel,
    point: ModelPoint,
    regularisation: str,
    gap: np.ndarray | None,
    start_gap: np.ndarray | None = None,
) -> SlidingPoint:
    """A design point with its steady sliding and motion, before modes are followed."""
    state, values = point.state(), point.values
    steady = state_working_point(prepared, state, gap, start_gap)
    slope, saturation = values[SLOPE.name], values[REGULARISATION_SPEED.name]
    friction = friction_law(reference.system, state, steady, slope, saturation, regularisation)
    motion_start = unwatched_point(reference, steady, state, friction)
    return SlidingPoint(steady, state, motion_start)
