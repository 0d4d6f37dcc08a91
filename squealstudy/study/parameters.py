"""The parameter of a study along which onsets are sought."""

from __future__ import annotations

from collections.abc import Sequence

ONSET_PARAMETER = "friction"


def onset_parameter(swept: Sequence[str]) -> str | None:
    """The parameter along which onsets are sought: friction if swept, else the first sweep."""
    if ONSET_PARAMETER in swept:
        return ONSET_PARAMETER
    return swept[0] if swept else None
