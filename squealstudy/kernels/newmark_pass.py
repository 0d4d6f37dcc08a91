"""The fused pass over the observation matrix for one design point: F = B^T r(B [q; v]).

For every contact point three dots, the laws, three axpys; B is read from memory once, a panel of
tiles at a time (THEORY.md eq. (62)).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import OUT_X, R_N, point_forces
from squealstudy.kernels.jit import fast_kernel, part_kernel
from squealstudy.kernels.newmark_layout import FORCE, Q_TRIAL, V_TRIAL, Modal, Work
from squealstudy.kernels.newmark_vector import fill
from squealstudy.kernels.tile import POINTS, observe_one, spread_one


@fast_kernel
def take_points(tile: np.ndarray, point: np.ndarray, first: int) -> None:
    """An observed tile (ROWS,) into the points (N_POINT, nc) from `first` on."""
    for c in range(3):
        for i in range(POINTS):
            point[OUT_X + c, first + i] = tile[c * POINTS + i]


@fast_kernel
def give_forces(point: np.ndarray, tile: np.ndarray, first: int) -> None:
    """Generalised forces of the points from `first` on into a tile (ROWS,)."""
    for c in range(3):
        for i in range(POINTS):
            tile[c * POINTS + i] = point[R_N + c, first + i]


@part_kernel
def one_panel(panel: np.ndarray, first: int, modal: Modal, work: Work, k: int) -> None:
    """Add the forces of a panel of tiles (.., n, ROWS), its first point `first`, to row FORCE."""
    x, point, tiles = work.x[k], work.point[k], work.tiles
    q, v, F = x[Q_TRIAL], x[V_TRIAL], x[FORCE]
    for t in range(panel.shape[0]):
        observe_one(panel[t], q, v, tiles[t, 0])
        take_points(tiles[t, 0], point, first + t * POINTS)
    last = first + panel.shape[0] * POINTS
    point_forces(modal.points[k], modal.laws[k], point, first, last)
    for t in range(panel.shape[0]):
        give_forces(point, tiles[t, 0], first + t * POINTS)
        spread_one(panel[t], tiles[t, 0], F)


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
    fill(work.x[k, FORCE], 0.0)
    step = work.tiles.shape[0]
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        one_panel(panel, t * POINTS, modal, work, k)
