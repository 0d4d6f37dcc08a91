"""Tables as the text of a TOML file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """The text of nested tables of texts, numbers, lists and tables, as `tomllib` reads them."""
    return "\n".join(_lines(tables, "")).lstrip("\n") + "\n"


def toml_value(value: object) -> str:
    """One value, not a table, as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_key(k)} = {toml_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, float):
        return repr(float(value))  # a numpy number is one too, and has another repr
    return repr(value)


def toml_key(name: str) -> str:
    """A key, in quotes where it needs them."""
    return name if BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _lines(tables: Mapping[str, Any], path: str) -> list[str]:
    """Single keys first, as TOML asks for, then the tables."""
    nested = {k: v for k, v in tables.items() if isinstance(v, Mapping) or _is_tables(v)}
    lines = [f"{toml_key(k)} = {toml_value(v)}" for k, v in tables.items() if k not in nested]
    for key, value in nested.items():
        name = f"{path}{toml_key(key)}"
        several = isinstance(value, list | tuple)
        for table in value if several else [value]:
            lines += ["", f"[[{name}]]" if several else f"[{name}]", *_lines(table, f"{name}.")]
    return lines


def _is_tables(value: object) -> bool:
    """Whether a value is a list of tables."""
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)
