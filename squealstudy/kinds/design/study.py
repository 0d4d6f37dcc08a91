"""A design study, read: its matrix of operation, its variables, what scatters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.design.section import (
    DesignStudyDefinition,
    GoalSection,
    VariableSection,
    VariantSection,
)
from squealstudy.kinds.limit_cycles.section import LimitCyclesSection
from squealstudy.models.acting_laws import expect_acting
from squealstudy.models.operating import IN_TIME_ONLY
from squealstudy.models.parameter_names import (
    ModeParameter,
    StudyParameter,
    check_disjoint,
    parse_parameter,
)
from squealstudy.study.definition import ResolvedStudy, resolve_study
from squealstudy.study.design import DesignPoint
from squealstudy.study.design_sections import DesignSection
from squealstudy.study.sampling import design_points
from squealstudy.study.section import flat_keys
from squealstudy.study.source import SourceText
from squealstudy.study.sweeps import BOUNDARY, Sweep, read_sweep
from squealstudy.study.tabled import SECTION as PARAMETERS
from squealstudy.study.tabled import TABLE, take_tables
from squealstudy.study.toml_text import KeyPath, toml_text
from squealstudy.wording import did_you_mean, plural

SCATTERS = DesignSection(type="sobol", samples=1)  # scatter is read as sweeps of a random design


@dataclass(frozen=True)
class Variable:
    """A quantity that may be changed.

    Attributes
    ----------
    parameter : PlainParameter or ModeParameter
    nominal : float
        Today's value.
    low, high : float
        Least and largest change from today's value, low <= 0 <= high.
    cost : float
        Cost of a change by high - low.
    """

    parameter: StudyParameter
    nominal: float
    low: float
    high: float
    cost: float

    @property
    def name(self) -> str:
        """The parameter's name as the file writes it."""
        return self.parameter.name

    @property
    def range(self) -> float:
        """Distance between the bounds."""
        return self.high - self.low


@dataclass(frozen=True)
class Alternative:
    """A variant of a study's model with its own study.

    Attributes
    ----------
    name : str
    cost : float
        Cost of choosing it.
    study : DesignStudy
        The study of the variant.
    """

    name: str
    cost: float
    study: DesignStudy


@dataclass(frozen=True)
class DesignStudy(ResolvedStudy):
    """A design study; `sweeps` are those of operation, then variables, then scattered parameters.

    Attributes
    ----------
    variables : tuple of Variable
    uncertain : tuple of Sweep
        Scattered parameters, with their distributions.
    alternatives : tuple of Alternative
        Variants with their studies.
    """

    variables: tuple[Variable, ...] = ()
    uncertain: tuple[Sweep, ...] = ()
    alternatives: tuple[Alternative, ...] = ()

    @property
    def goal(self) -> GoalSection:
        """The [goal] section."""
        return cast("DesignStudyDefinition", self.definition).goal

    @property
    def limit_cycles(self) -> LimitCyclesSection:
        """The [limit_cycles] section."""
        return cast("DesignStudyDefinition", self.definition).limit_cycles

    @property
    def n_operating(self) -> int:
        """Number of sweeps of the operation."""
        return len(self.sweeps) - len(self.variables) - len(self.uncertain)

    @property
    def operation(self) -> ResolvedStudy:
        """The study of today's design over the matrix of operation alone."""
        sweeps = self.sweeps[: self.n_operating]
        return replace(self, sweeps=sweeps, variables=(), uncertain=(), alternatives=())

    @property
    def nominal(self) -> np.ndarray:
        """Today's values (d,) of the variables."""
        return np.array([v.nominal for v in self.variables], dtype=float)

    @property
    def uncertain_nominal(self) -> np.ndarray:
        """Values (k,) in [parameters] of the scattered parameters."""
        return np.array([self.value_of(s.parameter) for s in self.uncertain], dtype=float)

    @cached_property
    def occurrence(self) -> np.ndarray:
        """Share (m,) of each operating point of the matrix; their sum is 1."""
        matrix = design_points(self.operation)
        weight = np.ones(len(matrix))
        for column, sweep in zip(matrix.T, self.sweeps, strict=False):
            if (shares := self.goal.occurrence.get(sweep.name)) is not None:
                indices = [sweep.values.index(swept_value) for swept_value in column.tolist()]
                weight = weight * (np.array(shares) / max(shares))[indices]
        share: np.ndarray = weight / weight.sum()
        return share

    def value_of(self, parameter: StudyParameter) -> float:
        """Value of a parameter in [parameters], or its default."""
        return float(self.values.get(parameter.name, parameter.default))

    def place(self, name: str) -> KeyPath:
        """Key of the place where the file first names a parameter."""
        indices = self._places(name)
        return indices[0] if indices else ("parameters", name)

    def last_place(self, name: str) -> KeyPath:
        """Key of the place where the file last names a parameter."""
        return self._places(name)[-1]

    def _places(self, name: str) -> list[KeyPath]:
        definition = cast("DesignStudyDefinition", self.definition)
        named = [("sweep", i, s.parameter, "parameter") for i, s in enumerate(definition.sweep)]
        named += [("variable", i, v.name, v.key) for i, v in enumerate(definition.variable)]
        scatter = enumerate(definition.uncertain)
        named += [("uncertain", i, s.parameter, "parameter") for i, s in scatter]
        return [
            (table, number, key)
            for table, number, parameter_name, key in named
            if parameter_name == name
        ]


