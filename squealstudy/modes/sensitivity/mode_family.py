"""One complex mode with its left vector, its nearest neighbours and its eigenvalue condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.quadratic_pencil import (
    QuadraticPencil,
    nearest_left,
    nearest_two_sided,
    product,
)

NEIGHBOURS = 6  # number of roots, the mode's own included
OFFSET = 1e-6  # relative distance of the shift from the root, so that Q(sigma) is regular


@dataclass(frozen=True)
class ModeNeighbourhood:
    """A mode (first) and the roots nearest to it.

    Attributes
    ----------
    lam : ndarray (k,) complex
        Roots, rad/s.
    X, Y : ndarray (n, k) complex
        Right and left vectors of unit mass norm, with Q(lambda) x = 0 and y^H Q(lambda) = 0.
    norm : ndarray (k,) complex
        Products y^H Q'(lambda) x = y^H (2 lambda M + C) x.
    residual : float
        Larger of the right and left |Q x| / (|lambda|^2 |M x| + |lambda| |C x| + |K x|).
    """

    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray
    norm: np.ndarray
    residual: float

    @property
    def condition(self) -> float:
        """Eigenvalue condition 2 |lambda| |x|_M |y|_M / |y^H (2 lambda M + C) x|.

        It is 1 for an undamped symmetric mode, 1/sqrt(1 - zeta^2) for a damped oscillator, infinite
        where two modes coalesce. Norms are those of the mass, not of the matrices as in Tisseur
        (2000). By the same change of matrices the root moves so many times as far as a real mode's.
        """
        size = float(np.abs(self.norm[0]))
        return 2.0 * float(np.abs(self.lam[0])) / size if size > 0 else float("inf")


def mode_family(
    pencil: QuadraticPencil, lam: complex, count: int = NEIGHBOURS
) -> ModeNeighbourhood:
    """The mode whose root is nearest `lam`, with its neighbours.

    Raises
    ------
    ConvergenceError
        Where ARPACK does not converge.
    """
    sigma = lam * (1.0 + OFFSET)
    roots = nearest_two_sided(pencil, pencil.factor(sigma), sigma, count)
    first = np.argsort(np.abs(roots.lam - lam), kind="stable")  # nearest to lam, not to sigma
    return _neighbourhood(pencil, *roots.take(first))


def known_mode(pencil: QuadraticPencil, lam: complex, x: np.ndarray) -> ModeNeighbourhood:
    """A mode whose root and right vector x (n,) are known, without neighbours.

    Only its left vector is computed, or the whole mode (`mode_family`) if another root is as near.
    """
    sigma = lam * (1.0 + OFFSET)
    left_pair = nearest_left(pencil, pencil.factor(sigma), sigma, x.conj())
    if not abs(left_pair[0][0] - lam) <= OFFSET * abs(lam):
        return mode_family(pencil, lam, 1)
    return _neighbourhood(pencil, np.array([lam]), x[:, None], left_pair[1])


def _neighbourhood(
    pencil: QuadraticPencil, lam: np.ndarray, X: np.ndarray, Y: np.ndarray
) -> ModeNeighbourhood:
    """A mode with its neighbours, vectors scaled to unit modal mass."""
    X, Y = (_unit_mass(pencil, V) for V in (X, Y))
    slopes = [pencil.slope(r, x) for r, x in zip(lam, X.T, strict=True)]
    norm = np.array([np.vdot(y, s) for y, s in zip(Y.T, slopes, strict=True)])
    residual = max(
        relative_residual(pencil, lam[0], X[:, 0]),
        relative_residual(pencil.adjoint(), np.conj(lam[0]), Y[:, 0]),
    )
    return ModeNeighbourhood(lam=lam, X=X, Y=Y, norm=norm, residual=residual)


def relative_residual(pencil: QuadraticPencil, lam: complex, x: np.ndarray) -> float:
    """|Q(lambda) x| over the sum of the sizes of its three parts."""
    parts = [lam**2 * product(pencil.M, x), lam * product(pencil.C, x), product(pencil.K, x)]
    size = sum(float(np.linalg.norm(part)) for part in parts)
    return float(np.linalg.norm(parts[0] + parts[1] + parts[2])) / max(size, 1e-300)


def biorthogonality(pencil: QuadraticPencil, families: Sequence[ModeNeighbourhood]) -> np.ndarray:
    """Products |y_i^H ((lambda_i + lambda_j) M + C) x_j| / sqrt(|norm_i norm_j|) (m, m).

    They are those of the first modes of m families: 0 for different modes, 1 for a mode itself.
    """
    X, Y = (
        np.column_stack(columns)
        for columns in zip(*((f.X[:, 0], f.Y[:, 0]) for f in families), strict=True)
    )
    lam, norm = (
        np.array(column) for column in zip(*((f.lam[0], f.norm[0]) for f in families), strict=True)
    )
    by_mass, by_damping = Y.conj().T @ (pencil.M @ X), Y.conj().T @ (pencil.C @ X)
    products = (lam[:, None] + lam) * by_mass + by_damping
    rel_products: np.ndarray = np.abs(products) / np.sqrt(np.abs(norm[:, None] * norm))
    return rel_products


def _unit_mass(pencil: QuadraticPencil, V: np.ndarray) -> np.ndarray:
    size = np.sqrt(np.einsum("ij,ij->j", V.conj(), pencil.M @ V).real)
    unit: np.ndarray = V / size
    return unit
