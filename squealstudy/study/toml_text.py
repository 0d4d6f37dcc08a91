"""Writes tables as TOML, and finds the lines of keys in a TOML text: tomllib does neither."""

from __future__ import annotations

import contextlib
import json
import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from functools import cached_property
from typing import Any

KeyPath = tuple[str | int, ...]  # keys, and 0-based positions in arrays

UNQUOTED_KEY = re.compile(r"[A-Za-z0-9_-]+")
# what may close a list or text that is cut in the middle
CLOSINGS = ("", "]", "]]", "]]]", '"""', "'''")
MAX_NESTING = 24  # deeper nesting means nothing in a study file and is not searched


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
    return name if UNQUOTED_KEY.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _lines(tables: Mapping[str, Any], path: str) -> list[str]:
    """Lines of nested tables: single keys before tables, as TOML asks for."""
    nested = {k: v for k, v in tables.items() if isinstance(v, Mapping) or _is_tables(v)}
    lines = [f"{toml_key(k)} = {toml_value(v)}" for k, v in tables.items() if k not in nested]
    for key, entry in nested.items():
        name = f"{path}{toml_key(key)}"
        several = isinstance(entry, list | tuple)
        for table in entry if several else [entry]:
            lines += ["", f"[[{name}]]" if several else f"[{name}]", *_lines(table, f"{name}.")]
    return lines


def _is_tables(value: object) -> bool:
    """Whether a value is a list of tables."""
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)


class KeyLines:
    """Lines of the tables, keys and array elements of a TOML text, which tomllib does not tell.

    The line of a key is the last one of the shortest beginning of the text that has the key.

    Parameters
    ----------
    text : str
        Valid TOML.
    """

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")
        self._read: dict[int, dict[str, Any]] = {0: {}}

    def find(self, keys: KeyPath) -> int | None:
        """Line (from 1) of a key, else of the innermost table that has a line; None without both.

        ``("sweep", 1, "num")`` is ``num`` in the second ``[[sweep]]``. A dotted key may be one text
        or several parts, both in `keys` and in the file.
        """
        parts: list[str | int] = []
        for key in keys:
            parts.extend(key.split(".") if isinstance(key, str) else [key])
        ends = range(min(len(parts), MAX_NESTING), 0, -1)
        tried = [(keys[:MAX_NESTING], 1), *((tuple(parts[:end]), end) for end in ends)]
        for path, joined in tried:
            if _holds(self._whole, path, joined):
                count = range(len(self._lines) + 1)
                return bisect_left(count, True, key=lambda n: _holds(self._tables(n), path, joined))
        return None

    @cached_property
    def _whole(self) -> dict[str, Any]:
        """Tables of the whole text."""
        return self._tables(len(self._lines))

    def _tables(self, count: int) -> dict[str, Any]:
        """Tables of the first lines of the text, or of fewer where these cannot be parsed."""
        if count not in self._read:
            head = "\n".join(self._lines[:count])
            for closing in CLOSINGS:
                with contextlib.suppress(ValueError, RecursionError):
                    self._read[count] = tomllib.loads(f"{head}\n{closing}")
                    break
            else:
                self._read[count] = self._tables(count - 1)
        return self._read[count]


def _holds(node: Any, path: KeyPath, joined: int) -> bool:
    """Whether nested tables hold a key; up to `joined` parts of its path may be one dotted key."""
    if not path:
        return True
    if isinstance(node, list):
        key = path[0]
        if not isinstance(key, int) or key >= len(node):
            return False
        return _holds(node[key], path[1:], joined)
    if not isinstance(node, dict):
        return False
    names = ((".".join(map(str, path[:n])), path[n:]) for n in range(1, joined + 1))
    return any(name in node and _holds(node[name], rest, joined) for name, rest in names)
