"""The Newmark kernel for design points that advance together over one observation matrix."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import point_force
from squealstudy.kernels.jit import fast_kernel, kernel
from squealstudy.kernels.newmark_layout import (
    FORCE,
    Q_TRIAL,
    RUNNING,
    STATUS,
    V_TRIAL,
    Modal,
    Saved,
    Settings,
    Work,
)
from squealstudy.kernels.newmark_pass import pass_one
from squealstudy.kernels.newmark_step import advance
from squealstudy.kernels.newmark_vector import fill

WIDTH = 4  # designs whose dots share the loads of B


@fast_kernel
def observe_four(
    B1: np.ndarray,
    B2: np.ndarray,
    xa: np.ndarray,
    xb: np.ndarray,
    xc: np.ndarray,
    xd: np.ndarray,
    out: np.ndarray,
) -> None:
    """[N q, T1 v, T2 v] of two points (3, n) for four designs (N_ROWS, n) into `out` (4, 6)."""
    N1, S1, R1 = B1[0], B1[1], B1[2]
    N2, S2, R2 = B2[0], B2[1], B2[2]
    q0, q1, q2, q3 = xa[Q_TRIAL], xb[Q_TRIAL], xc[Q_TRIAL], xd[Q_TRIAL]
    v0, v1, v2, v3 = xa[V_TRIAL], xb[V_TRIAL], xc[V_TRIAL], xd[V_TRIAL]
    a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    b0 = b1 = b2 = b3 = b4 = b5 = 0.0
    c0 = c1 = c2 = c3 = c4 = c5 = 0.0
    d0 = d1 = d2 = d3 = d4 = d5 = 0.0
    for j in range(N1.size):
        n1, s1, r1 = N1[j], S1[j], R1[j]
        n2, s2, r2 = N2[j], S2[j], R2[j]
        a0 += n1 * q0[j]
        b0 += n1 * q1[j]
        c0 += n1 * q2[j]
        d0 += n1 * q3[j]
        a1 += s1 * v0[j]
        b1 += s1 * v1[j]
        c1 += s1 * v2[j]
        d1 += s1 * v3[j]
        a2 += r1 * v0[j]
        b2 += r1 * v1[j]
        c2 += r1 * v2[j]
        d2 += r1 * v3[j]
        a3 += n2 * q0[j]
        b3 += n2 * q1[j]
        c3 += n2 * q2[j]
        d3 += n2 * q3[j]
        a4 += s2 * v0[j]
        b4 += s2 * v1[j]
        c4 += s2 * v2[j]
        d4 += s2 * v3[j]
        a5 += r2 * v0[j]
        b5 += r2 * v1[j]
        c5 += r2 * v2[j]
        d5 += r2 * v3[j]
    out[0, 0], out[0, 1], out[0, 2], out[0, 3], out[0, 4], out[0, 5] = a0, a1, a2, a3, a4, a5
    out[1, 0], out[1, 1], out[1, 2], out[1, 3], out[1, 4], out[1, 5] = b0, b1, b2, b3, b4, b5
    out[2, 0], out[2, 1], out[2, 2], out[2, 3], out[2, 4], out[2, 5] = c0, c1, c2, c3, c4, c5
    out[3, 0], out[3, 1], out[3, 2], out[3, 3], out[3, 4], out[3, 5] = d0, d1, d2, d3, d4, d5


@fast_kernel
def spread_pair(B1: np.ndarray, B2: np.ndarray, r: np.ndarray, F: np.ndarray) -> None:
    """F += B1^T r[:3] + B2^T r[3:] for two points (3, n) and one design."""
    N1, S1, R1 = B1[0], B1[1], B1[2]
    N2, S2, R2 = B2[0], B2[1], B2[2]
    r0, r1, r2, r3, r4, r5 = r[0], r[1], r[2], r[3], r[4], r[5]
    for j in range(F.size):
        one = N1[j] * r0 + S1[j] * r1 + R1[j] * r2
        two = N2[j] * r3 + S2[j] * r4 + R2[j] * r5
        F[j] += one + two


@fast_kernel
def pass_many(B: np.ndarray, modal: Modal, work: Work, active: np.ndarray, n_active: int) -> None:
    """`pass_one` for the first `n_active` designs of the list `active`, B read once."""
    r = np.zeros((WIDTH, 6))
    x, point = work.x, work.point
    nc = B.shape[0]
    for a in range(n_active):
        fill(x[active[a], FORCE], 0.0)
    for i in range(0, nc, 2):
        other = min(i + 1, nc - 1)
        for first in range(0, n_active, WIDTH):
            k0 = active[first]
            k1 = active[min(first + 1, n_active - 1)]
            k2 = active[min(first + 2, n_active - 1)]
            k3 = active[min(first + 3, n_active - 1)]
            observe_four(B[i], B[other], x[k0], x[k1], x[k2], x[k3], r)
            for a in range(min(WIDTH, n_active - first)):
                k = active[first + a]
                law = modal.laws[k]
                r[a, 0], r[a, 1], r[a, 2] = point_force(
                    modal.points[i], law, r[a, 0], r[a, 1], r[a, 2], point[k, i]
                )
                if other > i:
                    r[a, 3], r[a, 4], r[a, 5] = point_force(
                        modal.points[other], law, r[a, 3], r[a, 4], r[a, 5], point[k, other]
                    )
                else:
                    r[a, 3] = r[a, 4] = r[a, 5] = 0.0
                spread_pair(B[i], B[other], r[a], x[k, FORCE])


@kernel
def newmark_batch(
    B: np.ndarray, modal: Modal, settings: Settings, work: Work, saved: Saved
) -> None:
    """Integrate all designs to their ends or failures; arguments as of `newmark.newmark`.

    A design that needs more iterations falls behind in time and goes on alone in the end.
    """
    nb = work.counts.shape[0]
    active = np.zeros(nb, dtype=np.int64)
    while True:
        n_active = 0
        for k in range(nb):
            if work.counts[k, STATUS] == RUNNING:
                active[n_active] = k
                n_active += 1
        if n_active == 0:
            return
        if n_active == 1:
            k = active[0]
            x = work.x[k]
            pass_one(
                B, modal.points, modal.laws[k], x[Q_TRIAL], x[V_TRIAL], x[FORCE], work.point[k]
            )
        else:
            pass_many(B, modal, work, active, n_active)
        for a in range(n_active):
            advance(B, modal, settings, work, saved, active[a])
