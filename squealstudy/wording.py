"""Words of screens and pictures."""

from __future__ import annotations


def plural(n: int, word: str) -> str:
    """A count with its word."""
    return f"{n} {word}{'' if n == 1 else 's'}"
