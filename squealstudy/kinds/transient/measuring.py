"""Times and findings of transient runs with some integrator or basis, to compare methods."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import NewGaps
from squealstudy.engine.measurement import Measurement, MeasurementRequest, Measuring
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import silent
from squealstudy.kinds.complex_modes.measuring import reduction_seconds
from squealstudy.kinds.transient import preparation
from squealstudy.kinds.transient.batch import batch_task
from squealstudy.kinds.transient.preparation import make_training_runs, training_seconds
from squealstudy.kinds.transient.starts import set_up_all
from squealstudy.kinds.transient.worker import integrate
from squealstudy.machine.resources import memory_above
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.intervals import pooled_interval
from squealstudy.motion.outcome.summary import summarise
from squealstudy.motion.system import MotionPoint
from squealstudy.study.design import DesignPoint
from squealstudy.tables.method_quality import run_errors
from squealstudy.wording import IRREGULAR, LASTING, UNDECIDED

WITH_BOUNDS = {
    "growth_rate": ("growth_rate_low", "growth_rate_high"),
    "torque_mean": ("torque_mean_low", "torque_mean_high"),
    "torque_rms": ("torque_rms_low", "torque_rms_high"),
}
START_RATIO = 0.7  # each start has a perturbation of this size over that of the previous start
WITHOUT_BOUNDS = {"dominant_frequency": "torque_line_hz"}


def measure_runs(plan: Plan, measured: Sequence[int], request: MeasurementRequest) -> Measurement:
    """Run chosen points of a transient study; only their integration is timed.

    Working points, forecasts and summaries are the same for all methods of a basis.

    Parameters
    ----------
    plan : Plan
        A plan whose chosen points have their structures in the cache.
    measured : sequence of int
        Rows of the chosen points in the plan.
    request : MeasurementRequest
        Its `integrator` replaces the study's own (modal representation only). Each point runs
        `starts` times, from perturbations of different sizes, because levels of an irregular cycle
        depend on its start, and bounds must include that; seconds are those of one run.
    """
    return measure_points(plan, [plan.tasks[i] for i in measured], request)


def measure_points(
    plan: Plan, chosen: Sequence[DesignPoint], request: MeasurementRequest
) -> Measurement:
    """Do `measure_runs` for design points that need not be in the plan."""
    section = plan.study.section
    if section.changes:
        raise plan.study.error(
            ("transient", "sliding_speed" if section.sliding_speed else "pressure"),
            "methods are measured on levels that last: expected one speed and pressure",
        )
    preparation.warm(section)
    with threadpool_limits(1):
        make_training_runs(plan, silent, {task.structure for task in chosen})
        findings: dict[str, dict[str, Any]] = {}
        spent, passes, memory_mb, size = 0.0, [], 0.0, 0
        for first in range(0, len(chosen), section.batch):
            part = tuple(chosen[first : first + section.batch])
            runs = [
                _measured_batch(plan, part, request.integrator, START_RATIO**n)
                for n in range(request.starts)
            ]
            merged = map(pooled_findings, zip(*(r.findings for r in runs), strict=True))
            findings |= {str(first + n): finding for n, finding in enumerate(merged)}
            spent += sum(r.seconds if r.finished else np.nan for r in runs) / request.starts
            memory_mb = max(memory_mb, *(r.memory_mb for r in runs))
            finished = [motion for r in runs for motion in r.finished]
            passes += [motion.mean_iterations for motion in finished]
            size = max([size, *(len(motion.q) for motion in finished)])
    return Measurement(
        seconds=spent / len(chosen),
        setup_seconds=training_seconds(plan),
        reduction_seconds=reduction_seconds(plan),
        memory_mb=memory_mb,
        iterations=float(np.mean(passes)) if passes else np.nan,
        n_coordinates=size,
        findings=findings,
    )


class MeasuredBatch(NamedTuple):
    """Runs of some design points.

    Attributes
    ----------
    findings : list of dict
        Findings of each design point, failed ones included.
    seconds, memory_mb : float
        CPU time [s] and memory [MB] of the integration.
    finished : list of Motion
        Runs that were integrated.
    """

    findings: list[dict[str, Any]]
    seconds: float
    memory_mb: float
    finished: list[Motion]


def _measured_batch(
    plan: Plan, part: tuple[DesignPoint, ...], integrator: Integrator | None, start: float
) -> MeasuredBatch:
    """Run some points from their perturbations multiplied by `start`."""
    task = batch_task(plan, part, integrator=integrator)
    try:
        _ = task.reference
    except FAILURES as error:
        return MeasuredBatch([_failed(*reason(error)) for _ in part], 0.0, 0.0, [])
    starts = set_up_all(task, part, NewGaps())
    chosen = [
        point
        for point, start_or_failure in zip(part, starts, strict=True)
        if isinstance(start_or_failure, MotionPoint)
    ]
    ready = [
        _scaled(start_or_failure, start)
        for start_or_failure in starts
        if isinstance(start_or_failure, MotionPoint)
    ]
    seconds, finished, message = 0.0, [], ("failed", "")
    with memory_above() as memory:
        started = time.process_time()
        try:
            finished = integrate(task, chosen, ready) if ready else []
        except FAILURES as error:
            message = reason(error)
        seconds = time.process_time() - started
    done = iter(finished)
    findings = [
        _failed(*start_or_failure)
        if not isinstance(start_or_failure, MotionPoint)
        else _motion_finding(next(done))
        if finished
        else _failed(*message)
        for start_or_failure in starts
    ]
    return MeasuredBatch(findings, seconds, memory.megabytes, finished)


def _scaled(point: MotionPoint, start: float) -> MotionPoint:
    """The point with its initial state multiplied by `start`."""
    assert point.q0 is not None
    q0, v0 = point.start(len(point.q0))
    return replace(point, q0=start * q0, v0=start * v0)


def pooled_findings(findings: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One finding from several starts of a point: means with bounds, and the commonest class.

    Without a class that more than half have, it is irregular if all last, else undecided.
    """
    first = findings[0]
    failed = [finding for finding in findings if finding["status"] != "ok"]
    if failed or len(findings) == 1:
        return failed[0] if failed else first
    values = {
        name: _pooled([finding["values"][name] for finding in findings]) for name in first["values"]
    }
    modes = {mode for finding in findings for mode in finding["energy_share"]}
    shares = {
        mode: float(np.mean([finding["energy_share"].get(mode, 0.0) for finding in findings]))
        for mode in sorted(modes, key=int)
    }
    name, count = Counter(finding["class"] for finding in findings).most_common(1)[0]
    if 2 * count <= len(findings):  # all last, in different ways: an irregular motion
        name = IRREGULAR if {finding["class"] for finding in findings} <= {*LASTING} else UNDECIDED
    return {**first, "class": name, "values": values, "energy_share": shares}


