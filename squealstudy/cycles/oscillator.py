"""Equations of motion as harmonic balance sees them: a linear part and forces of a few coordinates.

    q'' + C q' + K q = sum over groups g of B_g^T f_g(B_g q, B_g q')

with the identity as mass. A group is a contact point with its three directions, or all coordinates
of a small oscillator. q = 0 is the steady state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from squealstudy.cycles.harmonics import LEAST_SAMPLES, Sampling, sampling
from squealstudy.errors import ModelError
from squealstudy.linalg.dense_qep import dense_roots

MAX_UNPROJECTED_COORDINATES = 60  # larger models are balanced in a basis


class LocalForces(NamedTuple):
    """Forces of g groups of b coordinates at S states, and their derivatives.

    Attributes
    ----------
    f : ndarray (S, g, b)
        Forces.
    by_y, by_w : ndarray (S, g, b, b)
        Derivatives of the forces (third index) by the group's displacements and velocities (last).
    """

    f: np.ndarray
    by_y: np.ndarray
    by_w: np.ndarray


Forces = Callable[[np.ndarray, np.ndarray], LocalForces]  # (displacements, velocities), (S, g, b)


@dataclass(frozen=True)
class Oscillator:
    """One design as an equation of motion about its steady state.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Linear damping [1/s] and stiffness [1/s2].
    B : ndarray (g, b, n)
        Displacements of the groups by the coordinates.
    forces : callable
        All forces that C and K do not hold: `LocalForces` at displacements and velocities
        (S, g, b).
    samples : int
        Least number of samples of a period.
    turning : callable or None
        The same as `forces`, at even samples of a whole period. Each sample has its share of
        forces that reverse between samples. None where `forces` are smooth enough.

    Raises
    ------
    ModelError
        Shapes that contradict each other, or values that are not finite.
    """

    C: np.ndarray
    K: np.ndarray
    B: np.ndarray
    forces: Forces
    samples: int = LEAST_SAMPLES
    turning: Forces | None = None

    def __post_init__(self) -> None:
        n = self.B.shape[-1]
        if self.B.ndim != 3 or self.C.shape != (n, n) or self.K.shape != (n, n):
            raise ModelError("oscillator: C, K and B have shapes that contradict each other")
        if not all(np.isfinite(A).all() for A in (self.C, self.K, self.B)):
            raise ModelError("oscillator: values that are not finite")

    def sampling(self, harmonics: int) -> Sampling:
        """Samples of a period for series with so many harmonics."""
        return sampling(harmonics, self.samples)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.B.shape[-1])

    @property
    def rows(self) -> np.ndarray:
        """B with all groups below each other, (g b, n)."""
        return self.B.reshape(-1, self.n)

    def evaluate(self, q: np.ndarray, v: np.ndarray) -> LocalForces:
        """Forces at states q, v (S, n)."""
        shape = (len(q), *self.B.shape[:2])
        return self.forces((q @ self.rows.T).reshape(shape), (v @ self.rows.T).reshape(shape))

    def spread(self, f: np.ndarray) -> np.ndarray:
        """Generalised forces (S, n) of local ones (S, g, b)."""
        generalised: np.ndarray = f.reshape(len(f), -1) @ self.rows
        return generalised

    def on(self, basis: np.ndarray) -> Oscillator:
        """The oscillator restricted to the span of orthonormal columns (n, r)."""
        K, C = (basis.T @ A @ basis for A in (self.K, self.C))
        return replace(self, C=C, K=K, B=self.B @ basis)

    def projected(self, D: np.ndarray) -> np.ndarray:
        """B^T D B (.., n, n) of local derivatives D (.., g, b, b), in their precision."""
        B = self.B.astype(D.dtype, copy=False)
        used = np.asarray(D.any(axis=tuple(range(D.ndim - 2))))
        rows, columns = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
        if len(columns) < len(rows):  # begin with the cheaper product
            turned: np.ndarray = np.swapaxes(self.projected(np.swapaxes(D, -1, -2)), -1, -2)
            return turned
        pushed = np.zeros((*D.shape[:-2], len(rows), self.n), D.dtype)
        for index, row in enumerate(rows):
            for column in np.flatnonzero(used[row]):
                pushed[..., index, :] += D[..., row, column, None] * B[:, column]
        left_rows = B[:, rows].reshape(-1, self.n)
        projected: np.ndarray = left_rows.T @ pushed.reshape(*D.shape[:-3], -1, self.n)
        return projected

    def steady_modes(self, highest: float) -> tuple[np.ndarray, np.ndarray]:
        """Roots (m,) [rad/s] about the steady state, by size, and right vectors (n, m).

        Of a pair only the root with positive imaginary part. A small model returns all roots, a
        large one those up to `highest` [rad/s].
        """
        zero = np.zeros((1, self.n))
        C, K = self.tangent(zero, zero)
        lam, psi = dense_roots(
            C[0], K[0], (0.0, np.inf if self.n <= MAX_UNPROJECTED_COORDINATES else highest)
        )
        order = [k for k in np.argsort(np.abs(lam), kind="stable") if lam[k].imag >= 0]
        return lam[order], psi[:, order]

    def tangent(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Damping and stiffness (S, n, n) of the equation linearised at states q, v (S, n)."""
        local = self.evaluate(q, v)
        return self.C - self.projected(local.by_w), self.K - self.projected(local.by_y)
