"""Sweeps of a study, each with its levels or its range, and the design over them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.models.parameter_names import StudyParameter, parse_parameter
from squealstudy.models.units import CELSIUS, ZERO_CELSIUS
from squealstudy.study.design_sections import MOST_POINTS, DesignSection, Scale, SweepSection
from squealstudy.study.distributions import DISPLAY_TAIL_PROBABILITY, KEYS, UNIFORM, Distribution
from squealstudy.study.kinds import model_kind
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import KeyPath

if TYPE_CHECKING:
    from squealstudy.models.parameter import ModelDefinition


SOBOL_INDICES = "sobol_indices"
RANDOM_DESIGNS = ("sobol", "latin_hypercube", SOBOL_INDICES)
BOUNDARY = "boundary"
LEAST_GROUPS = 8  # least number of base points of sobol_indices: fewer tell nothing
LEAST_SWEEPS = {"sobol": 1, "latin_hypercube": 1, "sobol_indices": 2, BOUNDARY: 1}
MOST_BOUNDARY_SWEEPS = 3
MOST_NODES = 1_000_000  # nodes of a boundary design's full grid, all of which its map holds
DISTRIBUTION_KEYS = ("distribution", "mean", "std", "median", "sigma")


@dataclass(frozen=True)
class Sweep:
    """One swept parameter with its values or its range.

    Attributes
    ----------
    parameter : PlainParameter or ModeParameter
    values : tuple of float
        Levels in the order of the file; empty for random designs. A boundary design has those of
        its coarse grid.
    low, high : float
        Ends of the swept range; for random designs those of `Distribution.range`.
    scale : str
        How the range is divided or sampled, ``linear`` or ``log``; ``log`` for lognormal.
    distribution : Distribution or None
        Distribution of the values in a random design; None in others.
    """

    parameter: StudyParameter
    values: tuple[float, ...]
    low: float
    high: float
    scale: Scale
    distribution: Distribution | None = None

    @property
    def name(self) -> str:
        """The parameter's name as the user wrote it."""
        return self.parameter.name

    def halved(self, times: int) -> tuple[float, ...]:
        """All levels of a boundary design: each step between `values` is halved so many times."""
        n = (len(self.values) - 1) * 2**times + 1
        return levels(self.values[0], self.values[-1], n, self.scale, zero=zero_of(self.parameter))


def resolve_sweeps(
    definition: StudyDefinition, model: ModelDefinition, source: SourceText
) -> tuple[Sweep, ...]:
    """Sweeps with their parameters and levels.

    Raises
    ------
    StudyFileError
        Where a parameter is unknown, repeated or cannot take a value, levels are missing or repeat,
        keys do not go together, or the design does not fit the sweeps.
    """
    design = definition.design
    sweeps: list[Sweep] = []
    for i, section in enumerate(definition.sweep):
        sweep = read_sweep(section, design, model, source, ("sweep", i))
        if sweep.name in [s.name for s in sweeps]:
            raise source.error(("sweep", i, "parameter"), f"'{sweep.name}' is swept twice")
        sweeps.append(sweep)
    check_design(definition, sweeps, source)
    return tuple(sweeps)


def read_sweep(
    section: SweepSection,
    design: DesignSection,
    model: ModelDefinition,
    source: SourceText,
    keys: KeyPath,
) -> Sweep:
    """Read the sweep of a table like [[sweep]], at `keys` of the file; StudyFileError."""
    return _SweepReader(section, design, model, source, keys).read()


