"""Structural parameters in a batch: derivatives by differences of the assembled matrices.

`modes.sensitivity.structural` takes the same differences for one design point. They are exact but
for round-off where matrices are linear in a parameter; else the error goes with the step squared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.laws.own_friction import STATE, has_own
from squealstudy.laws.spring import evaluate_springs
from squealstudy.linalg.overflow import OVERFLOW
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.stacked_assembly import StackedAssembly
from squealstudy.modes.sensitivity.structural import RELATIVE_STEP, SAME_MODE
from squealstudy.stacked.linear_slopes import MatrixSlope, matrix_slope
from squealstudy.stacked.modes import (
    Columns,
    StackedSystem,
    stacked_assembly,
    structures_of,
    system_about_sliding,
)
from squealstudy.stacked.state_slopes import StackedStep, StateSlopes
from squealstudy.system.contact_weights import ContactChange

GEOMETRY = (
    "N",
    "T",
    "T_perp",
    "speed_factor",
)  # no derivatives where these change with the parameter


@dataclass(frozen=True, eq=False)
class StructureSlopes:
    """m design points with the model from which their structures are built.

    Attributes
    ----------
    model : ModelDefinition
    options : mapping of str -> str or int
    columns : mapping of parameter -> number or ndarray (m,)
    slopes : StateSlopes
        Derivatives by the design state at these design points.
    """

    model: ModelDefinition
    options: Mapping[str, str | int]
    columns: Columns
    slopes: StateSlopes

    @property
    def _count(self) -> int:
        return len(self.slopes.system.linear.K)

    def value(self, name: str) -> np.ndarray:
        """Values (m,) of a parameter."""
        return np.broadcast_to(np.asarray(self.columns[name], dtype=float), self._count)

    def step(self, name: str, change: float) -> StackedStep:
        """The finite change: `change` times the modulus of the value, or `change` if that is 0."""
        values = self.value(name)
        reference = np.where(values != 0, np.abs(values), 1.0)
        nothing = np.full(len(values), np.nan)
        return StackedStep(name, values, reference, change * reference, nothing)

    def _assembly(self, name: str, value: np.ndarray) -> tuple[StackedAssembly, Mapping[int, str]]:
        """Assemblies with other values (m,) of a parameter, and the reasons of points without."""
        columns = {**self.columns, name: value}
        assembly, failures = stacked_assembly(self.model, self.options, columns, self._count)
        return assembly, {i: message for i, (_, message) in failures.items()}

    def moved(self, name: str, value: np.ndarray) -> tuple[StackedSystem, np.ndarray]:
        """The changed design points, and matrices (m, n, n) from their coordinates to the old ones.

        Raises
        ------
        SquealstudyError
            No design point has a structure with these values.
        """
        assembly, failures = self._assembly(name, value)
        changed, system = structures_of(assembly), self.slopes.system
        outcomes = {i: (OVERFLOW, text) for i, text in failures.items()}
        changed_system = system_about_sliding(changed, system.operating, system.damping, outcomes)
        return changed_system, np.linalg.solve(system.structures.phi, changed.phi)

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def by(self, name: str) -> tuple[MatrixSlope | None, np.ndarray]:
        """Derivatives of the matrices by a parameter, and at which points (m,) they exist.

        They do not where an end of the difference has no structure, where geometry changes, or
        where a changed component mode turns. Solving such points one by one tells why.
        """
        system, values = self.slopes.system, self.value(name)
        step = RELATIVE_STEP * np.where(values != 0, np.abs(values), 1.0)
        parameter = next(p for p in self.model.parameters if p.name == name)
        minimum = 0.0 if parameter.positive else parameter.minimum
        low, high = np.where(values - step >= minimum, values - step, values), values + step
        try:
            (first, lost), (second, other) = (self._assembly(name, x) for x in (high, low))
        except SquealstudyError:
            return None, np.zeros(self._count, dtype=bool)
        good = np.ones(self._count, dtype=bool)
        good[[*lost, *other]] = False
        for rows in GEOMETRY:
            same = getattr(first, rows) == getattr(second, rows)
            good &= same.reshape(len(same), -1).all(axis=1)
        if has_own(first.own_friction):
            same = first.own_friction[..., STATE] == second.own_friction[..., STATE]
            good &= same.all(axis=1)
        width = high - low

        def slope(upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
            quotient: np.ndarray = (upper - lower) / width.reshape(-1, *[1] * (upper.ndim - 1))
            return quotient

        phi = system.structures.phi
        basis_T = phi.swapaxes(1, 2)

        def of(rows: str) -> np.ndarray:
            return slope(getattr(first, rows), getattr(second, rows))

        def projected(rows: str) -> np.ndarray:
            matrix: np.ndarray = basis_T @ of(rows) @ phi
            return matrix

        elastic, springs, static = (projected(x) for x in ("K", "springs", "static_springs"))
        damping = None if first.C is None or second.C is None else projected("C")
        if named := list(system.damping.named_coordinates):
            changed = [_changed_modes(a, system) for a in (first, second)]
            good &= _same_modes(first, changed[0].phi, changed[1].phi, named)
            elastic = elastic + slope(changed[0].stiffness, changed[1].stiffness)
            dampers = slope(changed[0].dampers, changed[1].dampers)
            damping = dampers if damping is None else damping + dampers
        sliding, p = self.slopes.sliding, system.sliding.pressure
        area, factor = (np.broadcast_to(of(x), p.shape) for x in ("area", "frictional"))
        loads = np.einsum("mij,mi->mj", phi, of("load")) * system.operating.pressure[:, None]
        loads = loads + np.einsum("mij,mi->mj", phi, of("constant_load"))
        dp, dkappa = self._by_springs(first, second, width)
        mu, by_speed, by_pressure = self._by_own_friction(first, second, width)
        force, s = area * p + sliding.area * dp, system.structures
        drag = sliding.frictional * force + factor * sliding.area * p
        drag = sliding.friction.mu * drag + sliding.frictional * sliding.area * p * mu
        unbalanced = np.einsum("mij,mj->mi", elastic + static, sliding.displacement) - loads
        unbalanced = unbalanced - _along(s.N, force) + _along(s.T, drag)
        by = ContactChange(
            area=area,
            frictional=factor,
            pressure=dp,
            tangent=dkappa,
            mu=mu,
            by_speed=by_speed,
            by_pressure=by_pressure,
        )
        opening = np.broadcast_to(of("gap0"), p.shape)
        gaps = sliding.gaps_by_forces(unbalanced) + sliding.gaps_by_opening(opening)
        contact = sliding.contact(gaps, by)
        shape = system.linear.K.shape
        mass = np.broadcast_to(projected("M"), shape)
        stiffness = np.broadcast_to(elastic + springs, shape)
        return matrix_slope(system, contact, stiffness, damping, mass), good

    def _by_springs(
        self, first: StackedAssembly, second: StackedAssembly, width: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (m, c) of pressure and tangent at fixed gaps, by numbers of the springs."""
        gap = self.slopes.system.sliding.gap
        changes = np.zeros((2, *gap.shape))
        if count := first.spring_points.shape[1]:
            e = gap[:, gap.shape[1] - count :]
            ends = [np.array(evaluate_springs(e, a.spring_points)) for a in (first, second)]
            changes[:, :, gap.shape[1] - count :] = (ends[0] - ends[1]) / width[:, None]
        return changes[0], changes[1]

    def _by_own_friction(
        self, first: StackedAssembly, second: StackedAssembly, width: np.ndarray
    ) -> np.ndarray:
        """Derivatives (3, m, c) of mu, dmu/ds, dmu/dp at fixed pressures, by own friction."""
        system, p = self.slopes.system, self.slopes.system.sliding.pressure
        if not has_own(first.own_friction):
            return np.zeros((3, *p.shape))
        ends = [
            system.operating.rubbing(p, a.speed_factor, a.own_friction) for a in (first, second)
        ]
        pairs = [np.stack([x.mu, x.by_speed, x.by_pressure]) for x in ends]
        change: np.ndarray = (pairs[0] - pairs[1]) / width[:, None]
        return change


