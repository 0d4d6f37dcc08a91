"""The component-mode brake as a problem for rungs.

Over a box its modal damping is a sum of few fixed matrices with interpolated weights (THEORY.md eq.
(48)). With one damping ratio zeta for all real modes it is C = 2 zeta K_sym^(1/2), as the mass is
the identity. The matrix root is a smooth function of the design point: it is interpolated by
polynomials through nodes, and truncated by SVD.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.linalg.dense_qep import pairs_inside
from squealstudy.models.contact_points import ContactPoints
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import state_working_point
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import Interpolation, interpolation
from squealstudy.modes.reanalysis.problem import (
    DenseProblem,
    Linearisation,
    Linearised,
    in_band,
    in_or_below,
)
from squealstudy.modes.reanalysis.sweep_basis import corners
from squealstudy.reduction.prepared import PreparedModel, shape_column
from squealstudy.reduction.working_point import WorkingPoint, expect_consistent_laws
from squealstudy.reduction.working_point_field import Cardinals, WorkingPointField, anchor_at
from squealstudy.root_pairs import angular_band
from squealstudy.system.linearise import (
    ContactStructure,
    StructureWeights,
    reduced_structure,
    symmetric_stiffness,
)
from squealstudy.system.modal_damping import assembly_damping, modal_damping
from squealstudy.system.parametric import DAMPING, ParametricSystem, Term, Weights

DAMPING_CHECKS = 4  # random points at which interpolated modal damping is checked
# degree of interpolated gaps by number of parameters; beyond three it is 2
FIELD_DEGREE = {1: 8, 2: 5, 3: 3}
# degree of interpolated modal damping, which is not iterated afterwards, by the number of
# parameters that stiffen the brake
DAMPING_DEGREE = {0: 0, 1: 8, 2: 7, 3: 6}
OFF_CENTRE = 0.618
UNMOVED = 1e-10  # relative change of stiffness by a parameter that does not stiffen
TRUNCATION = 1e-6  # singular values of matrix roots below this share are dropped


class BrakeProblem(DenseProblem):
    """A prepared brake over a box of design points.

    Parameters
    ----------
    prepared : PreparedModel
    dimension : int
        Number of parameters that vary.
    state_at : callable
        Design state at theta in [-1, 1]^d.
    band_hz : (low, high)
    exact_damping : bool
        Whether modal damping of the assembly, also of single modes, is computed at each design
        point, as one dense term (n, n). If not it is interpolated over the box, as sums of small
        projections need it, and a design point has one ratio for all modes.
    """

    def __init__(
        self,
        prepared: PreparedModel,
        dimension: int,
        state_at: Callable[[np.ndarray], DesignState],
        band_hz: tuple[float, float],
        exact_damping: bool = False,
    ) -> None:
        self.prepared, self.state_at = prepared, state_at
        self.exact_damping = exact_damping
        self.dimension = dimension
        self.band = angular_band(band_hz)

    @cached_property
    def system(self) -> ParametricSystem:
        """Terms of the component-mode model."""
        structure, damping = self.structure, self.modal_damping
        if self.exact_damping:
            more = [Term(DAMPING, dense=True)]
        else:
            more = [Term(DAMPING, None, A) for A in ([] if damping is None else damping.matrices)]
        return ParametricSystem(structure.n, (*structure.system.terms, *more))

    @cached_property
    def structure(self) -> ContactStructure:
        """The component-mode model without modal damping."""
        return reduced_structure(self.prepared.model)

    @cached_property
    def modal_damping(self) -> ModalDampingField | None:
        """Interpolated damping of all real modes, where a design point of the box has any.

        Raises
        ------
        ConvergenceError
            Where a node of its interpolation has no working point.
        """
        if self.exact_damping or not self._has_modal_damping():
            return None
        axes = self._stiffening_axes()
        grid = interpolation(DAMPING_DEGREE.get(len(axes), 2), len(axes))
        nodes = np.zeros((len(grid.nodes), self.dimension))
        nodes[:, axes] = grid.nodes
        stiffness = [self._symmetric_stiffness(theta) for theta in nodes]
        return modal_damping_field(stiffness, lambda theta: grid.cardinals(theta[:, axes]))

    def _stiffening_axes(self) -> list[int]:
        """Directions along which the symmetric stiffness changes: not those of speed or damping.

        Looked at from the middle and from a point off all axes of the box.
        """
        axes = []
        for axis in range(self.dimension):
            for base in (0.0, OFF_CENTRE):
                ends = np.full((2, self.dimension), base)
                ends[:, axis] = -1.0, 1.0
                low, high = (self._symmetric_stiffness(theta) for theta in ends)
                if np.abs(high - low).max() > UNMOVED * np.abs(low).max():
                    axes.append(axis)
                    break
        return axes

    def _has_modal_damping(self) -> bool:
        """Whether there is modal damping, by the middle and the ends of each parameter."""
        middle, axes = np.zeros((1, self.dimension)), np.eye(self.dimension)
        looked_at = np.vstack([middle, axes, -axes])
        return any(self.state_at(theta).damping_ratio for theta in looked_at)

    def interpolation_error(self) -> float:
        """Largest error of a damping ratio by the interpolation of modal damping, at some points.

        Raises
        ------
        ConvergenceError
            Where `modal_damping` raises it.
        """
        field, worst = self.modal_damping, 0.0
        if field is None:
            return worst
        inside = np.random.default_rng(3).uniform(-1, 1, (DAMPING_CHECKS, self.dimension))
        for theta in np.vstack([corners(self.dimension), inside]):
            zeta = self.state_at(theta).damping_ratio
            K = self._symmetric_stiffness(theta)
            worst = max(worst, zeta * field.error(theta, K, self.band[1]))
        return worst

    def _symmetric_stiffness(self, theta: np.ndarray) -> np.ndarray:
        point = self.working_points(theta[None])[0]
        if isinstance(point, ConvergenceError):
            raise point
        weights = self.structure.weights(point, self.state_at(theta))
        return symmetric_stiffness(self.structure, weights)

    @cached_property
    def field(self) -> WorkingPointField | None:
        """Working points over the whole box, for starts; None where a node has none."""
        if not self.dimension:
            return None
        grid = interpolation(FIELD_DEGREE.get(self.dimension, 2), self.dimension)
        points = [_alone(self.prepared, self.state_at(theta)) for theta in grid.nodes]
        return self._field(grid.nodes, points, grid.cardinals, range(len(points)))

    def local_field(self, box: Box, grid: Interpolation) -> WorkingPointField | None:
        """Working points over a part of the box, anchored at its middle; None where one fails."""
        theta = np.vstack([box.place(grid.nodes), box.middle])
        points = self.working_points(theta)

        def cardinals(at: np.ndarray) -> np.ndarray:
            return np.hstack([grid.cardinals(box.local(at)), np.zeros((len(at), 1))])

        return self._field(theta, points, cardinals, [len(points) - 1])

    def _field(
        self,
        theta: np.ndarray,
        points: Sequence[WorkingPoint | ConvergenceError],
        cardinals: Cardinals,
        anchored: Sequence[int],
    ) -> WorkingPointField | None:
        """Working points between samples, interpolated; None where a sample has none."""
        solved = [p for p in points if isinstance(p, WorkingPoint)]
        if len(solved) < len(points):
            return None
        anchors = []
        for i in anchored:
            state = self.state_at(theta[i])
            space = self.prepared.space.changed(self._changes(state))
            anchors.append(anchor_at(theta[i], space, state.operating, solved[i]))
        gaps = np.array([p.gap for p in solved])
        return WorkingPointField(
            space=self.prepared.space, node_gaps=gaps, cardinals=cardinals, anchors=tuple(anchors)
        )

    def _changes(self, state: DesignState) -> dict[int, float]:
        model = self.prepared.model
        dk = state.stiffness_changes(self.structure.frequencies)
        return {shape_column(model, *key): change for key, change in dk.items()}

    def working_points(
        self, theta: np.ndarray, field: WorkingPointField | None = None
    ) -> list[WorkingPoint | ConvergenceError]:
        """Working points at theta (b, d), checked; the reason where there is none.

        `field` gives the starts; by default that of the whole box.
        """
        states = [self.state_at(row) for row in theta]
        working: list[WorkingPoint | None] = [None] * len(states)
        field = field or self.field
        if field is not None:
            changes = [self._changes(state) for state in states]
            working = field.solve(theta, [s.operating for s in states], changes)
        return [
            _alone(self.prepared, state)
            if point is None
            else _tried(self.prepared.space, point, state)
            for state, point in zip(states, working, strict=True)
        ]

    def samples(
        self, theta: np.ndarray, field: WorkingPointField | None = None
    ) -> list[Linearised]:
        """Weights and working points at theta (b, d); the reason where there is none."""
        linearised: list[Linearised] = []
        points = self.working_points(theta, field)
        damping = self.modal_damping
        modal = np.zeros((len(theta), 0)) if damping is None else damping.weights(theta)
        for row, point, roots in zip(theta, points, modal, strict=True):
            if isinstance(point, ConvergenceError):
                linearised.append(point)
            else:
                state = self.state_at(row)
                weights: Weights = self.structure.weights(point, state)
                more: Weights = tuple(2.0 * state.damping_ratio * w for w in roots)
                if self.exact_damping:
                    K = symmetric_stiffness(self.structure, weights)
                    more = (assembly_damping(K, state)[0],)
                linearised.append(Linearisation(weights + more, point))
        return linearised

    def weights(self, theta: np.ndarray) -> Weights:
        """Weights at theta, about its working point; ConvergenceError where it has none."""
        sample = self.samples(np.atleast_2d(theta))[0]
        if isinstance(sample, ConvergenceError):
            raise sample
        return sample.weights

    def pairs(
        self, theta: np.ndarray, reach: float, below: bool = False
    ) -> tuple[Weights, Eigenpairs]:
        """Exact pairs of the dense problem."""
        weights = self.weights(theta)
        if self.modal_damping is None:
            _, C, K = self.system.matrices(weights)
        else:
            C, K = self._with_exact_damping(theta, weights)
        all_inside = pairs_inside(C, K, reach * self.band[1])
        keep = in_or_below if below else in_band
        return weights, all_inside.take(keep(all_inside.lam, self.band, reach))

    def _with_exact_damping(self, theta: np.ndarray, weights: Weights) -> tuple[Any, Any]:
        _, C, K = self.structure.system.matrices(StructureWeights.of(weights))
        K_sym = symmetric_stiffness(self.structure, weights)
        return C + assembly_damping(K_sym, self.state_at(theta))[0], K

    def nominal_stiffness(self) -> np.ndarray:
        """Symmetric stiffness (n, n) at the middle of the box."""
        weights = self.weights(np.zeros(self.dimension))
        return symmetric_stiffness(self.structure, weights)


def _alone(prepared: PreparedModel, state: DesignState) -> WorkingPoint | ConvergenceError:
    try:
        return state_working_point(prepared, state)
    except ConvergenceError as error:
        return error


def _tried(
    contact: ContactPoints, point: WorkingPoint, state: DesignState
) -> WorkingPoint | ConvergenceError:
    """The working point, or the error that its pressures make laws inconsistent."""
    try:
        expect_consistent_laws(contact, state.operating, point)
    except ConvergenceError as error:
        return error
    return point


@dataclass(frozen=True)
class ModalDampingField:
    """K_sym^(1/2) at theta as sum of weights(theta)_j matrices_j.

    Attributes
    ----------
    matrices : ndarray (q, n, n)
        Symmetric, rad/s.
    at_nodes : ndarray (p, q)
        Weights at the nodes.
    cardinals : callable
        theta (b, d) -> (b, p).
    """

    matrices: np.ndarray
    at_nodes: np.ndarray
    cardinals: Cardinals

    def weights(self, theta: np.ndarray) -> np.ndarray:
        """Weights (b, q) at theta (b, d)."""
        weights: np.ndarray = self.cardinals(theta) @ self.at_nodes
        return weights

    def error(self, theta: np.ndarray, K_sym: np.ndarray, top: float) -> float:
        """Largest relative error of the damping of the real modes up to `top` rad/s at theta (d,).

        K_sym (n, n) is the symmetric stiffness there.
        """
        w2, phi = la.eigh(K_sym, subset_by_value=(0.0, top**2))
        S = np.tensordot(self.weights(theta[None])[0], self.matrices, 1)
        omega = np.sqrt(w2)
        damping = np.einsum("ij,ij->j", phi, S @ phi)
        return float((np.abs(damping - omega) / omega).max(initial=0.0))


def modal_damping_field(K_sym: Sequence[np.ndarray], cardinals: Cardinals) -> ModalDampingField:
    """The field through nodes with symmetric stiffnesses K_sym (p of (n, n))."""
    n = len(K_sym[0])
    roots = np.array([modal_damping(la.eigh(K), np.full(n, 0.5)).ravel() for K in K_sym])
    values, vectors = la.eigh(roots @ roots.T)
    s = np.sqrt(np.maximum(values[::-1], 0.0))
    U = vectors[:, ::-1][:, s > TRUNCATION * s[0]]
    return ModalDampingField((U.T @ roots).reshape(-1, n, n), U, cardinals)
