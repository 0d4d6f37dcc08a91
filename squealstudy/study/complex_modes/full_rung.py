"""Design points solved at full order: the assembly of a structure is built once a worker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.analysis.full_order.solution import solve_full_order
from squealstudy.analysis.point import PointModes
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import BasisSettings, ComponentModes, component_modes
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.complex_modes.solve import solve_design
from squealstudy.study.design import Design
from squealstudy.study.family_cache import prepared_any
from squealstudy.study.tasks import PointTask

# by structure, and whether component modes go with it
_built: dict[tuple[str, bool], tuple[Assembly, Mapping[str, ComponentModes]]] = {}


@dataclass(frozen=True)
class FullRung:
    """What the unreduced model of a point is built from."""

    options: Mapping[str, str | int]
    settings: BasisSettings

    def solve(self, point: PointTask, band_hz: tuple[float, float]) -> PointModes:
        """Complex modes of a point at full order; a family's are so anyway."""
        prepared = prepared_any(point.prepared_key)
        if isinstance(prepared, PreparedFamily):
            return solve_design(prepared, point.design, band_hz)
        assembly, modes = self.assembly(point)
        cutoff = self.settings.damped_to
        return solve_full_order(prepared, assembly, modes, point.design.state(), band_hz, cutoff)

    def assembly(self, point: PointTask) -> tuple[Assembly, Mapping[str, ComponentModes]]:
        """The unreduced model of a point, and the component modes that its study may change."""
        key = point.prepared_key, bool(point.design.mode_parameters())
        if key not in _built:
            _built.clear()  # one structure at a time: an assembly is large
            assembly = point.design.model.build(self.options, point.design.plain_values())
            modes = changed_modes(point.design, assembly, self.settings)
            _built[key] = (assembly, modes)
        return _built[key]


def changed_modes(
    design: Design, assembly: Assembly, settings: BasisSettings
) -> Mapping[str, ComponentModes]:
    """Component modes, by component; none where the study changes none of them."""
    if not design.mode_parameters():
        return {}
    return component_modes(assembly, settings.component_cutoff)
