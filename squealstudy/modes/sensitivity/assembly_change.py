"""How an assembly's matrices change with a material, a spring or a load, on one mesh.

Central differences of the matrices that the model builds. Stiffness is linear in moduli and
spring stiffnesses, mass in densities: there the difference is exact but for round-off; Poisson
ratios and angles leave an error of the step squared, about 1e-8.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ParameterError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.linalg.sparse_qep import LowRankSum
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.system.design_state import DesignState, ModeKey
from squealstudy.system.linearise import unreduced_structure

RELATIVE_STEP = 1e-4  # of the parameter
SAME_MODE = 0.99  # least product of a component mode with itself across a step
Build = Callable[[Mapping[str, float]], Assembly]


@dataclass(frozen=True)
class AssemblyChange:
    """Derivatives of an assembly by one structural parameter.

    Attributes
    ----------
    mass : csr_matrix (n_dof, n_dof)
    stiffness, static_stiffness : LowRankSum (n_dof, n_dof)
        Components with their changed modes, and springs; `static_stiffness` as at rest.
    dampers : LowRankSum (n_dof, n_dof)
        Of component modes.
    load : ndarray (n_dof,)
        Nodal forces of a unit pressure, N/Pa, and
    constant_load : ndarray (n_dof,)
        those that are always there, N.
    area : ndarray (nc,)
        m2, of the contact points.
    """

    mass: sp.csr_matrix
    stiffness: LowRankSum
    static_stiffness: LowRankSum
    dampers: LowRankSum
    load: np.ndarray
    constant_load: np.ndarray
    area: np.ndarray


def assembly_change(
    build: Build, values: Mapping[str, float], name: str, state: DesignState, cutoff_hz: float
) -> AssemblyChange:
    """Derivative of the assembly by the parameter `name` at `values`.

    Raises
    ------
    ParameterError
        A parameter that moves the mesh or the contact; one that mixes a changed component mode.
    """
    step = RELATIVE_STEP * (abs(values[name]) or 1.0)
    ends = [build({**values, name: values[name] + sign * step}) for sign in (1.0, -1.0)]
    check_same_mesh(name, *ends)
    modes = [changed_modes(end, state, cutoff_hz) for end in ends]
    _check_same_modes(name, ends[0], modes[0], modes[1], state)
    own = [unreduced_structure(e, m, state) for e, m in zip(ends, modes, strict=True)]
    U = np.vstack([np.asarray(s.shapes) for s in own]).T

    def slope(of: Callable[[Assembly], sp.spmatrix | np.ndarray]) -> sp.spmatrix | np.ndarray:
        return (of(ends[0]) - of(ends[1])) / (2 * step)

    def by_shapes(
        values_of: Callable[[Mapping[ModeKey, float]], Mapping[ModeKey, float]],
    ) -> np.ndarray:
        parts = [
            np.broadcast_to(s.by_mode(values_of(s.frequencies))[1], len(s.places)) for s in own
        ]
        quotient: np.ndarray = np.concatenate([parts[0], -parts[1]]) / (2 * step)
        return quotient

    changed = by_shapes(state.stiffness_changes)
    elastic, empty = slope(lambda a: a.K_el), sp.csr_matrix((U.shape[0], U.shape[0]))
    springs, static = slope(lambda a: a.K_springs()), slope(lambda a: a.K_springs(static=True))
    return AssemblyChange(
        mass=slope(lambda a: a.M),
        stiffness=LowRankSum(elastic + springs, U, changed),
        static_stiffness=LowRankSum(elastic + static, U, changed),
        dampers=LowRankSum(empty, U, by_shapes(state.modal_dampers)),
        load=slope(lambda a: a.load),
        constant_load=slope(lambda a: a.constant_load),
        area=slope(lambda a: a.contact.area),
    )


def check_same_mesh(name: str, first: Assembly, second: Assembly) -> None:
    """Raise ParameterError where two assemblies differ in their mesh or contact observation."""
    same = first.n_dof == second.n_dof and all(
        np.array_equal(a.coordinates, b.coordinates)
        for a, b in zip(first.components, second.components, strict=True)
    )
    one, other = first.contact, second.contact
    same = same and all(
        _equal(getattr(one, rows), getattr(other, rows)) for rows in ("N", "T", "T_perp")
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
    wanted = {key[0] for key in (*state.frequency_scale, *state.mode_damping)}
    return {
        c.name: ComponentModes(*real_modes(c.M, c.K, cutoff_hz))
        for c in assembly.components
        if c.name in wanted
    }


def _check_same_modes(
    name: str,
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    others: Mapping[str, ComponentModes],
    state: DesignState,
) -> None:
    """The changed modes must be themselves on both ends of a step: pairs may turn."""
    masses = {c.name: c.M for c in assembly.components}
    for component, mode in {*state.frequency_scale, *state.mode_damping}:
        one, other = (m[component].phi[:, mode - 1] for m in (modes, others))
        if abs(one @ (masses[component] @ other)) < SAME_MODE:
            raise ParameterError(
                name,
                f"mode {mode} of {component}, whose frequency or damping this study changes, is "
                "one of a pair that turns with this parameter: it has no derivative",
            )
