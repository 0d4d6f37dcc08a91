"""The one registry of columns: what each number of each table means, what is known of its error.

Store writes it into the metadata of the Parquet fields, beside the unit; reference pages are made
of it. A kind from outside the package brings its own (`Kind.columns`).
"""

from __future__ import annotations

from squealstudy.columns.column import PARAMETER, Column, Tables, column_names, unit_of
from squealstudy.columns.cycles import LIMIT_CYCLES
from squealstudy.columns.designs import DESIGN, VARIABLE
from squealstudy.columns.methods import METHOD_STABILITY, WORK_PRECISION
from squealstudy.columns.modes import COMPLEX_MODES, SENSITIVITY
from squealstudy.columns.runs import TRANSIENT

__all__ = [
    "COLUMNS",
    "Column",
    "Tables",
    "column_names",
    "column_of",
    "register_columns",
    "unit_of",
]

COLUMNS: dict[str, Tables] = {
    "complex_modes": COMPLEX_MODES,
    "transient": TRANSIENT,
    "limit_cycles": LIMIT_CYCLES,
    "sensitivity": SENSITIVITY,
    "design": DESIGN,
    "work_precision": WORK_PRECISION,
    "method_stability": METHOD_STABILITY,
}


def register_columns(kind: str, tables: Tables) -> None:
    """Add the columns of a kind from outside the package."""
    COLUMNS[kind] = tables


def column_of(kind: str, table: str, name: str, parameters: frozenset[str]) -> Column | None:
    """What a column of a table of a kind is; None where nobody has said.

    Parameters
    ----------
    kind : str
    table : str
        File of the table without ending; of histories, their folder.
    name : str
    parameters : frozenset of str
        Of the study: columns of their names hold their values, where the table has no other number
        of that name (the damping ratio of a mode).
    """
    columns = COLUMNS.get(kind, {}).get(table, ())
    default_column = None
    if name in parameters:
        default_column = VARIABLE if table == "designs" else PARAMETER
    return next((column for column in columns if column.fits(name)), default_column)
