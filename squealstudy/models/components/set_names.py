"""Look-up of sets and surfaces by name, regardless of capitals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from squealstudy.errors import ModelError

T = TypeVar("T")


def has_name(sets: Mapping[str, T], name: str) -> bool:
    """Whether there is a name, regardless of capitals."""
    return any(existing.casefold() == name.casefold() for existing in sets)


def found_name(sets: Mapping[str, T], name: str, noun: str, origin: Path) -> T:
    """The value of a name. Capitals count only between names that differ in nothing else.

    ModelError where there is no such name; it lists the names that there are.
    """
    if name in sets:
        return sets[name]
    alike: Sequence[str] = [existing for existing in sets if existing.casefold() == name.casefold()]
    if len(alike) != 1:
        existing = ", ".join(sorted(sets)) or "none"
        raise ModelError(f"{origin} has no {noun} '{name}'; it has {existing}")
    return sets[alike[0]]
