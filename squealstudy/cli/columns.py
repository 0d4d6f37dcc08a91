"""Text of `squealstudy columns`: tables of results and the meaning of their columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import RenderableType

from squealstudy.columns import COLUMNS, column_names, unit_of
from squealstudy.errors import SquealstudyError
from squealstudy.screen import facts, grid
from squealstudy.wording import did_you_mean, listed


def kinds_and_tables() -> Iterator[RenderableType]:
    """All kinds of study, each with its tables."""
    yield facts((kind, ", ".join(tables)) for kind, tables in COLUMNS.items())
    yield "\nsquealstudy columns KIND [TABLE], or RESULTS [TABLE], tells what columns mean."


def described(kind: str, table: str | None) -> Iterator[RenderableType]:
    """Columns of one table, or of all tables, of a kind of study.

    Raises
    ------
    SquealstudyError
        There is no such kind or table.
    """
    tables = COLUMNS.get(_expected(kind, COLUMNS, "kind of study"), {})
    for name in tables if table is None else (_expected(table, tables, f"table of {kind}"),):
        rows = []
        for column in tables[name]:
            names = column_names(column.name)
            unit = unit_of(names[0].replace("*", "1"), name) or ""
            error = (
                f"Its error: {', '.join(column.errors)}." if column.errors else column.leaves_out
            )
            rows.append([", ".join(names), unit, f"{column.definition} {error}".strip()])
        yield f"{name} of {kind}"
        yield grid("text:column", "text:unit", "text:meaning, and its error", rows=rows)
        yield ""


def _expected(name: str, names: Iterable[str], noun: str) -> str:
    expected = list(names)
    if name not in expected:
        text = f"there is no {noun} '{name}': expected one of {listed(expected)}"
        raise SquealstudyError(f"columns: {text}{did_you_mean(name, expected)}")
    return name
