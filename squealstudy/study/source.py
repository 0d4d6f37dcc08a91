"""A study file as text: reads, parses and validates it, with plain messages about mistakes."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from squealstudy.errors import ExtensionError, StudyFileError
from squealstudy.extensions import load_extension
from squealstudy.files import OF_JSON, read_whole
from squealstudy.study.toml_text import KeyLines, KeyPath
from squealstudy.wording import did_you_mean, expectation, shown

Model = TypeVar("Model", bound=BaseModel)
TOML_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
LIST_PLACE = re.compile(r"(?P<name>\w+)\[(?P<number>\d+)\]")
MOST_NAMED = 2  # most tables that a message proposes for a key
MOST_LISTED, MOST_SOUGHT = 10, 50  # further errors in a message; errors that are sorted by line


@dataclass(frozen=True)
class SourceText:
    """A study file's path and its text, for messages that name file, line and key."""

    path: Path
    text: str

    @classmethod
    def read(cls, path: str | Path) -> SourceText:
        """Read the text of a UTF-8 file; StudyFileError where that is not possible."""
        return cls(Path(path), _read_text(Path(path)))

    @cached_property
    def tables(self) -> dict[str, Any]:
        """The tables as nested dicts; StudyFileError with the line where it is not TOML."""
        return _parsed(self.path, self.text)

    @cached_property
    def lines(self) -> KeyLines:
        """Lines of the keys in the text."""
        return KeyLines(self.text)

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """The error to raise about a key, with its line or that of the table around it."""
        return StudyFileError(message, self.path, dotted(keys), self.lines.find(keys))


def dotted(keys: KeyPath) -> str:
    """A key path as users write it, ``sweep[2].num``: list positions count from 1."""
    text = "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in keys)
    return text.removeprefix(".")


def _read_text(path: Path) -> str:
    """Text of a study file; StudyFileError where it cannot be read as UTF-8."""
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # it might never end
            raise StudyFileError("expected a study file (TOML), got a pipe or a device", path)
        raw = read_whole(path, OF_JSON)
    except FileNotFoundError:
        raise StudyFileError("there is no such file", path) from None
    except IsADirectoryError:
        raise StudyFileError("expected a study file (TOML), got a directory", path) from None
    except OSError as e:
        raise StudyFileError(f"cannot be read: {e.strerror or e}", path) from None
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        line = raw.count(b"\n", 0, e.start) + 1
        raise StudyFileError("expected UTF-8 text", path, line=line) from None


def _parsed(path: Path, text: str) -> dict[str, Any]:
    """Tables of a TOML text; StudyFileError with line and column for a fault."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise StudyFileError("not valid TOML: lists or tables nested too deeply", path) from None
    except ValueError as e:  # TOMLDecodeError, and int()'s refusal of thousands of digits
        match = TOML_PLACE.search(str(e))
        if match is None:
            raise StudyFileError(f"not valid TOML: {e}", path) from None
        line = int(match[1]) if match[1] else text.rstrip("\n").count("\n") + 1
        what = str(e)[: match.start()].replace("Cannot overwrite a value", "a key is given twice")
        if match[2]:
            what += _mended(text.splitlines()[line - 1 : line], int(match[2]) - 1)
        column = f" (column {match[2]})" if match[2] else " (end of file)"
        raise StudyFileError(f"not valid TOML: {what}{column}", path, line=line) from None


def _mended(lines: list[str], column: int) -> str:
    """Proposal for values that are not TOML: .5, 5., 1,5, True, hoffmann; empty for others."""
    line = lines[0] if lines else ""
    before = re.search(r"[-+]?\d+$", line[:column])
    after = re.match(r"[^\s,\]}#]+", line[column:])
    word = after[0] if after else ""
    if re.fullmatch(r"[-+]?\.\d.*", word):
        return f" '{word}': a number begins with a digit, {word.replace('.', '0.', 1)}"
    if before and re.match(r"\.(?!\d)", word):
        return f": a number has a digit after its point, {before[0]}.0{word[1:]}"
    if before and re.fullmatch(r",\s*\d+\s*", line[column:].split("#")[0]):
        return ": a number has a point, and no comma"
    if word.lower() in ("true", "false"):
        return f" '{word}': expected {word.lower()}"
    if re.fullmatch(r"[^\W\d][\w./-]*|[\u2018-\u201f].*", word):
        return f" '{word}': text stands in plain quotes, \"{word.strip('‘’“”„')}\""
    return ""


def changed(
    source: SourceText, tables: Mapping[str, Any], changes: Mapping[str, Any]
) -> dict[str, Any]:
    """A copy of a file's tables with other values of some dotted keys.

    A value of None removes the key. StudyFileError where a key cannot be set.
    """
    copied = copy.deepcopy(dict(tables))
    for key, new_value in changes.items():
        try:
            _set_key(copied, key, new_value)
        except KeyError as error:
            message = f"'{error.args[0]}' is no single table in this file"
            raise StudyFileError(message, source.path, key) from None
    return copied


def _set_key(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, ``transient.step``, in nested tables; missing tables are made.

    A key that the file writes in quotes, with its dots, is replaced there. ``sweep[1].num`` is in
    the first of several tables of a name. KeyError about what is no table.
    """
    name, _, rest = key.partition(".")
    if key in tables or not rest:
        if value is None:
            tables.pop(key, None)
        else:
            tables[key] = value
        return
    if match := LIST_PLACE.fullmatch(name):
        listed = tables.get(match["name"])
        number = int(match["number"])
        if not isinstance(listed, list) or not 1 <= number <= len(listed):
            raise KeyError(name)
        _set_key(listed[number - 1], rest, value)
        return
    inner = tables.setdefault(name, {})
    if not isinstance(inner, dict):
        raise KeyError(name)
    _set_key(inner, rest, value)


