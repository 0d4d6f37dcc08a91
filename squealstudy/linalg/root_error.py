"""How far computed roots of a quadratic eigenproblem may be from the exact ones, to first order.

A perturbation dQ of Q(lambda) = lambda^2 M + lambda C + K moves a root by y^H dQ x / y^H Q' x.
dQ is the residual of the pair and the round-off of the matrices' entries. Left vectors are not
needed: y^H Q' x is small where another root nearby has nearly the same vector, which the right
vectors show.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import get_lapack_funcs

from squealstudy.linalg.sparse_qep import LowRankSum

Matrix = Any  # ndarray, scipy sparse matrix or LowRankSum
EPS = float(np.finfo(float).eps)
TIME_SCALE_RATIO = 4.0  # roots whose moduli differ by less than this ratio share a scale of time
ACCEPTED_REL_ERROR = 1e-8  # roots with a smaller relative error are not solved again
MAX_ERROR_OVER_ROUND_OFF = 10.0  # solving again helps only above this ratio
MIN_SIGNAL_TO_ROUND_OFF = 10.0  # a root whose modulus over its round-off is smaller may be zero
# a root that is zero within round-off is a rigid motion only below this share of the band's top
RIGID_BELOW = 1e-3
# a root with a larger condition counts as defective: matrix entries of 12 digits resolve no more. A
# defective root moves with the square root of a change (THEORY.md section 6): relative error of it
DEFECTIVE_CONDITION, DEFECTIVE_REL_ERROR = 1e6, 1e-6
TINY = float(np.finfo(float).tiny)


class RootErrors(NamedTuple):
    """Estimates of |lam - exact lam| (m,), rad/s.

    Attributes
    ----------
    error : ndarray (m,)
        Error by the residual and by round-off.
    round_off : ndarray (m,)
        Error by round-off alone, which another solution would have too.
    residual : ndarray (m,)
        |Q(lam) x| of the vectors as they were passed.
    """

    error: np.ndarray
    round_off: np.ndarray
    residual: np.ndarray

    def doubts(self, lam: np.ndarray) -> np.ndarray:
        """Ratio (m,) of each error to the accepted one; above 1 a root should be solved again."""
        allowed = np.maximum(
            ACCEPTED_REL_ERROR * np.abs(lam), MAX_ERROR_OVER_ROUND_OFF * self.round_off
        )
        with np.errstate(invalid="ignore", over="ignore"):  # infinite over infinite
            doubts = self.error / np.where(allowed > 0, allowed, 1.0)
        return np.nan_to_num(doubts, nan=np.inf)

    def doubt(self, lam: np.ndarray) -> float:
        """The largest of `doubts`."""
        return float(self.doubts(lam).max(initial=0.0))

    def resolved(self, lam: np.ndarray, top: float) -> np.ndarray:
        """Mask (m,) of the roots of a band up to `top` [rad/s] that are no zeros of free bodies.

        Zero roots are far below `top`, and zero within their round-off.
        """
        size = np.abs(lam)
        is_resolved: np.ndarray = (size > MIN_SIGNAL_TO_ROUND_OFF * self.round_off) | (
            size > RIGID_BELOW * top
        )
        return is_resolved


def root_errors(M: Matrix, C: Matrix, K: Matrix, lam: np.ndarray, psi: np.ndarray) -> RootErrors:
    """Estimated errors of roots lam (m,) of imaginary part >= 0 with right vectors psi (n, m).

        |x|^T (|r| + eps (|lam|^2 |M| + |lam| |C| + |K|) |x|) kappa
            / max(|x^H (2 lam M + C) x|, 2 |lam| x^H D x)

    (THEORY.md eq. (35)) with moduli entry by entry, r the residual, D the diagonal of M (where it
    is zero, the sum of the row's moduli) and kappa the condition of the root (`conditions`). Entry
    by entry, a stiff spring adds round-off only to modes that strain it; by norms of the matrices
    one spring of 1e15 N/m would drown all roots.
    """
    if not len(lam):
        return RootErrors(np.zeros(0), np.zeros(0), np.zeros(0))
    a, size = np.abs(psi), np.abs(lam)
    inertia, damping = _product(M, psi), _product(C, psi)
    r = inertia * lam**2 + damping * lam + _product(K, psi)
    D = _lumped(M)
    slope = np.abs(np.einsum("ij,ij->j", psi.conj(), 2 * lam * inertia + damping))
    slope = np.maximum(slope, 2 * size * (D @ a**2))
    energy = size**2 * _energy(M, a) + size * _energy(C, a) + _energy(K, a)
    # only roots that are wrong altogether overflow
    with np.errstate(over="ignore", invalid="ignore"):
        condition = conditions(lam, psi, D)
        error_per_residual = condition / np.maximum(slope, TINY)
        round_off = EPS * energy * error_per_residual
        round_off = np.maximum(round_off, of_defects(lam, condition))
        error = np.einsum("ij,ij->j", a, np.abs(r)) * error_per_residual + round_off
    return RootErrors(
        _unknown_as_infinite(error), _unknown_as_infinite(round_off), np.linalg.norm(r, axis=0)
    )


def of_defects(lam: np.ndarray, condition: np.ndarray) -> np.ndarray:
    """Errors [rad/s] of defective roots, 0 for others; all arrays have one shape."""
    errors: np.ndarray = np.where(
        condition > DEFECTIVE_CONDITION, DEFECTIVE_REL_ERROR * np.abs(lam), 0.0
    )
    return errors


def _unknown_as_infinite(error: np.ndarray) -> np.ndarray:
    """The errors, with infinity in place of NaN."""
    return np.where(np.isnan(error), np.inf, error)


def conditions(lam: np.ndarray, psi: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Condition (m,) of each root: 1 where modes are orthogonal, large next to a coalescence.

    It is the inverse of the sine of the angle between the state [x; lam x / s] and the states of
    all other roots, conjugates included, in the mass D (n,); s is about |lam|.
    """
    root = np.sqrt(D)[:, None] * psi
    H, S = root.conj().T @ root, root.T @ root
    diagonal = np.diag(H).real
    unit = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    H, S = H * np.outer(unit, unit), S * np.outer(unit, unit)
    condition = np.ones(len(lam))
    paired = lam.imag != 0
    scale_numbers = np.round(np.log(np.maximum(np.abs(lam), TINY)) / np.log(TIME_SCALE_RATIO))
    for scale_number in np.unique(scale_numbers):
        roots_of_scale = np.flatnonzero(scale_numbers == scale_number)
        scaled = lam / TIME_SCALE_RATIO**scale_number
        G = _gram(H, S, scaled, paired)
        G[np.diag_indices_from(G)] += EPS * len(G)  # two states may be parallel to round-off
        condition[roots_of_scale] = np.sqrt(np.maximum(inverse_diagonal(G, roots_of_scale), 1.0))
    return condition


def inverse_diagonal(G: np.ndarray, members: np.ndarray) -> np.ndarray:
    """Entries (k,) on the diagonal of the inverse of a Hermitian positive definite G (n, n).

    With the members last, they are the diagonal of (L2 L2^H)^-1, where L2 is the last block of the
    Cholesky factor and L2 L2^H the Schur complement of the others: half the work of an inverse.
    """
    others = np.setdiff1d(np.arange(len(G)), members)
    order = np.concatenate([others, members])
    try:
        L2 = np.linalg.cholesky(G[np.ix_(order, order)])[len(others) :, len(others) :]
    except np.linalg.LinAlgError:  # indefinite by round-off
        diagonal: np.ndarray = np.diag(np.linalg.inv(G)).real[members]
        return diagonal
    (invert,) = get_lapack_funcs(["trtri"], [L2])
    inverse, _ = invert(L2, lower=1)
    total: np.ndarray = np.square(np.abs(inverse)).sum(axis=0)
    return total


def _gram(H: np.ndarray, S: np.ndarray, lam: np.ndarray, paired: np.ndarray) -> np.ndarray:
    """Gram matrix of unit states, including the conjugate states of complex roots."""
    among_states = H * (1.0 + np.outer(lam.conj(), lam))
    across = S.conj() * (1.0 + np.outer(lam.conj(), lam.conj()))
    across, among_conjugates = across[:, paired], among_states.conj()[np.ix_(paired, paired)]
    G = np.block([[among_states, across], [across.conj().T, among_conjugates]])
    size = np.sqrt(np.maximum(np.diag(G).real, TINY))
    unit: np.ndarray = G / np.outer(size, size)
    return unit


def _product(A: Matrix, psi: np.ndarray) -> np.ndarray:
    """A psi in real arithmetic."""
    product: np.ndarray = A @ psi.real + 1j * (A @ psi.imag)
    return product


def _energy(A: Matrix, a: np.ndarray) -> np.ndarray:
    """a^T |A| a of each column (m,)."""
    if isinstance(A, LowRankSum):
        projected = np.abs(A.U).T @ a
        low: np.ndarray = np.abs(A.d) @ projected**2
        return low + _energy(A.sparse, a)
    energy: np.ndarray = np.einsum("ij,ij->j", a, (abs(A) if sp.issparse(A) else np.abs(A)) @ a)
    return energy


def _lumped(M: Matrix) -> np.ndarray:
    """Mass (n,) at each coordinate, in modulus: the diagonal, else the sum of the row."""
    M = M.sparse if isinstance(M, LowRankSum) else M
    diagonal = np.abs(M.diagonal())
    if not diagonal.all():
        diagonal = np.where(diagonal > 0, diagonal, np.asarray(abs(M).sum(axis=1)).ravel())
    return diagonal
