"""Reductions of the structures of design points, the last of which stay in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.errors import ConvergenceError, ModelError, ParameterError
from squealstudy.mechanics.basis import Basis
from squealstudy.mechanics.defaults import MODE_TOLERANCE
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.pairs import PointPairs, point_pairs
from squealstudy.mechanics.reduction import Reduction, reduced
from squealstudy.mechanics.values import Values
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import (
    CONTACT_OPTION,
    FRICTION_OPTION,
    PRESSURE,
    ModeKey,
    OperatingPoint,
    contact_parameters,
)
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.parameter_names import FREQUENCY_SCALE
from squealstudy.modes.judged_roots import light_or_growing

LAW_OPTIONS = (CONTACT_OPTION.name, FRICTION_OPTION.name)  # they change no structure
# reductions of meshed models in memory: some 100 MB each of a medium brake
MAX_MESHED_REDUCTIONS = 4
N_CHECKED_POINTS = 8  # design points at which the error of a basis is looked at
MAX_SMALL_REDUCTIONS = 64  # reductions of other models in memory: a kilobyte each
Memory = OrderedDict[Hashable, tuple[ModelDefinition, Reduction]]
_meshed_reductions: Memory = OrderedDict()
_small_reductions: Memory = OrderedDict()


@dataclass(frozen=True, eq=False)
class Structures:
    """How the structures of some design points are reduced.

    Attributes
    ----------
    values : Values
        Values of the design points.
    nominal : ModelPoint
        The model with none of its parameters varied. Bases are made at its operating point, or at
        that of a design point where it has no steady sliding (`sliding`).
    basis : Basis
    improved : bool
        Whether a basis is enriched once more where its error exceeds the tolerance of modes.
    """

    values: Values
    nominal: ModelPoint
    basis: Basis
    improved: bool = True
    _rounds: dict[int, int] = field(default_factory=dict, repr=False)
    _tried: dict[Hashable, PointPairs] = field(default_factory=dict, repr=False)
    _sliding: list[ModelPoint] = field(default_factory=list, repr=False)

    def reduction(self, first: ModelPoint, point_numbers: np.ndarray) -> Reduction:
        """Reduction of the structure with this first design point and these numbers of its points.

        Raises
        ------
        ConvergenceError
            Where there is no steady sliding, neither at `nominal` nor at the structure's design
            points that are tried.
        ModelError
            Where the geometry cannot be built, or for a family of matrices.
        ParameterError
            Where the basis does not hold a component mode.
        """
        if isinstance(first.model, FamilyDefinition):
            raise ModelError("a family of matrices has neither contact nor components to reduce")
        chosen = point_numbers[
            np.unique(np.linspace(0, len(point_numbers) - 1, N_CHECKED_POINTS).astype(int))
        ]
        refusals: list[ConvergenceError] = []
        for point in (self.nominal, *(self.values.point(int(i)) for i in chosen)):
            self._sliding[:] = [point]
            try:
                meshed = first.model.meshed
                reduction = self._meshed(first, point_numbers) if meshed else self._small(first)
            except ConvergenceError as error:
                refusals.append(error)
                continue
            _check_modes(first, reduction)
            return reduction
        raise refusals[1]  # the error of the first design point

    @property
    def sliding(self) -> ModelPoint:
        """Where the last reduction was made: `nominal`, or the design point in its place."""
        return self._sliding[0] if self._sliding else self.nominal

    @property
    def _nominal(self) -> OperatingPoint:
        return self.sliding.operating_point()

    def _small(self, first: ModelPoint) -> Reduction:
        """Reduction of a model without a mesh, on a complete basis.

        It is kept in memory unless structural parameters vary over the design points.
        """
        varied = self.values.varied.keys() & first.structural_values().keys()
        key = () if varied else self._identity(first)
        if key not in _small_reductions:
            reduction = reduced(first.assembly(), self._nominal, self.basis.settings(False))
            if varied:  # none of many structures is asked for again
                return reduction
            _small_reductions[key] = first.model, reduction
        return _recalled(_small_reductions, key, MAX_SMALL_REDUCTIONS)

    def _meshed(self, first: ModelPoint, point_numbers: np.ndarray) -> Reduction:
        """Reduction of a meshed model, enriched once more where its error exceeds the tolerance.

        The error is looked at only if `improved`, and if the basis tells it.
        """
        once = int(self.basis.enrichment and self.basis.residual_responses)
        number = int(point_numbers[0])
        if number not in self._rounds:
            self._rounds[number] = once
            reduction = self._made(first, once)
            chosen = point_numbers[
                np.unique(np.linspace(0, len(point_numbers) - 1, N_CHECKED_POINTS).astype(int))
            ]
            looked_at = chosen if self.improved and self.basis.tells_error else ()
            if any(self._error(reduction, int(i)) > MODE_TOLERANCE for i in looked_at):
                self._rounds[number] = once + 1
                self._tried.clear()
        return self._made(first, self._rounds[number])

    def pairs(self, point: ModelPoint, reduction: Reduction) -> PointPairs:
        """Complex modes of a design point in the basis' band, with errors where it tells them."""
        tried = self._tried.pop(_values_key(point), None)
        return tried or point_pairs(point, reduction, self.basis.band_hz, self.basis.tells_error)

    def _error(self, reduction: Reduction, number: int) -> float:
        """Largest relative error that the reduction makes in a point's light or growing modes.

        0 where there are no such modes, or the point fails.
        """
        point = self.values.point(number)
        try:
            modes = point_pairs(point, reduction, self.basis.band_hz, True)
        except FAILURES:
            return 0.0
        self._tried[_values_key(point)] = modes
        relative = np.nan_to_num(modes.error_reduction) / np.abs(modes.lam)
        return float(relative[light_or_growing(modes.lam)].max(initial=0.0))

    def _made(self, first: ModelPoint, enriching: int) -> Reduction:
        """The reduction with so many enrichments, from memory or made now."""
        key = (*self._identity(first), enriching)
        if key not in _meshed_reductions:
            with threadpool_limits(1):  # as in studies, where threads are left to the factors
                reduction = reduced(
                    first.assembly(),
                    self._nominal,
                    self.basis.settings(True),
                    self.training(),
                    self.basis.band_hz[1] if self._judged else None,
                    self.scales() if self._judged else (),
                    enriching,
                )
            _meshed_reductions[key] = first.model, reduction
        return _recalled(_meshed_reductions, key, MAX_MESHED_REDUCTIONS)

    @property
    def _judged(self) -> bool:
        return self.basis.tells_error or self.basis.residual_responses

    def _identity(self, first: ModelPoint) -> tuple[Hashable, ...]:
        """All that decides a reduction; a model file is identified by its content."""
        model = first.model
        files = (model.files, model.added) if isinstance(model, FileDefinition) else id(model)
        options = {k: v for k, v in first.options.items() if k not in LAW_OPTIONS}
        scales = tuple(tuple(sorted(scale.items())) for scale in self.scales())
        points = tuple(map(_operating_identity, (self._nominal, *self.training())))
        return (
            str(files),
            tuple(sorted(options.items())),
            tuple(first.structural_values().items()),
            points,
            scales,
            self.basis.identity,
        )

    def training(self) -> tuple[OperatingPoint, ...]:
        """Operating points at the ends of pressure and contact-law ranges, the rest nominal."""
        if not self.basis.enrichment:
            return ()
        names = (PRESSURE.name, *(p.name for p in contact_parameters()))
        trained = []
        for name in (n for n in self.values.columns if n in names):
            for end in sorted(set(self._varied_ends(name))):
                other = replace(self.sliding, values={**self.sliding.values, name: end})
                trained.append(other.operating_point())
        return tuple(trained)

    def _varied_ends(self, name: str) -> tuple[float, ...]:
        """Ends of the range of a structural parameter that the basis must serve; () if constant."""
        x, basis_range = self.values.columns[name], self.basis.ranges.get(name)
        if basis_range is None and not isinstance(x, np.ndarray) and x == self.nominal.values[name]:
            return ()
        low, high = self.values.ends(name)
        return (
            (low, high)
            if basis_range is None
            else (min(low, basis_range[0]), max(high, basis_range[1]))
        )

    def scales(self) -> tuple[Mapping[ModeKey, float], ...]:
        """Factors on component frequencies: all at their least, then all at their largest."""
        first = self.values.point(0)
        swept = [p for p in first.mode_parameters() if p.quantity == FREQUENCY_SCALE]
        extremes: list[Mapping[ModeKey, float]] = []
        for end, extreme in ((0, min), (1, max)):
            scale: dict[ModeKey, float] = {}
            for p in swept:
                factor_end = self.values.ends(p.name)[end]
                if p.name in self.basis.ranges:
                    factor_end = extreme(factor_end, self.basis.ranges[p.name][end])
                scale |= {(p.component, mode): factor_end for mode in p.modes}
            if any(factor != 1.0 for factor in scale.values()) and scale not in extremes:
                extremes.append(scale)
        return tuple(extremes)


