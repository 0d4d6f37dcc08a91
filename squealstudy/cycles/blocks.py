"""A cheap Newton step of harmonic balance, which solves each harmonic alone with mean tangents.

The blocks are scaled to unit diagonals and factorised in single precision. That of the first
harmonic is all but singular; it has a border, which holds the size and phase of the motion.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.errors import ConvergenceError

MAX_FLOAT32_STIFFNESS = 1e30  # 1/s2: a stiffness that single precision still holds


def mean_tangents(
    osc: Oscillator, local: LocalForces, xi: float, precision: type = np.float64
) -> tuple[np.ndarray, np.ndarray]:
    """Mean stiffness and damping (n, n) over the period, with added damping xi [1/s].

    `local` are the sampled forces; their tangents are averaged and projected in `precision`.
    """
    by_displacement, by_velocity = (
        osc.projected(D.mean(axis=0).astype(precision)) for D in local[1:]
    )
    return osc.K - by_displacement, osc.C - by_velocity + xi * np.eye(osc.n)


class Blocks:
    """Factorised blocks of the harmonics 0 to H about a motion.

    Parameters
    ----------
    osc : Oscillator
    motion : PeriodicMotion
        The motion in all coordinates.
    local : LocalForces
        Its sampled forces.
    weight : ndarray (n,)
        Scale of each coordinate, 1/s: the root of a stiffness.

    Raises
    ------
    ConvergenceError
        Where contact is absurdly stiff. `step` raises it where a block is singular.
    """

    def __init__(
        self, osc: Oscillator, motion: PeriodicMotion, local: LocalForces, weight: np.ndarray
    ) -> None:
        self.motion, self._weight = motion, weight
        with np.errstate(over="ignore", invalid="ignore"):
            K, C = mean_tangents(osc, local, motion.parameter, np.float32)
        if not max(np.abs(K).max(), np.abs(C).max() * motion.omega) < MAX_FLOAT32_STIFFNESS:
            raise ConvergenceError("not_finite", "contact is absurdly stiff in a periodic motion")
        scale = weight[:, None] * weight
        K, C = (K / scale).astype(np.float32), (motion.omega / scale * C).astype(np.float32)
        inertia = ((motion.omega / weight) ** 2).astype(np.float32)
        n, H = osc.n, motion.harmonics
        self._factors = [la.lu_factor(K, check_finite=False)]
        for h in range(1, H + 1):
            A = np.zeros((n + (h == 1),) * 2, np.complex64, order="F")
            A.real[:n, :n], A.imag[:n, :n] = K, h * C
            A[np.arange(n), np.arange(n)] -= h**2 * inertia
            if h == 1:
                q = weight * (motion.Q[1] - 1j * motion.Q[H + 1])
                A[:n, n], A[n, :n] = (x / la.norm(x) for x in (q / weight**2, q.conj()))
            self._factors.append(la.lu_factor(A, overwrite_a=True, check_finite=False))

    @property
    def harmonics(self) -> int:
        """Number H of harmonics."""
        return len(self._factors) - 1

    def step(self, R: np.ndarray, motion: PeriodicMotion) -> PeriodicMotion:
        """The change that balances a motion with imbalance R (2 H + 1, n), to first order.

        The first harmonic keeps its size and phase. Its equation is solved by a complex shift of
        its block instead, which gives the changes of frequency and added damping.
        """
        H, weight = motion.harmonics, self._weight
        largest = float(np.abs(R).max()) or 1.0
        R = R / (largest * weight)  # within single precision
        change = np.zeros_like(R)
        change[0] = la.lu_solve(self._factors[0], R[0].astype(np.float32))
        x, shift = self._bordered_solution(R[1] - 1j * R[H + 1], motion.Q[1] - 1j * motion.Q[H + 1])
        for h in range(1, H + 1):
            if h > 1:
                side = (R[h] - 1j * R[H + h]).astype(np.complex64)
                x = la.lu_solve(self._factors[h], side)
            change[h], change[H + h] = x.real, -x.imag
        if not np.isfinite(change).all():
            raise ConvergenceError("singular_jacobian", "the balance of a harmonic is singular")
        shift *= largest
        # A = -omega^2 + i omega (C + xi) + ..: where A changes by s, omega changes by
        # -Re s / 2 omega and xi by Im s / omega; the step takes the imbalance away, hence the minus
        d_omega = float(-shift.real / (2.0 * motion.omega))
        return PeriodicMotion(
            -largest * change / weight, -d_omega, -float(shift.imag / motion.omega)
        )

    def _bordered_solution(self, r: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, complex]:
        """Solve A x + s q = r for x (n,) and s, where x is orthogonal to q (both weighted).

        The factorised block has the q of another motion, nearby, as its border.
        """
        weighted, unit = self._weight * q, la.norm(self._weight * q)
        sides = np.zeros((len(q) + 1, 3), np.complex64)
        sides[:-1, 0], sides[:-1, 1], sides[-1, 2] = r, weighted / self._weight**2 / unit, 1.0
        solutions = la.lu_solve(self._factors[1], sides).astype(complex)
        # coefficients such that the border's unknown and the component along q vanish
        pair = np.vstack([solutions[-1], weighted.conj() @ solutions[:-1] / unit])
        if not np.isfinite(pair).all() or not abs(np.linalg.det(pair[:, 1:])) > 0.0:
            raise ConvergenceError("singular_jacobian", "the balance is singular")
        s, back = np.linalg.solve(pair[:, 1:], pair[:, 0])
        x: np.ndarray = solutions[:-1] @ [1.0, -s, -back]
        return x, s / unit
