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
    given: Mapping[str, Any] | None = None,
    more: bool = True,
    comments: bool = True,
) -> Iterator[str]:
    """A table that is given, with `more` of its keys as comments; one that is not, as a comment."""
    yield head if given is not None else f"# {head}"
    for key, field in fields.items():
        here = given is not None and key in given
        if not here and not more:
            continue
        if comments:
            yield from comment_lines(described(field))
        yield f"{key} = {toml_value((given or {})[key])}" if here else default_line(key, field)
    yield ""


def section_lines(
    name: str,
    section: BaseModel,
    given: Mapping[str, Any],
    shown: Collection[str] | None,
    commented: bool = False,
) -> Iterator[str]:
    """A section with the keys that are given, and those at their defaults that are `shown`."""
    yield f"# [{name}]" if commented else f"[{name}]"
    for key, field in type(section).model_fields.items():
        if shown is None or key in shown or key in given:
            yield from key_lines(key, getattr(section, key), described(field), given)
    yield ""


def section_fields(found: FieldInfo) -> dict[str, FieldInfo]:
    """Keys of the section that an annotation such as ``Section | None`` is of."""
    kinds: tuple[Any, ...] = getattr(found.annotation, "__args__", ())
    return next(k.model_fields for k in kinds if hasattr(k, "model_fields"))


def key_lines(
    name: str, default: object, described: str, given: Mapping[str, Any]
) -> Iterator[str]:
    """A key as given, else at its default as a comment, beneath what it is."""
    yield from comment_lines(described)
    if name in given:
        yield f"{toml_key(name)} = {toml_value(given[name])}"
        return
    if isinstance(default, BaseModel):
        default = default.model_dump(exclude_none=True)
    shown = "..." if default is None else toml_value(default)
    yield f"# {toml_key(name)} = {shown}"


def default_line(key: str, found: FieldInfo) -> str:
    """A key at its default, as a comment."""
    default = found.get_default(call_default_factory=True)
    has_default = default is not None and not found.is_required()
    return f"# {key} = {toml_value(default) if has_default else '...'}"


def described(found: FieldInfo) -> str:
    """What a key is, and what it can be where that is one of some words."""
    words = [word for word in get_args(found.annotation) if isinstance(word, str)]
    return f"{found.description} ({' | '.join(words)})" if words else found.description or ""


def comment_lines(text: str) -> Iterator[str]:
    """A text as lines of comments."""
    return (f"#   {line}" for line in wrapped(text, 4))


def wrapped(text: str, indent: int) -> list[str]:
    """A text in lines of MAX_LINE_CHARACTERS, less the indent."""
    return textwrap.wrap(text, MAX_LINE_CHARACTERS - indent, break_on_hyphens=False)
