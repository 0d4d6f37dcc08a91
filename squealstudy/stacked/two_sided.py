"""Roots of a batch of small pencils with both vectors, and modes with their nearest neighbours.

`mode_family.mode_family` and `mode_sensitivities.followed_root` do the same for one design point.
Left vectors are the right ones of the transposed pencils, assigned by their roots. Near a
coalescence they are as exact as the right ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.companion import MIN_RESOLVED_RATIO
from squealstudy.linalg.quadratic_pencil import LEFT_RIGHT_ROOT_REL_DISTANCE
from squealstudy.modes.sensitivity.mode_family import NEIGHBOURS, OFFSET
from squealstudy.modes.sensitivity.mode_sensitivities import CANDIDATES
from squealstudy.modes.sensitivity.reduced import ModeChoice
from squealstudy.stacked.roots import companion_pairs


@dataclass(frozen=True, eq=False)
class StackedFamilies:
    """N modes of a batch, each with its neighbours; the mass is the identity.

    Attributes
    ----------
    owner : ndarray (N,) of int
        Design point of each mode.
    lam : ndarray (N, q) complex
        Roots [rad/s] of the mode and its neighbours, that of the mode first.
    X, Y : ndarray (N, n, q) complex
        Right and left vectors of unit norm.
    norm : ndarray (N, q) complex
        y^H (2 lambda + C) x.
    there : ndarray (N, q) of bool
        Neighbours whose left vector is found; the others are left out.
    told : ndarray (N,) of bool
        Whether the mode's left vector is found, and no two roots of the family share one; other
        modes need LAPACK with both vectors.
    residual : ndarray (N,)
        As in `ModeNeighbourhood`.
    """

    owner: np.ndarray
    lam: np.ndarray
    X: np.ndarray
    Y: np.ndarray
    norm: np.ndarray
    there: np.ndarray
    told: np.ndarray
    residual: np.ndarray

    @property
    def condition(self) -> np.ndarray:
        """Eigenvalue conditions (N,), as in `ModeNeighbourhood`."""
        size = np.abs(self.norm[:, 0])
        with np.errstate(divide="ignore"):
            condition = 2.0 * np.abs(self.lam[:, 0]) / size
        return np.where(size > 0, condition, np.inf)


def right_pairs(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All roots (m, 2n) [rad/s] and right vectors (m, n, 2n) of unit norm; C, K (m, n, n)."""
    lam, X = companion_pairs(C, K)
    return lam, X / np.maximum(np.linalg.norm(X, axis=1), 1e-300)[:, None, :]


def drowned_rows(lam: np.ndarray, limit: float) -> np.ndarray:
    """Where (m,) round-off of the largest root may hide roots of modulus `limit` [rad/s]."""
    lost_accuracy = lam.shape[1] / 2 * np.finfo(float).eps / MIN_RESOLVED_RATIO
    rows: np.ndarray = np.abs(lam).max(axis=1, initial=0.0) * lost_accuracy >= limit
    return rows


def chosen_modes(
    lam: np.ndarray, band: tuple[float, float], choice: ModeChoice
) -> tuple[np.ndarray, np.ndarray]:
    """Design points (N,) and places (N,) among roots (m, 2n) of the chosen modes in a band [rad/s].

    As in `chosen_roots`, the modes of each point are in order of falling growth.
    """
    size = np.abs(lam)
    modes = (lam.imag > 0) & (size >= band[0]) & (size <= band[1])
    by_size = np.argsort(size, axis=1, kind="stable")
    if choice.frequencies_hz:
        distance = np.abs(size[:, :, None] / (2 * np.pi) - np.array(choice.frequencies_hz))
        distance = np.where(modes[:, :, None], distance, np.inf)
        ordered = np.take_along_axis(distance, by_size[:, :, None], 1)
        nearest = np.take_along_axis(by_size, ordered.argmin(axis=1), 1)
        chosen = np.zeros(modes.shape, dtype=bool)
        np.put_along_axis(chosen, nearest, True, 1)
        modes &= chosen
    elif choice.count is None:
        modes &= lam.real / np.where(size > 0, size, 1.0) > choice.stability_tolerance
    growth = np.take_along_axis(np.where(modes, -lam.real, np.inf), by_size, 1)
    order = np.take_along_axis(by_size, np.argsort(growth, axis=1, kind="stable"), 1)
    count = modes.sum(axis=1)
    if choice.count is not None:
        count = np.minimum(count, choice.count)
    owner, rank = np.nonzero(np.arange(lam.shape[1]) < count[:, None])
    return owner, order[owner, rank]


