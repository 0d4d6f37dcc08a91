"""Roots of design points in a patch: two-sided Ritz values of interpolated invariant subspaces.

The error of the subspaces is that of the interpolation, the error of Ritz values its square. The
latter is estimated from both residuals in the sweep basis, the next larger model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.modes.reanalysis.patch import Patch
from squealstudy.modes.reanalysis.problem import lightly_damped
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis
from squealstudy.system.parametric import Weights

NEAREST = 1e-13  # followed roots with a smaller relative distance are one
FIRST_ORDER = 2.0  # error of a heavily damped root over its distance to the first approximation
MOST_AMPLIFIED = 20.0  # largest dynamic over static response of a mode beyond the band


class RitzRoots(NamedTuple):
    """Roots of a batch of design points.

    Attributes
    ----------
    lam : ndarray (b, m) complex
        Roots, rad/s.
    X, Y : ndarray (b, r, m) complex
        Right and left vectors in reduced coordinates, with y^H Q'(lam) x = 1.
    error : ndarray (b, m)
        Estimated |lam - lam of the sweep basis|, rad/s.
    residual : ndarray (b, m)
        Normwise backward error in the sweep basis.
    """

    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray
    error: np.ndarray
    residual: np.ndarray


class _InterpolatedBases(NamedTuple):
    """Interpolated bases and their products with the matrices, (b, r, m) complex each."""

    X: np.ndarray
    CX: np.ndarray
    KX: np.ndarray
    Y: np.ndarray
    CY: np.ndarray
    KY: np.ndarray


def _eigenvalues(blocks: np.ndarray) -> np.ndarray:
    """Eigenvalues (b, k) of stacked matrices (b, k, k), for k = 1 and 2 in closed form."""
    k = blocks.shape[1]
    if k == 1:
        single: np.ndarray = blocks[:, :, 0]
        return single
    if k == 2:
        mean = (blocks[:, 0, 0] + blocks[:, 1, 1]) / 2
        half = (blocks[:, 0, 0] - blocks[:, 1, 1]) / 2
        root = np.sqrt(half**2 + blocks[:, 0, 1] * blocks[:, 1, 0])
        return np.stack([mean + root, mean - root], axis=1)
    values: np.ndarray = np.linalg.eigvals(blocks)
    return values


def ritz_roots(
    patch: Patch, basis: SweepBasis, theta: np.ndarray, weights: Sequence[Weights]
) -> RitzRoots:
    """Roots, vectors and errors of a batch of design points.

    Parameters
    ----------
    patch : Patch
    basis : SweepBasis
    theta : ndarray (b, d)
        Coordinates of the design points.
    weights : sequence of Weights
        Weights at these points.
    """
    C, K = basis.small.matrices(weights)
    cardinals = patch.cardinals(theta)
    batch = _products(patch, cardinals, C, K)
    lam, right, left_vectors = _small_problems(patch, cardinals, batch)
    for Z in (batch.X, batch.CX, batch.KX):
        _turn(patch, Z, right)
    for Z in (batch.Y, batch.CY, batch.KY):
        _turn(patch, Z, left_vectors)
    X, CX, KX, Y, CY, KY = batch
    roots, conj = lam[:, None, :], lam.conj()[:, None, :]
    slope = np.einsum("brm,brm->bm", Y.conj(), 2.0 * roots * X + CX)
    scale = 1.0 / np.where(slope == 0, 1e-300, slope)
    Y, CY, KY = (Z * scale.conj()[:, None, :] for Z in (Y, CY, KY))
    rx = X * roots**2 + CX * roots + KX
    ry = Y * conj**2 + CY * conj + KY
    shift = np.einsum("brm,brm->bm", Y.conj(), rx)  # Rayleigh's functional: second order too
    error = _error(patch, basis, lam, X, Y, rx, ry)
    error = np.minimum(error, _error_of_heavily_damped(patch, cardinals, lam))
    return RitzRoots(lam=lam - shift, X=X, Y=Y, error=error, residual=_backward(C, K, lam, X, rx))


def _products(
    patch: Patch, cardinals: np.ndarray, C: np.ndarray, K: np.ndarray
) -> _InterpolatedBases:
    """Interpolated bases, and their products with damping and stiffness."""
    X, Y = (_combined(cardinals, Z) for Z in (patch.X, patch.Y))
    Ct, Kt = C.transpose(0, 2, 1), K.transpose(0, 2, 1)
    return _InterpolatedBases(
        X=X, CX=_times(C, X), KX=_times(K, X), Y=Y, CY=_times(Ct, Y), KY=_times(Kt, Y)
    )


def _combined(cardinals: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """Sum over nodes of cardinals (b, q) times Z (q, r, m) complex."""
    q, r, m = Z.shape
    flat = np.ascontiguousarray(Z).view(float).reshape(q, -1)
    return (cardinals @ flat).view(complex).reshape(len(cardinals), r, m)


def _times(A: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Real (b, r, r) times complex (b, r, m) in real arithmetic."""
    b, r, m = X.shape
    return (A @ X.view(float).reshape(b, r, 2 * m)).view(complex)


