"""What tables say of the brake's modes beside their roots: energies and comparable shapes."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.point import PointModes, working_point_error
from squealstudy.analysis.reanalysis.point_roots import PointRoots
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.system.energy import component_energies, energy_shares
from squealstudy.system.linearise import StructureWeights
from squealstudy.system.parametric import Weights, product


class BrakeModes:
    """Reads modes given in the coordinates of a basis.

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

    def energies(self, weights: Weights, X: np.ndarray) -> np.ndarray:
        """Share of each component, then of the interfaces, in psi^H K_sym psi (c + 1, m)."""
        psi = X if self._V is None else product(self._V, X)
        named = StructureWeights.of(weights)
        components = component_energies(self._model, named, psi)
        return energy_shares(components, self._springs, self._normal, named, X)

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 on the prepared shape basis."""
        seen = product(self._shapes, X).T
        seen = seen / np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-300)
        unit: np.ndarray = seen.astype(np.complex64)
        return unit

    def read(self, found: PointRoots) -> PointModes:
        """The modes of a solved point, oscillating ones first."""
        assert found.sample is not None
        assert found.sample.working_point is not None
        order = np.argsort(found.lam.imag == 0, kind="stable")
        lam, X = found.lam[order], found.X[:, order]
        return PointModes(
            lam,
            lam.imag == 0,
            found.residual[order],
            self.energies(found.sample.weights, X),
            self.shapes(X),
            found.sample.working_point,
            found.error[order] + working_point_error(found.sample.working_point, lam),
            found.method,
        )
