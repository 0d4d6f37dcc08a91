"""Roots of the linearised equations as a one-step method integrates them: what its step errs by.

A sub-step h makes (q, v)_1 = P (q, v)_0 + first pull_0 + last pull_1 of q'' + c q' + w2 q = pull
(`motion.integrator`), with P, first and last diagonal in the coordinates and pull = -(K' q + C' v)
of all that is not diagonal. A motion that each step multiplies by z = exp(mu h) has, coordinate by
coordinate, (z - P) (q, v) = (first + z last) pull. With pull = det(z - P) r the unknowns r obey

    [diag(det(z - P)) + K' diag(a) + C' diag(b)] r = 0,   (a, b) = adj(z - P) (first + z last),

whose roots z near exp(lambda h) are found by Newton's method. That is where each step's balance is
found. A fixed Jacobian evaluates the forces once where the first guess 2 pull_0 - pull_-1 is within
tolerance: pull_1 is that of the trial state which the guess makes, and last (guess - pull_1), that
is last g det(z - P) r with g = -(1 - 1 / z)^2 at z pull_0, is added to (a, b).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.motion.integrator import FixedJacobian, KernelIntegrator

Guess = Callable[[complex], tuple[complex, complex]]
MAX_NEWTON_ITERATIONS = 8  # of Newton's method; the start is within the step's error of the root
NEWTON_TOLERANCE = 1e-12  # change of z
SHIFT_ROUND_OFF_RATIO = 1e-15  # of the largest entry
MIN_ANSWER_RATIO = 1e-8  # of the largest answer to a pull: coordinates below it begin anywhere
# of abs(lambda): what is found so far off is another root, or the step is too long
MAX_REL_ROOT_DISTANCE = 0.1


def integrated_roots(
    C: np.ndarray,
    K: np.ndarray,
    diagonal: tuple[np.ndarray, np.ndarray],
    lam: np.ndarray,
    right: np.ndarray,
    integrator: KernelIntegrator,
    step: float,
    iterated: bool,
) -> np.ndarray:
    """Roots mu (m,) [rad/s] with which modes of lambda^2 + lambda C + K move at a step.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Of the system linearised at steady sliding.
    diagonal : (w2, c), ndarray (n,)
        What the method takes as free motion of the coordinates, before it pre-warps them.
    lam : ndarray (m,) complex
    right : ndarray (n, m) complex
    integrator : KernelIntegrator
    step : float
        s.
    iterated : bool
        By one evaluation of the forces a step, from the method's guess; else balanced.

    Returns
    -------
    ndarray (m,) complex
        NaN where Newton's method does not find one near.
    """
    w2, c = diagonal
    table = integrator.step(*integrator.modes(w2, c, step), step)
    step_map = _Step(table, _guess(integrator) if iterated else _balanced)
    K_off, C_off = K - np.diag(w2), C - np.diag(c)
    return np.array(
        [
            _root(step_map, K_off, C_off, root, x, step)
            for root, x in zip(lam, right.T, strict=True)
        ],
        dtype=complex,
    )


def _balanced(_: complex) -> tuple[complex, complex]:
    return 0.0, 0.0


def _guess(integrator: KernelIntegrator) -> Guess:
    """(guess - pull_1) / z pull_0 of a method and its derivative by z."""
    if not isinstance(integrator, FixedJacobian):
        return _balanced  # Newton's iteration goes on to the squares of tolerances
    if not integrator.extrapolate:
        return lambda z: (1 / z - 1, -1 / z**2)
    return lambda z: (-((1 - 1 / z) ** 2), -2 * (1 - 1 / z) / z**2)


@dataclass(frozen=True)
class _Step:
    """Coefficients (8, n) of a step, and its guess."""

    table: np.ndarray
    guess: Guess

    def answers(self, z: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a, b and det (2, n) of the module's equation, each with its derivative by z."""
        t = self.table
        last_q, last_v = t[at.LAST_Q], t[at.LAST_V]
        force_q, force_v = t[at.FIRST_Q] + z * last_q, t[at.FIRST_V] + z * last_v
        q, v = z - t[at.QQ], z - t[at.VV]
        det, slope = q * v - t[at.QV] * t[at.VQ], q + v
        g, slope_g = self.guess(z)
        missed, slope_missed = g * det, slope_g * det + g * slope
        a = v * force_q + t[at.QV] * force_v + last_q * missed
        b = t[at.VQ] * force_q + q * force_v + last_v * missed
        slope_a = force_q + v * last_q + t[at.QV] * last_v + last_q * slope_missed
        slope_b = t[at.VQ] * last_q + force_v + q * last_v + last_v * slope_missed
        return np.array([a, slope_a]), np.array([b, slope_b]), np.array([det, slope])

    def matrices(self, K: np.ndarray, C: np.ndarray, z: complex) -> tuple[np.ndarray, np.ndarray]:
        """The matrix of r and its derivative by z."""
        parts = zip(*self.answers(z), strict=True)
        T, slope = (np.diag(det) + K * a + C * b for a, b, det in parts)
        return T, slope


def _root(
    made: _Step, K: np.ndarray, C: np.ndarray, lam: complex, x: np.ndarray, step: float
) -> complex:
    """The root near lambda, by Newton's method on z and r together (inverse iteration)."""
    z = np.exp(lam * step)
    along = made.answers(z)[0][0]
    size = np.abs(along)
    r = np.divide(x, along, out=np.ones_like(x), where=size > MIN_ANSWER_RATIO * size.max())
    r = r / np.linalg.norm(r)
    for _ in range(MAX_NEWTON_ITERATIONS):
        T, slope = made.matrices(K, C, z)
        shift = (
            SHIFT_ROUND_OFF_RATIO * np.abs(T).max()
        )  # a root met exactly would be a singular matrix
        try:
            u = np.linalg.solve(T + shift * np.eye(len(T)), slope @ r)
        except np.linalg.LinAlgError:
            u = np.zeros_like(r)
        size, along_r = np.linalg.norm(u), r.conj() @ u
        if not (np.isfinite(size) and abs(along_r) > 0.0):  # two roots in one place, or none near
            return complex(np.nan, np.nan)
        change = 1.0 / along_r
        z, r = z - change, u / size
        if abs(change) <= NEWTON_TOLERANCE:
            break
    mu = complex(np.log(z) / step)
    near = abs(mu - lam) <= MAX_REL_ROOT_DISTANCE * abs(lam) and np.isfinite(z)
    return mu if near else complex(np.nan, np.nan)