def read_study(source: SourceText, tables: Mapping[str, Any]) -> DesignStudy:
    """The study of a file's tables, with those of its variants.

    Raises
    ------
    StudyFileError
        Errors of `design_study`, of the study or of a variant.
    """
    study = design_study(resolve_study(source, tables))
    sections = cast("DesignStudyDefinition", study.definition).variant
    alternatives = tuple(_alternative(study, i, s, tables) for i, s in enumerate(sections))
    return replace(study, alternatives=alternatives)


def _alternative(
    study: DesignStudy, number: int, section: VariantSection, tables: Mapping[str, Any]
) -> Alternative:
    """The study of a variant: the file with some keys changed, and with no variants."""
    keys = ("variant", number)
    changed_tables = {
        **tables,
        "study": {**tables["study"], "name": f"{study.name}_{section.name}"},
    }
    if section.description:
        changed_tables["study"]["description"] = section.description
    del changed_tables["variant"]
    other = {"name", "file"} & section.model.keys()
    changed_tables["model"] = {**({} if other else tables["model"]), **section.model}
    try:
        changes = _by_name(section.parameters)
    except ValueError as error:
        raise study.error((*keys, PARAMETERS), str(error)) from None
    if not section.model and not changes:
        raise study.error(keys, "expected keys of model or parameters that differ, got none")
    sweeps, varied = study.sweeps, {v.name for v in study.variables}
    for name in (s.name for s in sweeps if s.name in changes and s.name not in varied):
        how = "scatters" if name in {s.name for s in study.uncertain} else "is swept"
        text = f"'{name}' {how}, alike in every variant: it cannot differ"
        raise study.error((*keys, PARAMETERS), text)
    changed_tables[PARAMETERS] = {**_by_name(tables.get(PARAMETERS, {})), **changes}
    source = SourceText(study.source.path, toml_text(changed_tables))
    try:
        changed_study = design_study(resolve_study(source, changed_tables))
    except StudyFileError as error:
        raise of_variant(study, number, error) from error
    return Alternative(section.name, section.cost, changed_study)


