"""The kind of method-stability studies: one method over two settings."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.kind import Kind, Warn
from squealstudy.engine.rows import FLAG, HEAD, REAL, TEXT, head
from squealstudy.engine.store import CELLS, Store
from squealstudy.engine.workers import Solved, Workers
from squealstudy.errors import ParameterError
from squealstudy.kinds.method_stability.section import MethodStabilityDefinition
from squealstudy.kinds.methods import MethodsFile, MethodsPlan, Run, Runs
from squealstudy.laboratory.method_stability.contract import StabilityCase, checked, known_cases
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.study.source import SourceText, validate
from squealstudy.tables.method_quality import agreement
from squealstudy.wording import did_you_mean

Values = Mapping[str, float]
FIELDS = (
    ("x", REAL),
    ("y", REAL),
    ("outcome", TEXT),
    ("by", TEXT),
    ("flagged", FLAG),
    ("predicted", REAL),
    ("measured", REAL),
    ("error", REAL),
    ("cost", REAL),
)
FAILED_ROW = {"outcome": "failed", "by": "", "flagged": True} | dict.fromkeys(
    ("predicted", "measured", "error", "cost"), np.nan
)
StabilityFile = MethodsFile[MethodStabilityDefinition]


@dataclass(frozen=True)
class LineTask:
    """Cells of one line of the map, along its first knob."""

    case: str
    knobs: tuple[str, str]
    cells: tuple[Run, ...]


class MethodStability(Kind):
    """Where a method works, is slow, is recovered, or goes wrong, on its minimal model."""

    name = "method_stability"
    description = "where a method fails"
    definition = MethodStabilityDefinition
    tables: tuple[str, ...] = (CELLS,)
    schema = pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])
    row_word = "cell"
    of_methods = True

    def read(self, source: SourceText, tables: Mapping[str, Any]) -> StabilityFile:
        """The file; its case and knobs are checked later."""
        return MethodsFile(self, source, validate(MethodStabilityDefinition, source, tables))

    def plan(self, study: StabilityFile) -> MethodsPlan:
        """All cells, the first knob varying fastest; StudyFileError for a wrong case or knob."""
        case, knobs, axes = _checked(study)
        section = study.definition.method_stability
        cells = []
        for y, x in itertools.product(axes[1], axes[0]):
            values = {**section.set, knobs[0]: float(x), knobs[1]: float(y)}
            exact = sorted((k, v.hex()) for k, v in values.items())
            cells.append(Run(content_hash([case.name, exact, source_hash()]), values))
        sizes = " x ".join(str(len(axis)) for axis in axes)
        return MethodsPlan(
            study=study,
            model=section.case,
            tasks=Runs(cells),
            facts=(
                ("case", case.title),
                ("boundary", case.boundary),
                ("cells", f"{sizes} over {' and '.join(knobs)}"),
            ),
            content=(case, knobs, dict(section.set)),
        )

    def make_models(
        self, plan: MethodsPlan, workers: Workers, warn: Warn
    ) -> tuple[MethodsPlan, dict[str, str]]:
        """Solve the first cell, so that kernels are compiled before workers start."""
        workers.report("first cell", 0, 1)
        with contextlib.suppress(*FAILURES):  # its row says so
            plan.content[0].evaluate(plan.tasks[0].content)
        workers.report("first cell", 1, 1)
        return plan, {}

    def tasks(self, plan: MethodsPlan, points: Sequence[Run], workers: Workers) -> list[LineTask]:
        """A task for each line of the map, with those of its cells that are to be solved."""
        case, knobs, _ = plan.content
        lines = itertools.groupby(points, key=lambda cell: cell.content[knobs[1]])
        return [LineTask(case.name, knobs, tuple(cells)) for _, cells in lines]

    def points_of(self, task: LineTask) -> Sequence[Run]:
        """The cells of a task."""
        return task.cells

    def single_tasks(self, task: LineTask) -> list[LineTask]:
        """A task for each cell of a task."""
        return [replace(task, cells=(cell,)) for cell in task.cells]

    def solve(self, task: LineTask) -> Solved:
        """Rows of one line of cells; a cell that fails does not stop the others."""
        return Solved([_row(task, cell) for cell in task.cells])

    def manifest(self, plan: MethodsPlan) -> dict[str, Any]:
        """Facts: the text of the file, the case and its knobs."""
        case, knobs, fixed = plan.content
        case_knobs = [case.knobs[name] for name in knobs]
        return {
            "study": plan.study.source.text,
            "case": case.name,
            "title": case.title,
            "boundary": case.boundary,
            "knobs": list(knobs),
            "units": {k.name: k.unit for k in case_knobs},
            "words": {k.name: k.description for k in case_knobs},
            "values": fixed,
        }

    def build_tables(
        self, plan: MethodsPlan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the table of cells; that table, and how often the prediction held."""
        ids = [cell.point_id for cell in plan.tasks]
        rows = store.rows(ids, self.schema)
        table = pa.Table.from_pylist([rows[i] for i in ids], schema=self.schema).to_pandas()
        table = table.rename(columns=dict(zip("xy", plan.content[1], strict=True)))
        store.write_table(CELLS, pa.Table.from_pandas(table, preserve_index=False))
        return table, agreement(table)


def _checked(study: StabilityFile) -> tuple[StabilityCase, tuple[str, str], tuple[np.ndarray, ...]]:
    """Case, names and values of both knobs; StudyFileError for an unknown case or a bad knob."""
    section, knobs = study.definition.method_stability, study.definition.knob
    cases = known_cases()
    if section.case not in cases:
        hint = did_you_mean(section.case, cases)
        text = f"expected one of {', '.join(cases)}, got '{section.case}'{hint}"
        raise study.error(("method_stability", "case"), text)
    if len(knobs) != 2:
        raise study.error(("knob",), f"expected two [[knob]] tables, got {len(knobs)}")
    case, (first, second) = cases[section.case], (k.name for k in knobs)
    if first == second:
        raise study.error(("knob", 1, "name"), f"'{second}' is both axes")
    axes = tuple(k.axis() for k in knobs)
    for i, (name, axis) in enumerate(zip((first, second), axes, strict=True)):
        for setting in (axis.min(), axis.max()):
            _allow(study, case, {name: float(setting)}, ("knob", i))
        if name in section.set:
            raise study.error(("method_stability", "set", name), f"'{name}' is an axis of the map")
    for name, setting in section.set.items():
        _allow(study, case, {name: setting}, ("method_stability", "set", name))
    return case, (first, second), axes


def _allow(
    study: StabilityFile, case: StabilityCase, values: Values, keys: tuple[str | int, ...]
) -> None:
    """Raise StudyFileError for values that a knob of the case does not allow."""
    try:
        checked(case.knobs, values)
    except ParameterError as error:
        hint = did_you_mean(error.key, case.knobs)
        raise study.error(keys, f"{error.key}: {error.message}{hint}") from None


def _row(task: LineTask, cell: Run) -> dict[str, Any]:
    """Chunk row of one pair of settings; an error of the case becomes a failed row."""
    started = time.perf_counter()
    coordinates = {axis: cell.content[name] for axis, name in zip("xy", task.knobs, strict=True)}
    try:
        cells, status, message = asdict(known_cases()[task.case].evaluate(cell.content)), "ok", ""
    except FAILURES as error:
        cells, (status, message) = FAILED_ROW, reason(error)
    wall = time.perf_counter() - started
    return head(cell.point_id, wall, status, message) | coordinates | cells


KIND = MethodStability()
