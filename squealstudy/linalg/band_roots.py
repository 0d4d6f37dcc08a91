"""All roots of a sparse quadratic eigenproblem in a band, for any real matrices.

M, C and K may be unsymmetric, and M and K singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.faults import raise_if_memory
from squealstudy.linalg.companion import inverse_pairs, pairs_up_to, regular
from squealstudy.linalg.factor import SINGULAR, Factor, factorise
from squealstudy.linalg.inverse_iteration import refined_root
from squealstudy.linalg.root_error import Matrix, root_errors
from squealstudy.linalg.sparse_qep import DENSE_LIMIT, LowRankSum, smallest_roots
from squealstudy.root_pairs import one_of_each_pair

FIRST_ROOTS = 60  # roots asked for first, if the caller has no guess
FALLBACK_SHIFT_RATIO = 0.02  # shift over the top of the band, used where K itself is singular
SINGULAR_PENCIL = (
    "lambda^2 M + lambda C + K is singular for every lambda: some coordinate, or a sum of several, "
    "has no mass, no damping and no stiffness"
)
LARGEST_DENSE = 2000  # most degrees of freedom for which LAPACK solves if most roots are wanted


@dataclass(frozen=True)
class BandRoots:
    """Roots of a quadratic eigenproblem in a band, with right vectors and errors.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots with a non-negative imaginary part, ascending in modulus, rad/s.
    psi : ndarray (n, m) complex
        Right vectors of unit 2-norm.
    n_below : int
        Number of roots up to the top of the band, including conjugates and roots below the band.
    error : ndarray (m,)
        Estimated |lam - exact lam|, rad/s (`root_errors`).
    """

    lam: np.ndarray
    psi: np.ndarray
    n_below: int
    error: np.ndarray


def roots_in_band(
    M: Matrix,
    C: Matrix,
    K: Matrix,
    band: tuple[float, float],
    first: int = FIRST_ROOTS,
    shift: float = 0.0,
) -> BandRoots:
    """Roots with band[0] <= |lambda| <= band[1] of lambda^2 M + lambda C + K.

    Roots nearest to a real shift are computed with one real factorisation there, and more of them
    until one is beyond the band. Where K is singular, or diagonal pivots spoil the roots, this is
    repeated about a positive shift, then with partial pivoting. If no attempt is accurate, the
    roots of the best one are returned with their errors; of few coordinates spoilt ones are refined
    one by one. Roots that are zero within round-off, the motions of a free body, are left out.

    Parameters
    ----------
    M, C, K : csr_matrix or ndarray (n, n)
        Up to `DENSE_LIMIT` coordinates they may be arrays, which LAPACK solves.
    band : (low, high)
        Bounds of |lambda|, rad/s.
    first : int
        Roots to ask for first, conjugates included; a wrong guess costs time only.
    shift : float
        Real shift of the first attempt, rad/s.

    Raises
    ------
    ConvergenceError
        No attempt gives any roots.
    """
    if M.shape[0] <= DENSE_LIMIT:
        M, C, K = (_dense(A) for A in (M, C, K))
    failure = ConvergenceError("not_converged", "no roots were found")
    best: BandRoots | None = None
    spoilt: tuple[np.ndarray, np.ndarray] | None = None
    least_doubt = np.inf
    other = shift or FALLBACK_SHIFT_RATIO * band[1]
    for sigma, pivoting in ((shift, False), (other, False), (other, True)):
        try:
            mu, psi = _roots_about(M, C, K, band[1], first, sigma, pivoting)
        except ConvergenceError as error:
            failure = error
            continue
        lam, psi = one_of_each_pair(sigma + mu, psi, (0.0, band[1]))
        band_roots, worst = judged_roots(M, C, K, lam, psi, band)
        if worst <= 1.0:
            return band_roots
        if best is None or worst < least_doubt:
            best, least_doubt, spoilt = band_roots, worst, (lam, psi)
    if spoilt is not None and M.shape[0] <= DENSE_LIMIT:
        best, _ = judged_roots(M, C, K, *_refined(M, C, K, *spoilt, band[1]), band)
    if best is None and failure.status == SINGULAR:  # at zero and about a shift
        raise ConvergenceError(SINGULAR, SINGULAR_PENCIL)
    if best is None:
        raise failure
    return best


def _refined(
    M: np.ndarray, C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray, top: float
) -> tuple[np.ndarray, np.ndarray]:
    """Roots lam (m,) with vectors psi (n, m); spoilt ones are solved again where that helps.

    It does where the root is then as accurate as round-off allows, and no zero of a free body.
    """
    lam, psi = lam.astype(complex), psi.astype(complex)
    for j in np.flatnonzero(root_errors(M, C, K, lam, psi).doubts(lam) > 1.0):
        root, x = refined_root(M, C, K, complex(lam[j]), psi[:, j])
        again, vectors = lam.copy(), psi.copy()
        again[j], vectors[:, j] = root, x
        errors = root_errors(M, C, K, again, vectors)
        if errors.doubts(again)[j] <= 1.0 and errors.resolved(again, top)[j]:
            lam, psi = again, vectors
    return lam, psi


def judged_roots(
    M: Matrix,
    C: Matrix,
    K: Matrix,
    lam: np.ndarray,
    psi: np.ndarray,
    band: tuple[float, float],
) -> tuple[BandRoots, float]:
    """Roots of a band out of all roots lam (m,) up to its top, and `RootErrors.doubt` of them.

    Where the doubt is above 1, another attempt may be better. Roots below the band that may be in
    it within their errors count.
    """
    below = len(lam) + int((lam.imag > 0).sum())
    above_bottom = np.abs(lam) >= band[0]
    doubt = _doubt_below(M, C, K, lam[~above_bottom], psi[:, ~above_bottom], band[0])
    lam, psi = lam[above_bottom], psi[:, above_bottom]
    errors = root_errors(M, C, K, lam, psi)
    resolved = errors.resolved(lam, band[1])
    band_roots = BandRoots(
        lam=lam[resolved], psi=psi[:, resolved], n_below=below, error=errors.error[resolved]
    )
    return band_roots, max(doubt, errors.doubt(lam))


def _doubt_below(
    M: Matrix, C: Matrix, K: Matrix, lam: np.ndarray, psi: np.ndarray, bottom: float
) -> float:
    """Largest doubt of the roots (m,) below a band that may be above its bottom [rad/s].

    Of few coordinates; where K is singular some roots are zero.
    """
    if not len(lam) or not isinstance(K, np.ndarray) or not regular(K):
        return 0.0
    errors = root_errors(M, C, K, lam, psi)
    may_be_in = np.abs(lam) + errors.error >= bottom
    return float(errors.doubts(lam)[may_be_in].max(initial=0.0))


def pair_residuals(M: Matrix, C: Matrix, K: Matrix, lam: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Normwise backward error of each pair (Tisseur 2000), with norms of the matrices.

    It is |Q(lambda) psi| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |psi|), which is at round-off for
    pairs that are as good as the entries of the matrices, such as stiff springs, allow.
    """
    size = np.abs(lam)
    R = M @ (psi * lam**2) + C @ (psi * lam) + K @ psi
    norm = size**2 * _norm(M) + size * _norm(C) + _norm(K)
    error: np.ndarray = np.linalg.norm(R, axis=0) / (norm * np.linalg.norm(psi, axis=0))
    return error


