"""Chunk rows of all kinds of study: their first columns, and tables made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from squealstudy.engine.plan import Plan
from squealstudy.engine.store import Store
from squealstudy.reduction.working_point import WorkingPoint

Fields = Sequence[tuple[str, pa.DataType]]
TEXT, REAL, FLAG = pa.string(), pa.float64(), pa.bool_()
WHOLE_NUMBER, COUNT = pa.int32(), pa.int64()
WORKING_POINT_FIELDS = (
    ("working_point_residual", REAL),
    ("open_share", REAL),
    ("contact_pressure_min", REAL),
    ("contact_pressure_max", REAL),
)
HEAD = (("point_id", TEXT), ("status", TEXT), ("message", TEXT), ("wall_s", REAL))


def head(point_id: str, wall_s: float, status: str = "ok", message: str = "") -> dict[str, Any]:
    """First columns of every row."""
    return {"point_id": point_id, "status": status, "message": message, "wall_s": wall_s}


def working_point_cells(point: WorkingPoint | None) -> dict[str, float]:
    """Columns WORKING_POINT_FIELDS of a working point; NaN without one.

    Contact pressures [Pa] are the least and the largest of all contact points, without springs.
    """
    names = [name for name, _ in WORKING_POINT_FIELDS]
    if point is None:
        return dict.fromkeys(names, np.nan)
    p = point.contact_pressure[point.touching]
    figures = (point.residual, point.open_share, float(p.min()), float(p.max()))
    return dict(zip(names, figures, strict=True))


def failed_row(
    schema: pa.Schema, point_id: str, status: str, message: str, wall_s: float = 0.0
) -> dict[str, Any]:
    """Row of a point without results: texts and lists are empty, floats NaN, others None."""
    numbers, lists = _missing_values(schema)
    nothing = numbers | {name: [] for name in lists}  # each row has its own, to be filled
    return nothing | head(point_id, wall_s, status, message)


def _missing_values(schema: pa.Schema) -> tuple[dict[str, Any], list[str]]:
    """Values for missing cells by column, and names of the columns with lists."""
    lists = [field.name for field in schema if pa.types.is_list(field.type)]
    others = {f.name: _missing_value(f.type) for f in schema if f.name not in lists}
    return others, lists


def _missing_value(kind: pa.DataType) -> Any:
    if pa.types.is_floating(kind):
        return np.nan
    return {TEXT: "", pa.binary(): b""}.get(kind)


def planned_rows(plan: Plan, store: Store, schema: pa.Schema) -> list[dict[str, Any]]:
    """Rows of all points of the plan, in its order.

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    ids = plan.tasks.ids.astype(str).tolist()
    row_of = store.rows(ids, schema)
    missing = sum(i not in row_of for i in ids)
    if missing:
        raise store.unsolved(missing, len(ids))
    return [row_of[i] for i in ids]


def planned_table(plan: Plan, store: Store, schema: pa.Schema) -> pa.Table:
    """The rows of `planned_rows` as one table, without an object for each cell.

    Raises
    ------
    MachineError
        Where a point of the plan is in no chunk.
    """
    ids = plan.tasks.ids
    parts = list(store.chunks(schema))
    table = pa.concat_tables(parts) if parts else schema.empty_table()
    order = rows_of(table["point_id"], ids)
    if missing := int((order < 0).sum()):
        raise store.unsolved(missing, len(ids))
    return table.take(order).combine_chunks()


def rows_of(point_ids: pa.ChunkedArray, wanted_ids: Sequence[str] | np.ndarray) -> np.ndarray:
    """Row of each wanted id, the last one if there are several; -1 where there is none."""
    n = len(point_ids)
    backwards = pa.array(point_ids.take(np.arange(n)[::-1]).combine_chunks())
    from_the_end = pc.index_in(
        pa.array(np.asarray(wanted_ids)).cast(pa.string()), value_set=backwards
    )
    rows: np.ndarray = n - 1 - from_the_end.fill_null(n).to_numpy()
    return rows


def tabled(rows: Sequence[Mapping[str, Any]], fields: Fields) -> pa.Table:
    """HEAD and `fields` of chunk rows as a table, null where a row lacks a field."""
    return pa.Table.from_pylist(list(rows), schema=pa.schema([*HEAD, *fields]))


def structs(fields: Fields) -> pa.DataType:
    """Type of a column with lists of items, which have these fields."""
    return pa.list_(pa.struct([pa.field(n, t) for n, t in fields]))


def nested(rows: Sequence[Mapping[str, Any]], name: str, fields: Fields) -> pa.Table:
    """The items in a column of lists as a table, each with its design point's id."""
    flat = [{"point_id": row["point_id"], **entry} for row in rows for entry in row[name]]
    return pa.Table.from_pylist(flat, schema=pa.schema([("point_id", TEXT), *fields]))


def items(rows: pa.Table, name: str, fields: Fields) -> pa.Table:
    """The table of `nested`, from a table of chunk rows."""
    column = rows[name].combine_chunks()
    owners = rows["point_id"].take(pc.list_parent_indices(column))
    schema = pa.schema([("point_id", TEXT), *fields])
    flat = column.flatten()
    parts = dict(zip([field.name for field in flat.type], flat.flatten(), strict=True))
    return pa.table([owners, *(parts[field] for field, _ in fields)], schema=schema)


def points_table(plan: Plan, points: pa.Table) -> pa.Table:
    """A row for each design point: HEAD, parameters, findings, and parameters that follow tables.

    Counts and flags are nullable (Int64, boolean), missing where a point has none.

    Parameters
    ----------
    plan : Plan
    points : Table
        HEAD and findings of its design points, in order (`tabled`).
    """
    columns = [points[name] for name, _ in HEAD]
    columns += [pa.array(plan.tasks.column(p), REAL) for p in plan.study.shown_parameters]
    columns += points.columns[len(HEAD) :]
    parameters = [pa.field(p, REAL) for p in plan.study.shown_parameters]
    followed = [t.name for t in plan.study.model.tables]
    columns += [pa.array(plan.tasks.column(p), REAL) for p in followed]
    names = list(points.schema)
    fields = [*names[: len(HEAD)], *parameters, *names[len(HEAD) :]]
    fields += [pa.field(p, REAL) for p in followed]
    return pa.Table.from_arrays(columns, schema=with_dtypes(pa.schema(fields)))


def with_dtypes(schema: pa.Schema) -> pa.Schema:
    """The schema with the dtypes that its columns shall have when pandas reads them."""
    dtypes = _dtypes(tuple(schema.names), tuple(schema.types))
    return schema.with_metadata((schema.metadata or {}) | dtypes)


@lru_cache(maxsize=64)  # rounds of a study write the same tables again and again
def _dtypes(names: tuple[str, ...], types: tuple[pa.DataType, ...]) -> dict[bytes, bytes]:
    """These dtypes in the form that pandas stores in the metadata of a schema."""
    import pandas as pd

    nullable = {WHOLE_NUMBER: pd.Int64Dtype(), COUNT: pd.Int64Dtype(), FLAG: pd.BooleanDtype()}
    schema = pa.schema(list(zip(names, types, strict=True)))
    frame = schema.empty_table().to_pandas(types_mapper=nullable.get)
    metadata: dict[bytes, bytes] = pa.Table.from_pandas(
        frame, schema=schema, preserve_index=False
    ).schema.metadata
    return metadata
