"""The unreduced model of a structure: its assembly is built once a worker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.analysis.full_order.solution import solve_full_order
from squealstudy.analysis.point import PointModes
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import BasisSettings, ComponentModes, component_modes
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.design import Design

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
        self, prepared: PreparedModel, design: Design, band_hz: tuple[float, float]
    ) -> PointModes:
        """Complex modes of a design point at full order; ConvergenceError."""
        assembly, modes = self.assembly(design)
        cutoff = self.settings.damped_to
        return solve_full_order(prepared, assembly, modes, design.state(), band_hz, cutoff)

    def assembly(self, design: Design) -> tuple[Assembly, Mapping[str, ComponentModes]]:
        """The unreduced model, and the component modes, by component, that its study may change."""
        changed = bool(design.mode_parameters())
        key = self.key, changed
        if key not in _built:
            _built.clear()  # one structure at a time: an assembly is large
            assembly = design.model.build(self.options, design.plain_values())
            cutoff = self.settings.component_cutoff
            _built[key] = (assembly, component_modes(assembly, cutoff) if changed else {})
        return _built[key]
