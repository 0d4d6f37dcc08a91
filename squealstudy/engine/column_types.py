"""Types that the columns of a table must have, whoever wrote it: numbers, texts or flags.

A hash in a journal tells that a table is as it was written, not by whom.
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
    """Why a table is none of its kind's, in words; empty where nothing speaks against it.

    Parameters
    ----------
    schema : pyarrow.Schema
        Of the table.
    kind, table : str
        Of study; file of the table without ending.
    parameters : collection of str
        Of the study.
    n_rows : int
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
