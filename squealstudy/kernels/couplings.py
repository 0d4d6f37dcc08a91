"""Local derivatives of forces between two harmonics, times what the groups see of vectors."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_entry_kernel, fast_kernel


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
