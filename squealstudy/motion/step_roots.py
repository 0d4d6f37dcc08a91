"""Roots of the linearised equations as a one-step method integrates them: the error of its step.

A sub-step h makes (q, v)_1 = P (q, v)_0 + first pull_0 + last pull_1 of q'' + c q' + w2 q = pull
(`motion.integrator`), with P, first and last diagonal in the coordinates and pull = -(K' q + C' v)
of all that is not diagonal. A motion that each step multiplies by z = exp(mu h) has, coordinate by
coordinate, (z - P) (q, v) = (first + z last) pull. With pull = det(z - P) r the unknowns r obey

    [diag(det(z - P)) + K' diag(a) + C' diag(b)] r = 0,   (a, b) = adj(z - P) (first + z last),

whose roots z near exp(lambda h) are found by Newton's method. This holds if each step is solved to
its balance. With a fixed Jacobian the forces are evaluated only once if the first guess
2 pull_0 - pull_-1 is within tolerance. Then pull_1 is that of the trial state which the guess
makes, and last (guess - pull_1), which is last g det(z - P) r with g = -(1 - 1 / z)^2 at z pull_0,
is added to (a, b).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.motion.integrator import FixedJacobian, KernelIntegrator

Guess = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
MAX_NEWTON_ITERATIONS = 8  # the start is within the step's error of the root
NEWTON_TOLERANCE = 1e-12  # last change of z
SHIFT_ROUND_OFF_RATIO = 1e-15  # shift of the diagonal over the largest entry
# response of a coordinate to a pull over the largest, below which its start does not matter
MIN_ANSWER_RATIO = 1e-8
# distance over abs(lambda) beyond which a root is another one, or the step is too long
MAX_REL_ROOT_DISTANCE = 0.1
ENTRIES_AT_ONCE = 2**18  # entries of matrices that are solved side by side: a few megabytes


@dataclass(frozen=True, eq=False)
class LinearMotions:
    """Design points linearised at steady sliding, in coordinates that they share.

    Attributes
    ----------
    C, K : ndarray (m, n, n)
        Damping [1/s] and stiffness [1/s2]; the mass is the identity.
    w2 : ndarray (n,)
        Stiffness of the coordinates' free motion, before a method pre-warps it, 1/s2.
    c : ndarray (m, n)
        Damping of that free motion, 1/s.
    """

    C: np.ndarray
    K: np.ndarray
    w2: np.ndarray
    c: np.ndarray

    def tables(self, integrator: KernelIntegrator, step: float) -> np.ndarray:
        """Coefficients (m, 8, n) of a step of each point; those of equal damping share the work."""
        table_of: dict[bytes, np.ndarray] = {}
        keys = [row.tobytes() for row in self.c]
        for key, c in zip(keys, self.c, strict=True):
            if key not in table_of:
                table_of[key] = integrator.step(*integrator.modes(self.w2, c, step), step)
        return np.array([table_of[key] for key in keys])


def integrated_roots(
    motions: LinearMotions,
    owner: np.ndarray,
    lam: np.ndarray,
    right: np.ndarray,
    integrator: KernelIntegrator,
    step: float,
) -> np.ndarray:
    """Roots mu [rad/s] with which modes of lambda^2 + lambda C + K move at a step.

    Parameters
    ----------
    motions : LinearMotions
        The m design points.
    owner : ndarray (N,) of int
        Index of the design point of each mode.
    lam : ndarray (N,) complex
        Roots of the equations, rad/s.
    right : ndarray (N, n) complex
        Right vectors, in rows.
    integrator : KernelIntegrator
    step : float
        Length of a step, s.

    Returns
    -------
    ndarray (2, N) complex
        Roots if each step is solved to its balance, and if forces are evaluated once a step from
        the method's guess. NaN where Newton's method finds none nearby.
    """
    tables = motions.tables(integrator, step)
    diagonal = np.arange(len(motions.w2))
    K_off, C_off = motions.K.copy(), motions.C.copy()
    K_off[:, diagonal, diagonal] -= motions.w2
    C_off[:, diagonal, diagonal] -= motions.c
    roots = np.empty((2, len(lam)), dtype=complex)
    count = max(1, ENTRIES_AT_ONCE // max(len(motions.w2), 1) ** 2)
    for first in range(0, len(lam), count):
        part = slice(first, first + count)
        owners = owner[part]
        for row, guess in enumerate((_balanced, _guess(integrator))):
            steps = _Steps(tables[owners], K_off[owners], C_off[owners], guess)
            roots[row, part] = _roots(steps, lam[part], right[part], step)
    return roots


def _balanced(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros_like(z), np.zeros_like(z)


def _guess(integrator: KernelIntegrator) -> Guess:
    """(guess - pull_1) / z pull_0 of a method and its derivative by z."""
    if not isinstance(integrator, FixedJacobian):
        return _balanced  # Newton's iteration goes on to the squares of tolerances
    if not integrator.extrapolate:
        return lambda z: (1 / z - 1, -1 / z**2)
    return lambda z: (-((1 - 1 / z) ** 2), -2 * (1 - 1 / z) / z**2)


@dataclass(frozen=True, eq=False)
class _Steps:
    """Coefficients (N, 8, n) of a step of each mode's point, K' and C' (N, n, n), and the guess."""

    table: np.ndarray
    K: np.ndarray
    C: np.ndarray
    guess: Guess

    def at(self, rows: np.ndarray) -> _Steps:
        """The coefficients of some modes."""
        return _Steps(self.table[rows], self.K[rows], self.C[rows], self.guess)

    def answers(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a, b and det of the module's equation at z (N,), each (2, N, n) with its derivative."""
        z, t = z[:, None], self.table.swapaxes(0, 1)
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

    def matrices(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The matrices (N, n, n) of r and their derivatives by z."""
        diagonal = np.arange(self.K.shape[1])
        pair = []
        for a, b, det in zip(*self.answers(z), strict=True):
            T = self.K * a[:, None, :] + self.C * b[:, None, :]
            T[:, diagonal, diagonal] += det
            pair.append(T)
        return pair[0], pair[1]


def _roots(steps: _Steps, lam: np.ndarray, x: np.ndarray, step: float) -> np.ndarray:
    """The roots (N,) near lambda, by Newton's method on z and r together (inverse iteration)."""
    z = np.exp(lam * step)
    force_response = steps.answers(z)[0][0]
    size = np.abs(force_response)
    responds = size > MIN_ANSWER_RATIO * size.max(axis=1, initial=0.0, keepdims=True)
    r = np.divide(x, force_response, out=np.ones_like(x), where=responds)
    r = r / np.linalg.norm(r, axis=1)[:, None]
    iterating = np.arange(len(lam))
    for _ in range(MAX_NEWTON_ITERATIONS):
        if not len(iterating):
            break
        T, slope = steps.at(iterating).matrices(z[iterating])
        shift = SHIFT_ROUND_OFF_RATIO * np.abs(T).max(axis=(1, 2))  # T is singular at a root
        T = T + shift[:, None, None] * np.eye(T.shape[1])
        u = _solved(T, np.einsum("Nij,Nj->Ni", slope, r[iterating]))
        size, along_r = np.linalg.norm(u, axis=1), np.einsum("Ni,Ni->N", r[iterating].conj(), u)
        # two roots in one place, or none near
        is_regular = np.isfinite(size) & (np.abs(along_r) > 0.0)
        z[iterating[~is_regular]] = np.nan
        iterating, u, size, along_r = (
            iterating[is_regular],
            u[is_regular],
            size[is_regular],
            along_r[is_regular],
        )
        change = 1.0 / along_r
        z[iterating], r[iterating] = z[iterating] - change, u / size[:, None]
        iterating = iterating[np.abs(change) > NEWTON_TOLERANCE]
    is_root = np.isfinite(z) & (z != 0.0)
    mu = np.log(np.where(is_root, z, 1.0)) / step
    is_near = is_root & (np.abs(mu - lam) <= MAX_REL_ROOT_DISTANCE * np.abs(lam))
    return np.where(is_near, mu, complex(np.nan, np.nan))


def _solved(T: np.ndarray, b: np.ndarray) -> np.ndarray:
    """T^-1 b (N, n) of matrices (N, n, n); zeros where one is singular."""
    try:
        return np.asarray(np.linalg.solve(T, b[..., None])[..., 0])
    except np.linalg.LinAlgError:
        if len(T) == 1:
            return np.zeros_like(b)
        return np.concatenate([_solved(T[k : k + 1], b[k : k + 1]) for k in range(len(T))])
