"""A study: the contents of its file, checked against the model and resolved to numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.mechanics.defaults import LUMPED, OF_FILE
from squealstudy.models.parameter_names import StudyParameter, check_disjoint, parse_parameter
from squealstudy.study.friction_maps import with_map
from squealstudy.study.kinds import kind_named, kind_names, kind_of_file, model_kind
from squealstudy.study.measured import measured_values
from squealstudy.study.sections import ModelSection, StudyDefinition
from squealstudy.study.source import SourceText, changed, extensions_of, not_registered, validate
from squealstudy.study.sweeps import BOUNDARY, Sweep, resolve_sweeps
from squealstudy.study.tabled import (
    GivenTable,
    expect_sweeps,
    expect_values,
    read_parameter_tables,
    take_tables,
    with_temperature,
)
from squealstudy.study.toml_text import KeyPath
from squealstudy.study.units import TEMPERATURE, with_numbers
from squealstudy.wording import did_you_mean, shown

if TYPE_CHECKING:  # the catalogue imports scipy and scikit-fem: only where a study is loaded
    from squealstudy.models.parameter import ModelDefinition
    from squealstudy.study.kind_protocols import ModelStudyKind


@dataclass(frozen=True)
class ResolvedStudy:
    """A study file, checked against its model and resolved.

    Attributes
    ----------
    source : SourceText
        The file as it was read, and its path.
    kind : ModelStudyKind
        The kind of study, which decides what is computed at the design points.
    definition : StudyDefinition
    model : ModelDefinition
    options : mapping of name -> str or int
        A value of every option of the model.
    values : mapping of name -> float
        A value of every parameter of the model, and the mode parameters of [parameters].
    sweeps : tuple of Sweep
    extensions : tuple of str
        Hashes of the extension files that the study names.
    """

    source: SourceText
    kind: ModelStudyKind
    definition: StudyDefinition
    model: ModelDefinition
    options: Mapping[str, str | int]
    values: Mapping[str, float]
    sweeps: tuple[Sweep, ...]
    extensions: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the study, which its results directory has too."""
        return self.definition.study.name

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """An error about a key of the file, to be raised."""
        return self.source.error(keys, message)

    @property
    def grows(self) -> bool:
        """Whether the study's results decide further design points."""
        return self.definition.design.type == BOUNDARY

    @property
    def section(self) -> Any:
        """The kind's own section of the file; None where the kind has none."""
        return getattr(self.definition, self.kind.section) if self.kind.section else None

    def variant(self, changes: Mapping[str, Any]) -> ResolvedStudy:
        """The study with other values at dotted keys; StudyFileError where one is refused."""
        return resolve_study(self.source, changed(self.source, self.source.tables, changes))

    @property
    def constant(self) -> dict[str, float]:
        """Values of the parameters that are the same at all design points, and in all designs."""
        varied = {s.name for s in self.sweeps}
        varied |= {v.parameter for v in getattr(self.definition, "variable", ())}
        varied |= {t.name for t in self.model.tables if varied.intersection(t.over)}
        return {name: v for name, v in self.values.items() if name not in varied}

    @property
    def doubts(self) -> list[str]:
        """Warnings about values, swept ones too, that may have been given in a wrong unit."""
        ends: dict[str, tuple[float, ...]] = {
            name: (number,) for name, number in self.values.items()
        }
        ends |= {s.name: tuple({s.low, s.high}) for s in self.sweeps}
        doubt_texts = (
            p.doubt(number) for p in self.model.parameters for number in sorted(ends[p.name])
        )
        return [f"{text}: are the units right?" for text in doubt_texts if text]

    @property
    def shown_parameters(self) -> tuple[str, ...]:
        """Names of the swept parameters, then of those in [parameters], each once."""
        swept = dict.fromkeys(s.name for s in self.sweeps)
        return tuple(swept | dict.fromkeys(self.definition.parameters))


def load_any(path: str | Path) -> Any:
    """Read and check a study file of any kind: a `ResolvedStudy`, or a study of methods.

    Raises
    ------
    StudyFileError
        About any fault of the file, with file, line, key and what was expected.
    """
    source = SourceText.read(path)
    return read_tables(source, source.tables)


