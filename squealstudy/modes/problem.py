"""Design points of one structure as a rung needs them, for any kind of model.

Roots and vectors of a rung become modes with energies and shapes here, whatever basis the vectors
are in.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.quadratic_pencil import product
from squealstudy.modes.point import PointModes, oscillating_first, working_point_error
from squealstudy.modes.reanalysis.estimate import Outcome
from squealstudy.modes.reanalysis.problem import Linearisation, SweptProblem
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.prepared import PreparedFamily, PreparedModel, unit_shapes
from squealstudy.system.energies import component_energies, energy_shares
from squealstudy.system.linearise import StructureWeights


class Point(Protocol):
    """A design point: the values of all its parameters, by name."""

    @property
    def values(self) -> Mapping[str, float]:
        """Value of every parameter, SI units."""
        ...


class Coordinates(Protocol):
    """Map from design points to coordinates theta in [-1, 1]^d, in which modes vary smoothly."""

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that vary."""
        ...

    def theta(self, values: np.ndarray) -> np.ndarray:
        """Coordinates (n, d) of design points with values (n, d) of the parameters that vary."""
        ...

    def design_at(self, theta: np.ndarray) -> Any:
        """The design point at coordinates (d,)."""
        ...


@dataclass(eq=False)
class Problem:
    """Design points of one structure, of a brake, a minimal model or a family of matrices.

    Attributes
    ----------
    prepared : PreparedModel or PreparedFamily
        The structure.
    swept : SweptProblem
        Terms and weights of the model over the box of all its design points.
    chart : Coordinates
        Map from design points to coordinates in that box and back.
    tolerance : float
        Largest error of lightly damped and of growing roots, relative to their moduli.
    exact : callable
        Returns the complex modes of a design point by the exact rung of the model; may raise
        ConvergenceError.
    full_order : callable
        The same in the unreduced model.
    load_basis : callable
        Returns the sweep basis over the box, which was made if the rung is `over_a_basis`.
    """

    prepared: PreparedModel | PreparedFamily
    swept: SweptProblem
    chart: Coordinates
    tolerance: float
    exact: Callable[[Any], PointModes]
    full_order: Callable[[Any], PointModes]
    load_basis: Callable[[], SweepBasis]

    def theta(self, points: Sequence[Point]) -> np.ndarray:
        """Coordinates (n, d) of design points."""
        names = self.chart.names
        values = [[point.values[name] for name in names] for point in points]
        return self.chart.theta(np.array(values).reshape(len(points), len(names)))

    def point_at(self, theta: np.ndarray) -> Point:
        """The design point at coordinates (d,)."""
        point: Point = self.chart.design_at(theta)
        return point

    @cached_property
    def basis(self) -> SweepBasis:
        """The sweep basis over the box, loaded once."""
        return self.load_basis()

    @cached_property
    def full_reader(self) -> Reader:
        """Reader of energies and shapes of vectors in full coordinates."""
        return Reader(self.prepared, None)

    @cached_property
    def basis_reader(self) -> Reader:
        """Reader of energies and shapes of vectors in coordinates of the sweep basis."""
        return Reader(self.prepared, self.basis.V)

    def modes(self, outcome: Outcome) -> PointModes | ConvergenceError:
        """Modes of a rung's roots, oscillating ones first; or the error of a point without any."""
        if isinstance(outcome, ConvergenceError):
            return outcome
        order = oscillating_first(outcome.lam)
        lam, X = outcome.lam[order], outcome.X[:, order]
        reader = self.full_reader if outcome.full else self.basis_reader
        point = outcome.at.working_point
        return PointModes(
            lam=lam,
            residual=outcome.residual[order],
            energies=reader.energies(outcome.at, X),
            shapes=reader.shapes(X),
            working_point=point,
            error_rung=outcome.error[order] + working_point_error(point, lam),
            method=outcome.method,
        )


class Reader:
    """Computes energies and comparable shapes of vectors (r, m) in the coordinates of a basis.

    Parameters
    ----------
    prepared : PreparedModel or PreparedFamily
        The model; a family of matrices has no energies.
    V : ndarray (n, r) or None
        The basis; None for vectors in full coordinates.
    """

    def __init__(self, prepared: PreparedModel | PreparedFamily, V: np.ndarray | None) -> None:
        self._model, self._V = prepared.model, V
        self._shapes = prepared.shape_rows if V is None else prepared.shape_rows @ V
        model = prepared.model
        if isinstance(model, ReducedModel):
            self._normal = np.asarray(model.N if V is None else model.N @ V)
            self._springs = np.asarray(model.K_springs if V is None else V.T @ model.K_springs @ V)

    def energies(self, linearisation: Linearisation, X: np.ndarray) -> np.ndarray:
        """Share of each component, then of the interfaces, in the elastic energy (c + 1, m)."""
        if not isinstance(self._model, ReducedModel):
            return np.zeros((0, X.shape[1]))
        psi = X if self._V is None else product(self._V, X)
        named = StructureWeights.of(linearisation.weights)
        components = component_energies(self._model, named, psi)
        return energy_shares(components, self._springs, self._normal, named, X)

    def shapes(self, X: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 on the prepared shape basis."""
        return unit_shapes(product(self._shapes, X))
