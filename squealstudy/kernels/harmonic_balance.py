"""Loops of the harmonic balance: contact forces at samples of a period, and equations of curves.

Forces and tangents are those of the laws of runs in time.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import entry_kernel, fast_entry_kernel, fast_kernel
from squealstudy.kernels.newmark_forces import point_forces, tangents
from squealstudy.kernels.newmark_output import contact_row
from squealstudy.kernels.regimes import find_regimes


@entry_kernel
def sampled_forces(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    f: np.ndarray,
    by_y: np.ndarray,
    by_w: np.ndarray,
) -> None:
    """Forces beyond those of the base state, R_N, R_1 and R_2, with their derivatives.

    Parameters
    ----------
    points : ndarray (N_POINT_ROWS, nc)
    law : ndarray (N_LAW,)
    y, w : ndarray (S, nc, 3)
        Changes of gap and sliding [m], and their velocities [m/s].
    f : ndarray (S, nc, 3)
        N.
    by_y, by_w : ndarray (S, nc, 3, 3)
        N/m, N s/m.
    """
    nc = points.shape[1]
    point = np.zeros((at.N_POINT, nc))
    for s in range(y.shape[0]):
        _take(y, w, point, s)
        point_forces(points, law, point, 0, nc)
        for i in range(nc):
            for c in range(3):
                f[s, i, c] = point[at.R_N + c, i]
            kn, k1, k2, d11, d12, d22 = tangents(law, points, point, i)
            by_y[s, i, 0, 0], by_y[s, i, 1, 0], by_y[s, i, 2, 0] = kn, k1, k2
            by_w[s, i, 1, 1], by_w[s, i, 2, 2] = d11, d22
            by_w[s, i, 1, 2] = by_w[s, i, 2, 1] = d12


@entry_kernel
def sampled_rows(
    points: np.ndarray,
    law: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    rows: np.ndarray,
    powers: np.ndarray,
) -> None:
    """Rows of histories (S, len(HISTORY)), of which those of `contact_row` are filled.

    And powers (S, 3) [W]: of friction, dissipated; of the belt; of the loads that balance the base.
    """
    nc = points.shape[1]
    point, own = np.zeros((at.N_POINT, nc)), np.zeros(0)
    for s in range(y.shape[0]):
        _take(y, w, point, s)
        point_forces(points, law, point, 0, nc)
        find_regimes(points, law, point, nc)
        contact_row(points, law, point, nc, own, 0.0, rows[s])
        for i in range(nc):
            w1, w2, speed = point[at.OUT_W1, i], point[at.OUT_W2, i], points[at.POINT_SPEED, i]
            t1, t2 = point[at.OUT_T1, i], point[at.OUT_T2, i]
            powers[s, 0] -= w1 * t1 + w2 * t2
            powers[s, 1] -= speed * t1
            powers[s, 2] -= points[at.POINT_T1, i] * (w1 - speed) + points[at.POINT_T2, i] * w2


@fast_kernel
def _take(y: np.ndarray, w: np.ndarray, point: np.ndarray, s: int) -> None:
    for i in range(point.shape[1]):
        point[at.OUT_X, i] = y[s, i, 0]
        point[at.OUT_W1, i], point[at.OUT_W2, i] = w[s, i, 1], w[s, i, 2]


@fast_entry_kernel
def couple(
    means: np.ndarray,
    used: np.ndarray,
    j: int,
    omega: float,
    seen: np.ndarray,
    widths: np.ndarray,
    starts: np.ndarray,
    pushed: np.ndarray,
) -> None:
    """Derivatives of the local forces' harmonic j by all coordinates.

    With a, b the means of D cos(m theta), D sin(m theta) over a period, D the derivatives by
    displacements, twice the mean of D cos(j theta) cos(k theta) is a_{j-k} + a_{j+k}, and so on;
    c, d are those of the derivatives by velocities. The groups come last: loops over them are
    those that vectorise.

    Parameters
    ----------
    means : ndarray (4, 2 H + 1, b, b, g)
        a, b, c, d for m = 0 to 2 H.
    used : ndarray (e, 2)
        Entries (row, column) of D that are not zero everywhere.
    j : int
    omega : float
        rad/s.
    seen : ndarray (r, b, g)
        What the groups see of the vectors of the harmonics 0 to H, one after the other.
    widths : ndarray (H + 1,)
        How many vectors each has.
    starts : ndarray (H + 1, 2)
        Places of a harmonic's cosines and sines among the coordinates.
    pushed : ndarray (2, m, b, g)
        Overwritten: cosines and sines; of the mean (j = 0) the first alone is meant.
    """
    groups = means.shape[4]
    L = np.zeros((4, groups), means.dtype)
    pushed[:] = 0.0
    half = 0.5 if j == 0 else 1.0  # the mean is no twice
    first = 0
    for k in range(len(widths)):
        near, far = abs(j - k), j + k
        sign = 1.0 if j > k else (-1.0 if j < k else 0.0)
        rate = k * omega
        for e in range(len(used)):
            row, column = used[e, 0], used[e, 1]
            m = means[:, :, row, column]
            for i in range(groups):
                L[0, i] = half * (m[0, near, i] + m[0, far, i])
                L[0, i] -= half * rate * (m[3, far, i] - sign * m[3, near, i])
                L[1, i] = half * (m[1, far, i] - sign * m[1, near, i])
                L[1, i] += half * rate * (m[2, near, i] + m[2, far, i])
                L[2, i] = m[1, far, i] + sign * m[1, near, i]
                L[2, i] -= rate * (m[2, near, i] - m[2, far, i])
                L[3, i] = m[0, near, i] - m[0, far, i]
                L[3, i] += rate * (m[3, far, i] + sign * m[3, near, i])
            for v in range(widths[k]):
                x = seen[first + v, column]
                at, behind = starts[k, 0] + v, starts[k, 1] + v
                _add(pushed[0, at, row], L[0], x)
                _add(pushed[1, at, row], L[2], x)
                if k:
                    _add(pushed[0, behind, row], L[1], x)
                    _add(pushed[1, behind, row], L[3], x)
        first += widths[k]


@fast_kernel
def _add(to: np.ndarray, a: np.ndarray, x: np.ndarray) -> None:
    """Products of the same places."""
    for i in range(len(x)):
        to[i] += a[i] * x[i]


@fast_kernel
def _scale(
    u: np.ndarray,
    R: np.ndarray,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
    F: np.ndarray,
) -> None:
    """The equations F (m + 2,): R (m,) over size and scale, norm and phase."""
    m, a = len(R), np.exp(u[-2])
    norm, turned = 0.0, 0.0
    for i in range(m):
        F[i] = R[i] / (a * scale[i])
        norm += in_first[i] * u[i] * u[i]
        turned += phase[i] * (u[i] - reference[i])
    F[m], F[m + 1] = 0.5 * (norm - 1.0), turned


@fast_entry_kernel
def scaled_residual(
    u: np.ndarray,
    R: np.ndarray,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
) -> np.ndarray:
    """The equations F (m + 2,) of a curve.

    Parameters
    ----------
    u : ndarray (m + 3,)
        Scaled coordinates over the size, frequency, logarithm of the size, mu.
    R : ndarray (m,)
        Imbalance of the coordinates.
    scale : ndarray (m,)
    in_first : ndarray (m,)
        1 of coordinates of the first harmonic, 0 of others.
    phase, reference : ndarray (m,)
        Unit direction in which a motion turns, and the motion whose phase it has.
    """
    F = np.empty(len(R) + 2)
    _scale(u, R, scale, in_first, phase, reference, F)
    return F


@fast_entry_kernel
def scaled_jacobian(
    u: np.ndarray,
    R: np.ndarray,
    by_z: np.ndarray,
    by_omega: np.ndarray,
    by_mu: np.ndarray,
    omega_0: float,
    scale: np.ndarray,
    in_first: np.ndarray,
    phase: np.ndarray,
    reference: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """`scaled_residual` and its derivatives (m + 2, m + 3), in the precision of `by_z` (m, m).

    `by_omega` and `by_mu` (m,) are derivatives of R by frequency [rad/s] and mu.
    """
    m, a = len(R), np.exp(u[-2])
    F, J = np.empty(m + 2), np.zeros((m + 2, m + 3), by_z.dtype)
    _scale(u, R, scale, in_first, phase, reference, F)
    for i in range(m):
        along = 0.0
        for k in range(m):
            J[i, k] = by_z[i, k] / (scale[i] * scale[k])
            along += J[i, k] * u[k]
        J[i, m] = by_omega[i] * omega_0 / (a * scale[i])
        J[i, m + 1] = along - F[i]
        J[i, m + 2] = by_mu[i] / (a * scale[i])
        J[m, i], J[m + 1, i] = in_first[i] * u[i], phase[i]
    return F, J
