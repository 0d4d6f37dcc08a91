"""The kind of work-precision studies: error against time of methods on one study.

Each measurement is a row.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd
import pyarrow as pa

from squealstudy.engine.cache import is_prepared
from squealstudy.engine.keys import content_hash
from squealstudy.engine.kind import Kind, Warn, as_kind
from squealstudy.engine.measurement import Measurement, MeasurementRequest, Measuring
from squealstudy.engine.store import ERRORS, MEASUREMENTS, Store
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Solved, Workers, at_once
from squealstudy.errors import ConvergenceError, ResultsError, SquealstudyError, StudyFileError
from squealstudy.kinds.methods import MethodsPlan, Run, Runs
from squealstudy.kinds.work_precision.section import WorkPrecisionDefinition
from squealstudy.kinds.work_precision.tables import SCHEMA, measurement_row, measurement_tables
from squealstudy.kinds.work_precision.variants import (
    PrecisionFile,
    Variant,
    check_file,
    common_study,
    make_variants,
)
from squealstudy.laboratory import integrators  # noqa: F401 - they register themselves
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.motion.integrator import integrator
from squealstudy.motion.warmup import warm
from squealstudy.study.definition import load_study
from squealstudy.study.sampling import count_points
from squealstudy.study.source import SourceText, validate
from squealstudy.wording import TORQUE, plural


class WorkPrecision(Kind):
    """Runs of all methods in alternation, on one core, each alone on the machine."""

    name = "work_precision"
    description = "error against time of methods"
    definition = WorkPrecisionDefinition
    tables: tuple[str, ...] = (MEASUREMENTS, ERRORS)
    schema = SCHEMA
    row_word = "run"
    of_methods = True

    def read(self, source: SourceText, tables: Mapping[str, Any]) -> PrecisionFile:
        """The file, checked, with its base study."""
        definition = validate(WorkPrecisionDefinition, source, tables)
        path = source.path.parent / definition.work_precision.base
        if not path.is_file():
            raise source.error(("work_precision", "base"), f"there is no study file {path}")
        return PrecisionFile(self, source, definition, load_study(path))

    def plan(self, study: PrecisionFile) -> MethodsPlan:
        """The runs: the reference once, then rounds over all methods."""
        variants = make_variants(study)
        check_file(study, variants)
        section, base = study.definition.work_precision, study.base
        methods = [v for v in variants if not v.reference]
        order = [(v, 0) for v in variants if v.reference]
        order += [(v, n) for n in range(section.repeats) for v in methods]
        runs = {content_hash([v.identity, n, section.starts]): (v, n) for v, n in order}
        structures = {key for v in variants for key in v.plan.structures}
        missing = sum(not is_prepared(key) for key in structures)
        return MethodsPlan(
            study=study,
            model=base.model.name,
            tasks=Runs(Run(name, run) for name, run in runs.items()),
            facts=(
                ("base", f"{base.source.path}: {base.name}, {base.kind.name}"),
                ("measured at", plural(len(variants[0].measured), "design point")),
                (
                    "runs",
                    f"{len(runs)}: {len(methods)} settings of {len(study.definition.method)} "
                    f"methods, {plural(section.repeats, 'round')}, and the reference",
                ),
                ("reductions", f"{len(structures)} needed, {missing} not in the cache"),
                ("judged by", ", ".join(quantities(study))),
            ),
            content=variants,
        )

    def make_models(
        self, plan: MethodsPlan, workers: Workers, warn: Warn
    ) -> tuple[MethodsPlan, dict[str, str]]:
        """Make the reductions of all variants, check the first one, and compile integrators."""
        for variant in plan.content:
            try:
                build_structures(variant.plan, replace(workers, seconds_without_workers=at_once))
            except StudyFileError:
                raise
            except SquealstudyError:  # no structure of this variant can be made: its rows say so
                continue
        first = plan.content[0].plan
        first.kind.check(first)
        warm(integrator(name) for name in sorted({v.integrator for v in plan.content} - {""}))
        return plan, {}

    def seconds_without_workers(self, plan: MethodsPlan) -> float:
        """Infinite: what is timed runs alone, in this process."""
        return float("inf")

    def tasks(self, plan: MethodsPlan, points: Sequence[Run], workers: Workers) -> list[Any]:
        """A task for each measurement."""
        return [(plan.study, run) for run in points]

    def points_of(self, task: tuple[PrecisionFile, Run]) -> list[Run]:
        """The measurement of a task."""
        return [task[1]]

    def single_tasks(self, task: tuple[PrecisionFile, Run]) -> list[tuple[PrecisionFile, Run]]:
        """The task itself, which is a single measurement."""
        return [task]

    def solve(self, task: tuple[PrecisionFile, Run]) -> Solved:
        """Run one measurement; ResultsError where the reference fails."""
        study, run = task
        variant, _ = run.content
        started, failure = time.perf_counter(), ("ok", "")
        try:
            measurement = _measured(study, variant)
        except FAILURES as error:
            measurement, failure = Measurement(), reason(error)
        row = measurement_row(run, time.perf_counter() - started, measurement, failure)
        if variant.reference and row["status"] != "ok":
            raise ResultsError(f"the reference '{variant.method}' failed: {row['message']}")
        return Solved([row])

    def manifest(self, plan: MethodsPlan) -> dict[str, Any]:
        """Facts: the texts of the files, the quantities that are judged, the measured points."""
        study, variants = plan.study, plan.content
        section, first = study.definition.work_precision, variants[0]
        names = [sweep.name for sweep in first.plan.study.sweeps]
        return {
            "study": study.source.text,
            "base": study.base.source.text,
            "base_kind": study.base.kind.name,
            "quantities": list(quantities(study)),
            "tolerance": section.tolerance,
            "over": _over(study),
            "reference": study.definition.reference.name,
            "units": {TORQUE: study.base.model.torque_unit},
            "measured_at": [
                dict(zip(names, first.plan.swept[i].tolist(), strict=True)) for i in first.measured
            ],
        }

    def build_tables(
        self, plan: MethodsPlan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables of measurements and errors; that of measurements, and facts."""
        study, variants = plan.study, plan.content
        row_of = store.rows([run.point_id for run in plan.tasks], self.schema)
        by_variant: dict[str, list[Mapping[str, Any]]] = {v.identity: [] for v in variants}
        for run in plan.tasks:
            by_variant[run.content[0].identity].append(row_of[run.point_id])
        measured, errors = measurement_tables(
            variants, by_variant, quantities(study), _over(study), _measuring(study)
        )
        for name, table in ((MEASUREMENTS, measured), (ERRORS, errors)):
            store.write_table(name, pa.Table.from_pandas(table, preserve_index=False))
        return measured, {"reference": study.definition.reference.name}


def _measuring(study: PrecisionFile) -> Measuring:
    measuring = as_kind(study.base.kind).measuring()
    assert measuring is not None
    return measuring


def quantities(study: PrecisionFile) -> tuple[str, ...]:
    """Quantities in which errors are measured, by name."""
    return study.definition.work_precision.quantities or _measuring(study).judged


def _over(study: PrecisionFile) -> int:
    """Number of design points that share a set-up."""
    return study.definition.work_precision.over or count_points(common_study(study))


def _measured(study: PrecisionFile, variant: Variant) -> Measurement:
    """Time a variant of a method and read its results."""
    if not all(is_prepared(key) for key in variant.plan.structures):
        raise ConvergenceError("structure", "no reduction of its model can be made")
    method = integrator(variant.integrator, variant.options) if variant.integrator else None
    measurement_request = MeasurementRequest(
        variant.lines, method, study.definition.work_precision.starts
    )
    return _measuring(study).measure(variant.plan, variant.measured, measurement_request)


KIND = WorkPrecision()