def extensions_of(source: SourceText, tables: Mapping[str, Any]) -> tuple[str, ...]:
    """Execute the extensions that a study names, and return their hashes."""
    section = tables.get("study")
    names = section.get("extensions", ()) if isinstance(section, Mapping) else ()
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return ()  # none, or validation says what is wrong
    hashes = []
    for number, name in enumerate(names):
        try:
            hashes.append(load_extension(source.path.parent / name))
        except ExtensionError as error:
            keys = ("study", "extensions", number)
            raise source.error(keys, f"'{name}': {error.message}") from error
    return tuple(hashes)


def not_registered(tables: Mapping[str, Any], name: object) -> str:
    """End of a message that says where an unknown name may be defined; empty if it is no text."""
    if not isinstance(name, str):
        return ""
    files = tables.get("study", {}).get("extensions")
    if files:
        return f"; '{name}' is in no file of extensions = {list(files)}"
    return "; one of your own needs its file, extensions = ['my_file.py'] in [study]"


def validate(kind: type[Model], source: SourceText, data: Mapping[str, Any]) -> Model:
    """`data` as a pydantic model; StudyFileError about all mistakes, in the order of the file."""
    try:
        return kind.model_validate(data)
    except ValidationError as e:
        problems = {_key_path(data, p["loc"]): p for p in e.errors(include_url=False)}
        for keys in [k for k, p in problems.items() if p["type"] == "too_short"]:
            if any(len(k) > len(keys) and k[: len(keys)] == keys for k in problems):
                del problems[keys]  # too short only because pydantic does not count wrong entries
    lines = {keys: source.lines.find(keys) for keys in list(problems)[:MOST_SOUGHT]}
    past_the_end = len(source.text) + 2  # for keys that are nowhere in the file
    first, *others = sorted(lines, key=lambda keys: lines[keys] or past_the_end)
    said = [_wording(kind, problems[first])]
    for keys in others[:MOST_LISTED]:
        line = f"line {lines[keys]}, " if lines[keys] else ""
        said.append(f"{line}key '{dotted(keys)}': {_wording(kind, problems[keys])}")
    if n_unsaid := len(problems) - len(said):
        said.append(f"and {n_unsaid} more")
    raise source.error(first, "\n".join(said))


def _key_path(data: Any, loc: KeyPath) -> KeyPath:
    """Key path in the data of an error, without types of a union that pydantic adds to it."""
    for depth, key in enumerate(loc):
        if isinstance(data, Mapping) and isinstance(key, str):
            data = data.get(key)
        elif isinstance(data, list | tuple) and isinstance(key, int) and key < len(data):
            data = data[key]
        else:
            return loc[:depth]
    return loc


