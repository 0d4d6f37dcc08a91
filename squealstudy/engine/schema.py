"""JSON Schemas of study and model files, for editors and the reference, from the pydantic models.

Besides keywords of JSON Schema a key may have ``unit``, ``kinds`` (of study, if not all kinds have
it) and an example from the folder `key_examples`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, create_model

from squealstudy.errors import SquealstudyError
from squealstudy.study.kinds import definition_of, kind_names
from squealstudy.study.sections import StudyDefinition

DIALECT = "https://json-schema.org/draft/2020-12/schema"
EXAMPLES = Path(__file__).with_name("key_examples")
KEYS_WITHOUT_UNIT = (  # keys without a unit, although others of the same name have one
    "components.mass",
    "components.sets.normal",
    "components.sets.plane.normal",
)
# schemas of model files: of meshed parts, of lumped models, of matrices
MODEL_FILE, LUMPED_FILE, MATRIX_FILE = FILES = ("model_file", "lumped_file", "matrix_file")
UNITS = {  # units of keys of study files
    **dict.fromkeys(("modes.band", "transient.sensors", "transient.modes_below"), "Hz"),
    **dict.fromkeys(("transient.duration", "transient.step"), "s"),
    **dict.fromkeys(("transient.pod_duration", "transient.pod_step", "fidelity.budget"), "s"),
    **dict.fromkeys(("sensitivity.modes",), "Hz"),
    "transient.perturbation": "m/s",
    "limit_cycles.screen": "1/s",
    "limit_cycles.points.at": "m",
    "variable.added_mass.max": "kg",
    "variable.added_mass.at": "of the model file, else m",
    "variable.stiffener.max": "N/m",
}
FREE_KEY_TABLES = {"additionalProperties", "patternProperties"}  # in tables whose keys are names
OF_PARAMETER = "of the parameter"
for _key in ("values", "start", "stop", "mean", "std", "median"):
    UNITS |= {f"{table}.{_key}": OF_PARAMETER for table in ("sweep", "uncertain")}
UNITS["variable.bounds"] = OF_PARAMETER


def schema_of(kind: str | None) -> dict[str, Any]:
    """The JSON Schema of study files or other files.

    `kind` is None for study files of models, the name of a kind that measures methods, or one of
    FILES.

    Raises
    ------
    SquealstudyError
        There is no such kind.
    """
    of_methods = [n for n in kind_names() if not issubclass(definition_of(n), StudyDefinition)]
    if kind is None:
        return study_schema()
    if kind == MODEL_FILE:
        return model_schema()
    if kind in FILES:
        return lumped_schema(kind)
    if kind not in of_methods:
        expected = f"{', '.join((*of_methods, *FILES[:-1]))} or {FILES[-1]}"
        raise SquealstudyError(f"kind '{kind}': expected {expected}")
    return methods_schema(kind)


def study_schema() -> dict[str, Any]:
    """JSON Schema of a study file, with the names and options of the models of the catalogue."""
    from squealstudy.models.catalogue import MODELS, model_names

    definitions = {name: definition_of(name) for name in kind_names()}
    of_models = {name: d for name, d in definitions.items() if issubclass(d, StudyDefinition)}
    study_model = create_model(
        "StudyDefinition",
        __base__=tuple(sorted(set(of_models.values()), key=lambda d: -len(d.__mro__))),
    )
    schema: dict[str, Any] = _without_null(study_model.model_json_schema())
    schema["$defs"]["StudySection"]["properties"]["kind"]["enum"] = list(of_models)
    model = schema["$defs"]["ModelSection"]
    model["properties"]["name"]["enum"] = list(model_names())
    choices: dict[str, list[str | int]] = {}
    for option in (option for m in MODELS.values() for option in m.options):
        allowed = choices.setdefault(option.name, [])
        allowed.extend(c for c in option.choices if c not in allowed)
        model["properties"][option.name] = {"enum": allowed, "description": option.description}
    model["additionalProperties"] = False
    model["anyOf"] = [{"required": [key]} for key in ("name", "file")]  # one of both
    del model["required"]
    for name, table in schema["properties"].items():
        kinds = [kind for kind, d in of_models.items() if name in d.model_fields]
        if len(kinds) < len(of_models):
            table["kinds"] = kinds
    return _finished(schema, "study", "squealstudy study file", UNITS)


def methods_schema(name: str) -> dict[str, Any]:
    """JSON Schema of the files of a kind that measures methods."""
    schema: dict[str, Any] = _without_null(definition_of(name).model_json_schema())
    return _finished(schema, name, f"squealstudy {name} file", {})


def model_schema() -> dict[str, Any]:
    """JSON Schema of a model file, with SI units; a file has the units that it states."""
    from squealstudy.models.components.model_file import DIMENSIONS, ModelFile

    schema: dict[str, Any] = _without_null(ModelFile.model_json_schema())
    units = {key: dimension.unit for key, dimension in DIMENSIONS.items() if dimension.unit}
    units["angle"] = "deg"
    units |= dict.fromkeys(KEYS_WITHOUT_UNIT, "")
    return _finished(schema, MODEL_FILE, "squealstudy model file", units)


def lumped_schema(name: str) -> dict[str, Any]:
    """JSON Schema of the file of a lumped model, LUMPED_FILE or MATRIX_FILE."""
    from squealstudy.models.lumped.matrix_tables import MatrixFile
    from squealstudy.models.lumped.tables import LumpedFile

    tables: dict[str, type[BaseModel]] = {LUMPED_FILE: LumpedFile, MATRIX_FILE: MatrixFile}
    schema: dict[str, Any] = _without_null(tables[name].model_json_schema())
    return _finished(schema, name, f"squealstudy {name.replace('_', ' ')}", {})


def _finished(
    schema: dict[str, Any], name: str, title: str, units: Mapping[str, str]
) -> dict[str, Any]:
    """The schema with its head, and units and examples of its keys."""
    path = EXAMPLES / f"{name}.toml"
    if path.is_file():  # kinds from outside have none
        _annotate(schema, schema["$defs"], tomllib.loads(path.read_text("utf-8")), (), units)
    head = {"$schema": DIALECT, "$id": f"urn:squealstudy:{name}", "title": title}
    return head | {k: v for k, v in schema.items() if k not in head}


def _annotate(
    node: dict[str, Any],
    tables: Mapping[str, Any],
    example: Mapping[str, Any],
    keys: tuple[str, ...],
    units: Mapping[str, str],
) -> None:
    """Add units and examples to the keys of a table and of tables in it."""
    for key, entry in node.get("properties", {}).items():
        path = (*keys, key)
        if unit := units.get(".".join(path), units.get(key if keys else "")):
            entry["unit"] = unit
        if key not in example:
            continue
        key_example = example[key]
        inner_tables = [tables[name] for name in table_names(entry)]
        entry_example = (
            key_example[0] if inner_tables and isinstance(key_example, list) else key_example
        )
        if inner_tables and isinstance(entry_example, dict) and FREE_KEY_TABLES & entry.keys():
            entry_example = next(iter(entry_example.values()))  # a table of tables by name
        for table in inner_tables:
            if isinstance(entry_example, dict):
                _annotate(table, tables, entry_example, path, units)
        if keys or not inner_tables:
            entry["examples"] = [key_example]


def table_names(node: Any) -> list[str]:
    """Names of the tables that a key may hold, directly or as entries of a list or table."""
    if isinstance(node, dict):
        if "$ref" in node:
            return [str(node["$ref"]).rpartition("/")[2]]
        parts: Iterable[Any] = [
            *node.get("anyOf", ()),
            node.get("items"),
            node.get("additionalProperties"),
            *node.get("patternProperties", {}).values(),
        ]
        return [name for part in parts for name in table_names(part)]
    return []


def _without_null(node: Any) -> Any:
    """The schema without `null`: TOML has none, and leaves out such keys."""
    if isinstance(node, list):
        return [_without_null(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    with_values = {k: _without_null(v) for k, v in node.items() if v is not None}
    types = with_values.get("anyOf", [])
    if {"type": "null"} not in types:
        return with_values
    others = [t for t in types if t != {"type": "null"}]
    rest = {k: v for k, v in with_values.items() if k != "anyOf"}
    return {**others[0], **rest} if len(others) == 1 else {**rest, "anyOf": others}
