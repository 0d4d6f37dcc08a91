"""What a worker process does: advance a batch of design points in time and write what they did."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from squealstudy.analysis.runs.summary import history_frame, summarise
from squealstudy.analysis.tables.validity import BETWEEN
from squealstudy.analysis.transient.energy_drift import DRIFT_LIMIT, EXACT_LIMIT, energy_drift
from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.analysis.transient.storage_error import STORAGE_LIMIT, storage_number
from squealstudy.analysis.transient.system import stick_number
from squealstudy.errors import SquealstudyError
from squealstudy.reduction.working_point import open_share
from squealstudy.study.keys import chunk_id
from squealstudy.study.rows import FAILURES, reason
from squealstudy.study.tasks import Solved
from squealstudy.study.transient.batch import BatchTask, reference_of, sampling
from squealstudy.study.transient.histories import history_file
from squealstudy.study.transient.hybrid_runs import hybrid_runs
from squealstudy.study.transient.modal_runs import Finished, modal_runs
from squealstudy.study.transient.ready import Ready, set_up
from squealstudy.study.transient.rows import failed_row, row
from squealstudy.study.transient.start import state_file
from squealstudy.study.validity import open_reason
from squealstudy.study.working_points import NewGaps

# stick number beyond which a stuck contact rings at the step: levels of a belt (.3 to
# 1.1 m/s, kicked by 4, steps of 5e-5 to 4e-4 s) err by .8 % at 26, 3 % at 52 and 12 % at 210
RINGS = 30.0
STUCK = 0.5  # share of the contact area that sticks at a time


def solve_batch(task: BatchTask) -> Solved:
    """Integrate the points of a batch: rows, histories, final states."""
    started = time.perf_counter()
    rows: list[dict[str, Any]] = []
    files: dict[str, Any] = {}
    ready: list[Ready] = []
    gaps = NewGaps()
    try:
        reference = reference_of(task)
    except SquealstudyError as error:  # no nominal working point on this structure
        return Solved([failed_row(p.point_id, 0.0, *reason(error)) for p in task.points])
    for point in task.points:
        outcome = set_up(task, reference, point, gaps)
        if isinstance(outcome, Ready):
            ready.append(outcome)
        else:
            rows.append(outcome)
    if ready:
        finished, files = _advance(task, reference, ready, started)
        rows += finished
    gaps.save(chunk_id(p.point_id for p in task.points))
    return Solved(rows, files)


def _advance(
    task: BatchTask, reference: ReferenceModes, ready: Sequence[Ready], started: float
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Integrate: rows, and histories and final states by their paths."""
    integrate = hybrid_runs if task.section.representation == "hybrid" else modal_runs
    try:
        finished = integrate(task, reference, ready)
    except FAILURES as error:
        return [failed_row(one.task.point_id, 0.0, *reason(error)) for one in ready], {}
    wall = (time.perf_counter() - started) / len(ready)
    rows: list[dict[str, Any]] = []
    files: dict[str, Any] = {}
    for one, done in zip(ready, finished, strict=True):
        rows.append(_row(task, reference, one, done, wall))
        files |= _files(task, one, done)
    return rows, files


def _row(
    task: BatchTask, reference: ReferenceModes, one: Ready, done: Finished, wall: float
) -> dict[str, Any]:
    result, system = done.run.result, reference.system
    summary = summarise(done.run)
    point = {
        **summary.point,
        "stick_number": stick_number(system, one.point.design, task.section.step),
        "n_coordinates": done.n_coordinates,
        "n_contact_points": len(system.area),
        "perturbation": one.perturbation,
    }
    step = task.section.step
    limit = EXACT_LIMIT if task.section.integrator == "exponential" else DRIFT_LIMIT
    doubts = {
        "the step resolves stuck friction": _ringing(point, step),
        "a step keeps the energy balance": _drifting(energy_drift(result), step, limit),
        "the storage resolves contact pressures": _rounded(task, reference, one, done),
    }
    message = result.message or BETWEEN.join(text for text in doubts.values() if text)
    area, force = system.area, one.point.design.force
    resting = 0.0 if force is None else open_share(area, force[:, 0] / area)
    reasons = [open_reason(one.task.design.law_kind, resting)]
    reasons += [f"{rule}: {text}" for rule, text in doubts.items() if text]
    point["invalid_reason"] = BETWEEN.join(text for text in reasons if text)
    modes = [
        {**m, "energies": reference.energies[:, m["mode"] - 1].tolist()} for m in summary.modes
    ]
    return row(one.task.point_id, wall, result.outcome, message, point, modes, summary.growth)


def _ringing(point: dict[str, Any], step: float) -> str:
    """The trapezoidal rule does not damp the friction of stuck points at a long step."""
    number, share = point["stick_number"], point.get("stick_share_max", 0.0)
    if number <= RINGS or not share >= STUCK:
        return ""
    return (
        f"{100 * share:.0f} % of the contact sticks while h k_t |T|^2 / 2 is {number:.3g}: "
        "friction rings and levels may err by more than 1 %, which a step of "
        f"{step * RINGS / number:.2g} s avoids"
    )


def _drifting(drift: float, step: float, limit: float) -> str:
    """Energy from nowhere, as methods of a fixed step make it in impacts at a long step."""
    if not drift > limit:
        return ""
    return (
        f"the energy balance is off by {100 * drift:.2g} % of the energy of the vibration: levels "
        f"may be wrong, which a step of {step / 2:.2g} s would show"
    )


def _rounded(task: BatchTask, reference: ReferenceModes, one: Ready, done: Finished) -> str:
    """Contact forces that single-precision storage may have changed."""
    energy = done.run.energy
    if task.section.storage != "single" or not len(energy):
        return ""
    number = storage_number(reference.system, one.point.design, float(energy.max()))
    if number <= STORAGE_LIMIT:
        return ""
    return (
        f"storage in single precision may change contact pressures by {100 * number:.2g} %, which "
        'storage = "double" does not'
    )


def _files(task: BatchTask, one: Ready, done: Finished) -> dict[str, Any]:
    """History where it is asked for, and the final state of a finished run, by their paths."""
    name, section = one.task.point_id, task.section
    files: dict[str, Any] = {}
    if section.save_every:
        every = section.save_every // sampling(section, task.band_hz)
        files |= history_file(name, history_frame(done.run).iloc[::every])
    if done.run.result.outcome == "ok":
        files |= state_file(name, one.task.prepared_key, section.representation, done.q, done.v)
    return files
