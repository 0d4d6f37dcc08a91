"""TOML text: tables written as such, and the lines of its keys, which tomllib does not give."""

from __future__ import annotations

import json
import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

KeyPath = tuple[str | int, ...]  # keys, and 0-based positions in arrays

MAX_DEPTH = 24  # deeper nesting has no meaning in a study file; it is not looked into
BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
SPACE = re.compile(r"[ \t]*")
KEY_PART = re.compile(r"""[A-Za-z0-9_-]+|"(?:\\.|[^"\\\n])*"|'[^'\n]*'""")
STRING = re.compile(
    r'''"""(?:\\.|[^\\])*?"""(?:"{0,2})|\'\'\'.*?\'\'\'(?:'{0,2})'''
    r"""|"(?:\\.|[^"\\\n])*"|'[^'\n]*\'""",
    re.DOTALL,
)
BARE_VALUE = re.compile(r"[^,\[\]{}#\n]+")
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


@dataclass(frozen=True)
class KeyLines:
    """Where the tables, keys and array elements of a TOML text are.

    Attributes
    ----------
    exact : dict of key path -> int
        1-based lines, in the order of the text; ``("sweep", 1, "num")`` is ``num`` in the second
        ``[[sweep]]``.
    loose : dict of key path -> int
        The same with dotted strings taken apart: ``"a.b" = 1`` is found like ``a.b = 1``.
    """

    exact: dict[KeyPath, int]
    loose: dict[KeyPath, int]

    def find(self, keys: KeyPath) -> int | None:
        """Line of a key, or else of the nearest key around it; None where neither is there."""
        parts = _split(keys)
        around = (self.loose.get(parts[:end]) for end in range(len(parts), 0, -1))
        return self.exact.get(keys) or next((line for line in around if line), None)


def key_lines(text: str) -> KeyLines:
    """The lines of all keys of valid TOML."""
    scanner = _Scanner(text)
    scanner.run()
    loose: dict[KeyPath, int] = {}
    for keys, line in scanner.lines.items():
        loose.setdefault(_split(keys), line)
    return KeyLines(scanner.lines, loose)


def find_line(text: str, keys: KeyPath) -> int | None:
    """Line of one key in valid TOML, as `KeyLines.find`."""
    return key_lines(text).find(keys)


def _split(keys: KeyPath) -> KeyPath:
    """The path with dotted strings taken apart."""
    parts: list[str | int] = []
    for key in keys:
        parts.extend(key.split(".") if isinstance(key, str) else [key])
    return tuple(parts)


class _Scanner:
    """Walks once over the text; on text it does not understand it stops where it is."""

    def __init__(self, text: str) -> None:
        self.text, self.pos = text, 0
        self.lines: dict[KeyPath, int] = {}
        self._ends = [m.start() for m in re.finditer("\n", text)]
        self._tables: dict[KeyPath, int] = {}  # arrays of tables: how many so far

    def run(self) -> None:
        base: KeyPath = ()
        while char := self._next():
            base = self._header() if char == "[" else base
            if char != "[":
                self._pair(base)

    def _header(self) -> KeyPath:
        """``[table]`` or ``[[array of tables]]``: the path of what follows."""
        line = self._line()
        many = self.text.startswith("[[", self.pos)
        self.pos += 2 if many else 1
        parts = self._key()
        self.pos += 2 if many else 1
        path: KeyPath = ()
        for i, part in enumerate(parts):
            path = (*path, part)
            self._note(path, line)
            if many and i == len(parts) - 1:
                self._tables[path] = self._tables.get(path, 0) + 1
            if path in self._tables:
                path = (*path, self._tables[path] - 1)
                self._note(path, line)
        return path

    def _pair(self, base: KeyPath) -> None:
        line = self._line()
        parts = self._key()
        for end in range(1, min(len(parts), MAX_DEPTH) + 1):
            self._note((*base, *parts[:end]), line)
        if not parts or not self.text.startswith("=", self.pos):
            self._stop()
            return
        self.pos += 1
        self._value((*base, *parts))

    def _value(self, path: KeyPath) -> None:
        char = self._next()
        if len(path) > MAX_DEPTH:
            self._stop()
        elif char == "[":
            self._array(path)
        elif char == "{":
            self._inline_table(path)
        elif found := (STRING if char in "\"'" else BARE_VALUE).match(self.text, self.pos):
            self.pos = found.end()
        else:
            self._stop()

    def _array(self, path: KeyPath) -> None:
        self.pos += 1
        index = 0
        while (char := self._next()) not in ("]", ""):
            if char == ",":
                self.pos += 1
                continue
            self._note((*path, index), self._line())
            self._value((*path, index))
            index += 1
        self.pos += 1

    def _inline_table(self, path: KeyPath) -> None:
        self.pos += 1
        while (char := self._next()) not in ("}", ""):
            if char == ",":
                self.pos += 1
            else:
                self._pair(path)
        self.pos += 1

    def _key(self) -> tuple[str, ...]:
        """A dotted key; the position is then after it and the spaces that follow."""
        parts: list[str] = []
        while True:
            self._skip(SPACE)
            found = KEY_PART.match(self.text, self.pos)
            if found is None:
                self._stop()
                return ()
            self.pos = found.end()
            parts.append(_unquoted(found.group()))
            self._skip(SPACE)
            if not self.text.startswith(".", self.pos):
                return tuple(parts)
            self.pos += 1

    def _next(self) -> str:
        """The next character that says something; empty at the end."""
        self._skip(BLANK)
        return self.text[self.pos : self.pos + 1]

    def _skip(self, pattern: re.Pattern[str]) -> None:
        found = pattern.match(self.text, self.pos)
        self.pos = found.end() if found else self.pos

    def _line(self) -> int:
        return bisect_left(self._ends, self.pos) + 1

    def _note(self, path: KeyPath, line: int) -> None:
        if len(path) <= MAX_DEPTH:
            self.lines.setdefault(path, line)

    def _stop(self) -> None:
        self.pos = len(self.text)


def _unquoted(part: str) -> str:
    """A key as it is meant; escapes of a basic string are for tomllib to read."""
    if part.startswith('"') and "\\" in part:
        return str(tomllib.loads(f"key = {part}")["key"])
    return part[1:-1] if part[0] in "\"'" else part
