"""Elastic energy of a mode shape, shared among components and interfaces."""

from __future__ import annotations

import numpy as np

from squealstudy.reduction.cmt import ReducedModel
from squealstudy.system.linearise import StructureWeights
from squealstudy.system.parametric import Matrix, product


def energy_shares(
    components: np.ndarray, springs: Matrix, N: Matrix, weights: StructureWeights, X: np.ndarray
) -> np.ndarray:
    """Share of each component, then of the interfaces, in psi^H K_sym psi.

    Parameters
    ----------
    components : ndarray (n_components, m)
        Elastic energies psi^H K psi of each component and mode.
    springs : matrix (n, n)
        Stiffness of linear interfaces, in the coordinates of X.
    N : matrix (nc, n)
        Contact normals, in the same coordinates.
    weights : StructureWeights
    X : ndarray (n, m) complex
        The mode shapes.

    Returns
    -------
    ndarray (n_components + 1, m)
        Columns sum to one; friction does no elastic work and is left out.
    """
    own = np.einsum("im,im->m", X.conj(), product(springs, X)).real
    interfaces = weights.springs * own + weights.normal @ squared(product(N, X))
    total = np.maximum(components.sum(axis=0) + interfaces, 1e-300)
    shares: np.ndarray = np.vstack([components, interfaces]) / total
    return shares


def component_energies(
    model: ReducedModel, weights: StructureWeights, psi: np.ndarray
) -> np.ndarray:
    """Elastic energy (n_components, m) of shapes (n, m) in component-mode coordinates."""
    by_coordinate = weights.elastic[:, None] * squared(psi)
    energies: np.ndarray = np.add.reduceat(by_coordinate, model.offsets[:-1], axis=0)
    return energies


def reduced_energy_shares(
    model: ReducedModel, weights: StructureWeights, psi: np.ndarray
) -> np.ndarray:
    """`energy_shares` (n_components + 1, m) of shapes psi (n, m) of a component-mode model."""
    components = component_energies(model, weights, psi)
    return energy_shares(components, model.K_springs, model.N, weights, psi)


def squared(X: np.ndarray) -> np.ndarray:
    """|X|^2, without the root."""
    size: np.ndarray = X.real**2 + X.imag**2
    return size
