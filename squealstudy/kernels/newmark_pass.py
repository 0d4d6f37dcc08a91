"""The fused pass over the observation matrix for one design point: F = B^T r(B [q; v]).

For every contact point three dots, the laws, three axpys; B is read once (theory.md section 6).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_point import point_force
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.newmark_vector import fill


@fast_kernel
def observe_point(
    N: np.ndarray, T1: np.ndarray, T2: np.ndarray, q: np.ndarray, v: np.ndarray
) -> tuple[float, float, float]:
    """N q, T1 v, T2 v of one contact point; all arguments (n,)."""
    x = 0.0
    v1 = 0.0
    v2 = 0.0
    for j in range(q.size):
        x += N[j] * q[j]
        v1 += T1[j] * v[j]
        v2 += T2[j] * v[j]
    return x, v1, v2


@fast_kernel
def spread_point(
    N: np.ndarray, T1: np.ndarray, T2: np.ndarray, rn: float, r1: float, r2: float, F: np.ndarray
) -> None:
    """F += N rn + T1 r1 + T2 r2; arrays (n,)."""
    for j in range(F.size):
        F[j] += N[j] * rn + T1[j] * r1 + T2[j] * r2


@fast_kernel
def pass_one(
    B: np.ndarray,
    points: np.ndarray,
    law: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    F: np.ndarray,
    trial: np.ndarray,
) -> None:
    """Contact and friction forces in modal coordinates at one state.

    Parameters
    ----------
    B : ndarray (nc, 3, n), f8 or f4
        Observation [N; T1; T2] of each point; arithmetic is f8 in any case.
    points : ndarray (nc, 8), law : ndarray (9,)
        See contact_point.
    q, v : ndarray (n,)
        Deviation from the reference state, and velocity.
    F : ndarray (n,)
        Overwritten with B^T r.
    trial : ndarray (nc, 6)
        Overwritten with the state of every point.
    """
    fill(F, 0.0)
    for i in range(B.shape[0]):
        N, T1, T2 = B[i, 0], B[i, 1], B[i, 2]
        x, v1, v2 = observe_point(N, T1, T2, q, v)
        rn, r1, r2 = point_force(points[i], law, x, v1, v2, trial[i])
        spread_point(N, T1, T2, rn, r1, r2, F)
