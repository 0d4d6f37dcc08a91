"""Tables of TOML with a comment on each key, and keys at their defaults as comments."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from squealstudy.study.toml_text import toml_key, toml_value

MAX_LINE_CHARACTERS = 100


def table_lines(
    head: str,
    fields: Mapping[str, FieldInfo],
    values: Mapping[str, Any] | None = None,
    with_defaults: bool = True,
    comments: bool = True,
) -> Iterator[str]:
    """Lines of a table: keys with values, and `with_defaults` other keys as comments.

    Where `values` is None, the whole table is a comment. `comments` also writes descriptions.
    """
    yield head if values is not None else f"# {head}"
    for key, field in fields.items():
        is_given = values is not None and key in values
        if not is_given and not with_defaults:
            continue
        if comments:
            yield from comment_lines(described(field))
        yield f"{key} = {toml_value((values or {})[key])}" if is_given else default_line(key, field)
    yield ""


def section_lines(
    name: str,
    section: BaseModel,
    values: Mapping[str, Any],
    always_shown: Collection[str] | None,
    commented: bool = False,
) -> Iterator[str]:
    """Lines of a section: keys with values, and those of `always_shown` as comments.

    None shows all keys. `commented` makes a comment of the head.
    """
    yield f"# [{name}]" if commented else f"[{name}]"
    for key, field in type(section).model_fields.items():
        if always_shown is None or key in always_shown or key in values:
            yield from key_lines(key, getattr(section, key), described(field), values)
    yield ""


def section_fields(field: FieldInfo) -> dict[str, FieldInfo]:
    """Keys of the section that a field such as ``Section | None`` holds."""
    kinds: tuple[Any, ...] = getattr(field.annotation, "__args__", ())
    return next(k.model_fields for k in kinds if hasattr(k, "model_fields"))


def key_lines(
    name: str, default: object, described: str, values: Mapping[str, Any]
) -> Iterator[str]:
    """Lines of a key below its description: with its value, else as a comment with its default."""
    yield from comment_lines(described)
    if name in values:
        yield f"{toml_key(name)} = {toml_value(values[name])}"
        return
    if isinstance(default, BaseModel):
        default = default.model_dump(exclude_none=True)
    text = "..." if default is None else toml_value(default)
    yield f"# {toml_key(name)} = {text}"


def default_line(key: str, field: FieldInfo) -> str:
    """A key at its default, as a comment."""
    default = field.get_default(call_default_factory=True)
    has_default = default is not None and not field.is_required()
    return f"# {key} = {toml_value(default) if has_default else '...'}"


def described(field: FieldInfo) -> str:
    """Description of a key, with its allowed words if there are any."""
    words = [word for word in get_args(field.annotation) if isinstance(word, str)]
    return f"{field.description} ({' | '.join(words)})" if words else field.description or ""


def comment_lines(text: str) -> Iterator[str]:
    """A text as comment lines."""
    return (f"#   {line}" for line in wrapped(text, 4))


def wrapped(text: str, indent: int) -> list[str]:
    """A text in lines of MAX_LINE_CHARACTERS, less the indent."""
    return textwrap.wrap(text, MAX_LINE_CHARACTERS - indent, break_on_hyphens=False)
