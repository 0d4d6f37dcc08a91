"""The equation of motion as y' = f(y), y = (q, v), with its tangents, for solvers of others."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_laws import law_at
from squealstudy.kernels.friction_laws import friction_tangent
from squealstudy.kernels.jit import entry_kernel, fast_kernel
from squealstudy.kernels.newmark_layout import (
    DELTA,
    PULL_TRIAL,
    Q_TRIAL,
    V_TRIAL,
    W2,
    C,
    Modal,
    Q,
    Saved,
    Settings,
    V,
    Work,
)
from squealstudy.kernels.newmark_output import save, stored_energy
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_residual import residual
from squealstudy.kernels.newmark_vector import fill


@fast_kernel
def take(y: np.ndarray, x: np.ndarray) -> None:
    """State y (2 m,) into the trial rows of x (N_ROWS, n), n >= m."""
    m = y.size // 2
    for j in range(m):
        x[Q_TRIAL, j] = y[j]
        x[V_TRIAL, j] = y[m + j]


@entry_kernel
def modal_rate(y: np.ndarray, B: np.ndarray, modal: Modal, work: Work, dy: np.ndarray) -> None:
    """Rate dy = f(y) of design 0, both (2 m,) with m modes."""
    x, modes, m = work.x[0], modal.modes[0], y.size // 2
    take(y, x)
    pass_one(B, modal, work, 0)
    fill(x[PULL_TRIAL], 0.0)
    residual(modal, work, 0)
    for j in range(m):
        dy[j] = y[m + j]
        dy[m + j] = x[DELTA, j] - modes[C, j] * y[m + j] - modes[W2, j] * y[j]


@entry_kernel
def point_tangents(y: np.ndarray, B: np.ndarray, modal: Modal, work: Work, D: np.ndarray) -> None:
    """Tangents of the contact points at y, as they stand in f.

    Parameters
    ----------
    D : ndarray (6, nc)
        dr_n/dx, dt1/dx, dt2/dx [N/m], dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [N s/m].
    """
    take(y, work.x[0])
    pass_one(B, modal, work, 0)
    law, points, point = modal.laws[0], modal.points[0], work.point[0]
    for i in range(D.shape[1]):
        area, factor = points[1, i], points[2, i]
        p, kappa = law_at(int(law[0]), law[1], law[2], points[0, i] + point[0, i])
        d11, d12, d22, s1, s2 = friction_tangent(
            int(law[3]),
            factor * law[4],
            factor * law[5],
            law[6],
            law[7],
            p,
            point[1, i],
            point[2, i],
        )
        D[0, i] = points[4, i] - area * kappa
        D[1, i], D[2, i] = -area * kappa * s1, -area * kappa * s2
        D[3, i], D[4, i], D[5, i] = area * d11, area * d12, area * d22


@entry_kernel
def show_state(
    y: np.ndarray,
    B: np.ndarray,
    modal: Modal,
    settings: Settings,
    work: Work,
    saved: Saved,
    keep: bool,
) -> float:
    """Make y the accepted state of design 0, in a row of the histories if wanted.

    Its stored energy [J] is returned.
    """
    x, m = work.x[0], y.size // 2
    take(y, x)
    pass_one(B, modal, work, 0)
    for j in range(m):
        x[Q, j], x[V, j] = y[j], y[m + j]
    if keep:
        save(modal, settings, work, saved, 0)
    return stored_energy(modal, work, 0)
