"""Study files to start from: each runs as it is and shows a result of interest.

They begin with the sections that a model and a kind propose (`ModelDefinition.start`,
`ModelKind.start`). Names, defaults and descriptions come from the schema that reads the file. Only
the keys that matter most are written, or every key there is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from squealstudy.engine.commented_toml import (
    comment_lines,
    key_lines,
    section_fields,
    section_lines,
    table_lines,
    wrapped,
)
from squealstudy.engine.lumped_template import TEXT as LUMPED_TEXT
from squealstudy.engine.lumped_template import file_beside, lumped_start
from squealstudy.engine.method_templates import METHOD_STABILITY, WORK_PRECISION
from squealstudy.engine.schema import methods_schema, study_schema
from squealstudy.errors import SquealstudyError
from squealstudy.files import write_text
from squealstudy.models.catalogue import MODELS, model_names
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.lumped.definition import NAME as LUMPED
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.models.parameter import ModelDefinition
from squealstudy.parameter import Parameter
from squealstudy.study.design_sections import SweepSection
from squealstudy.study.kind_protocols import ModelStudyKind
from squealstudy.study.kinds import kind_named, kind_names, model_kind
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.toml_text import toml_value
from squealstudy.wording import did_you_mean

BY_HAND = ("study", "model", "parameters", "sweep", "design")  # sections, written in this order
SWEPT = "friction"  # swept parameter of models that have it and propose no other
SWEEP_REL_RANGE = 0.2  # relative range of the sweep below and above the default
SWEEP_POINTS = 5
# name under which a study of scattering parameters is begun, and the kind of study that it is
ROBUST, OF_ROBUST = "robust", "complex_modes"
SIGMAS_IN_SWEEP = 6.0  # standard deviations in a range that a study would sweep otherwise
OF_METHODS = ("work_precision", "method_stability")
BASE = "_base"  # end of the name of the study that methods are measured on
SCHEMA_FILE = "squealstudy.schema.json"


@dataclass(frozen=True)
class Begun:
    """Parts of a study to start from.

    Attributes
    ----------
    kind : ModelStudyKind
    model : ModelDefinition
    tables : mapping of str -> mapping, or list of mappings
        Values that the file will give, by section.
    definition : StudyDefinition
        The same values as the schema reads them, with defaults for all keys left out.
    whole : bool
        Whether every key is written, not only those that matter most.
    """

    kind: ModelStudyKind
    model: ModelDefinition
    tables: Mapping[str, Any]
    definition: StudyDefinition
    whole: bool

    def shown(self, section: str) -> Collection[str] | None:
        """Keys of a section that are written even at their defaults; None: all."""
        return None if self.whole else self.kind.short.get(section, ())


def new_kinds() -> tuple[str, ...]:
    """Names that `new_study` takes as a kind: of studies of models, ``robust``, and of methods."""
    names = [name for name in kind_names() if not kind_named(name).of_methods]
    return (*names, ROBUST, *OF_METHODS)


def new_study(
    path: Path | str,
    kind: str = "complex_modes",
    model: str | None = None,
    whole: bool = False,
    schema: bool = False,
) -> Path:
    """Write a commented study file that runs as it is, and return its path.

    Where the model proposes a sweep, it leads from a stable design point to one that squeals.

    Parameters
    ----------
    path : Path or str
        Path of the new file.
    kind : str
        A kind of study, or ``robust``: complex modes with parameters that scatter.
    model : str or None
        Name of a model of the catalogue, or ``lumped``, whose file is written beside the study. A
        ``work_precision`` study writes a second study file, on which methods are measured: then
        this is its model. A ``method_stability`` study takes none, every other kind needs one.
    whole : bool
        Write every key with its default and meaning; otherwise only those that matter most.
    schema : bool
        Write the JSON Schema beside the study, for editors. The study refers to it, or to one that
        is already there.

    Raises
    ------
    SquealstudyError
        Where the file exists, kind or model is unknown, or they do not go together.

    Examples
    --------
    >>> import squealstudy as sq
    >>> sq.read_study(sq.new_study("new.toml", kind="limit_cycles", model="hulten"))
    <Study 'new': limit_cycles of hulten, new.toml>
    """
    path = Path(path)
    text = study_text(path.stem, kind, model, whole)
    written = {path: text}
    last = path  # the study of the model
    if kind == OF_METHODS[0]:
        last = path.with_name(f"{path.stem}{BASE}.toml")
        written[last] = study_text(last.stem, "transient", model, whole)
    if model == LUMPED and kind != OF_METHODS[1]:
        written[file_beside(last)] = LUMPED_TEXT
    for file in written:
        if file.exists():
            raise SquealstudyError(f"{file}: there is such a file already, it is not overwritten")
    name = f"{kind}.schema.json" if kind in OF_METHODS else SCHEMA_FILE
    model_path = path.with_name(name)
    if schema:
        json_schema = methods_schema(kind) if kind in OF_METHODS else study_schema()
        write_text(model_path, json.dumps(json_schema, indent=2) + "\n")
    if model_path.is_file():
        written[path] = f"#:schema ./{name}\n{text}"
    for file, content in written.items():
        write_text(file, content)
    return path


def study_text(name: str, kind: str, model: str | None, whole: bool = False) -> str:
    """The text of a study file with this name; SquealstudyError as for `new_study`."""
    kinds = new_kinds()
    if kind not in kinds:
        raise SquealstudyError(
            f"kind '{kind}': expected {', '.join(kinds)}{did_you_mean(kind, kinds)}"
        )
    if kind == OF_METHODS[1]:
        if model is not None:
            raise SquealstudyError(f"a {kind} study has a minimal model of its own: no model")
        return METHOD_STABILITY.format(name=_name(name))
    chosen_model = lumped_start(Path(f"{name}.toml")) if model == LUMPED else _known_model(model)
    if kind == OF_METHODS[0]:
        return WORK_PRECISION.format(
            name=_name(name), base=f"{name}{BASE}.toml", model=chosen_model.name
        )
    begun = _begun(_name(name), kind, chosen_model, whole)
    return "\n".join(_lines(begun, kind)).rstrip() + "\n"


def _known_model(model: str | None) -> ModelDefinition:
    """The model of a name; SquealstudyError tells what to do for other names."""
    if model is None:
        width = max(map(len, MODELS))
        listed = (f"  {name:{width}}  {m.description}" for name, m in MODELS.items())
        raise SquealstudyError("\n".join(["of which model? --model NAME, one of", *listed]))
    if model == MATRICES:
        raise SquealstudyError(
            f"model '{MATRICES}' is made of files that only its study names: "
            f"'squealstudy models {MATRICES}' shows what to write"
        )
    if model == OF_FILE:
        raise SquealstudyError(
            f"model '{OF_FILE}' is what a model file describes: begin with a study of another "
            'model and write file = "..." in place of its name'
        )
    if model not in MODELS:
        raise SquealstudyError(
            f"model '{model}': expected {', '.join(model_names())}"
            + did_you_mean(model, model_names())
        )
    return MODELS[model]


def _begun(name: str, kind: str, model: ModelDefinition, whole: bool) -> Begun:
    """Sections of a new study, from what its model and its kind propose."""
    study_kind = model_kind(OF_ROBUST if kind == ROBUST else kind)
    defaults = {p.name: p.default for p in model.parameters}
    of_model, of_kind = dict(model.start), dict(study_kind.start)
    swept = {**_range(model), **of_model.pop("sweep", {}), **of_kind.pop("sweep", {})}
    tables: dict[str, Any] = {
        "study": {"name": name, "kind": study_kind.name},
        "model": {"name": model.name, **of_model.pop("model", {})},
        "parameters": {k: v for k, v in study_kind.begins_with.items() if defaults.get(k) == 0.0},
        "sweep": [swept],
    }
    if kind == ROBUST:
        tables |= _scatter(swept, defaults)
    for section in (*of_kind, *(s for s in of_model if s not in of_kind)):
        if section in study_kind.definition.model_fields:
            tables[section] = _joined(of_kind.get(section), of_model.get(section))
    return Begun(study_kind, model, tables, study_kind.definition.model_validate(tables), whole)


def _joined(kinds: Any, models: Any) -> Any:
    """A section as its kind proposes it, with the model's values in preference to the kind's."""
    if isinstance(kinds or models, Mapping):
        return {**(kinds or {}), **(models or {})}
    return models or kinds


def _range(model: ModelDefinition) -> dict[str, Any]:
    """A sweep about the default of friction, or of the first parameter if there is no friction."""
    named = {p.name: p for p in model.parameters}
    chosen = named.get(SWEPT, model.parameters[0])
    low, high = _about(chosen)
    return {"parameter": chosen.name, "start": low, "stop": high, "num": SWEEP_POINTS}


def _about(parameter: Parameter) -> tuple[float, float]:
    """Ends of a range about the default of a parameter, within its bounds."""
    low, high = ((1 + side * SWEEP_REL_RANGE) * parameter.default for side in (-1, 1))
    low, high = max(low, parameter.minimum), min(high, parameter.maximum)
    return float(f"{low:.6g}"), float(f"{high:.6g}")


def _scatter(swept: Mapping[str, Any], defaults: Mapping[str, float]) -> dict[str, Any]:
    """Sections that let the swept parameter, and damping where there is some, scatter."""
    low, high = swept["start"], swept["stop"]
    ends = {"start": low, "stop": high}
    mean, std = (float(f"{v:.6g}") for v in ((low + high) / 2, (high - low) / SIGMAS_IN_SWEEP))
    normal = {"distribution": "truncated_normal", "mean": mean, "std": std}
    drawn = [{"parameter": swept["parameter"], **normal, **ends}]
    if damping := defaults.get("damping_ratio"):
        scatter = {"distribution": "lognormal", "median": damping, "sigma": 0.3}
        drawn.append({"parameter": "damping_ratio", **scatter})
    return {"sweep": drawn, "design": {"type": "sobol", "samples": 64}}


def _name(stem: str) -> str:
    """A study's name made of a file's: letters, digits, _ and -."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", stem) or "study"


