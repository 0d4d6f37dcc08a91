"""What small deviations from a cycle become in a period: products of steps of their equation.

Each step is the diagonal [3/3] Pade approximant of the exponential of the fourth-order Magnus term:
deviations that only turn keep their size, however fast (Iserles & Norsett 1999).
"""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.oscillator import Oscillator

CHUNK_BYTES = 64_000_000  # memory of the matrices of so many steps at a time


def monodromy(osc: Oscillator, cycle: PeriodicMotion, steps: int) -> np.ndarray:
    """Matrix (2 n, 2 n) from deviations (omega q, q') at theta = 0 to those a period later."""
    m, offset = 2 * osc.n, np.sqrt(3.0) / 6.0  # of the points of Gauss in a step
    points = [_states(cycle, steps, 0.5 + side * offset) for side in (-1, 1)]
    period_map = np.eye(m)
    chunk = max(1, min(steps, CHUNK_BYTES // (8 * m * m)))
    for first in range(0, steps, chunk):
        rows = slice(first, min(first + chunk, steps))
        A1, A2 = (_rates(osc, q[rows], v[rows], cycle.omega) for q, v in points)
        period_map = product(_steps(A1, A2, 2 * np.pi / steps)) @ period_map
    return period_map


def product(steps: np.ndarray) -> np.ndarray:
    """Last @ .. @ first of matrices (k, m, m), by pairs."""
    while len(steps) > 1:
        paired = steps[1 : 2 * (len(steps) // 2) : 2] @ steps[: 2 * (len(steps) // 2) : 2]
        steps = np.concatenate([paired, steps[-1:]]) if len(steps) % 2 else paired
    period_map: np.ndarray = steps[0]
    return period_map


def _steps(A1: np.ndarray, A2: np.ndarray, h: float) -> np.ndarray:
    """Propagators (S, 2 n, 2 n) of steps h from the rates at their two points of Gauss."""
    A = 0.5 * h * (A1 + A2) + np.sqrt(3.0) / 12.0 * h**2 * (A2 @ A1 - A1 @ A2)
    square, identity = A @ A, np.eye(A.shape[-1])
    even = identity + square / 10.0
    odd = A @ (0.5 * identity + square / 120.0)
    propagators: np.ndarray = np.linalg.solve(even - odd, even + odd)
    return propagators


def _states(cycle: PeriodicMotion, count: int, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacements and velocities (count, n) at an offset in each of `count` steps of a period."""
    H = cycle.harmonics
    orders = np.arange(H + 1)
    finer = -(-(2 * H + 1) // count)  # the transform needs more points than the series
    spectrum: np.ndarray = 0.5 * count * finer * cycle.Q[: H + 1].astype(complex)
    spectrum[0] *= 2.0
    spectrum[1:] -= 0.5j * count * finer * cycle.Q[H + 1 :]
    spectrum *= np.exp(2j * np.pi * offset / count * orders)[:, None]
    slope = 1j * cycle.omega * orders[:, None] * spectrum
    q, v = (np.fft.irfft(x, count * finer, axis=0)[::finer] for x in (spectrum, slope))
    return q, v


def _rates(osc: Oscillator, q: np.ndarray, v: np.ndarray, omega: float) -> np.ndarray:
    """Matrices (S, 2 n, 2 n) of the linearised equation by theta, for (omega q, q')."""
    n = osc.n
    C, K = osc.tangent(q, v)
    A = np.zeros((len(q), 2 * n, 2 * n))
    A[:, :n, n:] = np.eye(n)
    A[:, n:, :n] = -K / omega**2
    A[:, n:, n:] = -C / omega
    return A
