"""The Newmark kernel: one design point, several over one observation matrix, or one traced step.

The trace keeps the residuals of a plain step with the fixed Jacobian: what the iteration does, not
what it gives. Neither halving nor Newton comes to its help: a step that would need one ends it.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, lean_entry_kernel, part_kernel
from squealstudy.kernels.newmark_correct import place
from squealstudy.kernels.newmark_forces import (
    give_forces,
    is_small,
    pass_one,
    point_forces,
    take_points,
)
from squealstudy.kernels.newmark_layout import ModalArrays, SavedArrays, StepSettings, WorkArrays
from squealstudy.kernels.newmark_step import advance
from squealstudy.kernels.newmark_vector import copy
from squealstudy.kernels.tile import LANES, POINTS, ROWS, observe_eight, spread_eight

MIN_DESIGNS_FOR_LANES = 4  # designs from which a pass for all lanes costs less than one each


@fast_kernel
def to_lane(x: np.ndarray, lanes: np.ndarray, d: int) -> None:
    """Trial q and v of a design (N_ROWS, n) into lane d of `lanes` (3, n, LANES), F there zero."""
    for j in range(x.shape[1]):
        lanes[0, j, d] = x[at.Q_TRIAL, j]
        lanes[1, j, d] = x[at.V_TRIAL, j]
        lanes[2, j, d] = 0.0


@fast_kernel
def from_lane(lanes: np.ndarray, x: np.ndarray, d: int) -> None:
    """Row FORCE of a design from lane d."""
    for j in range(x.shape[1]):
        x[at.FORCE, j] = lanes[2, j, d]


@fast_kernel
def widen(narrow: np.ndarray, wide: np.ndarray) -> None:
    """Tiles (.., n, ROWS) in double precision: eight designs would convert each entry alone."""
    for t in range(narrow.shape[0]):
        for j in range(narrow.shape[1]):
            for i in range(ROWS):
                wide[t, j, i] = narrow[t, j, i]


@fast_kernel
def panel_of_eight(
    panel: np.ndarray, first: int, modal: ModalArrays, work: WorkArrays, designs: np.ndarray
) -> None:
    """Add the forces of a panel of tiles (.., n, ROWS), its first point `first`, to lanes F.

    The designs are in lanes 0, 1, ...
    """
    q, v, F = work.lanes[0], work.lanes[1], work.lanes[2]
    tiles = work.tiles
    for t in range(panel.shape[0]):
        observe_eight(panel[t], q, v, tiles[t])
    last = min(first + panel.shape[0] * POINTS, modal.fixed.shape[2])
    for d in range(designs.size):
        k = designs[d]
        for t in range(panel.shape[0]):
            take_points(tiles[t, d], work.point[k], first + t * POINTS)
        point_forces(modal.points[k], modal.laws[k], work.point[k], first, last)
        for t in range(panel.shape[0]):
            give_forces(work.point[k], tiles[t, d], first + t * POINTS)
    for t in range(panel.shape[0]):
        spread_eight(panel[t], tiles[t], F)


@part_kernel
def pass_eight(B: np.ndarray, modal: ModalArrays, work: WorkArrays, designs: np.ndarray) -> None:
    """`pass_one` for up to LANES designs, B (nt, n, ROWS) read once."""
    for d in range(designs.size):
        to_lane(work.x[designs[d]], work.lanes, d)
    step = work.tiles.shape[0]
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        if work.wide.shape[0] > 0:
            widen(panel, work.wide)
            panel_of_eight(work.wide[: panel.shape[0]], t * POINTS, modal, work, designs)
        else:
            panel_of_eight(panel, t * POINTS, modal, work, designs)
    for d in range(designs.size):
        from_lane(work.lanes, work.x[designs[d]], d)


@hot_kernel
def goes_on(counts: np.ndarray) -> bool:
    """Whether a design runs and has not reached the step of its pause; counts (N_COUNT,)."""
    return counts[at.STATUS] == at.RUNNING and counts[at.STEP] != counts[at.PAUSE]


@hot_kernel
def running(counts: np.ndarray, designs: np.ndarray, first: int, most: int) -> int:
    """List the designs (nb,) from `first` on that go on, `most` at most; how many they are."""
    n = 0
    for k in range(first, counts.shape[0]):
        if n == most:
            break
        if goes_on(counts[k]):
            designs[n] = k
            n += 1
    return n


@fast_kernel
def paused(counts: np.ndarray) -> bool:
    """Whether a design that runs has reached the step of its pause."""
    for k in range(counts.shape[0]):
        if counts[k, at.STATUS] == at.RUNNING and not goes_on(counts[k]):
            return True
    return False


@lean_entry_kernel
def newmark_batch(
    B: np.ndarray, modal: ModalArrays, settings: StepSettings, work: WorkArrays, saved: SavedArrays
) -> None:
    """Integrate all designs to their ends or failures; `work.counts` and `work.real` tell which.

    A design that needs more iterations falls behind in time and goes on alone in the end. One that
    comes to its pause is RUNNING and stops all, the others where they are: with a later PAUSE the
    next call goes on, and which designs share a pass, and so every rounding, is as without one.
    Designs of few coordinates and points share none: each goes to its end or pause alone, before
    the next.

    Parameters
    ----------
    B : ndarray (nt, n, ROWS), f8 or f4
        Tiles of the observation matrix, see tile.
    modal, settings, work, saved : newmark_layout tuples
        `work` holds the initial q and v in the rows Q_TRIAL and V_TRIAL as well.
    """
    listed, first_running, small = work.running, 0, is_small(B)
    most = 1 if small else listed.size
    while True:
        n = running(work.counts, listed, first_running, most)
        if n == 0:
            return
        for first in range(0, n, LANES):
            designs = listed[first : min(first + LANES, n)]
            if designs.size >= MIN_DESIGNS_FOR_LANES:
                pass_eight(B, modal, work, designs)
            else:
                for k in designs:
                    pass_one(B, modal, work, k)
        for k in listed[:n]:
            advance(B, modal, settings, work, saved, k)
        if small:
            first_running = listed[0]
        elif paused(work.counts):
            return


@lean_entry_kernel
def newmark_trace(
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    work: WorkArrays,
    saved: SavedArrays,
    first: np.ndarray,
    squares: np.ndarray,
) -> int:
    """Iterate one step of design 0; how many squared residuals were written to `squares` (m,).

    Parameters
    ----------
    B, modal, settings, work, saved
        As of `newmark_batch`, of one step without halvings.
    first : ndarray (n,) or (0,)
        Trial pull to start from; empty for that of the predictor.

    Notes
    -----
    The step converged where `work.counts[0, STATUS]` is DONE; its last residual is not written.
    """
    counts, real, x, n = work.counts[0], work.real[0], work.x[0], 0
    while counts[at.STATUS] == at.RUNNING and n < squares.size:
        starts = counts[at.MODE] == at.START
        pass_one(B, modal, work, 0)
        advance(B, modal, settings, work, saved, 0)
        if counts[at.STATUS] != at.RUNNING or not (starts or counts[at.MODE] == at.FIXED):
            break
        if starts and first.size > 0:
            copy(first, x[at.PULL_TRIAL])
            place(x, modal.steps[0, 0])
        elif not starts:
            squares[n] = real[at.E2_OLD]
            n += 1
    return n
