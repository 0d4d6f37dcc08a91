"""In a worker process: set up a batch of design points about steady sliding and integrate them.

The results are their rows, histories and final states.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from squealstudy.engine.cache import (
    NewGaps,
    is_whole,
    load_value,
    prepared_model,
    prepared_path,
    save_value,
)
from squealstudy.engine.final_states import state_files
from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.validity import open_reason
from squealstudy.engine.workers import Solved
from squealstudy.errors import ConvergenceError, ModelError, SquealstudyError
from squealstudy.kinds.transient.batch import BatchTask, sensed_modes
from squealstudy.kinds.transient.batch_steps import BatchSteps
from squealstudy.kinds.transient.histories import history_file, history_frame
from squealstudy.kinds.transient.starts import set_up_all
from squealstudy.kinds.transient.tables import lost_row, row
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.point import state_working_point
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.level_errors import doubts
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.level import StepParts
from squealstudy.motion.outcome.settling import known_outcome
from squealstudy.motion.outcome.summary import look_ahead, summarise
from squealstudy.motion.run_windows import window_rows
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.system import MotionPoint, stick_number
from squealstudy.reduction.cmt import component_modes
from squealstudy.reduction.hybrid import (
    HybridModel,
    HybridSettings,
    hybrid_model,
    hybrid_model_at,
)
from squealstudy.reduction.working_point import with_less_friction
from squealstudy.study.design import DesignPoint
from squealstudy.tables.validity import BETWEEN

# correlation of a mode's motion at the contact, between both representations, if it is the same
MIN_MODE_CORRELATION = 0.99
N_STOP_TESTS = 20  # number of times, evenly over a run, at which it is tested whether it may stop
Failure = tuple[str, str]  # status and message


def solve_batch(task: BatchTask) -> Solved:
    """Integrate the points of a batch; return their rows, histories and final states."""
    started = time.perf_counter()
    gaps = NewGaps()
    try:
        _ = task.reference
    except SquealstudyError as error:  # no nominal working point on this structure
        return Solved([lost_row(p.point_id, *reason(error)) for p in task.points])
    starts = list(zip(task.points, set_up_all(task, task.points, gaps), strict=True))
    ready = [(point, start) for point, start in starts if isinstance(start, MotionPoint)]
    rows = [
        lost_row(point.point_id, *start)
        for point, start in starts
        if not isinstance(start, MotionPoint)
    ]
    files: dict[str, Any] = {}
    chosen, points = [point for point, _ in ready], [start for _, start in ready]
    try:
        motions = integrate(task, chosen, points) if ready else []
    except FAILURES as error:
        if len(task.points) > 1:
            raise  # each is then tried by itself, so that one at fault does not spoil the others
        rows += [lost_row(point.point_id, *reason(error)) for point in chosen]
    else:
        look_ahead(motions)
        batch_rows, steps = [], BatchSteps(task, motions)
        for point, motion in zip(chosen, motions, strict=True):
            batch_rows.append(_row(task, point, motion, steps))
            files |= _history(task, point, motion)
        files |= _states(task, chosen, motions)
        wall = (time.perf_counter() - started) / max(len(ready), 1)
        rows += [row | {"wall_s": wall} for row in batch_rows]
    gaps.save()
    return Solved(rows, files)


def _row(task: BatchTask, point: DesignPoint, motion: Motion, steps: BatchSteps) -> dict[str, Any]:
    """Chunk row of a run: levels, outcome, doubts and errors by the step."""
    reference, settings = task.reference, task.settings()
    parts_of_steps: list[StepParts] = []

    def by_step(lasts: bool) -> StepParts:
        parts = steps.of(motion, lasts)
        if lasts:
            parts_of_steps.append(parts)
        return parts

    windows: list[dict[str, Any]] = []
    if motion.point.schedule is not None:
        windows = window_rows(motion, task.section.n_windows, steps.again(motion))

    system, summary = reference.system, summarise(motion, by_step)
    doubts_by_rule = doubts(motion, system, settings, summary.point)
    if parts_of_steps and parts_of_steps[0].reason and not task.hybrid:
        doubts_by_rule["another step tells what the step does to levels"] = parts_of_steps[0].reason
    reasons = [open_reason(point.law_kind, motion.point.open_share)]
    reasons += [f"{rule}: {text}" for rule, text in doubts_by_rule.items()]
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
    untold = [parts_of_steps[0].reason] if parts_of_steps and task.hybrid else []
    message = motion.message or BETWEEN.join([*doubts_by_rule.values(), *untold])
    return row(
        point.point_id,
        0.0,
        motion.outcome,
        message,
        modes=modes,
        growth=summary.growth,
        windows=windows,
        **columns,
    )


def _history(task: BatchTask, point: DesignPoint, motion: Motion) -> dict[str, Any]:
    """File of a run's history, by its path; empty where histories are not asked for."""
    section, every = task.section, task.settings().save_every
    if not section.save_every:
        return {}
    return history_file(point.point_id, history_frame(motion, section.save_every // every))


def _states(
    task: BatchTask, points: Sequence[DesignPoint], motions: Sequence[Motion]
) -> dict[str, Any]:
    """Files of the final states of runs that are ok, by path; one each if there are histories."""
    finished = {
        point.point_id: final_state(task, motion)
        for point, motion in zip(points, motions, strict=True)
        if motion.outcome == "ok"
    }
    section, key = task.section, task.points[0].structure
    return state_files(
        finished, key, section.representation, in_own_folder=bool(section.save_every)
    )


def integrate(
    task: BatchTask, chosen: Sequence[DesignPoint], points: Sequence[MotionPoint]
) -> list[Motion]:
    """Motions of design points that were set up, in the representation of the study.

    Raises
    ------
    ModelError
        Where not even the first mode of the hybrid representation is that of the modal one.
    """
    return hybrid_motions(task, chosen, points) if task.hybrid else _modal_motions(task, points)


def final_state(task: BatchTask, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Final deviation and velocity (n,) of a motion, in coordinates to start another run from."""
    if task.hybrid:
        return motion.q, motion.v
    final = task.reference.phi @ np.stack([motion.q, motion.v], axis=1)
    return final[:, 0], final[:, 1]


def _modal_motions(task: BatchTask, points: Sequence[MotionPoint]) -> list[Motion]:
    """Runs of a task in modal coordinates, from the start that the study asks for."""
    reference, settings = task.reference, task.settings()
    omega2 = reference.system.omega2[: reference.n_exact]
    system = replace(reference.system, sensed=sensed_modes(task.section, omega2, task.band_hz))
    if task.start is not None:
        q, v = (reference.phi.T @ x for x in (task.start.q, task.start.v))
        starts = [point.start(system.n) for point in points]
        points = [
            replace(point, q0=q0 + q, v0=v0 + v)
            for point, (q0, v0) in zip(points, starts, strict=True)
        ]
    return simulate(system, points, settings, _watch(task, settings, len(points)))


def _watch(task: BatchTask, settings: MotionSettings, count: int) -> Watch | None:
    """A watch that stops runs whose outcome is known; None where the study does not ask for it."""
    section = task.section
    if section.stop == "end":
        return None

    def judge(_: int, motion: Motion) -> str:
        return known_outcome(motion, section.duration, section.settle_tolerance)

    return Watch([max(1, settings.n_steps // N_STOP_TESTS)] * count, judge)


def hybrid_motions(
    task: BatchTask, chosen: Sequence[DesignPoint], points: Sequence[MotionPoint]
) -> list[Motion]:
    """Integrate design points one by one; final states are in hybrid coordinates.

    Raises
    ------
    ModelError
        Where not even the first modes of the two representations are the same.
    """
    reference, model = task.reference, _model(task)
    signs = common_modes(reference, model)
    m = len(signs)
    phi = np.hstack([model.phi[:, :m] * signs, model.phi[:, m:]])  # modes of the reference
    model = replace(model, phi=phi)
    sensed = sensed_modes(task.section, reference.system.omega2[:m], task.band_hz)
    motions: list[Motion] = []
    for design_point, point in zip(chosen, points, strict=True):
        own_model = hybrid_model_at(model, point.tangents(reference.system))
        design = _hybrid_point(task, model, own_model, m, design_point, point)
        motions.append(simulate_hybrid(own_model, design, task.settings(), sensed, model))
    return motions


def _model(task: BatchTask) -> HybridModel:
    """The hybrid model of the batch's structure, from the cache or made and kept there."""
    key = task.points[0].structure
    layers = task.section.layers
    content = [task.cutoff_hz, layers, task.component_modes, repr(task.operating)]
    name = content_hash([source_hash(), *content])
    path = prepared_path(key) / "hybrid" / name
    if not is_whole(path):
        settings = HybridSettings(task.cutoff_hz, task.cutoff_hz, layers)
        save_value(path, _build(task, settings))
    model: HybridModel = load_value(path)
    return model


def _build(task: BatchTask, settings: HybridSettings) -> HybridModel:
    """Make the hybrid model of a task's points."""
    first = task.points[0]
    prepared = prepared_model(first.structure)
    assembly = first.assembly()
    modes = component_modes(assembly, task.cutoff_hz) if task.component_modes else {}
    damped = {key: modes[key[0]] for key in task.component_modes}

    def model_at(operating: OperatingPoint) -> HybridModel:
        point = state_working_point(prepared, DesignState(operating))
        return hybrid_model(assembly, point, operating, settings, damped)

    return with_less_friction(model_at, task.operating)


def common_modes(reference: SharedModes, model: HybridModel) -> np.ndarray:
    """Signs (m,) that turn hybrid modes into the reference's modes of the same number.

    They are of the first m modes, up to the first that is not the same in both.

    Raises
    ------
    ModelError
        Where not even the first mode is the same.
    """
    m = min(len(model.omega), reference.n_exact)
    system = reference.system
    rows = zip((model.N, model.T, model.T_perp), (system.N, system.T1, system.T2), strict=True)
    observed = [(B @ model.phi[:, :m], other[:, :m]) for B, other in rows]
    in_model, other = (np.vstack(part) for part in zip(*observed, strict=True))
    sizes = np.linalg.norm(in_model, axis=0) * np.linalg.norm(other, axis=0)
    correlation = np.einsum("ij,ij->j", in_model, other) / np.maximum(sizes, 1e-300)
    first_odd = int(np.argmax(np.abs(correlation) < MIN_MODE_CORRELATION))
    m = first_odd if np.abs(correlation[first_odd]) < MIN_MODE_CORRELATION else m
    if m == 0:
        raise ModelError("the hybrid model does not have the modes of the modal representation")
    return np.sign(correlation[:m])


def _hybrid_point(
    task: BatchTask,
    model: HybridModel,
    model_at_point: HybridModel,
    m: int,
    chosen: DesignPoint,
    point: MotionPoint,
) -> MotionPoint:
    """The design point in coordinates of the hybrid model, which shares the first m modes.

    Modal damping acts on the real modes at the point's working point, those of `model_at_point`.
    ConvergenceError where frequencies of component modes are scaled.
    """
    state = chosen.state()
    if point.s is not None and point.s.any():
        raise ConvergenceError(
            "parameter", "the hybrid representation has no frequency_scale of component modes"
        )
    beta, shapes = state.stiffness_damping, model.phi[:, :m]
    zeta = (
        state.assembly_damping_ratios(len(model_at_point.omega)) + 0.5 * beta * model_at_point.omega
    )
    q0, v0 = (shapes @ x[:m] for x in point.start(task.reference.system.n))
    if task.start is not None:
        q0, v0 = q0 + task.start.q, v0 + task.start.v
    watching = point.growing.sensors[:, :m] @ model.sensors[:m]
    return replace(
        point,
        c=2.0 * zeta * model_at_point.omega,
        damping_between=None,
        beta=beta + state.damping_ratio / (np.pi * model.damping_cutoff),
        q0=q0,
        v0=v0,
        growing=replace(point.growing, sensors=watching),
    )
