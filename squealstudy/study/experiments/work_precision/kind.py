"""Work-precision studies: which runs there are, what one does, what their tables say."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.errors import (
    ConvergenceError,
    ParameterError,
    ResultsError,
    SquealstudyError,
    StudyFileError,
)
from squealstudy.study.cache import is_prepared
from squealstudy.study.chunks import read_chunks
from squealstudy.study.experiments.definition import PrecisionFile
from squealstudy.study.experiments.sections import FREQUENCY_QUANTITIES, TIME_QUANTITIES
from squealstudy.study.experiments.work_precision import rows
from squealstudy.study.experiments.work_precision.integrator import (
    check_integrator,
    chosen_integrator,
    warm_chosen,
)
from squealstudy.study.experiments.work_precision.tables import measurement_tables
from squealstudy.study.experiments.work_precision.variants import (
    Variant,
    common_study,
    make_variants,
)
from squealstudy.study.files import write_parquet
from squealstudy.study.keys import content_hash
from squealstudy.study.kinds import kind_named
from squealstudy.study.measure.frequency_domain import measure_modes
from squealstudy.study.measure.measurement import Measurement
from squealstudy.study.measure.time_domain import measure_runs
from squealstudy.study.names import ERRORS, MEASUREMENTS
from squealstudy.study.parallel import Workers
from squealstudy.study.rows import FAILURES, reason
from squealstudy.study.runner import build_structures
from squealstudy.study.sampling import count_points

QUANTITIES = {"complex_modes": FREQUENCY_QUANTITIES, "transient": TIME_QUANTITIES}
JUDGED = {  # where the file names no quantities
    "complex_modes": ("frequency", "damping_ratio"),
    "transient": ("growth_rate", "torque_rms", "torque_mean", "dominant_frequency"),
}


class WorkPrecision:
    """One experiment: its runs in alternation, on one core, and its tables."""

    tables: tuple[str, ...] = (MEASUREMENTS, ERRORS)
    in_parallel = False

    def __init__(self, experiment: PrecisionFile) -> None:
        self.experiment = experiment
        self.variants = make_variants(experiment)
        self._check()

    @property
    def base_kind(self) -> str:
        """Kind of the base study."""
        return self.experiment.base.study.definition.study.kind

    @property
    def quantities(self) -> tuple[str, ...]:
        """What errors are judged by."""
        return self.experiment.definition.work_precision.quantities or JUDGED[self.base_kind]

    @property
    def over(self) -> int:
        """Design points that share a set-up."""
        asked = self.experiment.definition.work_precision.over
        return asked or count_points(common_study(self.experiment))

    def _check(self) -> None:
        """StudyFileError for what the sections alone do not show."""
        if self.base_kind not in QUANTITIES:
            kinds = " or ".join(QUANTITIES)
            raise self.experiment.error(
                ("work_precision", "base"),
                f"expected a study of kind {kinds}, got {self.base_kind}",
            )
        if not self.experiment.definition.method:
            raise self.experiment.error(("method",), "expected at least one [[method]]")
        names = [method.name for method in self.experiment.definition.method]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise self.experiment.error(
                    ("method", i, "name"), f"two methods are called '{name}'"
                )
        known = QUANTITIES[self.base_kind]
        for name in self.quantities:
            if name not in known:
                raise self.experiment.error(
                    ("work_precision", "quantities"),
                    f"'{name}' is no quantity of a {self.base_kind} study, expected some of "
                    + ", ".join(known),
                )
        for variant in self.variants:
            if variant.plan.study.definition.study.kind != self.base_kind:
                raise self.experiment.error((*variant.keys, "set"), "the kind must stay")
            _ = variant.plan.method  # of complex modes: one that cannot serve the study says so
            self._check_integrator(variant)

    def _check_integrator(self, variant: Variant) -> None:
        if not variant.integrator:
            return
        section = variant.plan.study.definition.transient
        if section.stop != "end" or section.representation != "modal":
            raise self.experiment.error(
                (*variant.keys, "integrator"),
                'integrators run to the end, in modal coordinates: set transient.stop = "end" and '
                'transient.representation = "modal" for all methods',
            )
        if self.base_kind != "transient":
            raise self.experiment.error(
                (*variant.keys, "integrator"), f"a {self.base_kind} study integrates nothing"
            )
        try:
            check_integrator(variant.integrator, variant.options)
        except ParameterError as error:
            own = error.key != "integrator"
            place = "options" if own else "integrator"
            raise self.experiment.error(
                (*variant.keys, place), f"{error.key}: {error.message}" if own else error.message
            ) from None

    def facts(self) -> list[tuple[str, str]]:
        """What `check` says: points, runs, structures."""
        section, runs = self.experiment.definition.work_precision, self.runs()
        structures = {s.key for v in self.variants for s in v.plan.structures}
        missing = sum(not is_prepared(key) for key in structures)
        base = self.experiment.base
        return [
            ("base", f"{base.source.path}: {base.study.name}, {self.base_kind}"),
            ("measured at", f"{len(self.variants[0].measured)} design points"),
            (
                "runs",
                f"{len(runs)}: {len(self.variants) - 1} settings of "
                f"{len(self.experiment.definition.method)} methods, {section.repeats} rounds, "
                "and the reference",
            ),
            ("reductions", f"{len(structures)} needed, {missing} not in the cache"),
            ("judged by", ", ".join(self.quantities)),
        ]

    def prepare(self, workers: Workers) -> None:
        """Make the reductions of all variants; what the models show of the file is checked."""
        for variant in self.variants:
            try:
                build_structures(variant.plan, workers)
            except StudyFileError:
                raise
            except SquealstudyError:  # no structure of it can be made: its rows say so
                continue
        kind_named(self.base_kind).check(self.variants[0].plan)
        warm_chosen({v.integrator for v in self.variants if v.integrator})

    def runs(self) -> list[tuple[str, Variant, int]]:
        """Name, variant and round of every run: the reference once, then rounds over all."""
        methods = [v for v in self.variants if not v.reference]
        reference = [(v, 0) for v in self.variants if v.reference]
        repeats = self.experiment.definition.work_precision.repeats
        order = reference + [(v, n) for n in range(repeats) for v in methods]
        starts = self.experiment.definition.work_precision.starts
        found = {content_hash([v.identity, n, starts]): (v, n) for v, n in order}
        return [(name, v, n) for name, (v, n) in found.items()]

    def ids(self, run: tuple[str, Variant, int]) -> list[str]:
        """The one row of a run's chunk."""
        return [run[0]]

    def solve(self, run: tuple[str, Variant, int]) -> list[dict[str, Any]]:
        """Run one measurement; its one row."""
        name, variant, number = run
        started = time.perf_counter()
        try:
            made = self._measured(variant)
        except FAILURES as error:
            wall = time.perf_counter() - started
            row = rows.failed_row(name, variant.identity, number, wall, *reason(error))
        else:
            wall = time.perf_counter() - started
            row = rows.row(name, variant.identity, number, wall, made)
        if variant.reference and row["status"] != "ok":
            raise ResultsError(f"the reference '{variant.method}' failed: {row['message']}")
        return [row]

    def _measured(self, variant: Variant) -> Measurement:
        if not all(is_prepared(s.key) for s in variant.plan.structures):
            raise ConvergenceError("structure", "no reduction of its model can be made")
        if self.base_kind == "complex_modes":
            return measure_modes(variant.plan, variant.measured, variant.lines)
        starts = self.experiment.definition.work_precision.starts
        if not variant.integrator:
            return measure_runs(variant.plan, variant.measured, starts=starts)
        chosen = chosen_integrator(variant.integrator, variant.options)
        return measure_runs(variant.plan, variant.measured, chosen, starts)

    @property
    def schema(self) -> pa.Schema:
        """Of the chunk files."""
        return rows.SCHEMA

    def build_tables(self, directory: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write measurements and errors; the former, and facts for the manifest."""
        found = read_chunks(directory, {name for name, _, _ in self.runs()}, self.schema)
        by_variant: dict[str, list[Mapping[str, Any]]] = {v.identity: [] for v in self.variants}
        for name, variant, _ in self.runs():
            by_variant[variant.identity].append(found[name])
        measured, errors = measurement_tables(
            self.variants, by_variant, self.quantities, self.over, self.base_kind == "transient"
        )
        self._write(directory, measured, errors)
        return measured, {
            "base_kind": self.base_kind,
            "quantities": list(self.quantities),
            "tolerance": self.experiment.definition.work_precision.tolerance,
            "over": self.over,
            "reference": self.experiment.definition.reference.name,
            "measured_at": self._points(),
        }

    def _points(self) -> list[dict[str, float]]:
        first = self.variants[0]
        return [first.plan.swept[i] for i in first.measured]

    @staticmethod
    def _write(directory: Path, *tables: pd.DataFrame) -> None:
        names: Sequence[str] = (MEASUREMENTS, ERRORS)
        for name, table in zip(names, tables, strict=True):
            write_parquet(directory / name, pa.Table.from_pandas(table, preserve_index=False))
