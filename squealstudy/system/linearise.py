"""A structure with contact linearised about steady sliding: terms, weights, elastic energies.

    Q(lambda) = lambda^2 M + lambda C + K
    K_sym = K_elastic + K_springs + U^T s U + N^T (.) N,   K = K_sym + T^T (.) N
    C = C_own + dampers of component modes + beta K_sym + modal damping
        + T_perp^T (.) T_perp + T^T (.) T + (.) G

(THEORY.md eq. (17) to (20)). The terms belong to a structure in some coordinates: unreduced, of
component modes, or real modes of a reference. The weights belong to a design point; those of
contact and friction are `contact_weights`. Modal damping is no weighted sum of fixed matrices:
each user adds its own term.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws.own_friction import NO_OWN_FRICTION, NOT_LINEAR, is_linear
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import DesignState, ModeKey
from squealstudy.reduction.cmt import ComponentModes, ReducedModel, momenta
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.contact_weights import ContactWeights, contact_weights
from squealstudy.system.modal_damping import Modes, assembly_damping
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    Matrix,
    ParametricSystem,
    Term,
    Weights,
)


class StructureWeights(NamedTuple):
    """Weights of `ContactStructure.system` in the order of its terms, or their derivatives.

    Attributes
    ----------
    mass : float
        Factor on the mass: 1, or 0 in derivatives.
    elastic : ndarray (n,) or float
        Elastic stiffness: its diagonal, (rad/s)^2, or a factor on the whole matrix.
    springs : float
        Factor on the stiffness of linear interfaces.
    shapes : ndarray (m,) or float
        Changes of the stiffness of component modes that are no coordinates, (rad/s)^2.
    normal, coupling : ndarray (nc,) or float
        As in ContactWeights.
    elastic_damping, spring_damping, shape_damping, normal_damping : as the above
        Weights of the same matrices in the damping: dampers of component modes (in the first and
        third), and stiffness damping.
    across, along : ndarray (nc,) or float
        As in ContactWeights.
    own_damping : float
        Weight of the components' own damping: 1, or 0 in derivatives.
    turning : float
        Weight of the gyroscopic terms of rotors (`OperatingPoint.turning`), m/s.
    """

    mass: Any = 0.0
    elastic: Any = 0.0
    springs: Any = 0.0
    shapes: Any = 0.0
    normal: Any = 0.0
    coupling: Any = 0.0
    elastic_damping: Any = 0.0
    spring_damping: Any = 0.0
    shape_damping: Any = 0.0
    normal_damping: Any = 0.0
    across: Any = 0.0
    along: Any = 0.0
    own_damping: Any = 0.0
    turning: Any = 0.0

    @classmethod
    def of(cls, weights: Weights) -> StructureWeights:
        """Name the first of `weights`, which may have further terms behind them."""
        return cls(*weights[: len(cls._fields)])


SYMMETRIC_STIFFNESS_FIELDS = tuple(
    map(StructureWeights._fields.index, ("springs", "normal", "elastic", "shapes"))
)


def structure_weights(
    stiffness: tuple[Any, Any, Any],
    contact: ContactWeights,
    dampers: tuple[Any, Any] = (0.0, 0.0),
    beta: float = 0.0,
    mass: float = 1.0,
    turning: float = 0.0,
) -> StructureWeights:
    """Weights of a structure, including its stiffness damping.

    Parameters
    ----------
    stiffness : (elastic, springs, shapes)
        Weights of the symmetric stiffness without contact.
    contact : ContactWeights
    dampers : (elastic, shapes)
        Dampers of component modes, rad/s: of those that are coordinates, of those that are shapes.
    beta : float
        Factor of the stiffness damping beta K_sym, s.
    mass : float
        1, or 0 for derivatives; `own_damping` is the same.
    turning : float
        Weight of the gyroscopic terms of rotors, m/s.
    """
    elastic, springs, shapes = stiffness
    return StructureWeights(
        mass,
        *stiffness,
        contact.normal,
        contact.coupling,
        elastic_damping=dampers[0] + beta * elastic,
        spring_damping=beta * springs,
        shape_damping=dampers[1] + beta * shapes,
        normal_damping=beta * contact.normal if beta else 0.0,
        across=contact.across,
        along=contact.along,
        own_damping=mass,
        turning=turning,
    )


@dataclass(frozen=True)
class ContactStructure:
    """A structure with contact in n coordinates.

    Attributes
    ----------
    mass : matrix (n, n) or None
        None stands for the identity.
    elastic : matrix (n, n) or None
        Elastic stiffness of the components; None where it is diagonal: its weights are then the
        diagonal.
    stiffness : ndarray (n,) or float
        Weights of `elastic` without changes of component modes: the diagonal, or 1.
    springs : matrix (n, n) or None
        Stiffness of linear interfaces; None where there are none, or where `elastic` holds them.
    N, T, T_perp : matrix (nc, n)
        Contact observation (models.assembly.ContactInterface).
    area, frictional, speed_factor : ndarray (nc,)
    own_friction : ndarray (nc, k)
        As in ContactInterface.
    frequencies : mapping of (component, mode) -> float
        Frequency [rad/s] of each component mode that a design point may change or damp.
    places : mapping of (component, mode) -> int
        The coordinate of each of these, or its row of `shapes`.
    shapes : matrix (m, n) or None
        Rows phi^T M of component modes; None where they are coordinates.
    damping : matrix (n, n) or None
        The components' own damping; None where there is none.
    turning : matrix (n, n) or None
        Gyroscopic terms of rotors at 1 m/s of sliding; None where there are none.
    unturned : str
        Why a rotor has no gyroscopic terms; empty where it has, or where there is no rotor.
    """

    mass: Matrix | None
    elastic: Matrix | None
    stiffness: Any
    springs: Matrix | None
    N: Matrix
    T: Matrix
    T_perp: Matrix
    area: np.ndarray
    frictional: np.ndarray
    speed_factor: np.ndarray
    frequencies: Mapping[ModeKey, float]
    places: Mapping[ModeKey, int]
    shapes: Matrix | None = None
    damping: Matrix | None = None
    turning: Matrix | None = None
    unturned: str = ""
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.N.shape[1])

    @cached_property
    def system(self) -> ParametricSystem:
        """All terms; those of the symmetric stiffness stand in the damping once more."""
        none = np.zeros((0, self.n))
        springs = none if self.springs is None else None
        U = none if self.shapes is None else self.shapes
        symmetric = [
            (None, self.elastic),
            (springs, none if self.springs is None else self.springs),
            (U, U),
            (self.N, self.N),
        ]
        whole_matrices = [
            (none, none) if A is None else (None, A) for A in (self.damping, self.turning)
        ]
        terms = (
            Term(MASS, None, self.mass),
            *(Term(STIFFNESS, *sides) for sides in symmetric),
            Term(STIFFNESS, self.T, self.N),
            *(Term(DAMPING, *sides) for sides in symmetric),
            Term(DAMPING, self.T_perp, self.T_perp),
            Term(DAMPING, self.T, self.T),
            *(Term(DAMPING, *sides) for sides in whole_matrices),
        )
        return ParametricSystem(self.n, terms)

    @np.errstate(over="ignore", invalid="ignore")
    def weights(
        self, point: WorkingPoint, state: DesignState, in_time: bool = False
    ) -> StructureWeights:
        """Weights at a working point of a design point, without modal damping.

        ConvergenceError where entries of a matrix become too large; ParameterError where gyroscopic
        terms are asked for and there are none; ModelError where a contact point is stuck without a
        stiffness, except `in_time`.
        """
        if not (in_time or is_linear(self.own_friction)):
            raise ModelError(NOT_LINEAR)
        state.operating.expect_turning(self.turning, self.unturned)
        changes = self.by_mode(state.stiffness_changes(self.frequencies))
        weights = structure_weights(
            (self.stiffness + changes[0], 1.0, changes[1]),
            contact_weights(self, point, state.operating),
            self.by_mode(state.modal_dampers(self.frequencies)),
            state.stiffness_damping,
            turning=state.operating.turning,
        )
        self.system.expect_computable(weights, StructureWeights._fields)
        return weights

    def by_mode(self, values: Mapping[ModeKey, float]) -> tuple[Any, Any]:
        """Numbers of component modes as weights of the elastic diagonal and of shapes; one is 0."""
        if not values:
            return 0.0, 0.0
        weights = np.zeros(self.n if self.shapes is None else self.shapes.shape[0])
        for key, number in values.items():
            weights[self.places[key]] = number
        return (weights, 0.0) if self.shapes is None else (0.0, weights)


@lru_cache(maxsize=4)  # shared by the design points of a structure
def reduced_structure(model: ReducedModel) -> ContactStructure:
    """The structure of a component-mode model: unit mass, and component modes as coordinates."""
    frequencies = component_frequencies(model)
    return ContactStructure(
        mass=None,
        elastic=None,
        stiffness=model.k_el,
        springs=model.K_springs,
        N=model.N,
        T=model.T,
        T_perp=model.T_perp,
        area=model.area,
        frictional=model.frictional,
        speed_factor=model.speed_factor,
        frequencies=frequencies,
        places={key: model.mode_coordinate(*key) for key in frequencies},
        damping=model.C_el,
        turning=model.turning,
        unturned=model.unturned,
        own_friction=model.own_friction,
    )


def unreduced_structure(
    assembly: Assembly, modes: Mapping[str, ComponentModes], state: DesignState
) -> ContactStructure:
    """The structure of an assembly; component modes that the state changes or damps are shapes."""
    used = list(dict.fromkeys([*state.frequency_scale, *state.mode_damping]))
    contact = assembly.contact
    return ContactStructure(
        mass=assembly.M,
        elastic=assembly.K_el,
        stiffness=1.0,
        springs=assembly.K_springs(),
        N=contact.N,
        T=contact.T,
        T_perp=contact.T_perp,
        area=contact.area,
        frictional=contact.frictional,
        speed_factor=contact.speed_factor,
        frequencies={(name, j): float(modes[name].omega[j - 1]) for name, j in used},
        places={key: row for row, key in enumerate(used)},
        shapes=momenta(assembly, modes, used),
        damping=assembly.C_el,
        turning=assembly.turning,
        unturned="" if assembly.rotors is None else assembly.rotors.unturned,
        own_friction=contact.own_friction,
    )


def component_frequencies(model: ReducedModel) -> dict[ModeKey, float]:
    """Free-free frequency [rad/s] of every component mode in the basis."""
    return {
        (name, j + 1): float(np.sqrt(max(model.k_el[int(start) + j], 0.0)))
        for name, start, count in zip(model.components, model.offsets, model.n_modes, strict=False)
        for j in range(count)
    }


@dataclass(frozen=True)
class LinearisedModel:
    """Matrices of one design point; the mass is the identity.

    The coordinates are those of the component modes, or of an orthonormal basis of them.

    Attributes
    ----------
    C, K : ndarray (n, n)
        Damping [rad/s] and non-symmetric stiffness [(rad/s)^2].
    K_sym : ndarray (n, n)
        Stiffness without friction: components, springs and contact.
    weights : StructureWeights
    C_modal : ndarray (n, n) or float
        The part of C that is modal damping of the assembly; 0 where it has none.
    known_modes : Modes or None
        The `real_modes`, if they were solved for the modal damping already; else None.
    """

    C: np.ndarray
    K: np.ndarray
    K_sym: np.ndarray
    weights: StructureWeights
    C_modal: np.ndarray | float = 0.0
    known_modes: Modes | None = None

    @cached_property
    def real_modes(self) -> Modes:
        """Squares of frequencies (n,) [(rad/s)^2] and shapes (n, n) of K_sym."""
        return self.known_modes or la.eigh(self.K_sym, driver="evd")

    @property
    def pencil(self) -> QuadraticPencil:
        """The quadratic pencil of the identity, C and K."""
        return QuadraticPencil(sp.identity(len(self.K), format="csr"), self.C, self.K)


def linearise(
    model: ReducedModel,
    point: WorkingPoint,
    state: DesignState,
    projected: ParametricSystem | None = None,
    in_time: bool = False,
) -> LinearisedModel:
    """Linearise a component-mode model about a working point, with modal damping of the assembly.

    Parameters
    ----------
    model : ReducedModel
    point : WorkingPoint
    state : DesignState
    projected : ParametricSystem or None
        The terms of the model's structure projected on an orthonormal basis. The matrices are then
        in its coordinates, and modal damping acts on real modes of the projected stiffness.
    in_time : bool
        True for runs in time, where stuck points need no tangential stiffness.

    Raises
    ------
    ConvergenceError
        Entries of a matrix become too large.
    ParameterError
        The state damps an assembly mode that the basis does not have, or asks for gyroscopic terms
        that the model does not have.
    ModelError
        A contact point is stuck without a stiffness, except `in_time`.
    """
    structure = reduced_structure(model)
    system = projected or structure.system
    weights = structure.weights(point, state, in_time)
    K_sym = system.summed(weights, SYMMETRIC_STIFFNESS_FIELDS)
    K = K_sym + system.summed(weights, [StructureWeights._fields.index("coupling")])
    beta = state.stiffness_damping
    undamped_weights = weights
    if beta:
        undamped_weights = structure.weights(point, replace(state, stiffness_damping=0.0), in_time)
    C = system.summed(undamped_weights, system.numbers(DAMPING)) + beta * K_sym
    modal, assembly_modes = assembly_damping(K_sym, state, model.damped_to)
    return LinearisedModel(C + modal, K, K_sym, weights, modal, assembly_modes)


def symmetric_stiffness(structure: ContactStructure, weights: Weights) -> np.ndarray:
    """Stiffness (n, n) of components, springs and contact without friction; terms must be dense."""
    return structure.system.summed(weights, SYMMETRIC_STIFFNESS_FIELDS)
