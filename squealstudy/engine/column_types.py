"""Checks the types of a table's columns, as results directories may come from strangers.

A hash in the journal proves that a table was not changed after it was written, not who wrote it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import pyarrow as pa
import pyarrow.types as of

from squealstudy.columns import column_of
from squealstudy.columns.column import FLAGS, LISTS, NUMBERS, TEXTS
from squealstudy.engine.result_names import MOST_CELLS
from squealstudy.errors import printable


def _is_number(kind: pa.DataType) -> bool:
    return bool(of.is_integer(kind) or of.is_floating(kind))


def _is_text(kind: pa.DataType) -> bool:
    return bool(of.is_string(kind) or of.is_large_string(kind))


# test of a column's type, by what `columns` says that the column holds
IS_OF_TYPE: Mapping[str, Callable[[pa.DataType], bool]] = {
    NUMBERS: _is_number,
    TEXTS: _is_text,
    FLAGS: of.is_boolean,
    LISTS: lambda kind: of.is_list(kind) and _is_number(kind.value_type),
}


def misfit(
    schema: pa.Schema, kind: str, table: str, parameters: Collection[str], n_rows: int
) -> str:
    """Why a table cannot be this table of this kind of study, in words; empty if it can be.

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
        if not plain or (holds and not (IS_OF_TYPE[holds](field.type) or not n_rows)):
            name = printable(field.name)[:100]
            return f"column '{name}' holds {field.type}, not {holds or 'what a table holds'}"
    return ""
