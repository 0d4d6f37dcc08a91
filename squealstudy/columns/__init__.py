"""The registry of columns: the meaning of each column of each table, and its error if known.

The store writes it to the metadata of Parquet fields, with the unit, and reference pages are made
of it. A kind from outside the package adds its own columns (`Kind.columns`).
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
    """Definition of a column in a table of a kind of study; None where there is none.

    Parameters
    ----------
    kind : str
        Name of the kind.
    table : str
        File name of the table without ending; for histories their folder.
    name : str
        Name of the column.
    parameters : frozenset of str
        Parameters of the study. A column with such a name holds its values, unless the table has
        another number of that name (as the damping ratio of a mode).
    """
    columns = COLUMNS.get(kind, {}).get(table, ())
    default_column = None
    if name in parameters:
        default_column = VARIABLE if table == "designs" else PARAMETER
    return next((column for column in columns if column.fits(name)), default_column)
