"""A design point at full order: its pencil about a known working point, and its statics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.analysis.full_order.modes import (
    FullOrderSystem,
    component_terms,
    full_order_system,
    mode_frequencies,
)
from squealstudy.analysis.sensitivity.assembly_change import changed_modes
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.linalg.sparse_qep import LowRankSum, WoodburyFactor
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.working_point import WorkingPoint, working_point
from squealstudy.system.design_state import DesignState


@dataclass(frozen=True)
class FullOrderPoint:
    """The unreduced assembly of a design point.

    Attributes
    ----------
    modes : mapping of component -> ComponentModes
        Of the components whose modes the state changes.
    pencil : QuadraticPencil
        About `point`.
    """

    assembly: Assembly
    state: DesignState
    modes: Mapping[str, ComponentModes]
    point: WorkingPoint
    system: FullOrderSystem
    pencil: QuadraticPencil

    @classmethod
    def at(
        cls,
        assembly: Assembly,
        state: DesignState,
        point: WorkingPoint,
        component_cutoff_hz: float,
        damped_to_hz: float,
    ) -> FullOrderPoint:
        """The pencil about a working point that is known; errors of `full_order_system`."""
        modes = changed_modes(assembly, state, component_cutoff_hz)
        system = full_order_system(assembly, modes, point, state, damped_to_hz)
        pencil = QuadraticPencil(assembly.M, system.C, system.K)
        return cls(assembly, state, modes, point, system, pencil)

    @property
    def mode_stiffness(self) -> tuple[np.ndarray, np.ndarray]:
        """U (n_dof, m) and d (m,) of the stiffness that changed component modes add."""
        changes = self.state.stiffness_changes(mode_frequencies(self.modes))
        return component_terms(self.assembly, self.modes, changes)

    def static_factor(self, k_c: float) -> WoodburyFactor:
        """K0 = K_static + k_c N^T A N with the changed component modes, factorised."""
        c = self.assembly.contact
        K0 = self.assembly.K_el + self.assembly.K_springs(static=True)
        K0 = K0 + k_c * (c.N.T @ sp.diags(c.area) @ c.N)
        return WoodburyFactor(LowRankSum(K0, *self.mode_stiffness))


def solved_full_order_point(
    assembly: Assembly,
    state: DesignState,
    k_c: float,
    start: np.ndarray,
    component_cutoff_hz: float,
    damped_to_hz: float,
) -> FullOrderPoint:
    """A design point of a new structure, from its working point on.

    Parameters
    ----------
    k_c : float
        Contact stiffness per area of the contact space, Pa/m.
    start : ndarray (nc,)
        Gaps from which Newton starts.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    modes = changed_modes(assembly, state, component_cutoff_hz)
    U, d = component_terms(assembly, modes, state.stiffness_changes(mode_frequencies(modes)))
    space = contact_space(assembly, k_c, U).changed(dict(enumerate(d.tolist())))
    point = working_point(space, state.operating, start)
    return FullOrderPoint.at(assembly, state, point, component_cutoff_hz, damped_to_hz)
