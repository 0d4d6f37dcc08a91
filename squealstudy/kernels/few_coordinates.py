"""Harmonic balance of a few coordinates: its imbalance and Jacobian from sampled forces.

In all coordinates at once, for whom the calls of array functions would cost more than their sums.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_entry_kernel, fast_kernel, room_kernel


@fast_kernel
def _mean(weights: np.ndarray, x: np.ndarray) -> float:
    """Sum of products (S,)."""
    total = 0.0
    for s in range(len(x)):
        total += weights[s] * x[s]
    return total


@fast_kernel
def _linear(
    Q: np.ndarray, omega: float, xi: float, K: np.ndarray, C: np.ndarray, R: np.ndarray
) -> None:
    """Inertia, damping and stiffness of a series (2 H + 1, n) into R, of the same shape."""
    n, H = Q.shape[1], (Q.shape[0] - 1) // 2
    for i in range(n):
        for row in range(2 * H + 1):
            R[row, i] = 0.0
            for j in range(n):
                R[row, i] += K[i, j] * Q[row, j]
        for h in range(1, H + 1):
            rate = h * omega
            for j in range(n):
                c = C[i, j] + (xi if i == j else 0.0)
                R[h, i] += rate * c * Q[H + h, j]
                R[H + h, i] -= rate * c * Q[h, j]
            R[h, i] -= rate * rate * Q[h, i]
            R[H + h, i] -= rate * rate * Q[H + h, i]


@room_kernel
def _pulls(B: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Generalised forces (n, S) of local ones (S, g, b) of groups B (g, b, n)."""
    S, g, b = f.shape
    n = B.shape[2]
    found = np.zeros((n, S))
    for k in range(g):
        for c in range(b):
            for i in range(n):
                for s in range(S):
                    found[i, s] += B[k, c, i] * f[s, k, c]
    return found


@fast_entry_kernel
def imbalance_of_few(
    Q: np.ndarray,
    omega: float,
    xi: float,
    K: np.ndarray,
    C: np.ndarray,
    B: np.ndarray,
    f: np.ndarray,
    cosines: np.ndarray,
    sines: np.ndarray,
) -> np.ndarray:
    """R (2 H + 1, n) of a series: what is missing to q'' + (C + xi I) q' + K q = forces.

    Parameters
    ----------
    Q : ndarray (2 H + 1, n)
    omega, xi : float
        rad/s, 1/s.
    K, C : ndarray (n, n)
    B : ndarray (g, b, n)
    f : ndarray (S, g, b)
        Local forces at even samples of a period.
    cosines, sines : ndarray (2 H + 1, S)
        Means over the samples of products with the harmonics 0 to 2 H.
    """
    R = np.empty(Q.shape)
    _linear(Q, omega, xi, K, C, R)
    _take(_pulls(B, f), cosines, sines, R)
    return R


@fast_kernel
def _take(pulls: np.ndarray, cosines: np.ndarray, sines: np.ndarray, R: np.ndarray) -> None:
    """Take the harmonics of generalised forces (n, S) off R (2 H + 1, n)."""
    n, H = R.shape[1], (R.shape[0] - 1) // 2
    for i in range(n):
        R[0, i] -= _mean(cosines[0], pulls[i])
        for h in range(1, H + 1):
            R[h, i] -= 2.0 * _mean(cosines[h], pulls[i])
            R[H + h, i] -= 2.0 * _mean(sines[h], pulls[i])


@room_kernel
def _stiffnesses(B: np.ndarray, D: np.ndarray) -> np.ndarray:
    """B^T D B (n, n, S) of local derivatives (S, g, b, b)."""
    S, g, b = D.shape[:3]
    n = B.shape[2]
    found = np.zeros((n, n, S))
    for k in range(g):
        for c in range(b):
            for e in range(b):
                if _is_zero(D, k, c, e):
                    continue
                for i in range(n):
                    for j in range(n):
                        product = B[k, c, i] * B[k, e, j]
                        for s in range(S):
                            found[i, j, s] += product * D[s, k, c, e]
    return found


@fast_kernel
def _is_zero(D: np.ndarray, k: int, c: int, e: int) -> bool:
    """Whether entry (c, e) of group k is zero at all samples."""
    count = 0
    for s in range(D.shape[0]):
        count += D[s, k, c, e] != 0.0
    return count == 0


