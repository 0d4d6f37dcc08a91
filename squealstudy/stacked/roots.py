"""Complex modes of a batch of small quadratic eigenproblems, with their errors, by stacked LAPACK.

`linalg.companion`, `linalg.root_error` and `modes.point.band_modes` do the same for one design
point of a model of any size. Stacking pays up to about 40 coordinates; beyond, LAPACK takes longer
than the Python code around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.root_error import (
    EPS,
    MIN_SIGNAL_TO_ROUND_OFF,
    RIGID_BELOW,
    TIME_SCALE_RATIO,
    TINY,
    of_defects,
)
from squealstudy.root_pairs import by_modulus

REL_ROUND_OFF = 1e-13  # round-off of a dense eigenvalue over its modulus; as in modes.point


@dataclass(frozen=True, eq=False)
class StackedRoots:
    """Roots of m design points in a band, at most k of each, at the beginning of its row.

    Attributes
    ----------
    count : ndarray (m,) of int
        Number of roots of each point.
    lam : ndarray (m, k) complex
        Roots with imaginary part >= 0, rad/s: oscillating ones ascending in modulus, then
        overdamped ones; 0 beyond the count.
    psi : ndarray (m, n, k) complex
        Right vectors of unit norm; 0 beyond the count.
    error : ndarray (m, k)
        Estimates of |lam - exact lam|, rad/s.
    residual : ndarray (m, k)
        Normwise backward errors.
    """

    count: np.ndarray
    lam: np.ndarray
    psi: np.ndarray
    error: np.ndarray
    residual: np.ndarray

    @property
    def held(self) -> np.ndarray:
        """Whether each place (m, k) has a root."""
        is_root: np.ndarray = np.arange(self.lam.shape[1]) < self.count[:, None]
        return is_root


def stacked_roots(C: np.ndarray, K: np.ndarray, band: tuple[float, float]) -> StackedRoots:
    """Roots of lambda^2 I + lambda C + K with moduli in a band [rad/s], and their errors.

    C, K (m, n, n) must be finite. Roots that are zero within round-off are left out.
    """
    lam, psi = companion_pairs(C, K)
    size = np.abs(lam)
    inside = (lam.imag >= 0) & (size >= band[0]) & (size <= band[1])
    lam, psi, count = _gathered(lam, psi, inside, np.where(inside, size, np.inf))
    psi = psi / np.where(norms := np.linalg.norm(psi, axis=1), norms, 1.0)[:, None, :]
    is_root = np.arange(lam.shape[1]) < count[:, None]
    error, round_off = _errors(C, K, lam, psi, is_root)
    size = np.abs(lam)
    resolved = is_root & (
        (size > MIN_SIGNAL_TO_ROUND_OFF * round_off) | (size > RIGID_BELOW * band[1])
    )
    late = np.where(resolved, (lam.imag == 0).astype(int), 2)  # oscillating, overdamped, none
    order = by_modulus(lam, late)
    count = resolved.sum(axis=1)
    width = int(count.max(initial=0))
    order = order[:, :width]
    is_root = np.arange(width) < count[:, None]
    lam = np.where(is_root, np.take_along_axis(lam, order, 1), 0.0)
    psi = np.where(is_root[:, None, :], np.take_along_axis(psi, order[:, None, :], 2), 0.0)
    error = np.where(is_root, np.take_along_axis(error, order, 1), 0.0)
    error = np.maximum(error, REL_ROUND_OFF * np.abs(lam))
    return StackedRoots(count, lam, psi, error, _backward_errors(C, K, lam, psi))


def companion_pairs(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All roots (m, 2n) [rad/s] and right vectors (m, n, 2n), as in `companion.right_pairs`."""
    m, n = K.shape[:2]
    scale = np.sqrt(np.linalg.norm(K, axis=(1, 2)) / np.sqrt(n))
    scale = np.where(scale > 0, scale, 1.0)[:, None, None]
    A = np.zeros((m, 2 * n, 2 * n))
    A[:, :n, n:] = np.eye(n)
    A[:, n:, :n] = K / -(scale**2)
    A[:, n:, n:] = C / -scale
    lam, z = np.linalg.eig(A)
    lam, z = lam.astype(complex), z.astype(complex)
    vectors = np.where((np.abs(lam) > 1.0)[:, None, :], z[:, n:], z[:, :n])
    return lam * scale[:, 0], vectors


