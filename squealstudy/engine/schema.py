"""JSON Schemas of study files, for editors, from the sections and models themselves."""

from __future__ import annotations

from typing import Any

from pydantic import create_model

from squealstudy.study.kinds import definition_of, kind_names
from squealstudy.study.sections import StudyDefinition

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
