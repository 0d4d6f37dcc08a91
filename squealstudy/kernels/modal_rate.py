"""The equation of motion as y' = f(y), y = (q, v), with its tangents, for solvers of others."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_forces import all_forces, pass_one, tangents
from squealstudy.kernels.newmark_layout import ModalArrays, SavedArrays, StepSettings, WorkArrays
from squealstudy.kernels.newmark_output import save, stored_energy


@fast_kernel
def take(y: np.ndarray, x: np.ndarray) -> None:
    """State y (2 m,) into the trial rows of x (N_ROWS, n), n >= m."""
    m = y.size // 2
    for j in range(m):
        x[at.Q_TRIAL, j] = y[j]
        x[at.V_TRIAL, j] = y[m + j]


@entry_kernel
def modal_rate(
    y: np.ndarray, B: np.ndarray, modal: ModalArrays, work: WorkArrays, dy: np.ndarray
) -> None:
    """Rate dy = f(y) of design 0, both (2 m,) with m modes."""
    x, modes, m = work.x[0], modal.modes[0], y.size // 2
    take(y, x)
    pass_one(B, modal, work, 0)
    all_forces(modal, work, 0)
    for j in range(m):
        dy[j] = y[m + j]
        dy[m + j] = x[at.DELTA, j] - modes[at.C, j] * y[m + j] - modes[at.W2, j] * y[j]


@entry_kernel
def point_tangents(
    y: np.ndarray, B: np.ndarray, modal: ModalArrays, work: WorkArrays, D: np.ndarray
) -> None:
    """Tangents of the contact points at y, as they stand in f.

    Parameters
    ----------
    D : ndarray (6, nc)
        dr_n/dx, dt1/dx, dt2/dx [N/m], dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [N s/m].
    """
    take(y, work.x[0])
    pass_one(B, modal, work, 0)
    for i in range(D.shape[1]):
        D[:, i] = tangents(modal.laws[0], modal.points[0], work.point[0], i)


@entry_kernel
def show_state(
    y: np.ndarray,
    B: np.ndarray,
    modal: ModalArrays,
    settings: StepSettings,
    work: WorkArrays,
    saved: SavedArrays,
    keep: bool,
) -> float:
    """Make y the accepted state of design 0, in a row of the histories if wanted.

    Its stored energy [J] is returned.
    """
    x, m = work.x[0], y.size // 2
    take(y, x)
    pass_one(B, modal, work, 0)
    for j in range(m):
        x[at.Q, j], x[at.V, j] = y[j], y[m + j]
    if keep:
        save(modal, settings, work, saved, 0)
    return stored_energy(modal, work, 0)
