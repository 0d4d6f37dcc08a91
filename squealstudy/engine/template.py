"""What study files may say, from the sections and models themselves: never out of date.

A study file to start from, with the names, defaults and descriptions that it will be read with;
and the JSON Schema, for editors.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, create_model
from pydantic.fields import FieldInfo

from squealstudy.errors import SquealstudyError
from squealstudy.files import write_text
from squealstudy.models.catalogue import MODELS, model_names
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.models.parameter import ModelDefinition
from squealstudy.parameter import Parameter
from squealstudy.study.design_sections import SweepSection
from squealstudy.study.kinds import definition_of, kind_named, kind_names, model_kind
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.toml_text import toml_key, toml_value
from squealstudy.wording import did_you_mean

WIDTH = 100
ELSEWHERE = ("study", "model", "parameters", "sweep", "design")  # written by hand below
SWEPT = "friction"  # of models that have it
SHARE = 0.2  # below and above its default that the parameter is swept
LEVELS = 5


def new_study(path: Path | str, kind: str, model: str) -> Path:
    """Write a commented study file that runs as it is; its path.

    Parameters
    ----------
    path : Path or str
        A file that is not there yet.
    kind : str
        complex_modes, transient or sensitivity.
    model : str
        Of the catalogue.

    Raises
    ------
    SquealstudyError
        A file that is there, an unknown kind or model, or two that do not go together.
    """
    path = Path(path)
    text = study_text(path.stem, kind, model)
    if path.exists():
        raise SquealstudyError(f"{path}: there is such a file already, it is not overwritten")
    write_text(path, text)
    return path


def study_text(name: str, kind: str, model: str) -> str:
    """The text of such a file; raises as `new_study`."""
    known = [name for name in kind_names() if not kind_named(name).of_methods]
    if kind in kind_names() and kind not in known:
        raise SquealstudyError(
            f"kind '{kind}' is of studies of methods, which are made on other study files: "
            f"expected {', '.join(known)}"
        )
    if kind not in known:
        raise SquealstudyError(
            f"kind '{kind}': expected {', '.join(known)}{did_you_mean(kind, known)}"
        )
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
    given = {"study": {"name": _name(name), "kind": kind}, "model": {"name": model}}
    asked = model_kind(kind)
    definition = asked.definition.model_validate(given)
    purpose = f"A {kind} study of the model {model}: {MODELS[model].description}."
    lines = [f"# {line}" for line in _wrapped(purpose, 2)]
    lines += [
        "# What stands behind a # is a default: take the # away to change it. Numbers are",
        '# in SI units (angles in deg); values of parameters may have others: "12 bar".',
        "",
    ]
    lines += [
        *_study(definition),
        *_model(MODELS[model]),
        *_parameters(MODELS[model], asked.begins_with),
    ]
    lines += [*_sweep(MODELS[model]), *_section("design", definition.design, commented=True)]
    for section, found in asked.definition.model_fields.items():
        if section in ELSEWHERE or (section == "fidelity" and not asked.has_fidelity):
            continue
        value = getattr(definition, section)
        if value is None or value == ():
            lines += _optional(section, found, several=value is not None)
        else:
            lines += [*_comment(found.description or ""), *_section(section, value)]
    return "\n".join(lines).rstrip() + "\n"


def _name(stem: str) -> str:
    """A study's name from that of its file: letters, digits, _ and -."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", stem) or "study"


def _study(definition: StudyDefinition) -> Iterator[str]:
    study = definition.study
    yield "[study]"
    for key in ("name", "kind"):
        described = type(study).model_fields[key].description or ""
        yield from _comment(described)
        yield f"{key} = {toml_value(getattr(study, key))}"
    yield '# description = ""'
    yield from _comment(type(study).model_fields["extensions"].description or "")
    yield "# extensions = []"
    yield ""


def _model(model: ModelDefinition) -> Iterator[str]:
    yield "[model]"
    yield f"name = {toml_value(model.name)}"
    for option in model.options:
        default, *others = option.choices
        choices = f" (or {', '.join(map(toml_value, others))})" if others else ""
        yield from _key(option.name, default, option.description + choices)
    yield ""


def _parameters(model: ModelDefinition, begins_with: Mapping[str, float]) -> Iterator[str]:
    yield "[parameters]"
    for parameter in model.parameters:
        described = parameter.description + (f" [{parameter.unit}]" if parameter.unit else "")
        if parameter.name in begins_with and parameter.default == 0.0:
            yield from _comment(f"{described} (0 by default)")
            yield f"{toml_key(parameter.name)} = {toml_value(begins_with[parameter.name])}"
        else:
            yield from _key(parameter.name, parameter.default, described)
    yield ""


