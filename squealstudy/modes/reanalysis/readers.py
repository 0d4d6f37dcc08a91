"""What tables say of modes beside their roots, of vectors in the coordinates of a basis."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from squealstudy.modes.reanalysis.problem import Linearisation
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.system.energy import component_energies, energy_shares
from squealstudy.system.linearise import StructureWeights
from squealstudy.system.parametric import product


class Reader(Protocol):
    """Energies and comparable shapes of vectors (r, m)."""

    def energies(self, at: Linearisation, X: np.ndarray) -> np.ndarray:
        """Share of each component, then of the interfaces, in the elastic energy (c + 1, m)."""
        ...

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 on the prepared shape basis."""
        ...


class BrakeReader:
    """Of a component-mode model.

    Parameters
    ----------
    prepared : PreparedModel
    V : ndarray (n, r) or None
        The basis; None for component-mode coordinates themselves.
    """

    def __init__(self, prepared: PreparedModel, V: np.ndarray | None) -> None:
        model = prepared.model
        self._model, self._V = model, V
        self._normal = np.asarray(model.N if V is None else model.N @ V)
        self._springs = np.asarray(model.K_springs if V is None else V.T @ model.K_springs @ V)
        basis = prepared.shape_basis.T
        self._shapes = np.asarray(basis if V is None else basis @ V)

    def energies(self, at: Linearisation, X: np.ndarray) -> np.ndarray:
        """Shares in psi^H K_sym psi (c + 1, m)."""
        psi = X if self._V is None else product(self._V, X)
        named = StructureWeights.of(at.weights)
        components = component_energies(self._model, named, psi)
        return energy_shares(components, self._springs, self._normal, named, X)

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 on the prepared shape basis."""
        seen = product(self._shapes, X).T
        seen = seen / np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-300)
        unit: np.ndarray = seen.astype(np.complex64)
        return unit


class FamilyReader:
    """Of a family of matrices, whose modes have no energies; parameters as of BrakeReader."""

    def __init__(self, prepared: PreparedFamily, V: np.ndarray | None) -> None:
        self._prepared, self._V = prepared, V

    def energies(self, at: Linearisation, X: np.ndarray) -> np.ndarray:
        """None of any part (0, m)."""
        return np.zeros((0, X.shape[1]))

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 on the prepared shape basis."""
        return self._prepared.shapes(X if self._V is None else self._V @ X)
