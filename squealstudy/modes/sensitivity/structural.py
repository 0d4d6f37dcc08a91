"""Sensitivities to materials, springs and loads, by full-order vectors.

A structural parameter changes the assembled matrices. So its derivative is projected on right and
left vectors of the unreduced assembly, where each chosen mode is found next to its reduced root.
The working point moves with the parameter. For the finite change the assembly is built again, with
its own working point.

Derivatives of matrices are central differences of the matrices that the model builds. Stiffness is
linear in moduli and spring stiffnesses, mass in densities: there the difference is exact but for
round-off. For Poisson ratios and angles it has an error of the relative step squared, about 1e-8. A
parameter that cannot go below its value, as a spring of no stiffness, has a one-sided difference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ParameterError
from squealstudy.laws.own_friction import STATE, has_own
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.linalg.real_modes import real_modes
from squealstudy.linalg.sparse_qep import LowRankSum, WoodburyFactor
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import DesignState, ModeKey
from squealstudy.modes.full_order.modes import FullOrderSystem, full_order_system
from squealstudy.modes.sensitivity.assembly_change import AssemblyChange
from squealstudy.modes.sensitivity.mode_family import mode_family
from squealstudy.modes.sensitivity.mode_gradient import ModeGradient, RealModes
from squealstudy.modes.sensitivity.mode_sensitivities import (
    Sensitivity,
    Step,
    change_products,
    followed_roots,
    slope_and_validity,
)
from squealstudy.modes.sensitivity.reduced import ChosenModes
from squealstudy.modes.sensitivity.state_derivatives import StateDerivatives
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.working_point import WorkingPoint, working_point
from squealstudy.system.contact_weights import ContactChange, ContactWeights
from squealstudy.system.linearise import structure_weights, unreduced_structure

RELATIVE_STEP = 1e-4  # step of differences, over the reference value of the parameter
SAME_MODE = 0.99  # least product of a component mode with itself across a step
Build = Callable[[Mapping[str, float]], Assembly]


@dataclass(frozen=True)
class StructureBuilder:
    """How the assembly of a design point is built, and what its bases keep.

    Attributes
    ----------
    build : callable
        Takes the values of all the model's parameters and returns the Assembly.
    values : mapping of name -> float
        Values at the design point.
    component_cutoff_hz, damped_to_hz : float
        Frequency up to which component modes may be changed, and up to which assembly modes have
        modal damping, Hz.
    least : mapping of name -> float
        Least possible values of the parameters that have one.
    sizes : mapping of name -> float
        Least reference values of parameters that may be close to zero.
    """

    build: Build
    values: Mapping[str, float]
    component_cutoff_hz: float
    damped_to_hz: float
    least: Mapping[str, float] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)

    def reference(self, name: str) -> float:
        """The change of a parameter that counts as 100 %.

        It is the size of the value, or that in `sizes` if larger; 1 where both are zero.
        """
        return max(abs(self.values[name]), self.sizes.get(name, 0.0)) or 1.0

    def step(self, name: str, change: float) -> Step:
        """The finite change of a structural parameter; `change` is relative to `reference`."""
        reference = self.reference(name)
        return Step(name, self.values[name], reference, change * reference)

    def ends(self, name: str) -> tuple[float, float]:
        """Values (low, high) between which differences are taken; low is a possible value."""
        nominal, step = self.values[name], RELATIVE_STEP * self.reference(name)
        below = nominal - step
        return (below if below >= self.least.get(name, -np.inf) else nominal), nominal + step

    def assembly(self, changed: Mapping[str, float] | None = None) -> Assembly:
        """The assembly, with some parameters at other values."""
        return self.build({**self.values, **(changed or {})})

    def system(
        self, assembly: Assembly, state: DesignState, point: WorkingPoint
    ) -> FullOrderSystem:
        """An assembly linearised about a working point; raises what `full_order_system` does."""
        modes = changed_modes(assembly, state, self.component_cutoff_hz)
        return full_order_system(assembly, modes, point, state, self.damped_to_hz)

    def working_point(
        self,
        assembly: Assembly,
        state: DesignState,
        k_c: float | np.ndarray,
        start: np.ndarray,
    ) -> WorkingPoint:
        """The working point of an assembly, iterated from gaps `start` (nc,).

        `k_c` is the contact stiffness per area of the contact space, Pa/m. Raises ConvergenceError
        where there is no working point.
        """
        modes = changed_modes(assembly, state, self.component_cutoff_hz)
        unreduced = unreduced_structure(assembly, modes, state)
        _, dk = unreduced.by_mode(state.stiffness_changes(unreduced.frequencies))
        space = contact_space(assembly, k_c, np.asarray(unreduced.shapes).T)
        space = space.changed(dict(enumerate(np.ravel(dk))) if np.ndim(dk) else {})
        return working_point(space, state.operating, start)


def check_structural(structure: StructureBuilder, names: Sequence[str]) -> None:
    """Raise ParameterError for the first parameter that moves the mesh."""
    base = structure.assembly()
    for name in names:
        check_same_mesh(name, base, structure.assembly({name: structure.ends(name)[1]}))


def structural_sensitivities(
    design: ChosenModes,
    structure: StructureBuilder,
    names: Sequence[str],
    change: float,
    reanalysis: bool = True,
) -> list[list[Sensitivity]]:
    """Sensitivities of every chosen mode of a design point, one list for each mode.

    Parameters
    ----------
    design : ChosenModes
        The design point and its chosen modes.
    structure : StructureBuilder
        Builds its assembly and changed ones.
    names : sequence of str
        Structural parameters that leave the mesh as it is.
    change : float
        Finite change, relative to `StructureBuilder.reference`.
    reanalysis : bool
        Whether the finite change is solved beside each derivative.

    Raises
    ------
    ParameterError
        Where a parameter has no derivative (`assembly_change`).
    ConvergenceError
        Where ARPACK does not converge.
    """
    sensitivities: list[list[Sensitivity]] = [[] for _ in design.families]
    if not design.families or not names:
        return sensitivities
    full = structure.system(structure.assembly(), design.state, design.point)
    families = [mode_family(full.pencil, complex(f.lam[0]), len(f.lam)) for f in design.families]
    real = None
    if len(full.omega):
        zeta = design.state.assembly_damping_ratios(len(full.omega))
        real = RealModes(full.w2, full.phi, full.assembly.M @ full.phi, zeta, full.structure.N)
    gradients = [ModeGradient(family, full.structure, real) for family in families]
    response = StaticResponse(full, design)
    for name in names:
        step = structure.step(name, change)
        by = assembly_change(structure, name, design.state)
        contact = response.change(by)
        changed = partial(_changed_pencil, design, structure, step)
        finite, reason = followed_roots(full.pencil, families, changed if reanalysis else None)
        for number, (family, gradient) in enumerate(zip(families, gradients, strict=True)):
            products = structural_products(gradient, full, by, contact)
            mass = np.vdot(family.Y[:, 0], by.mass @ family.X[:, 0])
            slope = slope_and_validity(family, products, step.size, complex(mass))
            sensitivities[number].append(Sensitivity(step, *slope, finite[number], reason))
    return sensitivities


class StaticResponse:
    """Derivatives of the contact of a full-order design point by a change of its assembly."""

    def __init__(self, full: FullOrderSystem, design: ChosenModes) -> None:
        c, operating, w = full.assembly.contact, full.state.operating, full.point
        k_c = design.prepared.space.k_c
        self._full, self._k_c = full, k_c
        self._derivatives = StateDerivatives(design.prepared, design.state, design.point)
        K0 = full.assembly.K_el + full.assembly.K_springs(static=True)
        K0 = K0 + full.assembly.K_contact(k_c)
        shapes = np.asarray(full.structure.shapes)
        dk = np.broadcast_to(full.weights.shapes, len(shapes))
        self._factor = WoodburyFactor(LowRankSum(K0, shapes.T, dk))
        of_points = (c.speed_factor, c.own_friction)
        self._friction = operating.friction_at(w.contact_pressure, *of_points).mu
        self._mu = self._friction * c.frictional
        load = operating.brake_pressure * full.assembly.load + full.assembly.constant_load
        normal = c.area * (w.contact_pressure + k_c * (w.gap - c.gap0))
        sliding = c.area * self._mu * w.contact_pressure
        self._displacement = self._factor.solve(load + c.N.T @ normal - c.T.T @ sliding)

    def change(self, by: AssemblyChange) -> ContactWeights:
        """Total derivative of the contact weights: the working point moves."""
        c, w = self._full.assembly.contact, self._full.point
        dp, dkappa = by.springs_at(w.gap)
        force = by.area * w.contact_pressure + c.area * dp
        unbalanced = by.static_stiffness @ self._displacement
        unbalanced -= self._full.state.operating.brake_pressure * by.load + by.constant_load
        drag = self._mu * force + self._friction * by.frictional * c.area * w.contact_pressure
        mu, by_speed, by_pressure = by.friction_at(self._full.state.operating, c, w)
        drag = drag + c.frictional * c.area * w.contact_pressure * mu
        unbalanced -= c.N.T @ force - c.T.T @ drag
        unbalanced += c.N.T @ (c.area * self._k_c * by.opening)
        imbalance = c.N @ self._factor.solve(unbalanced) - by.opening
        gap = self._derivatives.motion.solve(imbalance)
        change = ContactChange(dp, dkappa, by.area, by.frictional)
        change = change._replace(mu=mu, by_speed=by_speed, by_pressure=by_pressure)
        return self._derivatives.contact(gap, change)


def structural_products(
    gradient: ModeGradient, full: FullOrderSystem, by: AssemblyChange, contact: ContactWeights
) -> np.ndarray:
    """`change_products` (k, k) of full-order modes; modal damping is that of `gradient`."""
    family, beta, phi = gradient.family, full.state.stiffness_damping, full.phi
    KX = by.stiffness @ family.X
    CX = beta * KX + by.dampers @ family.X + by.damping @ family.X
    weights = structure_weights((0.0, 0.0, 0.0), contact, beta=beta, mass=0.0)
    products = change_products(family, KX, CX, by.mass @ family.X)
    products = products + gradient.products(weights)
    if gradient.damping is not None:
        products[0, 0] += gradient.damping.by_stiffness(phi.T @ (by.stiffness @ phi))
        products[0, 0] += gradient.damping.by_mass(phi.T @ (by.mass @ phi))
    return products


def _changed_pencil(
    design: ChosenModes, structure: StructureBuilder, step: Step
) -> QuadraticPencil:
    """Pencil of the assembly with the changed value, linearised about its own working point."""
    state, k_c = design.state, design.prepared.space.k_c
    assembly = structure.assembly({step.name: step.value + step.size})
    point = structure.working_point(assembly, state, k_c, np.asarray(design.point.gap))
    return structure.system(assembly, state, point).pencil


def assembly_change(structure: StructureBuilder, name: str, state: DesignState) -> AssemblyChange:
    """Derivative of the assembly by the parameter `name` at the structure's values.

    Raises
    ------
    ParameterError
        Where the parameter moves the mesh or the contact, or turns a component mode that the study
        changes or damps within a pair of equal frequency.
    """
    low, high = structure.ends(name)
    ends = [structure.assembly({name: value}) for value in (high, low)]
    check_same_mesh(name, *ends)
    modes = [changed_modes(end, state, structure.component_cutoff_hz) for end in ends]
    _check_same_modes(name, ends[0], modes[0], modes[1], state)
    unreduced = [unreduced_structure(e, m, state) for e, m in zip(ends, modes, strict=True)]
    U = np.vstack([np.asarray(s.shapes) for s in unreduced]).T

    def slope(
        matrix_of: Callable[[Assembly], sp.spmatrix | np.ndarray],
    ) -> sp.spmatrix | np.ndarray:
        return (matrix_of(ends[0]) - matrix_of(ends[1])) / (high - low)

    def by_shapes(
        values_of: Callable[[Mapping[ModeKey, float]], Mapping[ModeKey, float]],
    ) -> np.ndarray:
        parts = [
            np.broadcast_to(s.by_mode(values_of(s.frequencies))[1], len(s.places))
            for s in unreduced
        ]
        quotient: np.ndarray = np.concatenate([parts[0], -parts[1]]) / (high - low)
        return quotient

    changed = by_shapes(state.stiffness_changes)
    elastic, empty = slope(lambda a: a.K_el), sp.csr_matrix((U.shape[0], U.shape[0]))
    springs, static = slope(lambda a: a.K_springs()), slope(lambda a: a.K_springs(static=True))
    return AssemblyChange(
        mass=slope(lambda a: a.M),
        stiffness=LowRankSum(elastic + springs, U, changed),
        static_stiffness=LowRankSum(elastic + static, U, changed),
        dampers=LowRankSum(empty, U, by_shapes(state.modal_dampers)),
        damping=slope(lambda a: empty if a.C_el is None else a.C_el)
        + state.operating.turning * slope(lambda a: empty if a.turning is None else a.turning),
        load=slope(lambda a: a.load),
        constant_load=slope(lambda a: a.constant_load),
        area=slope(lambda a: a.contact.area),
        frictional=slope(lambda a: a.contact.frictional),
        opening=slope(lambda a: a.contact.gap0),
        ends=(ends[0].contact.spring_points, ends[1].contact.spring_points, high - low),
        own=(ends[0].contact.own_friction, ends[1].contact.own_friction),
    )


def check_same_mesh(name: str, first: Assembly, second: Assembly) -> None:
    """Raise ParameterError where two assemblies differ in their mesh or contact observation."""
    same = first.n_dof == second.n_dof and all(
        np.array_equal(a.coordinates, b.coordinates)
        for a, b in zip(first.components, second.components, strict=True)
    )
    contact, other_contact = first.contact, second.contact
    same = same and all(
        _equal(getattr(contact, rows), getattr(other_contact, rows))
        for rows in ("N", "T", "T_perp")
    )
    same = same and np.array_equal(contact.speed_factor, other_contact.speed_factor)
    if has_own(contact.own_friction):
        same = same and np.array_equal(
            contact.own_friction[:, STATE], other_contact.own_friction[:, STATE]
        )
    if not same:
        raise ParameterError(
            name,
            "it is geometry: it moves the mesh or the contact, so there is no derivative of the "
            "matrices; expected a material, a spring stiffness or a load; sweep it instead",
        )


def _equal(A: sp.csr_matrix, B: sp.csr_matrix) -> bool:
    return A.shape == B.shape and (A != B).nnz == 0


def changed_modes(
    assembly: Assembly, state: DesignState, cutoff_hz: float
) -> dict[str, ComponentModes]:
    """Free-free modes of the components whose modes the state changes or damps."""
    names = {key[0] for key in (*state.frequency_scale, *state.mode_damping)}
    return {
        c.name: ComponentModes(*real_modes(c.M, c.K, cutoff_hz))
        for c in assembly.components
        if c.name in names
    }


def _check_same_modes(
    name: str,
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    others: Mapping[str, ComponentModes],
    state: DesignState,
) -> None:
    """Raise ParameterError where a changed component mode is another one at the step's other end.

    The modes of a pair of equal frequency may turn into each other with the parameter.
    """
    masses = {c.name: c.M for c in assembly.components}
    for component, mode in {*state.frequency_scale, *state.mode_damping}:
        shape, other_shape = (m[component].phi[:, mode - 1] for m in (modes, others))
        if abs(shape @ (masses[component] @ other_shape)) < SAME_MODE:
            raise ParameterError(
                name,
                f"mode {mode} of {component}, whose frequency or damping this study changes, is "
                "one of a pair that turns with this parameter: it has no derivative",
            )