def _sweep(model: ModelDefinition) -> Iterator[str]:
    """One sweep that is in use, of friction where the model has it."""
    named = {p.name: p for p in model.parameters}
    chosen = named.get(SWEPT, model.parameters[0])
    low, high = _range(chosen)
    yield "# what varies; the first [[sweep]] varies fastest in a grid"
    yield "[[sweep]]"
    used = {"parameter": chosen.name, "start": low, "stop": high, "num": LEVELS}
    for key, found in SweepSection.model_fields.items():
        yield from _comment(_described(found))
        yield f"{key} = {toml_value(used[key])}" if key in used else _default(key, found)
    yield ""


def _range(parameter: Parameter) -> tuple[float, float]:
    """Values about the default that the parameter may take."""
    low, high = ((1 + side * SHARE) * parameter.default for side in (-1, 1))
    low, high = max(low, parameter.minimum), min(high, parameter.maximum)
    return float(f"{low:.6g}"), float(f"{high:.6g}")


def _section(name: str, section: BaseModel, commented: bool = False) -> Iterator[str]:
    """A section with all of its keys at their defaults."""
    yield f"# [{name}]" if commented else f"[{name}]"
    for key, found in type(section).model_fields.items():
        yield from _key(key, getattr(section, key), _described(found))
    yield ""


def _optional(name: str, found: FieldInfo, several: bool = False) -> Iterator[str]:
    """A section that is not there unless it is given; `several` of its name are a list."""
    yield from _comment(found.description or "")
    yield f"# [[{name}]]" if several else f"# [{name}]"
    for key, inner in _fields(found).items():
        yield from _comment(_described(inner))
        yield _default(key, inner)
    yield ""


def _fields(found: FieldInfo) -> dict[str, FieldInfo]:
    """Keys of the section that an annotation such as ``Section | None`` is of."""
    kinds: tuple[Any, ...] = getattr(found.annotation, "__args__", ())
    return next(k.model_fields for k in kinds if hasattr(k, "model_fields"))


def _key(name: str, default: object, described: str) -> Iterator[str]:
    yield from _comment(described)
    if isinstance(default, BaseModel):
        default = default.model_dump(exclude_none=True)
    shown = "..." if default is None else toml_value(default)
    yield f"# {toml_key(name)} = {shown}"


def _default(key: str, found: FieldInfo) -> str:
    default = found.get_default(call_default_factory=True)
    known = default is not None and not found.is_required()
    return f"# {key} = {toml_value(default) if known else '...'}"


def _described(found: FieldInfo) -> str:
    """What a key is, and what it can be where that is one of some words."""
    words = [word for word in get_args(found.annotation) if isinstance(word, str)]
    return f"{found.description} ({' | '.join(words)})" if words else found.description or ""


def _comment(text: str) -> Iterator[str]:
    return (f"#   {line}" for line in _wrapped(text, 4))


def _wrapped(text: str, indent: int) -> list[str]:
    return textwrap.wrap(text, WIDTH - indent, break_on_hyphens=False)


DIALECT = "https://json-schema.org/draft/2020-12/schema"


def study_schema() -> dict[str, Any]:
    """JSON Schema of a study file, with the names and options of the models of the catalogue."""
    from squealstudy.models.catalogue import MODELS, model_names

    found = {name: definition_of(name) for name in kind_names()}
    of_models = {name: d for name, d in found.items() if issubclass(d, StudyDefinition)}
    whole = create_model(
        "StudyDefinition",
        __base__=tuple(sorted(set(of_models.values()), key=lambda d: -len(d.__mro__))),
    )
    schema: dict[str, Any] = _without_null(whole.model_json_schema())
    schema["$defs"]["StudySection"]["properties"]["kind"]["enum"] = list(of_models)
    model = schema["$defs"]["ModelSection"]
    model["properties"]["name"]["enum"] = list(model_names())
    choices: dict[str, list[str | int]] = {}
    for option in (option for m in MODELS.values() for option in m.options):
        known = choices.setdefault(option.name, [])
        known.extend(c for c in option.choices if c not in known)
        model["properties"][option.name] = {"enum": known, "description": option.description}
    model["additionalProperties"] = False
    head = {"$schema": DIALECT, "title": "squealstudy study file"}
    return head | {k: v for k, v in schema.items() if k not in head}


def methods_schema(name: str) -> dict[str, Any]:
    """JSON Schema of the files of a kind that measures methods."""
    schema: dict[str, Any] = _without_null(definition_of(name).model_json_schema())
    head = {"$schema": DIALECT, "title": f"squealstudy {name} file"}
    return head | {k: v for k, v in schema.items() if k not in head}


def _without_null(node: Any) -> Any:
    """The schema without `null`, which TOML does not have: such keys are left out instead."""
    if isinstance(node, list):
        return [_without_null(item) for item in node]
    if not isinstance(node, dict):
        return node
    kept = {k: _without_null(v) for k, v in node.items() if v is not None}
    types = kept.get("anyOf", [])
    if {"type": "null"} not in types:
        return kept
    others = [t for t in types if t != {"type": "null"}]
    rest = {k: v for k, v in kept.items() if k != "anyOf"}
    return {**others[0], **rest} if len(others) == 1 else {**rest, "anyOf": others}
