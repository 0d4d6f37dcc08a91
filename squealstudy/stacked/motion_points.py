"""Design points of a batch in time, with the modes by which growth in their runs is measured.

`motion.point.motion_point` makes one such point; here the tangents of all are formed at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from squealstudy.models.operating import DesignState
from squealstudy.motion.point import weights_in_time, with_step_roots
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.step_roots import LinearMotions
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.stacked.growing_modes import stacked_growing_modes
from squealstudy.stacked.linear import computable, quadratic


class SlidingPoint(NamedTuple):
    """A design point at its own steady sliding, on the modes of a batch (`unwatched_point`)."""

    steady: WorkingPoint
    state: DesignState
    motion: MotionPoint


def watched_points(
    system: ModalSystem,
    points: Sequence[SlidingPoint],
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> list[MotionPoint]:
    """The points with their growing modes, as `motion_point` gives them.

    Raises
    ------
    LinAlgError
        Matrices of a point have entries too large to compute with.
    """
    C, K = tangents(system, points)
    if not (computable(C) & computable(K)).all():
        raise np.linalg.LinAlgError("matrices that cannot be computed with")
    modes = stacked_growing_modes(C, K, system.omega2, band_hz, tolerance)
    motions = LinearMotions(C, K, system.omega2, np.array([point.motion.c for point in points]))
    growing = with_step_roots(modes, motions, settings)
    return [replace(point.motion, growing=g) for point, g in zip(points, growing, strict=True)]


@np.errstate(over="ignore", invalid="ignore")
def tangents(system: ModalSystem, points: Sequence[SlidingPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Damping and stiffness (m, n, n) linearised at steady sliding, as in `point.tangent`."""
    weights = [weights_in_time(system, point.motion, point.steady, point.state) for point in points]
    normal, coupling, across = (
        np.array([getattr(w, name) for w in weights]) for name in ("normal", "coupling", "across")
    )
    along = np.array([np.broadcast_to(w.along, w.normal.shape) for w in weights])
    d, s = (np.array([getattr(point.motion, name) for point in points]) for name in ("d", "s"))
    N, T, across_T, U = (A[None] for A in (system.N, system.T1, system.T2, system.shapes))
    K = quadratic(N, normal - system.k_ref, N) + quadratic(T, coupling, N) + quadratic(U, s, U)
    C = quadratic(across_T, across, across_T) + quadratic(U, d, U)
    if along.any():
        C = C + quadratic(T, along, T)
    diagonal = np.arange(system.n)
    K[:, diagonal, diagonal] += system.omega2
    C[:, diagonal, diagonal] += np.array([point.motion.c for point in points])
    for matrix, point in zip(C, points, strict=True):
        if point.motion.damping_between is not None:
            matrix += point.motion.damping_between
    return C, K
