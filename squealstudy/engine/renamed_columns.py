"""Columns of results of before, by the names that they have now."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

# by kind of study, the former name and today's: docs/reference/words-in-tables.md has them too
RENAMED_COLUMNS = {
    "transient": {"dominant_frequency_hz": "torque_line_hz"},
    "design": {
        "stage": "analysis",
        "role": "origin",
        "meets": "meets_margin",
        "uncoupled_damping": "damping_without_friction",
    },
}


def with_new_names(table: pd.DataFrame, kind: str) -> pd.DataFrame:
    """A table of results of a kind, its columns named as this version names them."""
    names = {
        old: new
        for old, new in RENAMED_COLUMNS.get(kind, {}).items()
        if old in table and new not in table
    }
    return table.rename(columns=names) if names else table