@fast_entry_kernel
def balance_of_few(
    Q: np.ndarray,
    omega: float,
    xi: float,
    K: np.ndarray,
    C: np.ndarray,
    B: np.ndarray,
    local: tuple[np.ndarray, np.ndarray, np.ndarray],
    slope: np.ndarray,
    cosines: np.ndarray,
    sines: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`imbalance_of_few`; its derivatives by Q, (m, m) with m = (2 H + 1) n, and by omega, as R.

    `local` are forces (S, g, b), their derivatives by displacements and by velocities (S, g, b, b);
    `slope` (S, 2 H + 1) gives derivatives by the angle from a series.

    With a, b the means of D cos(m theta), D sin(m theta) over a period, D the derivatives by
    displacements, twice the mean of D cos(j theta) cos(k theta) is a_{j-k} + a_{j+k}, and so on;
    c, d are those of the derivatives by velocities.
    """
    f, by_y, by_w = local
    S, n, H = f.shape[0], Q.shape[1], (Q.shape[0] - 1) // 2
    R, by_omega = np.empty(Q.shape), np.empty(Q.shape)
    _linear(Q, omega, xi, K, C, R)
    for i in range(n):  # the derivative of what is linear
        by_omega[0, i] = 0.0
        for h in range(1, H + 1):
            by_omega[h, i] = -2.0 * h * h * omega * Q[h, i] + h * xi * Q[H + h, i]
            by_omega[H + h, i] = -2.0 * h * h * omega * Q[H + h, i] - h * xi * Q[h, i]
            for j in range(n):
                by_omega[h, i] += h * C[i, j] * Q[H + h, j]
                by_omega[H + h, i] -= h * C[i, j] * Q[h, j]
    _take(_pulls(B, f), cosines, sines, R)
    D, E = _stiffnesses(B, by_y), _stiffnesses(B, by_w)
    rates, pulls = np.zeros((n, S)), np.zeros((n, S))
    for s in range(S):
        for row in range(1, 2 * H + 1):
            for j in range(n):
                rates[j, s] += slope[s, row] * Q[row, j]
    for i in range(n):
        for j in range(n):
            for s in range(S):
                pulls[i, s] += E[i, j, s] * rates[j, s]
    _take(pulls, cosines, sines, by_omega)
    J = np.zeros((len(R) * n, len(R) * n))
    a, b, c, d = np.zeros((4, 2 * H + 1))
    for i in range(n):
        for j in range(n):
            for m in range(2 * H + 1):
                a[m], b[m] = _mean(cosines[m], D[i, j]), _mean(sines[m], D[i, j])
                c[m], d[m] = _mean(cosines[m], E[i, j]), _mean(sines[m], E[i, j])
            _couple(a, b, c, d, omega, J[i::n, j::n])
    _add_linear(omega, xi, K, C, J)
    return R, J, by_omega


@fast_kernel
def _couple(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, omega: float, J: np.ndarray
) -> None:
    """Take derivatives of the harmonics of forces by those of displacements off J."""
    H = (len(a) - 1) // 2
    for j in range(H + 1):
        half = 0.5 if j == 0 else 1.0  # the mean is no twice
        for k in range(H + 1):
            near, far, rate = abs(j - k), j + k, k * omega
            sign = 1.0 if j > k else (-1.0 if j < k else 0.0)
            J[j, k] -= half * (a[near] + a[far] - rate * (d[far] - sign * d[near]))
            if k:
                J[j, H + k] -= half * (b[far] - sign * b[near] + rate * (c[near] + c[far]))
            if j:
                J[H + j, k] -= b[far] + sign * b[near] - rate * (c[near] - c[far])
            if j and k:
                J[H + j, H + k] -= a[near] - a[far] + rate * (d[far] + sign * d[near])


@fast_kernel
def _add_linear(omega: float, xi: float, K: np.ndarray, C: np.ndarray, J: np.ndarray) -> None:
    """Add the derivatives of `_linear` to J (m, m)."""
    n = len(K)
    H = (len(J) // n - 1) // 2
    for h in range(H + 1):
        rate = h * omega
        for i in range(n):
            for j in range(n):
                c = C[i, j] + (xi if i == j else 0.0)
                k = K[i, j] - (rate * rate if i == j else 0.0)
                J[h * n + i, h * n + j] += k
                if h:
                    J[(H + h) * n + i, (H + h) * n + j] += k
                    J[h * n + i, (H + h) * n + j] += rate * c
                    J[(H + h) * n + i, h * n + j] -= rate * c