def _lines(begun: Begun, kind: str) -> Iterator[str]:
    """Yield all lines of the study file."""
    model, definition = begun.model, begun.definition
    purpose = f"A {kind} study of the model {model.name}: {model.description}."
    yield from (f"# {line}" for line in wrapped(purpose, 2))
    yield "# What stands behind a # is a default: take the # away to change it. Numbers are"
    yield '# in SI units (angles in deg); values of parameters may have others: "12 bar".'
    if not begun.whole:
        yield f"# squealstudy new FILE --model {model.name} --kind {kind} --all: every key;"
        yield f"# squealstudy models {model.name}: every parameter."
    yield ""
    yield from _study(begun)
    yield from _model(begun)
    yield from _parameters(begun)
    yield from _sweeps(begun)
    if begun.whole or "design" in begun.tables:
        design_table, design = begun.tables.get("design"), definition.design
        yield from section_lines(
            "design", design, design_table or {}, begun.shown("design"), design_table is None
        )
    for section, field in type(definition).model_fields.items():
        if section in BY_HAND or (section == "fidelity" and not begun.kind.has_fidelity):
            continue
        yield from _of_kind(begun, section, field)


def _of_kind(begun: Begun, section: str, field: FieldInfo) -> Iterator[str]:
    """Yield the lines of one of the other sections, if it is to be written."""
    begun_with, shown = begun.tables.get(section), begun.shown(section)
    if not begun.whole and begun_with is None and not shown:
        return
    section_value = getattr(begun.definition, section)
    yield from comment_lines(field.description or "")
    if isinstance(begun_with, list):
        for number, table in enumerate(begun_with):
            more = begun.whole and number == 0
            yield from table_lines(f"[[{section}]]", section_fields(field), table, more)
    elif section_value is None or section_value == ():
        yield from table_lines(
            f"[[{section}]]" if section_value == () else f"[{section}]", section_fields(field)
        )
    else:
        yield from section_lines(section, section_value, begun_with or {}, shown)