def read_tables(source: SourceText, tables: Mapping[str, Any]) -> Any:
    """The study of a file's tables, perhaps with values changed; of any kind, as `load_any`."""
    kind = kind_of_file(source, tables)
    return resolve_study(source, tables) if kind is None else kind.read(source, tables)


def load_study(path: str | Path) -> ResolvedStudy:
    """Read and check a study file of a model; StudyFileError about any fault."""
    source = SourceText.read(path)
    return resolve_study(source, source.tables)


def parse_study(text: str, path: Path) -> ResolvedStudy:
    """The study of a TOML text; `path` is used in messages. StudyFileError about any fault."""
    source = SourceText(path, text)
    return resolve_study(source, source.tables)


def given_keys(study: ResolvedStudy) -> set[str]:
    """Dotted keys of the file's sections, such as ``transient.step``; none in lists of tables."""
    return {
        f"{section}.{key}"
        for section, table in study.source.tables.items()
        if isinstance(table, dict)
        for key in table
    }


def resolve_study(source: SourceText, tables: Mapping[str, Any]) -> ResolvedStudy:
    """The study of a file's tables, perhaps with values changed; StudyFileError about any fault."""
    from squealstudy.study.design import DesignPoint
    from squealstudy.study.laws import check_laws
    from squealstudy.study.model_files import named_by_content

    extensions = extensions_of(source, tables)
    kind = _kind(source, tables)
    tables = with_map(tables, source)
    tables, given_tables = take_tables(named_by_content(tables, source))
    tables = with_numbers(tables, partial(_model_with_units, tables, source, given_tables), source)
    definition = validate(kind.definition, source, tables)
    model = _model(definition, source)
    followed = read_parameter_tables(with_temperature(model, given_tables), given_tables, source)
    if any(TEMPERATURE in table.over for table in followed):
        model = with_temperature(model, given_tables)
    model = replace(model, tables=followed)
    options = _options(definition.model, model, source)  # laws, before parameters that need them
    values = model.defaults()
    used: list[tuple[KeyPath, StudyParameter]] = []
    for name, written in definition.parameters.items():
        keys = ("parameters", name)
        try:
            parameter = parse_parameter(name, model)
            values[name] = parameter.check(written)
        except ParameterError as e:
            raise source.error(keys, e.message) from None
        used.append((keys, parameter))
    expect_values(followed, values, source)
    values = model.followed(values)
    for place, name, _ in given_tables:
        used.append((place[:-1], parse_parameter(name, model)))
        if name in definition.parameters:
            raise source.error(place, f"'{name}' is given twice")
    sweeps = resolve_sweeps(definition, model, source)
    used += [(("sweep", i, "parameter"), s.parameter) for i, s in enumerate(sweeps)]
    expect_sweeps(followed, sweeps, source)
    _check_disjoint(used, source)
    _check_acting(used, model, options, source)
    cutoff_hz = definition.reduction.component_cutoff_factor * definition.modes.band[1]
    values |= measured_values(model, cutoff_hz, [parameter for _, parameter in used])
    study = ResolvedStudy(
        source=source,
        kind=kind,
        definition=definition,
        model=model,
        options=options,
        values=values,
        sweeps=sweeps,
        extensions=extensions,
    )
    check_laws(DesignPoint(model, options, values), sweeps, study.error)
    return study


def _kind(source: SourceText, tables: Mapping[str, Any]) -> ModelStudyKind:
    """The kind of a study file; StudyFileError for a section of another kind."""
    kind = kind_of_file(source, tables)
    if kind is None:  # then [study] has a fault, which validation reports
        validate(StudyDefinition, source, tables)
        raise source.error(("study", "kind"), "expected the name of a kind of study")
    if kind.of_methods:
        text = f"expected a study of a model, {kind.name} is one of methods"
        raise source.error(("study", "kind"), text)
    for name in (name for name in tables if name not in kind.definition.model_fields):
        for other in map(kind_named, kind_names()):
            if other.section == name:
                raise source.error(
                    (name,), f'a [{name}] section needs kind = "{other.name}", this is {kind.name}'
                )
    study_kind = model_kind(kind.name)
    if "fidelity" in tables and not study_kind.has_fidelity:
        raise source.error(("fidelity",), f"a {kind.name} study has no [fidelity] section")
    return study_kind


