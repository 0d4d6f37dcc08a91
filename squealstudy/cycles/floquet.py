"""Floquet multipliers of a cycle: what becomes of small deviations in a period.

The monodromy matrix is the product of steps of the linearised equation, each the diagonal [3/3]
Pade approximant of the exponential of the fourth-order Magnus term: deviations that only turn keep
their size, however fast (Iserles & Norsett 1999). Its error is judged by half as many steps, and by
the multiplier that must be one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import series_at
from squealstudy.cycles.oscillator import Oscillator

STEPS = 256  # a period, at least
STEPS_A_HARMONIC = 16
LARGE = 60  # coordinates above which the trapezoidal rule takes over
TRAPEZOIDAL_STEPS = 192
NEAR = 0.97  # size of multipliers of which the trapezoidal rule's error is told
BLOCK = 32  # steps of which the tangents are made together
CHUNK_BYTES = 64_000_000
FLIP, FOLD, TORUS = (
    "flip",
    "fold",
    "torus",
)  # a multiplier beyond -1, 1, or a pair beyond the circle


@dataclass(frozen=True, eq=False)
class Floquet:
    """Multipliers of a cycle.

    Attributes
    ----------
    multipliers : ndarray (2 n,) complex
        Largest first, the trivial one left to the end.
    vectors : ndarray (2 n, 2 n) complex
        Deviations (q, q') at theta = 0 that they belong to, unit norms.
    trivial : complex
        The one along the motion, which is 1 but for the error.
    error : float
        Of the multipliers at or beyond half of the unit circle: difference to half as many steps,
        of the trivial one to 1, and of a projection to a smaller one, whichever is most.
    period : float
        s.
    """

    multipliers: np.ndarray
    vectors: np.ndarray
    trivial: complex
    error: float
    period: float

    @property
    def n_unstable(self) -> int:
        """Multipliers that are beyond the unit circle by more than the error."""
        return int((np.abs(self.multipliers[:-1]) > 1.0 + self.error).sum())

    @property
    def stable(self) -> bool | None:
        """Whether the cycle attracts; None where the error does not let that be said."""
        if self.n_unstable:
            return False
        return True if (np.abs(self.multipliers[:-1]) < 1.0 - self.error).all() else None

    @property
    def growth_rate(self) -> float:
        """Of the deviation that grows fastest, or decays slowest, 1/s."""
        largest = float(np.abs(self.multipliers[0])) if len(self.multipliers) > 1 else 0.0
        return float(np.log(max(largest, 1e-300)) / self.period)

    @property
    def instability(self) -> str:
        """How the cycle is unstable, by its largest multiplier; empty where it is not."""
        if not self.n_unstable:
            return ""
        largest = complex(self.multipliers[0])
        if abs(largest.imag) > self.error:
            return TORUS
        return FOLD if largest.real > 0 else FLIP


def floquet(osc: Oscillator, cycle: PeriodicMotion) -> Floquet:
    """Multipliers of a cycle of an oscillator."""
    large = osc.n > LARGE
    whole = trapezoidal if large else monodromy
    steps = TRAPEZOIDAL_STEPS if large else max(STEPS, STEPS_A_HARMONIC * cycle.harmonics)
    steps += steps % 2
    coarse = np.linalg.eigvals(whole(osc, cycle, steps // 2))
    found, vectors = la.eig(whole(osc, cycle, steps))
    q, v = cycle.Q, cycle.omega
    synthesis, slope = series_at(np.zeros(1), cycle.harmonics)
    velocity = v * (slope @ q)[0]
    force = osc.spread(osc.evaluate(synthesis @ q, velocity[None]).f)[0]
    acceleration = force - osc.C @ velocity - osc.K @ (synthesis @ q)[0]
    flow = np.concatenate([cycle.omega * velocity, acceleration])
    along = np.abs(flow @ vectors.conj()) * (np.abs(found - 1.0) < 0.5)
    own = int(np.argmax(along)) if along.any() else int(np.argmin(np.abs(found - 1.0)))
    trivial = complex(found[own])
    order = [k for k in np.argsort(-np.abs(found), kind="stable") if k != own] + [own]
    found, vectors = found[order], vectors[:, order]
    vectors[: osc.n] /= cycle.omega
    compared = _radii if large else _difference
    error = max(abs(trivial - 1.0), compared(found, coarse))
    return Floquet(
        found, vectors / la.norm(vectors, axis=0), trivial, error, 2 * np.pi / cycle.omega
    )


def floquet_on(
    osc: Oscillator, small: np.ndarray, large: np.ndarray, cycle: PeriodicMotion
) -> Floquet:
    """Multipliers on the larger of two bases (n, r); what the smaller changes is their error."""
    few, many = (floquet(osc.on(V), replace(cycle, Q=cycle.Q @ V)) for V in (small, large))
    return replace(many, error=max(many.error, _radii(many.multipliers, few.multipliers)))


def _difference(fine: np.ndarray, coarse: np.ndarray) -> float:
    """Largest distance of a multiplier that is not small to the nearest of the coarse ones."""
    seen = fine[np.abs(fine) > 0.5]
    if not len(seen):
        return 0.0
    return float(np.abs(seen[:, None] - coarse).min(axis=1).max())


def _radii(fine: np.ndarray, coarse: np.ndarray) -> float:
    """Largest difference in size of multipliers near the unit circle, in order of size.

    The last of `fine` is the trivial one, which is left out, as is the nearest to 1 of `coarse`.
    There may be fewer of `coarse`: what it lacks is not compared.
    """
    coarse = np.delete(coarse, int(np.argmin(np.abs(coarse - 1.0))))
    sizes = np.sort(np.abs(fine[:-1]))[::-1], np.sort(np.abs(coarse))[::-1]
    kept = min(int((sizes[0] > NEAR).sum()), len(coarse))
    sizes = sizes[0][:kept], sizes[1][:kept]
    return float(np.abs(sizes[0] - sizes[1]).max(initial=0.0))


def trapezoidal(osc: Oscillator, cycle: PeriodicMotion, steps: int) -> np.ndarray:
    """The same as `monodromy` by the trapezoidal rule, which costs a few solves of n a step.

    It turns fast deviations too slowly, but neither feeds nor damps them: sizes of multipliers are
    kept.
    """
    n, h = osc.n, 2 * np.pi / steps
    one, q, p = np.eye(n), np.eye(n, 2 * n), np.eye(n, 2 * n, n)
    C, K = _stiffness(osc, cycle, np.zeros(1))
    for first in range(0, steps, BLOCK):
        theta = h * np.arange(first + 1, min(first + BLOCK, steps) + 1)
        for C1, K1 in zip(*_stiffness(osc, cycle, theta), strict=True):
            middle = q + 0.5 * h * p
            pull = p - 0.5 * h * (C[0] @ p + K[0] @ q + K1 @ middle)
            p1 = la.solve(one + 0.5 * h * C1 + 0.25 * h**2 * K1, pull, check_finite=False)
            q, p = middle + 0.5 * h * p1, p1
            C, K = C1[None], K1[None]
    return np.vstack([q, p])


def _stiffness(
    osc: Oscillator, cycle: PeriodicMotion, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Damping over omega and stiffness over omega^2 (S, n, n) at angles."""
    synthesis, slope = series_at(theta, cycle.harmonics)
    C, K = osc.tangent(synthesis @ cycle.Q, cycle.omega * (slope @ cycle.Q))
    return C / cycle.omega, K / cycle.omega**2


def monodromy(osc: Oscillator, cycle: PeriodicMotion, steps: int) -> np.ndarray:
    """Matrix (2 n, 2 n) from deviations (omega q, q') at theta = 0 to those a period later."""
    m = 2 * osc.n
    whole = np.eye(m)
    chunk = max(1, min(steps, CHUNK_BYTES // (8 * m * m)))
    for first in range(0, steps, chunk):
        whole = _product(_steps(osc, cycle, steps, first, min(first + chunk, steps))) @ whole
    return whole


def _product(steps: np.ndarray) -> np.ndarray:
    """Last @ .. @ first of matrices (k, m, m), by pairs."""
    while len(steps) > 1:
        paired = steps[1 : 2 * (len(steps) // 2) : 2] @ steps[: 2 * (len(steps) // 2) : 2]
        steps = np.concatenate([paired, steps[-1:]]) if len(steps) % 2 else paired
    found: np.ndarray = steps[0]
    return found


def _steps(osc: Oscillator, cycle: PeriodicMotion, count: int, first: int, last: int) -> np.ndarray:
    """Propagators (last - first, 2 n, 2 n) of steps of a period that has `count`."""
    h = 2 * np.pi / count
    middle = h * (np.arange(first, last) + 0.5)
    offset = h * np.sqrt(3.0) / 6.0
    A1, A2 = (_rates(osc, cycle, middle + side * offset) for side in (-1, 1))
    A = 0.5 * h * (A1 + A2) + np.sqrt(3.0) / 12.0 * h**2 * (A2 @ A1 - A1 @ A2)
    square, one = A @ A, np.eye(2 * osc.n)
    even = one + square / 10.0
    odd = A @ (0.5 * one + square / 120.0)
    found: np.ndarray = np.linalg.solve(even - odd, even + odd)
    return found


def _rates(osc: Oscillator, cycle: PeriodicMotion, theta: np.ndarray) -> np.ndarray:
    """Matrices (S, 2 n, 2 n) of the linearised equation by theta, for (omega q, q')."""
    n = osc.n
    C, K = _stiffness(osc, cycle, theta)
    A = np.zeros((len(theta), 2 * n, 2 * n))
    A[:, :n, n:] = np.eye(n)
    A[:, n:, :n] = -K
    A[:, n:, n:] = -C
    return A