def _norm(A: Matrix) -> float:
    """Upper bound of the 2-norm: the geometric mean of the largest column and row sums."""
    return float(np.sqrt(abs(A).sum(axis=0).max() * abs(A).sum(axis=1).max()))


def _roots_about(
    M: Matrix,
    C: Matrix,
    K: Matrix,
    limit: float,
    first: int,
    sigma: float,
    pivoting: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """All roots up to `limit` minus the shift sigma, and perhaps others, with their vectors."""
    n = M.shape[0]
    C_s, K_s = C + 2 * sigma * M, K + sigma * C + sigma**2 * M
    reach = limit + abs(sigma)
    if n <= DENSE_LIMIT:
        return _dense_roots(M, C_s, K_s, limit, pivoting)
    factor: Factor = _pivoting_factor(K_s) if pivoting else factorise(K_s)
    count = first
    while 2 * count <= n or n > LARGEST_DENSE:
        count = min(count, 2 * n - 2)
        mu, psi = smallest_roots(M, LowRankSum(C_s), LowRankSum(K_s), count, limit / 2, factor)
        farthest = np.abs(mu).max()
        if farthest > reach or count == 2 * n - 2:
            return mu, psi
        count = max(int(count * min(reach / farthest, 3.0) ** 1.2), count) + 20
    return _dense_roots(M, C_s, K_s, limit)


def _pivoting_factor(A: sp.spmatrix) -> spla.SuperLU:
    """SuperLU with partial pivoting: slower than `factorise`, for matrices far from definite."""
    try:
        return spla.splu(A.tocsc())
    except RuntimeError as error:  # "Factor is exactly singular"
        raise_if_memory(error)
        raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error


def _dense(A: Matrix) -> np.ndarray:
    dense: np.ndarray = A.toarray() if sp.issparse(A) else A
    return dense


def _dense_roots(
    M: Matrix, C: Matrix, K: Matrix, limit: float, inverse: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """All roots by LAPACK: of the companion form, or of its inverse where M is singular.

    The inverse is also more accurate for small roots beside stiff springs.
    """
    M_d, C_d, K_d = (_dense(A) for A in (M, C, K))
    if not inverse and np.linalg.matrix_rank(M_d) == M.shape[0]:
        return pairs_up_to(C_d, K_d, limit, M_d)
    return inverse_pairs(C_d, K_d, limit, M_d)  # about a shift this works for any regular pencil
