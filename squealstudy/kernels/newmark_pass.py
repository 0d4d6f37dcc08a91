"""The fused pass over the observation matrix for one design point: F = B^T r(B [q; v]).

For every contact point three dots, the laws, three axpys; B is read from memory once, a panel of
tiles at a time (THEORY.md eq. (62)).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.contact_point import point_forces
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_layout import Modal, Work
from squealstudy.kernels.newmark_vector import fill
from squealstudy.kernels.tile import POINTS, observe_one, spread_one


@fast_kernel
def take_points(tile: np.ndarray, point: np.ndarray, first: int) -> None:
    """An observed tile (ROWS,) into the points (N_POINT, nc) from `first` on."""
    for c in range(3):
        for i in range(POINTS):
            point[at.OUT_X + c, first + i] = tile[c * POINTS + i]


@fast_kernel
def give_forces(point: np.ndarray, tile: np.ndarray, first: int) -> None:
    """Generalised forces of the points from `first` on into a tile (ROWS,)."""
    for c in range(3):
        for i in range(POINTS):
            tile[c * POINTS + i] = point[at.R_N + c, first + i]


@fast_kernel
def observe_panel(panel: np.ndarray, first: int, work: Work, k: int) -> None:
    """Gaps and velocities of the points of a panel of tiles (.., n, ROWS) at a trial state."""
    x, tiles = work.x[k], work.tiles
    for t in range(panel.shape[0]):
        observe_one(panel[t], x[at.Q_TRIAL], x[at.V_TRIAL], tiles[t, 0])
        take_points(tiles[t, 0], work.point[k], first + t * POINTS)


@fast_kernel
def spread_panel(panel: np.ndarray, first: int, work: Work, k: int) -> None:
    """Add the forces of the points of a panel, the first of them `first`, to row FORCE."""
    for t in range(panel.shape[0]):
        give_forces(work.point[k], work.tiles[t, 0], first + t * POINTS)
        spread_one(panel[t], work.tiles[t, 0], work.x[k, at.FORCE])


@fast_kernel
def pass_one(B: np.ndarray, modal: Modal, work: Work, k: int) -> None:
    """Contact and friction forces in modal coordinates at the trial state of design k.

    Parameters
    ----------
    B : ndarray (nt, n, ROWS), f8 or f4
        Tiles of the observation matrix; arithmetic is f8 in any case.
    modal, work : newmark_layout tuples
        The rows Q_TRIAL and V_TRIAL of `work.x` are read, FORCE is overwritten with B^T r and
        `work.point` with the state of every point.
    """
    fill(work.x[k, at.FORCE], 0.0)
    step = work.tiles.shape[0]
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        first, last = t * POINTS, (t + panel.shape[0]) * POINTS
        observe_panel(panel, first, work, k)
        point_forces(modal.points[k], modal.laws[k], work.point[k], first, last)
        spread_panel(panel, first, work, k)