@dataclass(frozen=True)
class _SweepReader:
    """One [[sweep]] table, and all that its meaning depends on."""

    section: SweepSection
    design: DesignSection
    model: ModelDefinition
    source: SourceText
    keys: KeyPath

    def read(self) -> Sweep:
        """The sweep of a section; StudyFileError for a fault in it."""
        self._check_keys()
        try:
            parameter = parse_parameter(self.section.parameter, self.model)
        except ParameterError as e:
            raise self.source.error((*self.keys, "parameter"), e.message) from None
        if self.design.type in RANDOM_DESIGNS:
            return self._random(parameter)
        listed = self.section.values is not None
        values = self._listed(parameter) if listed else self._range(parameter)
        low, high = min(values), max(values)
        if self.design.type in ("grid", BOUNDARY) and len(set(values)) < len(values):
            key = "values" if listed else "stop"
            raise self._error(key, "a value appears twice: a grid would repeat its points")
        self._check_range(parameter, low, high, "values" if listed else "stop")
        return Sweep(parameter, values, low, high, self.section.scale)

    def _random(self, parameter: StudyParameter) -> Sweep:
        """A sweep with a distribution, whose tails must be values that the parameter can take."""
        section, name = self.section, self.section.distribution
        start, stop = -math.inf, math.inf
        if "start" in KEYS[name]:
            ends = self._range(parameter)
            start, stop = min(ends), max(ends)
        mean, std = (getattr(section, k) for k in KEYS[name][:2])
        scale: Scale = "log" if name == "lognormal" else section.scale
        distribution = (
            Distribution(name, start=start, stop=stop, scale=scale, zero=zero_of(parameter))
            if name == UNIFORM
            else Distribution(name, mean, std, start, stop, scale, zero_of(parameter))
        )
        low, high = distribution.range
        for end in (low, high):
            try:
                parameter.check(end)
            except ParameterError as e:
                raise self._error(
                    "distribution",
                    f"{parameter.name}: {beyond_range_text(distribution, e.message)}",
                ) from None
        self._check_range(parameter, low, high, "distribution" if start == -math.inf else "stop")
        return Sweep(parameter, (), low, high, scale, distribution)

    def _check_range(self, parameter: StudyParameter, low: float, high: float, key: str) -> None:
        try:
            parameter.check_range(low, high)
        except ParameterError as e:
            raise self._error(key, f"{parameter.name} {e.message}") from None

    def _check_keys(self) -> None:
        """Check that the keys given are those of a list, a divided range, or a distribution."""
        keys = self.section.model_fields_set
        if self.design.type in RANDOM_DESIGNS:
            self._check_random_keys(keys)
            return
        for key in DISTRIBUTION_KEYS:
            if key in keys:
                designs = ", ".join(RANDOM_DESIGNS)
                raise self._error(key, f"only {designs} designs have '{key}'")
        if "values" in keys and self.design.type == BOUNDARY:
            raise self._error("values", "a boundary design halves a range: give start, stop, num")
        if "values" in keys:
            for key in ("start", "stop", "num", "scale"):
                if key in keys:
                    raise self._error(key, f"give either values or start, stop and num; not {key}")
            return
        choice = "start, stop and num"
        choice = choice if self.design.type == BOUNDARY else f"values, or {choice}"
        self._check_present(("start", "stop", "num"), choice)
        if self.design.type == BOUNDARY and self.section.num == 1:
            raise self._error("num", "expected at least 2 in a boundary design, got 1")

    def _check_random_keys(self, keys: set[str]) -> None:
        """Check that the keys given are all those of the distribution, and no others."""
        kind, name = self.design.type, self.section.distribution
        if "values" in keys:
            raise self._error("values", f"a {kind} design samples a range: give start and stop")
        if "num" in keys:
            raise self._error("num", "'samples' in [design] counts the points of a random design")
        needed = KEYS[name]
        self._check_present(needed, " and ".join(needed))
        allowed = {"parameter", "distribution", *needed, *(["scale"] if name == UNIFORM else [])}
        for key in SweepSection.model_fields:
            if key in keys and key not in allowed:
                hint = "; truncated_normal has ends" if key in ("start", "stop") else ""
                raise self._error(
                    key, f"a {name} distribution has {' and '.join(needed)}, not '{key}'{hint}"
                )

    def _check_present(self, needed: tuple[str, ...], choice: str) -> None:
        """Raise StudyFileError for a key that a range or distribution lacks."""
        keys = self.section.model_fields_set
        missing = [key for key in needed if key not in keys]
        if missing and not keys & set(needed):
            raise self._error("", f"the sweep is empty: give {choice}")
        if missing:
            what = "a swept range" if self.section.distribution == UNIFORM else "the distribution"
            raise self._error(missing[0], f"the key '{missing[0]}' of {what} is missing")

    def _listed(self, parameter: StudyParameter) -> tuple[float, ...]:
        values = self.section.values or ()
        if not values:
            raise self._error("values", "expected at least one value, got an empty list")
        return tuple(self._checked(parameter, v, ("values", i)) for i, v in enumerate(values))

    def _range(self, parameter: StudyParameter) -> tuple[float, ...]:
        """The levels from start to stop; only these two where the design is random."""
        section = self.section
        start = self._checked(parameter, section.start, ("start",))
        stop = self._checked(parameter, section.stop, ("stop",))
        zero = zero_of(parameter)
        if section.scale == "log" and min(start, stop) <= zero:
            key = "start" if start <= zero else "stop"
            raise self._error(key, f"a log scale needs values above 0, got {min(start, stop):g}")
        if section.num == 1:
            return (start,)
        if start == stop or not math.isfinite(stop - start):
            what = "the same as start" if start == stop else "too far from start"
            raise self._error("stop", f"{what}: nothing to divide")
        if self.design.type in RANDOM_DESIGNS or section.num is None:
            return (start, stop)
        # the coarse grid of a boundary design: every 2^levels-th value of the full grid, so that
        # both have the same rounded values
        every = 2**self.design.levels if self.design.type == BOUNDARY else 1
        return levels(start, stop, (section.num - 1) * every + 1, section.scale, every, zero)

    def _checked(self, parameter: StudyParameter, value: float | None, key: KeyPath) -> float:
        try:
            return parameter.check(math.nan if value is None else value)
        except ParameterError as e:
            raise self.source.error((*self.keys, *key), f"{parameter.name}: {e.message}") from None

    def _error(self, key: str, message: str) -> StudyFileError:
        return self.source.error((*self.keys, key) if key else self.keys, message)