def _pooled(numbers: Sequence[Sequence[float | None]]) -> list[float | None]:
    """Value with bounds over all starts; None for all three where one start lacks a number."""
    columns = [[n for n in column if n is not None] for column in zip(*numbers, strict=True)]
    if any(len(column) < len(numbers) for column in columns):
        return [None, None, None]
    return list(pooled_interval(*(np.array(column) for column in columns)))


def _failed(status: str, message: str) -> dict[str, Any]:
    return {"status": status, "message": message}


def _motion_finding(motion: Motion) -> dict[str, Any]:
    if motion.outcome != "ok":
        return _failed(motion.outcome, motion.message)
    summary = summarise(motion)
    return _finding(summary.point, summary.modes)


def run_finding(row: dict[str, Any]) -> dict[str, Any]:
    """The finding that errors are measured on, from a chunk row of a transient study."""
    if row["status"] != "ok":
        return _failed(row["status"], row["message"])
    return _finding(row, row["modes"])


def _finding(point: Mapping[str, Any], modes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The finding of a run: its values, with bounds where there are some."""
    values: dict[str, list[float | None]] = {}
    for name, (low, high) in WITH_BOUNDS.items():
        values[name] = _numbers(point, name, low, high)
    for name, column in WITHOUT_BOUNDS.items():
        values[name] = _numbers(point, column, column, column)
    return {
        "status": "ok",
        "message": "",
        "class": point["class"],
        "torque_static": float(point["torque_static"]),
        "predicted_frequency_hz": float(np.nan_to_num(point["predicted_frequency_hz"])),
        "energy_balance": float(point["energy_balance"]),
        "values": values,
        "energy_share": {str(m["mode"]): m["energy_share"] for m in modes},
    }


def _numbers(point: Any, *names: str) -> list[float | None]:
    numbers = [float(point.get(name, np.nan)) for name in names]
    return [None if np.isnan(x) else x for x in numbers]


MEASURING = Measuring(
    quantities=("growth_rate", "torque_mean", "torque_rms", "dominant_frequency", "energy_share"),
    judged=("growth_rate", "torque_rms", "torque_mean", "dominant_frequency"),
    measure=measure_runs,
    comparisons=(run_errors,),
    finding=run_finding,
)
