"""Types that the columns of a table must have, whoever wrote it: numbers, texts or flags.

They are checked because a hash in a journal proves that a table is as it was written, but not who
wrote it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import pyarrow as pa
import pyarrow.types as of

from squealstudy.columns import column_of
from squealstudy.columns.column import FLAGS, LISTS, NUMBERS, TEXTS
from squealstudy.engine.result_names import MOST_CELLS
from squealstudy.errors import printable


def _numbers(kind: pa.DataType) -> bool:
    return bool(of.is_integer(kind) or of.is_floating(kind))


def _texts(kind: pa.DataType) -> bool:
    return bool(of.is_string(kind) or of.is_large_string(kind))


FITS: Mapping[str, Callable[[pa.DataType], bool]] = {
    NUMBERS: _numbers,
    TEXTS: _texts,
    FLAGS: of.is_boolean,
    LISTS: lambda kind: of.is_list(kind) and _numbers(kind.value_type),
}


def misfit(
    schema: pa.Schema, kind: str, table: str, parameters: Collection[str], n_rows: int
) -> str:
    """Why a table cannot be that table of this kind of study, in words; empty if it can.

    Parameters
    ----------
    schema : pyarrow.Schema
        Names and types of the table's columns.
    kind, table : str
        Kind of study; name of the table's file without its suffix.
    parameters : collection of str
        Names of the study's parameters.
    n_rows : int
        Number of rows of the table.
    """
    if n_rows * len(schema) > MOST_CELLS:
        return f"{n_rows:,} rows of {len(schema):,} columns are more than a table has"
    if len(set(schema.names)) < len(schema):
        return "two columns have one name"
    parameter_names = frozenset(parameters)
    for field in schema:
        column = column_of(kind, table, field.name, parameter_names)
        holds = column.holds if column else ""
        plain = not of.is_nested(field.type) or of.is_list(field.type)
        if not plain or (holds and not (FITS[holds](field.type) or not n_rows)):
            name = printable(field.name)[:100]
            return f"column '{name}' holds {field.type}, not {holds or 'what a table holds'}"
    return ""