def _operating_identity(point: OperatingPoint) -> tuple[Hashable, ...]:
    laws = (point.law.kind, *point.law.parameters, point.law.definition.source)
    curve = (point.curve.kind, point.curve.definition.source)
    return (*point.sliding_friction, point.brake_pressure, *laws, *curve)


def _recalled(memory: Memory, key: Hashable, max_entries: int) -> Reduction:
    """An entry of a memory, from which those that were not asked for longest are removed."""
    memory.move_to_end(key)
    while len(memory) > max_entries:
        memory.popitem(last=False)
    return memory[key][1]


def _values_key(point: ModelPoint) -> Hashable:
    return tuple(point.values.values())


def _check_modes(point: ModelPoint, reduction: Reduction) -> None:
    """Raise ParameterError where a component mode in use is not in the basis."""
    counts = reduction.prepared.model.mode_counts
    for parameter in point.mode_parameters():
        if (highest := max(parameter.modes)) > (count := counts[parameter.component]):
            where = f" up to {reduction.settings.component_cutoff:g} Hz in this basis"
            up_to = where if point.model.meshed else ""
            text = f"{parameter.component} has modes 1 to {count}{up_to}, got mode {highest}"
            raise ParameterError(parameter.name, text)


def forget() -> None:
    """Remove all reductions from memory; those still in use elsewhere stay there."""
    _meshed_reductions.clear()
    _small_reductions.clear()