def _model_with_units(
    tables: Mapping[str, Any], source: SourceText, given_tables: Sequence[GivenTable]
) -> ModelDefinition | None:
    """The model named in a study file, for units of its parameters; None if it is not known."""
    from squealstudy.models.catalogue import MODELS

    section = tables.get("model")
    if not isinstance(section, Mapping):
        return None
    name, file = section.get("name"), section.get("file")
    if isinstance(file, str) and name in (None, LUMPED) and (source.path.parent / file).is_file():
        from squealstudy.study.model_files import read_model_file

        return with_temperature(read_model_file(source.path.parent / file), given_tables)
    registered = MODELS.get(name) if isinstance(name, str) else None
    return registered if registered is None else with_temperature(registered, given_tables)


def _model(definition: StudyDefinition, source: SourceText) -> ModelDefinition:
    """The model that a study names; StudyFileError for an unknown name."""
    from squealstudy.models.catalogue import MODELS, model_names
    from squealstudy.models.matrices.family import NAME
    from squealstudy.study.family import family_of

    name = definition.model.name
    if definition.model.file is not None or name == OF_FILE:
        from squealstudy.study.model_files import model_of_file

        return model_of_file(definition, source)
    if name not in model_names():
        raise source.error(
            ("model", "name"),
            f"expected one of {', '.join(model_names())}, got {shown(name)}"
            + (did_you_mean(name, model_names()) or not_registered(source.tables, name)),
        )
    model = family_of(definition, source) if name == NAME else MODELS[name]
    parts = definition.added_parts(source)
    if not parts:
        return model
    from squealstudy.study.added_parts import with_added  # imports scikit-fem

    return with_added(model, parts)


def _options(
    section: ModelSection, model: ModelDefinition, source: SourceText
) -> dict[str, str | int]:
    """The value of every option of the model: as given, or its default."""
    from squealstudy.models.matrices.family import FamilyDefinition

    options = {option.name: option for option in model.options}
    values = {option.name: option.choices[0] for option in model.options}
    foreign = () if isinstance(model, FamilyDefinition) else section.family_keys
    for name, written in (dict.fromkeys(foreign) | section.options).items():
        keys = ("model", name)
        if name not in options:
            its = f"its options are {', '.join(options)}" if options else "it has no options"
            hint = did_you_mean(name, options) or f"; {its}"
            raise source.error(keys, f"unknown key of model '{model.name}'{hint}")
        choices = options[name].choices
        if (
            not isinstance(written, str | int)
            or isinstance(written, bool)
            or written not in choices
        ):
            allowed = " or ".join(shown(choice) for choice in choices)
            advice = (
                not_registered(source.tables, written) if callable(options[name].allowed) else ""
            )
            advice += did_you_mean(str(written), map(str, choices))
            raise source.error(keys, f"expected {allowed}, got {shown(written)}{advice}")
        values[name] = written
    return values


def _check_acting(
    used: list[tuple[KeyPath, StudyParameter]],
    model: ModelDefinition,
    options: Mapping[str, str | int],
    source: SourceText,
) -> None:
    """Refuse parameters of laws not chosen, which would seem to have no influence."""
    from squealstudy.models.acting_laws import expect_acting
    from squealstudy.study.design import DesignPoint

    design = DesignPoint(model, options, {})
    for keys, parameter in used if design.has_working_point else ():
        try:
            expect_acting(parameter, design)
        except ParameterError as e:
            raise source.error(keys, e.message) from None


def _check_disjoint(used: list[tuple[KeyPath, StudyParameter]], source: SourceText) -> None:
    """Refuse a component mode that two names set, in [parameters] or by sweeps."""
    try:
        check_disjoint(parameter for _, parameter in used)
    except ParameterError as e:
        keys = next(keys for keys, parameter in used if parameter.name == e.key)
        raise source.error(keys, e.message) from None
