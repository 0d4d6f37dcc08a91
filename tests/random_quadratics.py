"""Random dense quadratic eigenproblems of the kinds that a brake's design points are, and worse."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment


class Problem(NamedTuple):
    """lambda^2 I + lambda C + K, (n, n) each, and the band (low, high) asked for, rad/s."""

    C: np.ndarray
    K: np.ndarray
    band: tuple[float, float]


TOP = 5e4  # rad/s, about 8 kHz


def _frequencies(rng: np.random.Generator, n: int) -> np.ndarray:
    """Some inside the band, most beyond it, as in a component-mode model."""
    return np.sort(TOP * rng.uniform(0.02, 1.0, n) ** 0.6 * rng.uniform(2.0, 8.0))


def _turned(rng: np.random.Generator, *matrices: np.ndarray) -> list[np.ndarray]:
    """The same problem in other orthonormal coordinates."""
    n = len(matrices[0])
    Q = la.qr(rng.standard_normal((n, n)))[0]
    return [Q @ A @ Q.T for A in matrices]


def _low(rng: np.random.Generator) -> float:
    return float(rng.choice([1e-5, 0.01, 0.06, 0.3])) * TOP


def brake(rng: np.random.Generator, n: int) -> Problem:
    """Component modes, rigid ones among them, joined by contact with friction and its damping."""
    w = _frequencies(rng, n)
    w[: rng.integers(0, 12)] = 0.0
    nc = int(rng.integers(8, 40))
    N, T = rng.standard_normal((2, nc, n)) / np.sqrt(n)
    k_n = (TOP**2) * 10.0 ** rng.uniform(-2, 1.5, nc)
    mu = rng.uniform(0, 1.0)
    springs = rng.standard_normal((14, n)) / np.sqrt(n)
    stiff = (TOP**2) * 10.0 ** rng.uniform(-3, 1.0, 14)
    K = np.diag(w**2) + (N.T * k_n) @ N + (springs.T * stiff) @ springs - mu * (T.T * k_n) @ N
    C = (T.T * (TOP * 10.0 ** rng.uniform(-3, 0.5))) @ T + np.diag(2 * rng.choice([0, 0.005]) * w)
    return Problem(C, K, (_low(rng), TOP))


def lock_in(rng: np.random.Generator, n: int) -> Problem:
    """Pairs of modes at, next to and beyond coalescence, equal and unequal dampers."""
    w2 = _frequencies(rng, n) ** 2
    K, C = np.diag(w2), np.zeros((n, n))
    for i in 2 * rng.choice(n // 2 - 1, size=8, replace=False):
        w2[i + 1] = w2[i] * (1 + 10.0 ** rng.uniform(-4, -1))
        coupling = (w2[i + 1] - w2[i]) / 2
        beyond = rng.choice([0.0, 1.0, -1.0]) * 10.0 ** rng.uniform(-15, -1)
        K[i + 1, i + 1] = w2[i + 1]
        K[i, i + 1], K[i + 1, i] = coupling * (1 + beyond), -coupling
        C[i, i], C[i + 1, i + 1] = rng.choice([0.0, 10.0, 300.0], 2)
    C, K = _turned(rng, C, K)
    return Problem(C, K, (_low(rng), TOP))


def overdamped(rng: np.random.Generator, n: int) -> Problem:
    """Real roots in the band, some of them critically damped or nearly so."""
    w = _frequencies(rng, n)
    zeta = 10.0 ** rng.uniform(-4, -2, n)
    heavy = rng.choice(n, size=int(rng.integers(1, 16)), replace=False)
    zeta[heavy] = 10.0 ** rng.uniform(-0.3, 1.5, len(heavy))
    near = rng.choice([0.0, 1.0, -1.0], len(heavy)) * 10.0 ** rng.uniform(-15, -2, len(heavy))
    zeta[heavy[::3]] = (1.0 + near)[::3]  # critical: a double real root
    C, K = _turned(rng, np.diag(2 * zeta * w), np.diag(w**2))
    if rng.random() < 0.5:
        R = rng.standard_normal((n, 6)) / np.sqrt(n)
        C = C + TOP * 10.0 ** rng.uniform(-2, 1.5) * R @ R.T
    return Problem(C, K, (_low(rng), TOP))


def unsymmetric(rng: np.random.Generator, n: int) -> Problem:
    """K and C of no symmetry; some roots diverge, one of them where a shift may be."""
    w = _frequencies(rng, n)
    spread = rng.standard_normal((2, n, n)) / n
    K = np.diag(w**2) + TOP**2 * 10.0 ** rng.uniform(-3, 0.5) * spread[0]
    C = np.diag(w * rng.normal(0.0, 0.01, n)) + TOP * 10.0 ** rng.uniform(-4, 0.0) * spread[1]
    if rng.random() < 0.3:
        root = TOP * rng.choice([0.05, 0.083, 0.2]) * (1 + rng.choice([0, 1e-12, 1e-6]))
        K[0, :] = K[:, 0] = C[0, :] = C[:, 0] = 0.0
        K[0, 0] = -(root**2)
    C, K = _turned(rng, C, K)
    return Problem(C, K, (_low(rng), TOP))


def gyroscopic(rng: np.random.Generator, n: int) -> Problem:
    """Skew-symmetric C, small to large, with and without damping: pairs split, none grows."""
    w = _frequencies(rng, n)
    G = rng.standard_normal((n, n)) / np.sqrt(n)
    C = TOP * 10.0 ** rng.uniform(-3, 0.3) * (G - G.T) + np.diag(2 * rng.choice([0, 0.01]) * w)
    C, K = _turned(rng, C, np.diag(w**2))
    return Problem(C, K, (_low(rng), TOP))


def singular(rng: np.random.Generator, n: int) -> Problem:
    """Free motions, exactly or nearly without stiffness, damped or not."""
    w = _frequencies(rng, n)
    free = int(rng.integers(1, 13))
    w[:free] = TOP * rng.choice([0.0, 1e-10, 1e-7, 1e-4], free)
    C, K = _turned(rng, np.diag(2 * rng.choice([0.0, 0.005]) * w), np.diag(w**2))
    return Problem(C, K, (_low(rng), TOP))


def multiple(rng: np.random.Generator, n: int) -> Problem:
    """Equal parts, coupled or not: every root two or three times, exactly or nearly."""
    copies = int(rng.integers(2, 4))
    m = n // copies
    part = brake(rng, m)
    C, K = (la.block_diag(*[A] * copies) for A in (part.C, part.K))
    if rng.random() < 0.5:
        link = 10.0 ** rng.uniform(-14, -3) * TOP**2 * rng.standard_normal((len(K), 2))
        K = K + link @ link.T / len(K)
    if rng.random() < 0.5:
        C, K = _turned(rng, C, K)
    return Problem(C, K, part.band)


def crowded(rng: np.random.Generator, n: int) -> Problem:
    """From a few to all of the roots in the band."""
    w = TOP * rng.uniform(0.0, 10.0 ** rng.uniform(0.0, 1.0), n)
    C, K = _turned(rng, np.diag(w * rng.normal(0.0, 0.02, n)), np.diag(w**2))
    return Problem(C, K, (_low(rng), TOP))


def sparse_band(rng: np.random.Generator, n: int) -> Problem:
    """None or a few roots in the band, or all of the lowest in one narrow cluster."""
    w = TOP * rng.uniform(1.3, 20.0, n)
    few = int(rng.integers(0, 5))
    w[:few] = TOP * (0.5 + 10.0 ** rng.uniform(-14, -1) * rng.uniform(-1, 1, few))
    C, K = _turned(rng, np.diag(0.01 * w), np.diag(w**2))
    return Problem(C, K, (_low(rng), TOP))


def stiff(rng: np.random.Generator, n: int) -> Problem:
    """Springs far stiffer than the modes of the band, and dampers beside them."""
    found = brake(rng, n)
    R = rng.standard_normal((4, n)) / np.sqrt(n)
    K = found.K + TOP**2 * 10.0 ** rng.uniform(2, 5) * R.T @ R
    return Problem(found.C + TOP * 10.0 ** rng.uniform(-2, 2) * R.T @ R, K, found.band)


KINDS: tuple[Callable[[np.random.Generator, int], Problem], ...] = (
    brake,
    lock_in,
    overdamped,
    unsymmetric,
    gyroscopic,
    singular,
    multiple,
    crowded,
    sparse_band,
    stiff,
)


def random_problem(number: int, n: int) -> Problem:
    """The kinds in turn."""
    rng = np.random.default_rng(number)
    return KINDS[number % len(KINDS)](rng, n)


AGREED = 1e-10  # relative distance of a root from its twin where both are well conditioned
UNITS = 100.0  # backward errors of LAPACK's roots, in units of round-off of the companion form


def all_roots_with_errors(p: Problem) -> tuple[np.ndarray, np.ndarray]:
    """All 2n roots by `geev`, and how far each may be off: its backward error times its condition.

    Next to a coalescence the condition goes beyond the root of round-off, and so does the error.
    """
    n = len(p.K)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-p.K / TOP**2, -p.C / TOP]])
    lam, left, right = la.eig(A, left=True)
    condition = 1.0 / np.maximum(np.abs(np.einsum("ij,ij->j", left.conj(), right)), 1e-17)
    eps = float(np.finfo(float).eps)
    error = UNITS * eps * np.linalg.norm(A) * np.minimum(condition, eps**-0.5) * TOP
    return lam * TOP, AGREED * np.abs(lam) * TOP + error


def difference(p: Problem, lam: np.ndarray) -> str:
    """What is wrong with the roots lam (m,) of a band beside `geev`'s: missed, doubled; or ''.

    Every root must be one of geev's, each of those taken once, and none in the band may be left,
    but for those that their error may have brought in or out.
    """
    exact, error = all_roots_with_errors(p)
    size = np.abs(exact)
    near = (exact.imag >= -error) & (size + error >= p.band[0]) & (size - error <= p.band[1])
    exact, error = exact[near], error[near]
    # a pair that is one double real root to round-off may be two complex ones
    distance = np.abs(lam[:, None] - exact) / error
    rows, columns = linear_sum_assignment(np.minimum(distance, 1e3))
    if len(lam) > len(exact):
        return f"{len(lam)} roots, of {len(exact)}"
    if (distance[rows, columns] > 1.0).any():
        return f"a root is off by {distance[rows, columns].max():.3g} times its error"
    left = np.setdiff1d(np.arange(len(exact)), columns)
    size = np.abs(exact[left])
    inside = (size - error[left] > p.band[0]) & (size + error[left] < p.band[1])
    missed = left[inside & (exact[left].imag >= error[left])]
    return f"missed {exact[missed]}" if len(missed) else ""
