"""The unreduced model of a structure: its assembly is built once a worker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.engine.cache import Prepared
from squealstudy.models.assembly import Assembly
from squealstudy.modes.full_order.modes import full_order_modes, solve_family_point
from squealstudy.modes.point import PointModes
from squealstudy.reduction.cmt import BasisSettings, ComponentModes, component_modes
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.design import DesignPoint

# by structure, and whether component modes go with it
_built: dict[tuple[str, bool], tuple[Assembly, Mapping[str, ComponentModes]]] = {}


@dataclass(frozen=True)
class Unreduced:
    """What the unreduced model of a structure is built from.

    Attributes
    ----------
    key : str
        Of the structure.
    options : mapping of name -> str or int
        Of the model.
    settings : BasisSettings
        Of the reduction: which real modes have modal damping of their own.
    """

    key: str
    options: Mapping[str, str | int]
    settings: BasisSettings

    def solve(
        self,
        prepared: Prepared,
        design: DesignPoint,
        band_hz: tuple[float, float],
        check: bool = False,
    ) -> PointModes:
        """Complex modes of a design point at full order; ConvergenceError.

        With `check` those that others are held against: a family's own modes are of full order, and
        are checked by another factorisation.
        """
        if isinstance(prepared, PreparedFamily):
            return solve_family_point(prepared, design.plain_values(), band_hz, check)
        assembly, modes = self.assembly(design)
        cutoff = self.settings.damped_to
        return full_order_modes(prepared, assembly, modes, design.state(), band_hz, cutoff)

    def assembly(self, design: DesignPoint) -> tuple[Assembly, Mapping[str, ComponentModes]]:
        """The unreduced model, and the component modes, by component, that its study may change."""
        changed = bool(design.mode_parameters())
        key = self.key, changed
        if key not in _built:
            _built.clear()  # one structure at a time: an assembly is large
            assembly = design.model.build(self.options, design.plain_values())
            cutoff = self.settings.component_cutoff
            _built[key] = (assembly, component_modes(assembly, cutoff) if changed else {})
        return _built[key]