def _by_name(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Values, and tables that are followed, by parameter; ValueError for one given twice."""
    remaining, followed = take_tables({PARAMETERS: parameters})
    by_name = flat_keys(remaining[PARAMETERS])
    for _, name, table in followed:
        if name in by_name:
            raise ValueError(f"'{name}' is given twice")
        by_name[name] = {TABLE: table}
    return by_name


def of_variant(study: DesignStudy, number: int, error: StudyFileError) -> StudyFileError:
    """An error about a variant's study as one of the file; of another file, which it names."""
    if error.path != study.source.path:
        return error
    name = cast("DesignStudyDefinition", study.definition).variant[number].name
    prefix = f"{error.key}: " if error.key else ""
    return study.error(("variant", number), f"variant '{name}': {prefix}{error.message}")


def design_study(study: ResolvedStudy) -> DesignStudy:
    """The study with its variables and what scatters, without those of its variants.

    Raises
    ------
    StudyFileError
        A model without contact; an unknown or repeated parameter; bounds beyond what one can take;
        a value of a part that is added; a scatter that is not about the value in [parameters]; a
        boundary design; a probability without scatter, or the other way round.
    """
    definition = cast("DesignStudyDefinition", study.definition)
    if not study.model.components:
        raise study.error(
            ("study", "kind"),
            f"model '{study.model.name}' has no components and no contact: nothing of it can be "
            "changed by name",
        )
    if definition.design.type == BOUNDARY:
        raise study.error(
            ("design", "type"), "the operating points of a design study are a grid, zip or sample"
        )
    variables = tuple(_variable(study, i, s) for i, s in enumerate(definition.variable))
    uncertain = tuple(
        read_sweep(s, SCATTERS, study.model, study.source, ("uncertain", i))
        for i, s in enumerate(definition.uncertain)
    )
    probability = definition.goal.margin.probability
    if probability is not None and not uncertain:
        raise study.error(
            ("goal", "margin", "probability"), "nothing scatters: [[uncertain]] says what does"
        )
    if probability is None and uncertain:
        raise study.error(
            ("goal",), "the scatter of [[uncertain]] needs margin.probability, how surely it is met"
        )
    variable_sweeps = [
        Sweep(v.parameter, (), v.nominal + v.low, v.nominal + v.high, "linear") for v in variables
    ]
    resolved = {f.name: getattr(study, f.name) for f in fields(ResolvedStudy)}
    study_with_variables = DesignStudy(
        **{**resolved, "sweeps": (*study.sweeps, *variable_sweeps, *uncertain)},
        variables=variables,
        uncertain=uncertain,
    )
    _check_names(study_with_variables)
    _check_scatter(study_with_variables)
    _check_occurrence(study_with_variables)
    return study_with_variables


def _one_sigma(sweep: Sweep) -> tuple[float, float]:
    """Values between which what scatters is as often as a normal one within a deviation."""
    assert sweep.distribution is not None
    low, high = sweep.distribution.quantiles(np.array([0.1587, 0.8413]))
    return float(low), float(high)


def deviations(study: DesignStudy, sigmas: float) -> tuple[np.ndarray, np.ndarray]:
    """How far below and above [parameters] (k,) scatter goes as often as normal beyond `sigmas`."""
    from scipy.stats import norm

    tails = norm.cdf([-sigmas, sigmas])
    ends = np.array([s.distribution.quantiles(tails) for s in study.uncertain if s.distribution])
    low, high = np.maximum(0.0, (ends - study.uncertain_nominal[:, None]) * [-1.0, 1.0]).T
    return low, high


def _check_scatter(study: DesignStudy) -> None:
    """Check that each scattered parameter scatters about its value in [parameters]."""
    for number, (sweep, nominal) in enumerate(
        zip(study.uncertain, study.uncertain_nominal, strict=True)
    ):
        low, high = _one_sigma(sweep)
        if not low <= nominal <= high:
            text = (
                f"expected a scatter about {sweep.name} = {nominal:g} of [parameters], got one "
                f"that is from {low:.4g} to {high:.4g} in two thirds of all cases"
            )
            raise study.error(("uncertain", number), text)


def _expect_free(study: DesignStudy, name: str) -> None:
    """StudyFileError for what follows a table, or what others follow by one: no slope knows it."""
    for table in study.model.tables:
        if name == table.name:
            text = f"'{name}' follows a table in [parameters]: nothing else can change it"
            raise study.error(study.place(name), text)
        if name in table.over:
            text = f"'{table.name}' follows '{name}' by a table: it can be swept, not searched"
            raise study.error(study.place(name), text)


def _check_occurrence(study: DesignStudy) -> None:
    """Weights of all values of swept parameters of a grid, not negative, not all 0."""
    swept = {s.name: s for s in study.sweeps[: study.n_operating]}
    for name, weights in study.goal.occurrence.items():
        keys = ("goal", "occurrence", name)
        if study.definition.design.type != "grid":
            raise study.error(keys, "weights of values need operating points that are a grid")
        if name not in swept:
            raise study.error(keys, f"'{name}' is not swept{did_you_mean(name, swept)}")
        count = len(swept[name].values)
        if len(weights) != count:
            what = plural(count, "value")
            raise study.error(keys, f"expected a weight for each of {what}, got {len(weights)}")
        if min(weights) < 0 or max(weights) == 0:
            raise study.error(keys, "expected weights of at least 0, one of them above it")


def _variable(study: ResolvedStudy, number: int, section: VariableSection) -> Variable:
    keys = ("variable", number)
    try:
        parameter = parse_parameter(section.name, study.model)
    except ParameterError as error:
        raise study.error((*keys, section.key), error.message) from None
    nominal = float(study.values.get(parameter.name, parameter.default))
    if section.added is not None and nominal:
        text = f"'{parameter.name}' is added, starting from 0: expected no value of it"
        raise study.error((PARAMETERS, parameter.name), text)
    low, high = section.ends
    for index, end in enumerate(section.ends):
        try:
            parameter.check(nominal + end)
        except ParameterError as error:
            text = f"{parameter.name}, today {nominal:g}, changed by {end:g}: {error.message}"
            raise study.error((*keys, "bounds", index), text) from None
    return Variable(parameter, nominal, low, high, section.cost)


def _check_names(study: DesignStudy) -> None:
    """Each parameter once, all of them acting on complex modes."""
    design = DesignPoint(study.model, study.options, {})
    names: set[str] = set()
    for sweep in study.sweeps:
        name = sweep.name
        if name in names:
            text = f"'{name}' is swept, variable or uncertain already"
            raise study.error(study.last_place(name), text)
        names.add(name)
        if sweep in study.sweeps[study.n_operating :]:
            _expect_free(study, name)
        if name in IN_TIME_ONLY:
            text = f"'{name}' acts in time only, complex modes do not see it"
            raise study.error(study.place(name), text)
        try:
            expect_acting(sweep.parameter, design)
        except ParameterError as error:
            raise study.error(study.place(name), error.message) from None
    used: list[StudyParameter] = [s.parameter for s in study.sweeps]
    parameters = (parse_parameter(n, study.model) for n in study.definition.parameters)
    try:
        check_disjoint([*(p for p in parameters if isinstance(p, ModeParameter)), *used])
    except ParameterError as error:
        raise study.error(study.place(error.key), error.message) from None
