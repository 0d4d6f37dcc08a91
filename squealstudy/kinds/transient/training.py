"""Training runs: what the modes beyond a truncated basis do, for POD vectors that repair it."""

from __future__ import annotations

import json
import time
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import NewGaps
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import write_atomic, write_json
from squealstudy.engine.workers import Progress
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.transient.batch import ALL_MODES, batch_task, settings_of, training_path
from squealstudy.kinds.transient.motions import set_up
from squealstudy.kinds.transient.plan_facts import training_designs
from squealstudy.motion.modal_basis import Training
from squealstudy.motion.point import perturbed
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import MotionPoint

TIMED = ".json"
SNAPSHOTS = 1500  # of each design point
START = 0.1  # of the sliding speed: the limit cycle is soon reached


def make_training_runs(plan: Plan, report: Progress, wanted: Collection[str] | None = None) -> None:
    """Make the training that the study's basis needs, where the cache does not hold them.

    `wanted` are the keys of the structures to be trained on; all by default.

    Raises
    ------
    SquealstudyError
        Where no training run reaches its end.
    """
    if not plan.study.section.pod_vectors:
        return
    asked = [s.key for s in plan.structures if wanted is None or s.key in wanted]
    missing = [key for key in asked if not training_path(plan, key).is_file()]
    for done, key in enumerate(missing):
        report("training run", done, len(missing))
        started = time.process_time()
        with threadpool_limits(1):
            made = training_run(plan, key)
        path = training_path(plan, key)
        write_json(path.with_suffix(TIMED), {"seconds": time.process_time() - started})
        write_atomic(path, partial(_save, made))
    if missing:
        report("training run", len(missing), len(missing))


def training_seconds(plan: Plan) -> float:
    """What training took on the structures that are trained on, for all of them; 0 without."""
    if not plan.study.section.pod_vectors:
        return 0.0
    files = [training_path(plan, s.key).with_suffix(TIMED) for s in plan.structures]
    made = [json.loads(f.read_text())["seconds"] for f in files if f.is_file()]
    return float(sum(made)) * len(files) / max(len(made), 1)


def _save(training: Training, path: Path) -> None:
    with path.open("wb") as handle:
        np.savez(handle, snapshots=training.snapshots, modes=training.modes)


def training_run(plan: Plan, prepared_key: str) -> Training:
    """Displacements and growing modes of the training designs, all modes kept."""
    points = tuple(
        replace(d, point_id="training", structure=prepared_key) for d in training_designs(plan)
    )
    task = batch_task(plan, points, ALL_MODES)
    system = task.reference.system
    found = [(p, set_up(task, p, NewGaps())) for p in points]
    designs = [
        perturbed(system, made, START * p.values["sliding_speed"])
        for p, made in found
        if isinstance(made, MotionPoint)
    ]
    settings = settings_of(task.section.training, 0)
    settings = replace(settings, save_every=max(1, settings.n_steps // SNAPSHOTS), save_q=True)
    finished = [m for m in simulate(system, designs, settings) if m.outcome == "ok"]
    if not finished:
        raise SquealstudyError(f"{plan.study.path}: no training run for pod_vectors succeeded")
    return Training(
        np.concatenate([motion.q_history for motion in finished]),
        np.hstack([motion.point.growing.right for motion in finished]),
    )
