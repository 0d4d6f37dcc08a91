"""The keys of study and model files as tables of Markdown, made from the JSON Schema."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from squealstudy.engine.schema import table_names

GUARD_AGAINST_OVERFLOW = 1e30  # bounds of this size only prevent overflow, and are not shown


def key_tables(schema: Mapping[str, Any]) -> str:
    """All keys of a schema with type, unit, default and meaning, a section for each table."""
    lines: list[str] = []
    plain: dict[str, Any] = {}
    for name, table in schema["properties"].items():
        inner = list(_inner(table, schema))
        if not inner:
            plain[name] = table
            continue
        lines += _table(_heading(name, table), table, inner, schema)
    if plain:
        head = ["## Top of the file", "", *_rows(plain, (), schema)]
        lines = [*head, *lines]
    return "\n".join(lines) + "\n"


def _inner(node: Mapping[str, Any], schema: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for name in dict.fromkeys(table_names(node)):
        yield schema["$defs"][name]


def _heading(name: str, table: Mapping[str, Any]) -> str:
    if table.get("type") == "array":
        return f"[[{name}]]"
    return f"[{name}{_table_suffix(table)}]"


def _table_suffix(table: Mapping[str, Any]) -> str:
    """Text after the name of a table: ".NAME" where its keys are names of tables."""
    return ".NAME" if {"additionalProperties", "patternProperties"} & table.keys() else ""


def _table(
    heading: str,
    table: Mapping[str, Any],
    inner: Iterable[Mapping[str, Any]],
    schema: Mapping[str, Any],
) -> list[str]:
    """A section of the page: a table of the file, and tables in it."""
    lines = [f"## `{heading}`", "", sentence(table.get("description", ""))]
    if kinds := table.get("kinds"):
        lines += ["", f"Kinds: {', '.join(f'`{k}`' for k in kinds)}."]
    nested_lines: list[str] = []
    for definition in inner:
        lines += ["", *_rows(definition["properties"], definition.get("required", ()), schema)]
        for key, entry in definition["properties"].items():
            for nested in _inner(entry, schema):
                plain = heading.strip("[]")
                inside = f"{plain}.{key}{_table_suffix(entry)}"
                nested_lines += [f"### `{inside}`", "", sentence(entry.get("description", "")), ""]
                nested_lines += _rows(nested["properties"], nested.get("required", ()), schema)
                for inner_key, inner_entry in nested["properties"].items():
                    for innermost in _inner(inner_entry, schema):
                        nested_lines += [f"### `{inside}.{inner_key}`", ""]
                        nested_lines += _rows(
                            innermost["properties"], innermost.get("required", ()), schema
                        )
    return [*lines, *nested_lines]


def _rows(
    properties: Mapping[str, Any], required: Iterable[str], schema: Mapping[str, Any]
) -> list[str]:
    """Lines of a Markdown table of keys, and an example of values where the schema has one."""
    has_units = any("unit" in entry for entry in _entries(schema))
    titles = ["key", "type", *["unit"] * has_units, "default", "meaning"]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    examples: list[str] = []
    for key, entry in properties.items():
        default = "*required*" if key in required else _default(entry)
        meaning = sentence(entry.get("description", ""))
        unit = [entry.get("unit", "")] * has_units
        cells = (f"`{key}`", _type(entry, schema), *unit, default, meaning)
        lines.append("| " + " | ".join(cell(c) for c in cells) + " |")
        examples += [f"{_bare(key)} = {toml_value(e)}" for e in entry.get("examples", ())]
    if examples:
        lines += ["", "```toml", *examples, "```"]
    return [*lines, ""]


def _entries(schema: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Schemas of all keys of the file and of tables in it."""
    for table in (schema, *schema.get("$defs", {}).values()):
        yield from table.get("properties", {}).values()


def _type(node: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """Type, choices and range of a key, in words."""
    if "enum" in node:
        return " or ".join(f"`{toml_value(v)}`" for v in node["enum"])
    if "const" in node:
        return f"`{toml_value(node['const'])}`"
    if "anyOf" in node:
        return ", or ".join(_type(part, schema) for part in node["anyOf"])
    if "$ref" in node:
        return "table"
    kind = node.get("type", "any")
    names = {"integer": "whole number", "boolean": "true or false", "string": "text"}
    names |= {"array": "list", "object": "table"}
    if isinstance(kind, list):
        return " or ".join(str(names.get(k, k)) for k in kind)
    if kind == "array":
        parts = node.get("prefixItems")
        if parts:
            return f"list of {len(parts)}, {_type(parts[0], schema)}"
        return "list" if "items" not in node else f"list of: {_type(node['items'], schema)}"
    words = names.get(kind, kind)
    return words + _range(node)


def _range(node: Mapping[str, Any]) -> str:
    """Text of the bounds of a key, after a comma; empty without bounds."""
    bounds = (
        ("exclusiveMinimum", "above"),
        ("minimum", "at least"),
        ("exclusiveMaximum", "below"),
        ("maximum", "at most"),
    )
    texts = [
        f"{word} {node[key]:,}"
        for key, word in bounds
        if key in node and abs(node[key]) < GUARD_AGAINST_OVERFLOW
    ]
    return ", " + ", ".join(texts) if texts else ""


def _default(node: Mapping[str, Any]) -> str:
    if "default" not in node or node["default"] in ([], {}, ""):
        return ""
    return f"`{toml_value(node['default'])}`"


def toml_value(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_bare(k)} = {toml_value(v)}" for k, v in value.items()) + "}"
    return f"{value:g}" if isinstance(value, float) and value != int(value) else str(value)


def _bare(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key) else toml_value(key)


def sentence(text: str) -> str:
    """The text as a sentence for Markdown; names in angle brackets are escaped."""
    plain = " ".join(text.split()).replace("<", "&lt;").replace("*", "\\*")
    if not plain:
        return ""
    return plain[0].upper() + plain[1:] + ("" if plain.endswith((".", "!", "?")) else ".")


def cell(text: str) -> str:
    """The text escaped for a cell of a table."""
    return text.replace("|", "\\|")
