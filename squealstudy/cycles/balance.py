"""Harmonic balance by alternating frequency and time, with its analytic Jacobian.

Forces are evaluated at samples of a period and projected on the harmonics (Cameron & Griffin
1989). With the Fourier coefficients of their derivatives D(theta) the Jacobian is exact for these
samples: products of two harmonics are sums of harmonics at every sample. Where friction changes
direction between samples it is nearly exact (`kernels/turns.py`).

The added damping xi of `C + xi I` is an unknown: with it every amplitude is periodic (extended
periodic motion concept, Krack 2015, doi 10.1016/j.compstruc.2015.03.008), and xi = 0 is a cycle.

Each harmonic may be balanced in vectors of its own. The coordinates z of a motion are then its
components in these vectors: first those of the mean, then of the cosines 1 to H, then of the sines.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.cycles.harmonics import Sampling
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.kernels.few_coordinates import balance_of_few, imbalance_of_few
from squealstudy.kernels.harmonic_balance import couple

MAX_SUMMED_COORDINATES = 6  # most coordinates for which one kernel sums over samples and harmonics


class Balanced(NamedTuple):
    """Imbalance of a series, and its derivatives.

    Attributes
    ----------
    R : ndarray (m,)
        The imbalance (`Balance.imbalance`).
    J : ndarray (m, m)
        Its derivatives by the coordinates.
    by_omega, by_xi : ndarray (m,)
        Its derivatives by the angular frequency and by the added damping.
    """

    R: np.ndarray
    J: np.ndarray
    by_omega: np.ndarray
    by_xi: np.ndarray


class Balance:
    """Balance of the harmonics 0 to H of an oscillator.

    Parameters
    ----------
    osc : Oscillator
    harmonics : int
        Number H of the highest harmonic.
    vectors : sequence of ndarray (n, r_h), or None
        Orthonormal vectors of each harmonic 0 to H; None to balance in all coordinates.
    """

    def __init__(
        self, osc: Oscillator, harmonics: int, vectors: Sequence[np.ndarray] | None = None
    ) -> None:
        self.osc, self.harmonics, self.vectors = osc, harmonics, vectors
        self.rule = osc.sampling(harmonics)
        self._few: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        if vectors is None and osc.n <= MAX_SUMMED_COORDINATES:
            K, C, B = map(np.ascontiguousarray, (osc.K, osc.C, osc.B))
            self._few = K, C, B
        count = harmonics + 1
        if vectors is None:
            self.K, self.C, self._rows = [osc.K] * count, [osc.C] * count, [osc.rows] * count
        else:
            self.K, self.C = ([V.T @ A @ V for V in vectors] for A in (osc.K, osc.C))
            self._rows = [osc.rows @ V for V in vectors]
        sizes = np.array([len(K) for K in self.K])
        starts = np.concatenate([[0], np.cumsum([*sizes, *sizes[1:]])]).tolist()
        blocks = [slice(a, b) for a, b in itertools.pairwise(starts)]
        # slices of z with the cosines and with the sines of each harmonic; the mean has no sines
        self.parts = [blocks[:1], *zip(blocks[1:count], blocks[count:], strict=True)]
        self.size = int(starts[-1])
        self._orders = np.repeat(self.rule.order, [p.stop - p.start for p in blocks])
        everything = np.arange(self.size)
        mean, cosines, sines = (everything[: sizes[0]], *np.split(everything[sizes[0] :], 2))
        self._turned_from = np.concatenate([mean, sines, cosines])
        self._turns = self._orders * np.repeat([0.0, 1.0, -1.0], [len(mean), *[len(sines)] * 2])

    # -- coordinates -----------------------------------------------------------------------------
    def lowered(self, Q: np.ndarray) -> np.ndarray:
        """Project a series Q (2 H + 1, n) on the vectors: its coordinates (m,)."""
        if self.vectors is None:
            return Q.ravel()
        H, z = self.harmonics, np.zeros(self.size)
        for h, (V, parts) in enumerate(zip(self.vectors, self.parts, strict=True)):
            for row, part in zip((h, H + h), parts, strict=False):
                z[part] = Q[row] @ V
        return z

    def lifted(self, z: np.ndarray) -> np.ndarray:
        """Assemble the series (2 H + 1, n) from its coordinates z (m,)."""
        if self.vectors is None:
            return z.reshape(2 * self.harmonics + 1, -1)
        H, Q = self.harmonics, np.zeros((2 * self.harmonics + 1, self.osc.n))
        for h, (V, parts) in enumerate(zip(self.vectors, self.parts, strict=True)):
            for row, part in zip((h, H + h), parts, strict=False):
                Q[row] = V @ z[part]
        return Q

    # -- forces ----------------------------------------------------------------------------------
    def _local_series(self, z: np.ndarray) -> np.ndarray:
        """Series (2 H + 1, g b) of the displacements that local forces depend on."""
        if self.vectors is None:
            return z.reshape(2 * self.harmonics + 1, -1) @ self._rows[0].T
        H = self.harmonics
        series = np.zeros((2 * H + 1, len(self._rows[0])))
        for h, (rows, parts) in enumerate(zip(self._rows, self.parts, strict=True)):
            for row, part in zip((h, H + h), parts, strict=False):
                series[row] = rows @ z[part]
        return series

    def sampled(self, z: np.ndarray, omega: float) -> LocalForces:
        """Forces at the samples of a period."""
        return _forces(self.osc, self.rule, self._local_series(z), omega)

    def _spread(self, f: np.ndarray) -> np.ndarray:
        """Harmonics (m,) of the generalised forces that samples f (S, g, b) of local ones make."""
        local = self.rule.analysis @ f.reshape(len(f), -1)
        if self.vectors is None:
            harmonics: np.ndarray = (local @ self._rows[0]).ravel()
            return harmonics
        H, harmonics = self.harmonics, np.zeros(self.size)
        for h, (rows, parts) in enumerate(zip(self._rows, self.parts, strict=True)):
            for row, part in zip((h, H + h), parts, strict=False):
                harmonics[part] = local[row] @ rows
        return harmonics

    # -- equations -------------------------------------------------------------------------------
    def turned(self, z: np.ndarray) -> np.ndarray:
        """Coordinates (m,) of the derivative by theta.

        The cosine of harmonic h becomes h times the sine, the sine minus h times the cosine.
        """
        turned: np.ndarray = self._turns * z[self._turned_from]
        return turned

    def imbalance(
        self, z: np.ndarray, omega: float, xi: float, local: LocalForces | None = None
    ) -> np.ndarray:
        """Imbalance R (m,) of each harmonic: q'' + (C + xi I) q' + K q less the forces.

        `local` are the forces `sampled` at this motion, if the caller has them already.
        """
        local = self.sampled(z, omega) if local is None else local
        if self._few:
            Q, rule = z.reshape(-1, self.osc.n), self.rule
            R = imbalance_of_few(Q, omega, xi, *self._few, local.f, rule.cosines, rule.sines)
            return R.ravel()
        R, turned = np.zeros(self.size), self.turned(z)
        if self.vectors is None:  # all harmonics at once
            Q, T = (x.reshape(2 * self.harmonics + 1, -1) for x in (z, turned))
            R = (Q @ self.osc.K.T + omega * (T @ self.osc.C.T)).ravel()
        else:
            for K, C, parts in zip(self.K, self.C, self.parts, strict=True):
                for part in parts:
                    R[part] = K @ z[part] + omega * (C @ turned[part])
        R += omega * xi * turned - (omega * self._orders) ** 2 * z
        return R - self._spread(local.f)

    def balanced(
        self,
        z: np.ndarray,
        omega: float,
        xi: float,
        local: LocalForces | None = None,
        precision: type = np.float64,
    ) -> Balanced:
        """`imbalance` of coordinates z (m,) at omega [rad/s], xi [1/s], with its derivatives.

        `precision` is the floating-point type of the derivatives by the coordinates.
        """
        local = self.sampled(z, omega) if local is None else local
        if self._few:
            (K, C, B), Q, rule = self._few, z.reshape(-1, self.osc.n), self.rule
            sums = rule.slope, rule.cosines, rule.sines
            R, J, by_omega = balance_of_few(Q, omega, xi, K, C, B, (*local,), *sums)
            J = J.astype(precision, copy=False)
            return Balanced(R.ravel(), J, by_omega.ravel(), omega * self.turned(z))
        rates = (self.rule.slope @ self._local_series(z)).reshape(local.f.shape)
        by_omega = -self._spread(np.einsum("sgbc,sgc->sgb", local.by_w, rates))
        turned = self.turned(z)
        if self.vectors is None:
            by_omega += (turned.reshape(len(self.rule.order), -1) @ self.osc.C.T).ravel()
        else:
            for C, parts in zip(self.C, self.parts, strict=True):
                for part in parts:
                    by_omega[part] += C @ turned[part]
        by_omega += xi * turned - 2.0 * omega * self._orders**2 * z
        J = self._jacobian(local, omega, xi, precision)
        return Balanced(self.imbalance(z, omega, xi, local), J, by_omega, omega * turned)

    def _jacobian(self, local: LocalForces, omega: float, xi: float, precision: type) -> np.ndarray:
        """Derivatives of the imbalance by the coordinates, (m, m)."""
        rule, (g, b) = self.rule, self.osc.B.shape[:2]
        of_harmonics = [
            -(weights @ D.reshape(len(D), -1)).reshape(-1, g, b, b)
            for D in (local.by_y, local.by_w)
            for weights in (rule.cosines, rule.sines)
        ]
        means: np.ndarray = np.ascontiguousarray(
            np.moveaxis(np.array(of_harmonics), 2, -1), precision
        )
        used = np.argwhere(means.any(axis=(0, 1, 4)))
        rows = np.vstack([R.T for R in self._rows]).reshape(-1, g, b)
        observed: np.ndarray = np.ascontiguousarray(np.moveaxis(rows, 2, 1), precision)
        J: np.ndarray = np.zeros((self.size, self.size), precision)
        pushed: np.ndarray = np.zeros((2, self.size, b, g), precision)
        starts = np.array([[p.start for p in (*parts, *parts)][:2] for parts in self.parts])
        widths = np.array([len(K) for K in self.K])
        for j, parts in enumerate(self.parts):
            couple(means, used, j, omega, observed, widths, starts, pushed)
            derivatives = observed[widths[:j].sum() :][: widths[j]].reshape(widths[j], g * b)
            for part, columns in zip(parts, pushed, strict=False):
                J[part] = derivatives @ columns.reshape(self.size, g * b).T
            for part, other, sign in zip(parts, parts[::-1], (1.0, -1.0), strict=False):
                identity = np.eye(len(self.K[j]))
                J[part, part] += self.K[j] - (j * omega) ** 2 * identity
                if j:
                    J[part, other] += sign * j * omega * (self.C[j] + xi * identity)
        return J


def imbalance(
    osc: Oscillator, Q: np.ndarray, omega: float, xi: float, local: LocalForces | None = None
) -> np.ndarray:
    """`Balance.imbalance` of a series Q (2 H + 1, n) in all coordinates, of the same shape."""
    whole = Balance(osc, (len(Q) - 1) // 2)
    return whole.imbalance(Q.ravel(), omega, xi, local).reshape(Q.shape)


def sampled(osc: Oscillator, rule: Sampling, Q: np.ndarray, omega: float) -> LocalForces:
    """Forces at samples of a period of a series Q (2 H + 1, n) in all coordinates."""
    return _forces(osc, rule, Q @ osc.rows.T, omega)


def _forces(osc: Oscillator, rule: Sampling, local_series: np.ndarray, omega: float) -> LocalForces:
    """Forces at samples; `local_series` (2 H + 1, g b) are the displacements they depend on."""
    shape = (len(rule.synthesis), *osc.B.shape[:2])
    return (osc.turning or osc.forces)(
        (rule.synthesis @ local_series).reshape(shape),
        (omega * (rule.slope @ local_series)).reshape(shape),
    )