def _gathered(
    lam: np.ndarray, psi: np.ndarray, chosen: np.ndarray, key: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chosen roots and vectors first, ascending in `key`, then zeros; and their number (m,)."""
    count = chosen.sum(axis=1)
    width = int(count.max(initial=0))
    order = np.argsort(key, axis=1, kind="stable")[:, :width]
    is_root = np.arange(width) < count[:, None]
    lam = np.where(is_root, np.take_along_axis(lam, order, 1), 0.0)
    psi = np.take_along_axis(psi, order[:, None, :], 2)
    return lam, np.where(is_root[:, None, :], psi, 0.0), count


def _errors(
    C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray, is_root: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors and round-off (m, k) of roots, as in `root_errors` with M = I (THEORY.md eq. (35))."""
    a, size = np.abs(psi), np.abs(lam)
    damping = C @ psi
    r = psi * (lam**2)[:, None, :] + damping * lam[:, None, :] + K @ psi
    mass = np.einsum("mij,mij->mj", a, a)
    slope = np.abs(np.einsum("mij,mij->mj", psi.conj(), 2 * lam[:, None, :] * psi + damping))
    slope = np.maximum(slope, 2 * size * mass)
    energy = size**2 * mass + size * _energies(C, a) + _energies(K, a)
    with np.errstate(over="ignore", invalid="ignore"):
        condition = conditions(lam, psi, is_root)
        shift_per_residual = condition / np.maximum(slope, TINY)
        round_off = np.maximum(EPS * energy * shift_per_residual, of_defects(lam, condition))
        error = np.einsum("mij,mij->mj", a, np.abs(r)) * shift_per_residual + round_off
    return tuple(np.where(np.isnan(x), np.inf, x) for x in (error, round_off))  # type: ignore[return-value]


def _energies(A: np.ndarray, a: np.ndarray) -> np.ndarray:
    energies: np.ndarray = np.einsum("mij,mij->mj", a, np.abs(A) @ a)
    return energies


def conditions(lam: np.ndarray, psi: np.ndarray, is_root: np.ndarray) -> np.ndarray:
    """Condition (m, k) of each root among those of its point, as in `root_error.conditions`."""
    condition = np.ones(lam.shape)
    if not lam.shape[1]:
        return condition
    adjoint = psi.conj().swapaxes(1, 2)
    H, S = adjoint @ psi, psi.swapaxes(1, 2) @ psi
    energies = np.einsum("mii->mi", H).real
    unit = 1.0 / np.sqrt(np.where(energies > 0, energies, 1.0))
    unit_products = unit[:, :, None] * unit[:, None, :]
    H, S = H * unit_products, S * unit_products
    level = np.round(np.log(np.maximum(np.abs(lam), TINY)) / np.log(TIME_SCALE_RATIO))
    for number in np.unique(level[is_root]):
        members = is_root & (level == number)
        rows = np.flatnonzero(members.any(axis=1))
        G = _gram(
            H[rows],
            S[rows],
            lam[rows] / TIME_SCALE_RATIO**number,
            is_root[rows],
            lam[rows].imag != 0,
        )
        count = is_root[rows].sum(axis=1) + (is_root[rows] & (lam[rows].imag != 0)).sum(axis=1)
        diagonal = np.arange(G.shape[1])
        G[:, diagonal, diagonal] += EPS * count[:, None]  # two states may be parallel
        inverse = np.einsum("mii->mi", np.linalg.inv(G)).real[:, : lam.shape[1]]
        condition_numbers = np.sqrt(np.maximum(inverse, 1.0))
        condition[rows] = np.where(members[rows], condition_numbers, condition[rows])
    return condition


def _gram(
    H: np.ndarray, S: np.ndarray, lam: np.ndarray, is_root: np.ndarray, paired: np.ndarray
) -> np.ndarray:
    """Gram matrices (m, 2k, 2k) of unit states and of conjugates of paired ones.

    Rows and columns without a root are those of the identity.
    """
    bar = lam.conj()
    gram = H * (1.0 + bar[:, :, None] * lam[:, None, :])
    across = S.conj() * (1.0 + bar[:, :, None] * bar[:, None, :])
    G = np.concatenate(
        [
            np.concatenate([gram, across], axis=2),
            np.concatenate([across.conj().swapaxes(1, 2), gram.conj()], axis=2),
        ],
        axis=1,
    )
    entries = np.concatenate([is_root, is_root & paired], axis=1)
    size = np.sqrt(np.maximum(np.einsum("mii->mi", G).real, TINY))
    G = G / (size[:, :, None] * size[:, None, :])
    pair_of_entries = entries[:, :, None] & entries[:, None, :]
    unit: np.ndarray = np.where(pair_of_entries, G, np.eye(G.shape[1]))
    return unit


def _backward_errors(C: np.ndarray, K: np.ndarray, lam: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Backward errors (m, k) as in `dense_qep.backward_error`; 0 beyond the count."""
    R = psi * (lam**2)[:, None, :] + (C @ psi) * lam[:, None, :] + K @ psi
    size = np.abs(lam)
    sizes = (np.linalg.norm(A, axis=(1, 2))[:, None] for A in (C, K))
    norm_C, norm_K = sizes
    norm = (size**2 + size * norm_C + norm_K) * np.linalg.norm(psi, axis=1)
    error: np.ndarray = np.linalg.norm(R, axis=1) / np.where(norm > 0, norm, 1.0)
    return error
