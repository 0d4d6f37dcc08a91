"""A method-stability study: its cells, solved line by line, and their table."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.analysis.method_stability.cases import CASES
from squealstudy.analysis.method_stability.contract import Case, checked
from squealstudy.analysis.tables.agreement import agreement
from squealstudy.errors import ParameterError
from squealstudy.study.chunks import read_chunks
from squealstudy.study.experiments.definition import StabilityFile
from squealstudy.study.files import write_parquet
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.study.names import CELLS
from squealstudy.study.parallel import Workers
from squealstudy.study.parameters import did_you_mean
from squealstudy.study.rows import FAILURES, FLAG, HEAD, REAL, TEXT, head, reason

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
NOTHING = {"outcome": "failed", "by": "", "flagged": True} | dict.fromkeys(
    ("predicted", "measured", "error", "cost"), np.nan
)


class MethodStability:
    """One case over two knobs."""

    tables: tuple[str, ...] = (CELLS,)
    in_parallel = True

    def __init__(self, experiment: StabilityFile) -> None:
        self.experiment = experiment
        self.case = self._case()
        if len(experiment.definition.knob) != 2:
            count = len(experiment.definition.knob)
            raise experiment.error(("knob",), f"expected two [[knob]] tables, got {count}")
        self.axes = tuple(k.axis() for k in experiment.definition.knob)
        self._check()

    @property
    def schema(self) -> pa.Schema:
        """Of the chunk files."""
        return pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])

    @property
    def knobs(self) -> tuple[str, str]:
        """Names of the two axes, the first varying fastest."""
        first, second = (k.name for k in self.experiment.definition.knob)
        return first, second

    def _case(self) -> Case:
        name = self.experiment.definition.method_stability.case
        if name not in CASES:
            raise self.experiment.error(
                ("method_stability", "case"),
                f"expected one of {', '.join(CASES)}, got '{name}'{did_you_mean(name, CASES)}",
            )
        return CASES[name]

    def _check(self) -> None:
        """StudyFileError for knobs that the case does not have, or values it cannot take."""
        fixed = self.experiment.definition.method_stability.set
        if self.knobs[0] == self.knobs[1]:
            raise self.experiment.error(("knob", 1, "name"), f"'{self.knobs[1]}' is both axes")
        for i, (name, axis) in enumerate(zip(self.knobs, self.axes, strict=True)):
            for value in (axis.min(), axis.max()):
                self._allowed({name: float(value)}, ("knob", i))
            if name in fixed:
                raise self.experiment.error(
                    ("method_stability", "set", name), f"'{name}' is an axis of the map"
                )
        for name, value in fixed.items():
            self._allowed({name: value}, ("method_stability", "set", name))

    def _allowed(self, values: Values, keys: tuple[str | int, ...]) -> None:
        try:
            checked(self.case.knobs, values)
        except ParameterError as error:
            hint = did_you_mean(error.key, self.case.knobs)
            raise self.experiment.error(keys, f"{error.key}: {error.message}{hint}") from None

    def facts(self) -> list[tuple[str, str]]:
        """What `check` says."""
        sizes = " x ".join(str(len(axis)) for axis in self.axes)
        return [
            ("case", self.case.title),
            ("boundary", self.case.boundary),
            ("cells", f"{sizes} over {' and '.join(self.knobs)}"),
        ]

    def prepare(self, workers: Workers) -> None:
        """The first cell: kernels are compiled here, before workers start."""
        workers.report("first cell", 0, 1)
        self.case.evaluate(self._values(0, 0))
        workers.report("first cell", 1, 1)

    def _values(self, i: int, j: int) -> dict[str, float]:
        x, y = float(self.axes[0][i]), float(self.axes[1][j])
        fixed = self.experiment.definition.method_stability.set
        return {**fixed, self.knobs[0]: x, self.knobs[1]: y}

    def _cells(self) -> Iterator[tuple[int, int]]:
        for j, i in itertools.product(range(len(self.axes[1])), range(len(self.axes[0]))):
            yield i, j

    def _identity(self, i: int, j: int) -> str:
        values = sorted((k, v.hex()) for k, v in self._values(i, j).items())
        return content_hash([self.case.name, values, source_hash()])

    def runs(self) -> list[int]:
        """Lines of the map."""
        return list(range(len(self.axes[1])))

    def ids(self, run: int) -> list[str]:
        """Rows of a run's chunk."""
        return [self._identity(i, run) for i in range(len(self.axes[0]))]

    def solve(self, run: int) -> list[dict[str, Any]]:
        """Rows of one line of cells; no cell stops the others."""
        return [self._row(i, run) for i in range(len(self.axes[0]))]

    def _row(self, i: int, j: int) -> dict[str, Any]:
        started = time.perf_counter()
        values = self._values(i, j)
        place = {"x": values[self.knobs[0]], "y": values[self.knobs[1]]}
        try:
            found, status, message = asdict(self.case.evaluate(values)), "ok", ""
        except FAILURES as error:
            found, (status, message) = NOTHING, reason(error)
        wall = time.perf_counter() - started
        return head(self._identity(i, j), wall, status, message) | place | found

    def build_tables(self, directory: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the cells; the table, and facts for the manifest."""
        ids = [self._identity(i, j) for i, j in self._cells()]
        rows = read_chunks(directory, set(ids), self.schema)
        table = pa.Table.from_pylist([rows[i] for i in ids], schema=self.schema).to_pandas()
        table = table.rename(columns={"x": self.knobs[0], "y": self.knobs[1]})
        write_parquet(directory / CELLS, pa.Table.from_pandas(table, preserve_index=False))
        known = [self.case.knobs[name] for name in self.knobs]
        return table, {
            "case": self.case.name,
            "title": self.case.title,
            "boundary": self.case.boundary,
            "knobs": list(self.knobs),
            "units": {k.name: k.unit for k in known},
            "words": {k.name: k.description for k in known},
            "values": dict(self.experiment.definition.method_stability.set),
            **agreement(table),
        }