def _along(rows: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """rows^T forces (m, n) of rows (m or 1, c, n) and forces (m, c)."""
    observed: np.ndarray = (rows.swapaxes(1, 2) @ forces[:, :, None])[:, :, 0]
    return observed


@dataclass(frozen=True, eq=False)
class _ChangedModes:
    """Changes of component modes' stiffness and their dampers (m, n, n), in the old coordinates."""

    phi: np.ndarray
    stiffness: np.ndarray
    dampers: np.ndarray


def _changed_modes(assembly: StackedAssembly, system: StackedSystem) -> _ChangedModes:
    """Changes by factors and damping ratios of component modes, of a changed structure."""
    changed, damping = structures_of(assembly), system.damping
    rows = changed.phi.swapaxes(1, 2) @ assembly.M @ system.structures.phi
    omega = np.sqrt(np.maximum(changed.k_el, 0.0))
    stiffness = (damping.scale**2 - 1.0) * changed.k_el
    dampers = 2.0 * damping.component_ratio * damping.scale * omega
    basis_T = rows.swapaxes(1, 2)
    return _ChangedModes(
        changed.phi,
        basis_T @ (stiffness[:, :, None] * rows),
        basis_T @ (dampers[:, :, None] * rows),
    )


def _same_modes(
    assembly: StackedAssembly, lower: np.ndarray, upper: np.ndarray, named: list[int]
) -> np.ndarray:
    """Whether (m or 1,) the changed component modes are the same at both ends of a step."""
    products = np.einsum("mik,mij,mjk->mk", lower, assembly.M, upper)
    same: np.ndarray = (np.abs(products[:, named]) >= SAME_MODE).all(axis=1)
    return same
