"""Names of sets and surfaces, in whatever capitals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from squealstudy.errors import ModelError

T = TypeVar("T")


def has_name(sets: Mapping[str, T], name: str) -> bool:
    """Whether a name is there, in whatever capitals."""
    return any(existing.casefold() == name.casefold() for existing in sets)


def found_name(sets: Mapping[str, T], name: str, noun: str, origin: Path) -> T:
    """The value of a name; capitals count only where names differ by nothing else.

    Raises ModelError, with the names that there are.
    """
    if name in sets:
        return sets[name]
    alike: Sequence[str] = [existing for existing in sets if existing.casefold() == name.casefold()]
    if len(alike) != 1:
        existing = ", ".join(sorted(sets)) or "none"
        raise ModelError(f"{origin} has no {noun} '{name}'; it has {existing}")
    return sets[alike[0]]