def beyond_range_text(distribution: Distribution, message: str) -> str:
    """The message that a distribution has values which the parameter cannot take."""
    advice = (
        "" if distribution.bounded else "; distribution = 'truncated_normal' has start and stop"
    )
    tails = (
        "" if distribution.bounded else f" in its tails of probability {DISPLAY_TAIL_PROBABILITY:g}"
    )
    return f"the {distribution.name} distribution has such values{tails}: {message}{advice}"


def zero_of(parameter: StudyParameter) -> float:
    """Value of a parameter at which its quantity vanishes: -273.15 of a temperature in degC."""
    return -float(ZERO_CELSIUS) if parameter.unit in CELSIUS else 0.0


def levels(
    start: float, stop: float, num: int, scale: Scale, every: int = 1, zero: float = 0.0
) -> tuple[float, ...]:
    """`num` >= 2 values from start to stop, equally spaced themselves or in their logarithm.

    Start and stop are exact. Values between are rounded to far less than their spacing, so that
    they are the same in sweeps over different ranges. With `every`, a divisor of num - 1, only each
    `every`-th value is returned. Logarithms are taken of the distance from `zero` (`zero_of`).
    """
    indices = range(every, num - 1, every)
    if scale == "log":
        a, b = math.log10(start - zero), math.log10(stop - zero)
        step = abs(math.expm1((b - a) / (num - 1) * math.log(10)))
        digits = min(max(12, 9 - math.floor(math.log10(step))), 17) if step else 17
        inner = [float(f"{10 ** (a + (b - a) * i / (num - 1)):.{digits}g}") for i in indices]
        inner = [round(x + zero, digits - 3) for x in inner] if zero else inner
    else:
        step = (stop - start) / (num - 1)
        digits = 9 - math.floor(math.log10(abs(step))) if step else 0
        inner = [round(start + step * i, digits) for i in indices]
    return (start, *inner, stop)