def _wording(kind: type[BaseModel], problem: ErrorDetails) -> str:
    """Message on one pydantic error, for the author of the file."""
    loc, written, context = problem["loc"], problem["input"], problem.get("ctx", {})
    if problem["type"] == "value_error":
        return str(context["error"])
    if problem["type"] == "missing":
        names_key = not isinstance(loc[-1], int)
        return _missing(kind, loc) if names_key else _too_few(kind, loc, written)
    if problem["type"] == "extra_forbidden":
        keys = list((_section(kind, loc[:-1]) or kind).model_fields)
        if where := _elsewhere(kind, str(loc[-1])):
            return f"it belongs in {where}"
        closest = did_you_mean(str(loc[-1]), keys)
        return f"unknown key{closest or '; expected one of ' + ', '.join(keys)}"
    if problem["type"] == "tuple_type" and isinstance(written, dict):
        return f"expected [[{loc[-1]}]] with two brackets: there can be several"
    if problem["type"] == "model_type" and isinstance(written, list):
        if not all(isinstance(entry, dict) for entry in written) and (of := _section(kind, loc)):
            return f"expected a table {{{' = ..., '.join(of.model_fields)} = ...}}"
        return f"expected [{loc[-1]}] with one bracket: there is only one"
    expected = expectation(problem["type"], context)
    if not expected:
        return f"{problem['msg']}, got {shown(written)}"
    hint = ""
    if problem["type"] == "literal_error":
        hint = did_you_mean(str(written), re.findall(r"'([^']*)'", expected))
        expected = expected if " or " not in expected else f"one of {expected}"
    return f"expected {expected}, got {shown(written)}{hint}"


def _too_few(kind: type[BaseModel], loc: KeyPath, entry: object) -> str:
    """Message about a list of fixed length with too few values; `loc` ends at the missing one."""
    section = _section(kind, loc[:-2]) or kind
    parts = list(_annotation_parts(section.model_fields[str(loc[-2])].annotation))
    count = next(len(get_args(p)) for p in parts if get_origin(p) is tuple)
    return f"expected {count} values, got {len(entry) if isinstance(entry, Sized) else loc[-1]}"


def _missing(kind: type[BaseModel], loc: KeyPath) -> str:
    section = _section(kind, loc[:-1]) or kind
    field = section.model_fields.get(str(loc[-1]))
    meaning = f": {field.description}" if field is not None and field.description else ""
    is_section = len(loc) == 1 and _section(kind, loc) is not None
    what = f"table [{loc[-1]}]" if is_section else f"key '{loc[-1]}'"
    return f"the {what} is missing{meaning}"


def _section(kind: type[BaseModel], loc: KeyPath) -> type[BaseModel] | None:
    """The pydantic model of the table at a key path; None where it is no table."""
    section: type[BaseModel] | None = kind
    named = False
    for key in loc:
        if named or section is None or isinstance(key, int):
            named = False
            continue
        field = section.model_fields.get(key)
        annotation = field.annotation if field is not None else None
        kinds = list(_annotation_parts(annotation))
        section = next((k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)), None)
        named = any(get_origin(k) is dict for k in kinds)
    return section


def _elsewhere(kind: type[BaseModel], key: str) -> str:
    """Text on the tables of the file that have a key; empty for none, or for too many."""
    from squealstudy.models.operating import (  # numba is slow to load
        CONTACT_OPTION,
        FRICTION_OPTION,
    )

    if key in (CONTACT_OPTION.name, FRICTION_OPTION.name):
        return "[model]" if "model" in kind.model_fields else "[model] of the study"
    table_names = list(dict.fromkeys(_tables_with(kind, key, "")))
    return " or ".join(table_names[:MOST_NAMED]) if len(table_names) <= MOST_NAMED else ""


def _tables_with(kind: type[BaseModel], key: str, path: str) -> Iterator[str]:
    """Names, as files write them, of the inner tables that have a key."""
    for name, field in kind.model_fields.items():
        kinds = list(_annotation_parts(field.annotation))
        table = next((k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)), None)
        if table is None:
            continue
        origins = [get_origin(k) for k in kinds]
        table_path = f"{path}{name}" + (".NAME" if dict in origins else "")
        if key in table.model_fields:
            yield (
                f"[[{table_path}]]"
                if tuple in origins and dict not in origins
                else f"[{table_path}]"
            )
        yield from _tables_with(table, key, f"{table_path}.")


def _annotation_parts(annotation: Any) -> Iterator[Any]:
    """An annotation and all annotations in it."""
    yield annotation
    for part in get_args(annotation):
        yield from _annotation_parts(part)