def _small_problems(
    patch: Patch, cardinals: np.ndarray, batch: _InterpolatedBases
) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
    """Ritz values (b, m) in state space, and each block's right and left vectors (b, k, k).

    With [X; X S] and [T Y^H + Y^H C, Y^H]: (T Yx S - Yk) v = lam (T Yx + Yc + Yx S) v, where
    Yx = Y^H X, Yc = Y^H C X, Yk = Y^H K X.
    """
    S, T = cardinals @ patch.S, cardinals @ patch.T
    lams, rights, lefts, offset = [], [], [], 0
    for start, k in patch.slices:
        block_columns = slice(start, start + k)
        Yh = batch.Y[:, :, block_columns].conj().transpose(0, 2, 1)
        Yx, Yc, Yk = (Yh @ Z[:, :, block_columns] for Z in (batch.X, batch.CX, batch.KX))
        Sb, Tb = (Z[:, offset : offset + k * k].reshape(-1, k, k) for Z in (S, T))
        offset += k * k
        A, N = Tb @ Yx @ Sb - Yk, Tb @ Yx + Yc + Yx @ Sb
        if k == 1:
            lam, right = (A / N)[:, :, 0], np.ones_like(A)
            left_vectors = right
        else:
            lam, right = np.linalg.eig(np.linalg.solve(N, A))
            left_vectors = np.linalg.inv(N @ _separated(right)).conj().transpose(0, 2, 1)
        lams.append(lam)
        rights.append(right)
        lefts.append(left_vectors)
    return np.hstack(lams), rights, lefts


def _separated(V: np.ndarray) -> np.ndarray:
    """Vectors (b, k, k) kept from being exactly parallel, as they are at an exceptional point."""
    return V + 1e-15 * np.eye(V.shape[1])


def _turn(patch: Patch, Z: np.ndarray, turns: Sequence[np.ndarray]) -> None:
    """Multiply columns of each block (b, r, k) by its vectors (b, k, k), in place, if k > 1."""
    for (start, k), turn in zip(patch.slices, turns, strict=True):
        if k > 1:
            block_columns = slice(start, start + k)
            Z[:, :, block_columns] = Z[:, :, block_columns] @ turn


def _error(
    patch: Patch,
    basis: SweepBasis,
    lam: np.ndarray,
    X: np.ndarray,
    Y: np.ndarray,
    rx: np.ndarray,
    ry: np.ndarray,
) -> np.ndarray:
    """Second-order error (b, m) by the other followed modes, and by all modes not followed.

    The resolvent of the followed ones is the sum of x_i y_i^H / (lam - lam_i), those of the same
    block included, as Rayleigh's functional shifts their roots, too. The others are represented by
    the nominal real modes; beyond the band, where one may be near a root, with their dynamic
    response.
    """
    through = (ry.conj().transpose(0, 2, 1) @ X) * (Y.conj().transpose(0, 2, 1) @ rx).transpose(
        0, 2, 1
    )
    gap = lam[:, :, None] - lam[:, None, :]
    # an infinite distance leaves out the mode itself
    gap = np.where(np.abs(gap) < NEAREST * np.abs(lam)[:, :, None], np.inf, gap)
    parts = through / gap
    # contributions may cancel by chance, and the next order then counts
    by_block = np.maximum(np.abs(parts.sum(axis=2)), np.linalg.norm(parts, axis=2))
    by_basis = np.einsum("brm,brm,brm->bm", ry.conj(), _flexibility(patch, basis, lam), rx)
    total: np.ndarray = by_block + np.abs(by_basis)
    return total


def _error_of_heavily_damped(patch: Patch, cardinals: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Another estimate (b, m) for heavily damped roots, infinite for light ones.

    Overdamped roots change by decades and collide; the second-order error by other modes is then
    far above the true one. Their distance to the roots of the interpolated matrices, whose error is
    of first order, is a better bound.
    """
    error, heavily_damped = np.full(lam.shape, np.inf), ~lightly_damped(lam)
    flat, offset = cardinals @ patch.S if heavily_damped.any() else np.zeros(0), 0
    for start, k in patch.slices:
        block_columns = slice(start, start + k)
        if heavily_damped[:, block_columns].any():
            first = _eigenvalues(flat[:, offset : offset + k * k].reshape(-1, k, k))
            distance = np.abs(lam[:, block_columns, None] - first[:, None, :]).min(axis=2)
            error[:, block_columns] = np.where(
                heavily_damped[:, block_columns], FIRST_ORDER * distance, np.inf
            )
        offset += k * k
    return error


def _flexibility(patch: Patch, basis: SweepBasis, lam: np.ndarray) -> np.ndarray:
    """Response (b, r, m) of the nominal real modes: static in the band, else at |lam|."""
    w2 = (1.0 / basis.flexibility)[:, None]
    dynamic = w2 - np.abs(lam[:, None, :]) ** 2
    limit = w2 / MOST_AMPLIFIED
    dynamic = np.where(np.abs(dynamic) < limit, np.copysign(limit, dynamic), dynamic)
    outside = (w2 > patch.reach[1] ** 2) | (w2 < patch.reach[0] ** 2)
    response: np.ndarray = 1.0 / np.where(outside, dynamic, w2)
    return response


def _backward(
    C: np.ndarray, K: np.ndarray, lam: np.ndarray, X: np.ndarray, rx: np.ndarray
) -> np.ndarray:
    size, c, k = np.abs(lam), np.linalg.norm(C, axis=(1, 2)), np.linalg.norm(K, axis=(1, 2))
    norm = size**2 + size * c[:, None] + k[:, None]
    error: np.ndarray = np.linalg.norm(rx, axis=1) / (norm * np.linalg.norm(X, axis=1))
    return error