def _study(begun: Begun) -> Iterator[str]:
    """Lines of the section [study]."""
    study = begun.definition.study
    yield "[study]"
    for key in ("name", "kind"):
        if begun.whole:
            yield from comment_lines(type(study).model_fields[key].description or "")
        yield f"{key} = {toml_value(getattr(study, key))}"
    yield '# description = ""'
    if begun.whole:
        yield from comment_lines(type(study).model_fields["extensions"].description or "")
        yield "# extensions = []"
    yield ""


def _model(begun: Begun) -> Iterator[str]:
    """Lines of the section [model]."""
    begun_with = begun.tables["model"]
    yield "[model]"
    if isinstance(begun.model, FileDefinition):
        yield f"file = {toml_value(Path(begun.model.path).name)}"
    else:
        yield f"name = {toml_value(begun.model.name)}"
    for option in begun.model.options:
        default, *others = option.choices
        choices = f" ({' | '.join(map(str, option.choices))})" if others else ""
        if not begun.whole and not others:
            continue
        yield from key_lines(option.name, default, option.description + choices, begun_with)
    yield ""


def _parameters(begun: Begun) -> Iterator[str]:
    """Lines of the section [parameters]: of a meshed model those that matter most."""
    begun_with = begun.tables["parameters"]
    shown = begun.shown("parameters")
    yield "[parameters]"
    for parameter in begun.model.parameters:
        of_minimal_model = not begun.model.meshed and parameter.structural
        matters = shown is None or parameter.name in shown or of_minimal_model
        if not matters and parameter.name not in begun_with:
            continue
        described = parameter.description + (f" [{parameter.unit}]" if parameter.unit else "")
        described += f" ({parameter.default:g} by default)" if parameter.name in begun_with else ""
        yield from key_lines(parameter.name, parameter.default, described, begun_with)
    yield ""


def _sweeps(begun: Begun) -> Iterator[str]:
    yield "# what varies; the first [[sweep]] varies fastest in a grid"
    for number, sweep in enumerate(begun.tables["sweep"]):
        more = begun.whole and number == 0
        yield from table_lines("[[sweep]]", SweepSection.model_fields, sweep, more, begun.whole)
