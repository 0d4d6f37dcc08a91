"""Shares of components in the energy of modes."""

from __future__ import annotations

import numpy as np

from squealstudy.linalg.quadratic_pencil import product, squared
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.system.linearise import StructureWeights
from squealstudy.system.parametric import (
    Matrix,
)


def energy_shares(
    components: np.ndarray, springs: Matrix, N: Matrix, weights: StructureWeights, X: np.ndarray
) -> np.ndarray:
    """Share of each component, then of all interfaces, in psi^H K_sym psi; it may be negative.

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
        Mode shapes.

    Returns
    -------
    ndarray (n_components + 1, m)
        Each column sums to one, or is zero where the energies sum to zero. Friction stores no
        energy and is left out.
    """
    spring_energies = np.einsum("im,im->m", X.conj(), product(springs, X)).real
    interfaces = weights.springs * spring_energies + weights.normal @ squared(product(N, X))
    total = components.sum(axis=0) + interfaces
    shares: np.ndarray = np.vstack([components, interfaces]) / np.where(total, total, 1.0)
    return shares + 0.0  # without -0


def component_energies(
    model: ReducedModel, weights: StructureWeights, psi: np.ndarray
) -> np.ndarray:
    """Elastic energy (n_components, m) of shapes (n, m) in component-mode coordinates."""
    by_coordinate = weights.elastic[:, None] * squared(psi)
    return np.asarray(np.add.reduceat(by_coordinate, model.offsets[:-1], axis=0))


def reduced_energy_shares(
    model: ReducedModel, weights: StructureWeights, psi: np.ndarray
) -> np.ndarray:
    """`energy_shares` (n_components + 1, m) of shapes psi (n, m) of a component-mode model."""
    components = component_energies(model, weights, psi)
    return energy_shares(components, model.K_springs, model.N, weights, psi)
