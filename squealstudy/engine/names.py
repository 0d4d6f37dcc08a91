"""Names of the files of a results directory."""

from __future__ import annotations

from collections.abc import Sequence

POINTS, MODES, GROWTH = "points.parquet", "modes.parquet", "growth.parquet"
ONSETS = "onsets.parquet"
SENSITIVITIES = "sensitivities.parquet"
MEASUREMENTS, ERRORS = "measurements.parquet", "errors.parquet"
CELLS = "cells.parquet"
HISTORIES, STATES = "histories", "states"
ONSET_PARAMETER = "friction"
INACCURATE = "inaccurate"  # status of a point whose roots are there, with too large an error


def onset_parameter(swept: Sequence[str]) -> str | None:
    """The parameter along which onsets are sought: friction if swept, else the first sweep."""
    if ONSET_PARAMETER in swept:
        return ONSET_PARAMETER
    return swept[0] if swept else None