def families(
    C: np.ndarray,
    K: np.ndarray,
    pairs: tuple[np.ndarray, np.ndarray],
    owner: np.ndarray,
    mode_index: np.ndarray,
) -> StackedFamilies:
    """Modes at places of `right_pairs` (`pairs`), with their left vectors and neighbours."""
    lam, X = pairs
    mu, Y = right_pairs(C.swapaxes(1, 2), K.swapaxes(1, 2))
    mu = mu.conj()  # Q(conj mu)^T y = 0 is y^H Q(mu) = 0
    roots = lam[owner, mode_index]
    order = _nearest_first(lam[owner], roots, mode_index)[:, :NEIGHBOURS]
    nearby_roots = np.take_along_axis(lam[owner], order, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (
            np.abs(nearby_roots[:, :, None] - mu[owner][:, None, :])
            / np.abs(nearby_roots)[:, :, None]
        )
    distance = np.where(np.isnan(distance), np.inf, distance)
    partner = distance.argmin(axis=2)
    in_family = (
        np.take_along_axis(distance, partner[:, :, None], 2)[:, :, 0] < LEFT_RIGHT_ROOT_REL_DISTANCE
    )
    pair_in_family = (
        in_family[:, :, None] & in_family[:, None, :] & ~np.eye(order.shape[1], dtype=bool)
    )
    shares_partner = (pair_in_family & (partner[:, :, None] == partner[:, None, :])).any(
        axis=(1, 2)
    )
    rows = owner[:, None]
    # (N, q, n): one advanced index before and after the slice puts it last
    right, left_vectors = X[rows, :, order].swapaxes(1, 2), Y[rows, :, partner].swapaxes(1, 2)
    damping = C[owner]
    slope = 2.0 * nearby_roots[:, None, :] * right + damping @ right
    norm = np.einsum("Nij,Nij->Nj", left_vectors.conj(), slope)
    residual = np.maximum(
        _residual(C[owner], K[owner], roots, right[:, :, 0]),
        _residual(
            C[owner].swapaxes(1, 2), K[owner].swapaxes(1, 2), roots.conj(), left_vectors[:, :, 0]
        ),
    )
    is_served = in_family[:, 0] & ~shares_partner
    return StackedFamilies(
        owner, nearby_roots, right, left_vectors, norm, in_family, is_served, residual
    )


def _nearest_first(lam: np.ndarray, roots: np.ndarray, mode_index: np.ndarray) -> np.ndarray:
    """Order (N, 2n) of roots by their distance to a shift beside each mode, which comes first."""
    distance = np.abs(lam - (roots * (1.0 + OFFSET))[:, None])
    distance[np.arange(len(roots)), mode_index] = -1.0
    return np.argsort(distance, axis=1, kind="stable")


def _residual(C: np.ndarray, K: np.ndarray, lam: np.ndarray, x: np.ndarray) -> np.ndarray:
    """|Q(lambda) x| (N,) over the sum of the norms of its three parts."""
    lam = lam[:, None]
    parts = (lam**2 * x, lam * (C @ x[:, :, None])[:, :, 0], (K @ x[:, :, None])[:, :, 0])
    size = sum(np.linalg.norm(part, axis=1) for part in parts)
    residual: np.ndarray = np.linalg.norm(sum(parts), axis=1) / np.maximum(size, 1e-300)
    return residual


def biorthogonality(C: np.ndarray, families: StackedFamilies) -> np.ndarray:
    """Largest product (N,) of each mode's left vector with another mode of its design point."""
    largest = np.zeros(len(families.owner))
    first = np.searchsorted(families.owner, families.owner)
    count = np.bincount(families.owner, minlength=1)
    lam, norm, x, y = (
        families.lam[:, 0],
        families.norm[:, 0],
        families.X[:, :, 0],
        families.Y[:, :, 0],
    )
    for shift in range(int(count.max(initial=0))):  # other modes of its point in turn
        rows = np.flatnonzero(shift < count[families.owner])
        other = first[rows] + shift
        rows, other = rows[other != rows], other[other != rows]
        damping = np.einsum("Ni,Nij,Nj->N", y[rows].conj(), C[families.owner[rows]], x[other])
        mass = np.einsum("Ni,Ni->N", y[rows].conj(), x[other])
        products = np.abs((lam[rows] + lam[other]) * mass + damping)
        with np.errstate(divide="ignore", invalid="ignore"):
            products = products / np.sqrt(np.abs(norm[rows] * norm[other]))
        largest[rows] = np.maximum(largest[rows], products)
    return largest


def followed(
    C: np.ndarray,
    families: StackedFamilies,
    changed: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Change (N,) [rad/s] of each mode's root in a changed batch, and its match (N,).

    Parameters
    ----------
    C : ndarray (m, n, n)
        Damping of the unchanged design points.
    families : StackedFamilies
    changed : (roots (m, 2n), right vectors (m, n, 2n))
        The vectors in coordinates of the unchanged design points.
    """
    lam, y = families.lam[:, 0], families.Y[:, :, 0].conj()
    roots, X = changed[0][families.owner], changed[1][families.owner]
    X = X / np.maximum(np.linalg.norm(X, axis=1), 1e-300)[:, None, :]
    by_damping = np.einsum("Ni,Nij->Nj", y, C[families.owner])
    product = (lam[:, None] + roots) * np.einsum("Ni,Nij->Nj", y, X)
    product += np.einsum("Ni,Nij->Nj", by_damping, X)
    match = np.abs(product) / np.maximum(np.abs(families.norm[:, 0]), 1e-300)[:, None]
    distance = np.abs(roots - (lam * (1.0 + OFFSET))[:, None])
    order = np.argsort(distance, axis=1)[:, :CANDIDATES]
    best = np.take_along_axis(match, order, 1).argmax(axis=1)
    nearest = order[np.arange(len(lam)), best]
    entries = np.arange(len(lam)), nearest
    return roots[entries] - lam, match[entries]
