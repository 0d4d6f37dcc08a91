"""Design points about their own steady sliding, on modes that they share: one, or a batch."""

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
    known: np.ndarray | None = None,
    near: np.ndarray | None = None,
    settings: MotionSettings | None = None,
) -> tuple[WorkingPoint, MotionPoint]:
    """Steady sliding of a design point, and the design about it on shared modes.

    Parameters
    ----------
    regularisation : str
        ``regularised`` or ``smooth`` friction below its bound.
    band_hz : (low, high) or None
        Where unstable modes are followed; nowhere without one.
    tolerance : float
        Damping ratio below minus which a mode is unstable.
    known : ndarray (nc,) or None
        Gaps of the working point, where they are known.
    near : ndarray (nc,) or None
        Those of a design nearby, to start from.
    settings : MotionSettings or None
        Of its run, at whose step followed modes have other roots.

    Raises
    ------
    ParameterError
        Friction so soft that steady sliding is not steady.
    ConvergenceError
        No steady sliding.
    """
    sliding = _sliding(reference, prepared, point, regularisation, known, near)
    if band_hz is None:
        return sliding.steady, sliding.motion
    return sliding.steady, _watched(reference, sliding, band_hz, tolerance, settings)


def motions_at(
    reference: SharedModes,
    prepared: PreparedModel,
    points: Sequence[ModelPoint],
    regularisation: str,
    band_hz: tuple[float, float],
    tolerance: float,
    known: Sequence[np.ndarray | None],
    settings: MotionSettings | None = None,
) -> list[tuple[WorkingPoint, MotionPoint] | Exception]:
    """`motion_at` of design points, or which of FAILURES one is; small models have arrays of all.

    Parameters as of `motion_at`, of each point what is known.
    """
    every: list[SlidingPoint | Exception] = []
    for point, gap in zip(points, known, strict=True):
        try:
            every.append(_sliding(reference, prepared, point, regularisation, gap))
        except FAILURES as error:
            every.append(error)
    sliding = [one for one in every if isinstance(one, SlidingPoint)]
    watched = iter(_all_watched(reference, sliding, band_hz, tolerance, settings))
    return [one if isinstance(one, Exception) else next(watched) for one in every]


def _all_watched(
    reference: SharedModes,
    sliding: Sequence[SlidingPoint],
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> list[tuple[WorkingPoint, MotionPoint] | Exception]:
    """Points with their growing modes; where arrays of all cannot serve one, each by itself."""
    if len(sliding) > 1 and reference.system.n <= MOST_COORDINATES:
        with contextlib.suppress(np.linalg.LinAlgError):
            motions = watched_points(reference.system, sliding, band_hz, tolerance, settings)
            return [(one.steady, motion) for one, motion in zip(sliding, motions, strict=True)]
    watched: list[tuple[WorkingPoint, MotionPoint] | Exception] = []
    for one in sliding:
        try:
            watched.append((one.steady, _watched(reference, one, band_hz, tolerance, settings)))
        except FAILURES as error:
            watched.append(error)
    return watched


def _watched(
    reference: SharedModes,
    one: SlidingPoint,
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> MotionPoint:
    return watched_point(
        reference.system, one.motion, one.steady, one.state, band_hz, tolerance, settings
    )


def _sliding(
    reference: SharedModes,
    prepared: PreparedModel,
    point: ModelPoint,
    regularisation: str,
    known: np.ndarray | None,
    near: np.ndarray | None = None,
) -> SlidingPoint:
    """A design point at its own steady sliding."""
    state, values = point.state(), point.values
    steady = state_working_point(prepared, state, known, near)
    slope, saturation = values[SLOPE.name], values[REGULARISATION_SPEED.name]
    friction = friction_law(reference.system, state, steady, slope, saturation, regularisation)
    motion_start = unwatched_point(reference, steady, state, friction)
    return SlidingPoint(steady, state, motion_start)
