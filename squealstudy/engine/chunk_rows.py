"""The rows of a task: one for each design point, also where it fails.

A kind of study puts expected failures (`failures.FAILURES`) into rows itself. Unexpected errors
become failed rows here, so that no design point ends its study.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from squealstudy import faults
from squealstudy.engine.workers import Solved
from squealstudy.errors import (
    ExtensionError,
    ResultsError,
    SquealstudyError,
    StudyFileError,
)
from squealstudy.machine.resources import peak_memory_mb
from squealstudy.mechanics.failures import reason

if TYPE_CHECKING:
    from squealstudy.engine.kind import Kind

DIED = "worker_died"  # status of the points of a task that killed every worker that tried it
OF_THE_STUDY = (StudyFileError, ResultsError, ExtensionError)  # errors that all points have
PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class ChunkRows:
    """Rows that are written as one chunk file.

    Attributes
    ----------
    table : Table
    files : mapping of str -> Table, or mapping of names to arrays
        As of `Solved`.
    known : int
        Number of points whose working point an earlier study had solved.
    wall_s : float
        Time that the worker needed, s.
    peak_mb : float
        Largest memory of the worker up to now, MB.
    """

    table: pa.Table
    files: Mapping[str, pa.Table | Mapping[str, Any]]
    known: int
    wall_s: float
    peak_mb: float


def lost_chunk(kind: Kind, task: Any, why: str) -> ChunkRows:
    """Failed rows for the points of a task that killed every worker that tried it."""
    rows = [kind.failed_row(p.point_id, DIED, why) for p in kind.points_of(task)]
    return ChunkRows(pa.Table.from_pylist(rows, schema=kind.schema), {}, 0, 0.0, 0.0)


def solve_chunk(kind: Kind, task: Any) -> ChunkRows:
    """Solve a task of a kind of study in a worker, which writes nothing.

    If the task fails as a whole, each of its design points is solved by itself, and those that fail
    become failed rows.

    Raises
    ------
    SquealstudyError, OSError, MemoryError
        The error concerns the whole study, or the machine.
    """
    started = time.perf_counter()
    try:
        parts = [_solved(kind, task)]
    except Exception as error:
        if _of_all_points(error):
            raise
        parts = [_solved_or_failed(kind, part) for part in kind.single_tasks(task)]
    return ChunkRows(
        table=pa.concat_tables(table for table, _ in parts),
        files={name: content for _, one in parts for name, content in one.files.items()},
        known=sum(one.known for _, one in parts),
        wall_s=time.perf_counter() - started,
        peak_mb=peak_memory_mb(),
    )


def _solved(kind: Kind, task: Any) -> tuple[pa.Table, Solved]:
    solved = kind.solve(task)
    if solved.table is not None:
        return solved.table, solved
    return pa.Table.from_pylist(list(solved.rows), schema=kind.schema), solved


def _solved_or_failed(kind: Kind, task: Any) -> tuple[pa.Table, Solved]:
    """Solve a task; an error that concerns only its points becomes their failed rows."""
    try:
        return _solved(kind, task)
    except Exception as error:
        if _of_all_points(error):
            raise
        why = unforeseen(error)
        rows = [kind.failed_row(p.point_id, *why) for p in kind.points_of(task)]
        return pa.Table.from_pylist(rows, schema=kind.schema), Solved(rows)


def _of_all_points(error: Exception) -> bool:
    """Whether an error concerns the machine or the whole study, not a single point."""
    return isinstance(error, OF_THE_STUDY) or faults.sentence(error) is not None


def unforeseen(error: Exception) -> tuple[str, str]:
    """Status and message of a point with an unexpected error.

    The message has the last line of this package that was executed, if there is one.
    """
    status, message = reason(error)
    if isinstance(error, SquealstudyError):
        return status, message
    lines = extract_tb(error.__traceback__)
    package_lines = [line for line in lines if PACKAGE in Path(line.filename).parents] or list(
        lines
    )
    if not package_lines:
        return status, message
    return (
        status,
        f"{message} ({Path(package_lines[-1].filename).name}, line {package_lines[-1].lineno})",
    )
