"""Names of sets and surfaces, in whatever capitals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from squealstudy.errors import ModelError

T = TypeVar("T")


def has_name(of: Mapping[str, T], name: str) -> bool:
    """Whether a name is there, in whatever capitals."""
    return any(known.casefold() == name.casefold() for known in of)


def found_name(of: Mapping[str, T], name: str, what: str, origin: Path) -> T:
    """The value of a name; capitals count only where names differ by nothing else.

    Raises ModelError, with the names that there are.
    """
    if name in of:
        return of[name]
    alike: Sequence[str] = [known for known in of if known.casefold() == name.casefold()]
    if len(alike) != 1:
        known = ", ".join(sorted(of)) or "none"
        raise ModelError(f"{origin} has no {what} '{name}'; it has {known}")
    return of[alike[0]]
