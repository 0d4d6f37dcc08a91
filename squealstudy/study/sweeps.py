"""What a study varies: each sweep with its levels, or its range for random designs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.study.parameters import StudyParameter, parse_parameter
from squealstudy.study.sections import DesignSection, Scale, StudyDefinition, SweepSection
from squealstudy.study.source import SourceText
from squealstudy.study.toml_lines import KeyPath

if TYPE_CHECKING:
    from squealstudy.models.parameter import ModelDefinition

RANDOM_DESIGNS = ("sobol", "latin_hypercube")


@dataclass(frozen=True)
class Sweep:
    """One swept parameter.

    Attributes
    ----------
    parameter : PlainParameter or ModeParameter
    values : tuple of float
        Levels in the order of the file; empty for random designs.
    low, high : float
        The range that is swept.
    scale : str
        ``linear`` or ``log``: how start to stop is divided or sampled.
    """

    parameter: StudyParameter
    values: tuple[float, ...]
    low: float
    high: float
    scale: Scale

    @property
    def name(self) -> str:
        """The parameter's name as the user wrote it."""
        return self.parameter.name


def resolve_sweeps(
    definition: StudyDefinition, model: ModelDefinition, source: SourceText
) -> tuple[Sweep, ...]:
    """Sweeps with their parameters and levels.

    Raises
    ------
    StudyFileError
        An unknown or repeated parameter, a value it cannot take, no levels, levels that repeat,
        keys that do not go together, or a design that does not fit the sweeps.
    """
    design = definition.design
    sweeps: list[Sweep] = []
    for i, section in enumerate(definition.sweep):
        sweep = _SweepReader(section, design, model, source, ("sweep", i)).read()
        if sweep.name in [s.name for s in sweeps]:
            raise source.error(("sweep", i, "parameter"), f"'{sweep.name}' is swept twice")
        sweeps.append(sweep)
    _check_design(design, sweeps, source)
    if design.type == "zip":
        _check_zip(definition.sweep, sweeps, source)
    return tuple(sweeps)


def _check_design(design: DesignSection, sweeps: list[Sweep], source: SourceText) -> None:
    random = design.type in RANDOM_DESIGNS
    if random and not sweeps:
        raise source.error(
            ("design", "type"), f"a {design.type} design needs at least one [[sweep]]"
        )
    if random and design.samples is None:
        raise source.error(
            ("design", "samples"),
            f"the key 'samples' is missing: number of points of a {design.type} design",
        )
    for key in ("samples", "seed"):
        if not random and key in design.model_fields_set:
            raise source.error(
                ("design", key),
                f"only {' and '.join(RANDOM_DESIGNS)} designs have '{key}', not {design.type}",
            )


def _check_zip(sections: tuple[SweepSection, ...], sweeps: list[Sweep], source: SourceText) -> None:
    """Equal lengths, and no point twice."""
    for i, sweep in enumerate(sweeps):
        if len(sweep.values) != len(sweeps[0].values):
            raise source.error(
                ("sweep", i, "num" if sections[i].values is None else "values"),
                f"zip takes sweeps of equal length: '{sweep.name}' has {len(sweep.values)} values, "
                f"'{sweeps[0].name}' has {len(sweeps[0].values)}",
            )
    points = list(zip(*(s.values for s in sweeps), strict=True))
    if len(set(points)) < len(points):
        raise source.error(("design", "type"), "a point of this zip design appears twice")


@dataclass(frozen=True)
class _SweepReader:
    """One [[sweep]] table, and all that its meaning depends on."""

    section: SweepSection
    design: DesignSection
    model: ModelDefinition
    source: SourceText
    keys: KeyPath

    def read(self) -> Sweep:
        self._check_keys()
        try:
            parameter = parse_parameter(self.section.parameter, self.model)
        except ParameterError as e:
            raise self.source.error((*self.keys, "parameter"), e.message) from None
        listed = self.section.values is not None
        values = self._listed(parameter) if listed else self._range(parameter)
        low, high = min(values), max(values)
        if self.design.type in RANDOM_DESIGNS:
            values = ()
        elif self.design.type == "grid" and len(set(values)) < len(values):
            key = "values" if listed else "stop"
            raise self._error(key, "a value appears twice: a grid would repeat its points")
        return Sweep(parameter, values, low, high, self.section.scale)

    def _check_keys(self) -> None:
        """The keys given are those of a list, of a divided range, or of a range to sample."""
        random = self.design.type in RANDOM_DESIGNS
        given = self.section.model_fields_set
        if "values" in given and random:
            raise self._error(
                "values", f"a {self.design.type} design samples a range: give start and stop"
            )
        if "num" in given and random:
            raise self._error("num", "'samples' in [design] counts the points of a random design")
        if "values" in given:
            for key in ("start", "stop", "num", "scale"):
                if key in given:
                    raise self._error(key, f"give either values or start, stop and num; not {key}")
            return
        wanted = ("start", "stop") if random else ("start", "stop", "num")
        missing = [key for key in wanted if key not in given]
        if missing and not given & set(wanted):
            choice = "start and stop" if random else "values, or start, stop and num"
            raise self._error("", f"the sweep is empty: give {choice}")
        if missing:
            raise self._error(missing[0], f"the key '{missing[0]}' of a swept range is missing")

    def _listed(self, parameter: StudyParameter) -> tuple[float, ...]:
        values = self.section.values or ()
        if not values:
            raise self._error("values", "expected at least one value, got an empty list")
        return tuple(self._checked(parameter, v, ("values", i)) for i, v in enumerate(values))

    def _range(self, parameter: StudyParameter) -> tuple[float, ...]:
        """The levels from start to stop; these two alone where the design is random."""
        section = self.section
        start = self._checked(parameter, section.start, ("start",))
        stop = self._checked(parameter, section.stop, ("stop",))
        if section.scale == "log" and min(start, stop) <= 0:
            key = "start" if start <= 0 else "stop"
            raise self._error(key, f"a log scale needs values above 0, got {min(start, stop):g}")
        if section.num == 1:
            return (start,)
        if start == stop or not math.isfinite(stop - start):
            what = "the same as start" if start == stop else "too far from start"
            raise self._error("stop", f"{what}: nothing to divide")
        if self.design.type in RANDOM_DESIGNS or section.num is None:
            return (start, stop)
        return levels(start, stop, section.num, section.scale)

    def _checked(self, parameter: StudyParameter, value: float | None, key: KeyPath) -> float:
        try:
            return parameter.check(math.nan if value is None else value)
        except ParameterError as e:
            raise self.source.error((*self.keys, *key), f"{parameter.name}: {e.message}") from None

    def _error(self, key: str, message: str) -> StudyFileError:
        return self.source.error((*self.keys, key) if key else self.keys, message)


def levels(start: float, stop: float, num: int, scale: Scale) -> tuple[float, ...]:
    """`num` >= 2 values from start to stop, both exactly in; equally spaced, or in their logarithm.

    The values between are rounded far below their spacing, so that two sweeps over different
    ranges share the values they have in common.
    """
    if scale == "log":
        a, b = math.log10(start), math.log10(stop)
        inner = [float(f"{10 ** (a + (b - a) * i / (num - 1)):.12g}") for i in range(1, num - 1)]
    else:
        step = (stop - start) / (num - 1)
        digits = 9 - math.floor(math.log10(abs(step))) if step else 0
        inner = [round(start + step * i, digits) for i in range(1, num - 1)]
    return (start, *inner, stop)
