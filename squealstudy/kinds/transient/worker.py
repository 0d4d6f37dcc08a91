"""What a worker process does: advance a batch of design points in time, and say what they did."""

from __future__ import annotations

import time
from typing import Any

from squealstudy.engine.cache import NewGaps
from squealstudy.engine.keys import chunk_id
from squealstudy.engine.rows import FAILURES, reason
from squealstudy.engine.store import history_file
from squealstudy.engine.validity import open_reason
from squealstudy.engine.workers import Solved
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.transient.batch import BatchTask
from squealstudy.kinds.transient.motions import final_state, integrate, set_up
from squealstudy.kinds.transient.rows import failed_row, row
from squealstudy.kinds.transient.start import state_file
from squealstudy.motion.doubts import doubts
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.summary import history_frame, summarise
from squealstudy.motion.system import MotionPoint, stick_number
from squealstudy.reduction.working_point import open_share
from squealstudy.study.design import DesignPoint
from squealstudy.tables.validity import BETWEEN


def solve_batch(task: BatchTask) -> Solved:
    """Integrate the points of a batch: rows, histories, final states."""
    started = time.perf_counter()
    gaps = NewGaps()
    try:
        _ = task.reference
    except SquealstudyError as error:  # no nominal working point on this structure
        return Solved([failed_row(p.point_id, 0.0, *reason(error)) for p in task.points])
    found = [(point, set_up(task, point, gaps)) for point in task.points]
    ready = [(point, made) for point, made in found if isinstance(made, MotionPoint)]
    rows = [
        failed_row(point.point_id, 0.0, *made)
        for point, made in found
        if not isinstance(made, MotionPoint)
    ]
    files: dict[str, Any] = {}
    chosen, points = [point for point, _ in ready], [made for _, made in ready]
    try:
        motions = integrate(task, chosen, points) if ready else []
    except FAILURES as error:
        rows += [failed_row(point.point_id, 0.0, *reason(error)) for point in chosen]
    else:
        wall = (time.perf_counter() - started) / max(len(ready), 1)
        for point, motion in zip(chosen, motions, strict=True):
            rows.append(_row(task, point, motion, wall))
            files |= _files(task, point, motion)
    gaps.save(chunk_id(p.point_id for p in task.points))
    return Solved(rows, files)


def _row(task: BatchTask, point: DesignPoint, motion: Motion, wall: float) -> dict[str, Any]:
    reference, settings = task.reference, task.settings()
    system, summary = reference.system, summarise(motion)
    sticks = summary.point.get("stick_share_max", 0.0)
    said = doubts(motion, system, settings, sticks)
    area, force = system.area, motion.point.force
    resting = 0.0 if force is None else open_share(area, force[:, 0] / area)
    reasons = [open_reason(point.law_kind, resting)]
    reasons += [f"{rule}: {text}" for rule, text in said.items()]
    columns = {
        **summary.point,
        "stick_number": stick_number(system, motion.point, settings.step),
        "n_coordinates": len(motion.q),
        "n_contact_points": len(system.area),
        "perturbation": task.perturbation,
        "invalid_reason": BETWEEN.join(text for text in reasons if text),
    }
    modes = [
        {**m, "energies": reference.energies[:, m["mode"] - 1].tolist()} for m in summary.modes
    ]
    message = motion.message or BETWEEN.join(said.values())
    return row(
        point.point_id,
        wall,
        motion.outcome,
        message,
        summary=columns,
        modes=modes,
        growth=summary.growth,
    )


def _files(task: BatchTask, point: DesignPoint, motion: Motion) -> dict[str, Any]:
    """History where it is asked for, and the final state of a finished run, by their paths."""
    section, every = task.section, task.settings().save_every
    files: dict[str, Any] = {}
    if section.save_every:
        kept = history_frame(motion).iloc[:: section.save_every // every]
        files |= history_file(point.point_id, kept)
    if motion.outcome == "ok":
        q, v = final_state(task, motion)
        files |= state_file(point.point_id, point.structure, section.representation, q, v)
    return files