def check_design(definition: StudyDefinition, sweeps: Sequence[Sweep], source: SourceText) -> None:
    """Raise StudyFileError where the design does not fit its sweeps, or has keys of other types."""
    design = definition.design
    random = design.type in RANDOM_DESIGNS
    min_sweeps = LEAST_SWEEPS.get(design.type, 0)
    if len(sweeps) < min_sweeps:
        needed = "one [[sweep]]" if min_sweeps == 1 else "two [[sweep]] tables"
        raise source.error(("design", "type"), f"a {design.type} design needs at least {needed}")
    if random and design.samples is None:
        raise source.error(
            ("design", "samples"),
            f"the key 'samples' is missing: number of points of a {design.type} design",
        )
    for key in ("samples", "seed"):
        if not random and key in design.model_fields_set:
            raise source.error(
                ("design", key),
                f"only {', '.join(RANDOM_DESIGNS)} designs have '{key}', not {design.type}",
            )
    if "levels" in design.model_fields_set and design.type != BOUNDARY:
        raise source.error(
            ("design", "levels"), f"only boundary designs have 'levels', not {design.type}"
        )
    n = design.samples or 1
    if design.type == "sobol_indices" and (n < LEAST_GROUPS or n & (n - 1)):
        below = max(LEAST_GROUPS, 1 << (n.bit_length() - 1))
        raise source.error(
            ("design", "samples"),
            f"expected a power of two from {LEAST_GROUPS} on, such as {below} or {2 * below}, "
            f"got {n}",
        )
    groups = len(sweeps) + 2 if design.type == SOBOL_INDICES else 1
    points = n * groups if random else math.prod(len(s.values) for s in sweeps)
    if points > MOST_POINTS and design.type != "zip":
        raise source.error(
            ("design", "samples") if random else ("sweep",),
            f"the design would have {points:,} points, more than {MOST_POINTS:,}: "
            f"fewer {'samples' if random else 'values'}",
        )
    if design.type == "zip":
        _check_zip(definition.sweep, sweeps, source)
    if design.type == BOUNDARY:
        _check_boundary(definition, sweeps, source)


def _check_boundary(
    definition: StudyDefinition, sweeps: Sequence[Sweep], source: SourceText
) -> None:
    """Check for complex modes, few sweeps, and a full grid of at most MOST_NODES."""
    kind, design = model_kind(definition.study.kind), definition.design
    if not kind.chooses_rung:
        raise source.error(
            ("design", "type"),
            f"a boundary design needs kind = 'complex_modes', this is {kind.name}",
        )
    if len(sweeps) > MOST_BOUNDARY_SWEEPS:
        raise source.error(
            ("design", "type"),
            f"a boundary design has 1 to {MOST_BOUNDARY_SWEEPS} [[sweep]] tables, "
            f"got {len(sweeps)}",
        )
    nodes = math.prod((len(s.values) - 1) * 2**design.levels + 1 for s in sweeps)
    if nodes > MOST_NODES:
        raise source.error(
            ("design", "levels"),
            f"the full grid would have {nodes:,} nodes, more than {MOST_NODES:,}: "
            "fewer levels, or a smaller num",
        )
    for i, sweep in enumerate(sweeps):
        steps = [b - a for a, b in itertools.pairwise(sweep.halved(design.levels))]
        if min(steps) <= 0 <= max(steps):
            raise source.error(
                ("sweep", i, "stop"), f"too near to start for {design.levels} halvings of each step"
            )


def _check_zip(
    sections: tuple[SweepSection, ...], sweeps: Sequence[Sweep], source: SourceText
) -> None:
    """Check that sweeps have equal lengths and no point appears twice."""
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
