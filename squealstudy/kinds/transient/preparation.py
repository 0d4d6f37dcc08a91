"""Preparation of a transient study: kernels, warnings, timed steps, training runs.

A training run has all modes. POD vectors of its motion complete a truncated basis.
"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import (
    NewGaps,
    discard,
    is_prepared,
    is_whole,
    load_value,
    save_value,
)
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Progress
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.transient.batch import (
    ALL_MODES,
    BatchTask,
    batch_task,
    settings_of,
    training_path,
    truncated_choice,
)
from squealstudy.kinds.transient.plan_facts import regularised, training_designs
from squealstudy.kinds.transient.section import WORKING_POINT, TransientSection
from squealstudy.kinds.transient.starts import set_up, set_up_all
from squealstudy.laws.friction.exponential_fall import DECAY_SPEED, STATIC_RATIO
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.motion.level_errors import MAX_STICK_NUMBER
from squealstudy.motion.point import perturbed
from squealstudy.motion.shared_modes import Training
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import (
    CLOSING_LIMIT,
    STICK_LIMIT,
    MotionPoint,
    closing_number,
    stick_number,
)
from squealstudy.motion.warmup import warm_kernels
from squealstudy.wording import in_digits

TIMED_STEPS = 300  # most steps of a point that are timed
MAX_END_POINTS = 6  # most design points that are checked for warnings
# regularisation speed over decay speed: slow stick-slip of a mass on a belt, RMS 4.86 N for small
# ratios, is 2 % less at 1/50, and 0.74 N or none at 2
MAX_DECAY_SHARE = 0.2
SNAPSHOTS_PER_POINT = 1500  # about so many snapshots of each point of a training run
# start velocity of a training run over the sliding speed, so that the limit cycle is reached soon
TRAINING_VELOCITY_RATIO = 0.1


def warm(section: TransientSection) -> float:
    """Compile the kernels in this process, before workers need them; seconds that it took."""
    return warm_kernels(section.storage == "single")


def warnings(plan: Plan) -> list[str]:
    """Warnings on settings, and on growth outside the band, stiff friction and stiff contact.

    All but settings are checked at ends of the sweeps, if the first structure is in the cache.
    """
    if not is_prepared(plan.tasks[0].structure):
        return [*_standstill_warnings(plan), *_rounded_away(plan)]
    outside: list[tuple[float, float]] = []
    stiff: list[tuple[float, float, float]] = []
    closing: list[float] = []
    for task in _ends(plan):
        design = set_up(task, task.points[0], NewGaps())
        if isinstance(design, MotionPoint):
            modes, system = design.growing, task.reference.system
            if modes.n_outside:
                outside.append((modes.growth_outside, modes.frequency_outside))
            number = stick_number(system, design, task.section.step)
            first_point = task.points[0]
            speed = (
                first_point.values[REGULARISATION_SPEED.name] if regularised(first_point) else 0.0
            )
            stiff.append((number, design.friction.k_t, speed))
            # squeal saturates where the vibration moves about as fast as the disc
            closing.append(closing_number(design.contact, abs(design.speed), task.section.step))
    of_tasks = (_outside(plan, outside), _stiff(plan, stiff), _closing(plan, closing))
    texts = (*of_tasks, _standstill_warnings(plan), _rounded_away(plan))
    return [text for part in texts for text in part]


def _ends(plan: Plan) -> list[BatchTask]:
    """Tasks of single design points: the last, the first, and one for each end of a sweep.

    They are those with the first point's structure, at most MAX_END_POINTS.
    """
    chosen = [len(plan.tasks) - 1, 0]
    for column in plan.coordinates.T:
        chosen += [int(np.argmax(column)), int(np.argmin(column))]
    key = plan.tasks[0].structure
    tasks = [plan.tasks[i] for i in dict.fromkeys(chosen) if plan.tasks[i].structure == key]
    basis = truncated_choice(plan)
    return [batch_task(plan, (task,), basis) for task in tasks[:MAX_END_POINTS]]


def _outside(plan: Plan, outside: Sequence[tuple[float, float]]) -> list[str]:
    """Warning about unstable modes that are not followed, by growth rates and frequencies."""
    if not outside:
        return []
    growth, hz = max(outside)
    low, high = plan.band_hz
    where = f"above the band of {high:g} Hz" if hz > high else f"below the band from {low:g} Hz"
    return [
        f"a mode {where} is unstable too ({in_digits(hz)} Hz at {in_digits(growth)} 1/s): it will "
        "grow in time, and nothing follows it; a wider band does, structural damping "
        "(damping_ratio, or stiffness_damping that rises with frequency) holds it"
    ]


def _standstill_warnings(plan: Plan) -> list[str]:
    section = plan.study.section
    if section.perturbation or section.changes or section.start != WORKING_POINT:
        return []
    return ["perturbation is 0: steady sliding stays as it is, unstable or not"]


def _rounded_away(plan: Plan) -> list[str]:
    """Warning where static friction decays at speeds below the regularisation speed."""
    points = plan.tasks
    names = (REGULARISATION_SPEED.name, SLOPE.name, STATIC_RATIO.name, DECAY_SPEED.name)
    given_names = {*plan.study.values}
    if not set(names) <= given_names:
        return []  # the study has another curve of friction
    speed, slope, ratio, decay = (points.column(name) for name in names)
    is_rounded = (slope == 0) & (ratio > 1) & (speed > MAX_DECAY_SHARE * decay)
    if not is_rounded.any():
        return []
    worst = int(np.argmax(np.where(is_rounded, speed / decay, 0.0)))
    largest = MAX_DECAY_SHARE * decay[is_rounded].min()
    return [
        f"the excess of static friction is rounded away: it falls over a sliding speed of "
        f"{decay[worst]:.3g} m/s ({DECAY_SPEED.name}), and points stick below {speed[worst]:.3g} "
        f"m/s already. Stick-slip comes out too small or not at all: a "
        f"{REGULARISATION_SPEED.name} of {largest:.2g} or less keeps it"
    ]


def _stiff(plan: Plan, stiff: list[tuple[float, float, float]]) -> list[str]:
    """Warning about the largest stick number in `stiff`: (number, slope, regularisation speed)."""
    number, slope, speed = max(stiff, default=(0.0, 0.0, 0.0))
    if number <= MAX_STICK_NUMBER:
        return []
    if number <= STICK_LIMIT:
        step = plan.study.section.step * MAX_STICK_NUMBER / number
        return [
            "where half of the contact sticks its friction rings at this step, and levels may err "
            f"by more than 1 % (h k_t |T|^2 / 2 is {number:.3g}). A step of {step:.2g} s avoids it"
        ]
    step = plan.study.section.step * STICK_LIMIT / number
    softer = f"contact.kt of {slope * STICK_LIMIT / number:.2g}"
    if speed > 0:
        softer = f"{REGULARISATION_SPEED.name} of {speed * number / STICK_LIMIT:.2g}"
    return [
        f"friction is too stiff for the step: h k_t |T|^2 / 2 is {number:.3g} with k_t = "
        f"{slope:.3g} N s/m3, steps converge up to {STICK_LIMIT:g}. A step of {step:.2g} s or a "
        f"{softer} would do for friction, other limits apart"
    ]


def _closing(plan: Plan, closing: list[float]) -> list[str]:
    """Warning where contact is too stiff for the step in impacts."""
    number = max(closing, default=0.0)
    if number <= CLOSING_LIMIT:
        return []
    step = plan.study.section.step * CLOSING_LIMIT / number
    return [
        f"contact is too stiff for the step: closing at the sliding speed v it stiffens by e to "
        f"lambda h v = {number:.3g} in a step, impacts are resolved up to {CLOSING_LIMIT:g}. A "
        f"step of {step:.2g} s would do for impacts, other limits apart"
    ]


class TimedSteps(NamedTuple):
    """Timing of the first steps of a point.

    Attributes
    ----------
    seconds : float
        Time of the steps that were timed, s.
    steps, total : int
        Number of these steps, and of the steps of the whole run.
    loading_s : float
        Time before them, s, which a process takes once, to compile or load kernels.
    """

    seconds: float
    steps: int
    total: int
    loading_s: float


def time_steps(task: BatchTask) -> TimedSteps:
    """Time the first steps of a point; SquealstudyError where it cannot be run."""
    design = set_up(task, task.points[0], NewGaps())
    if not isinstance(design, MotionPoint):
        raise SquealstudyError(design[1])
    loading = time.perf_counter()
    warm(task.section)
    full_settings = settings_of(task.section, 0)
    simulate(task.reference.system, [design], replace(full_settings, duration=full_settings.step))
    steps = min(TIMED_STEPS, full_settings.n_steps)
    settings = replace(full_settings, duration=steps * full_settings.step)
    started = time.perf_counter()
    simulate(task.reference.system, [design], settings)
    seconds = time.perf_counter() - started
    return TimedSteps(seconds, steps, full_settings.n_steps, started - loading)


def make_training_runs(
    plan: Plan, report: Progress, structures: Collection[str] | None = None
) -> None:
    """Make the training runs that the study's basis needs and the cache does not hold.

    `structures` are the keys of structures that need one; None: those of all structures.

    Raises
    ------
    SquealstudyError
        Where no training run reaches its end.
    """
    if not plan.study.section.pod_vectors:
        return
    keys = [key for key in plan.structures if structures is None or key in structures]
    missing = [key for key in keys if _seconds(plan, key) is None]
    for done, key in enumerate(missing):
        report("training run", done, len(missing))
        started = time.process_time()
        with threadpool_limits(1):
            training = training_run(plan, key)
        discard(training_path(plan, key))  # a damaged one may be there
        save_value(training_path(plan, key), (training, time.process_time() - started))
    if missing:
        report("training run", len(missing), len(missing))


def training_seconds(plan: Plan) -> float:
    """Seconds of training for all structures, estimated from those in the cache; 0 without POD."""
    if not plan.study.section.pod_vectors:
        return 0.0
    seconds_of = (_seconds(plan, key) for key in plan.structures)
    known_seconds = [seconds for seconds in seconds_of if seconds is not None]
    return float(sum(known_seconds)) * len(plan.structures) / max(len(known_seconds), 1)


def _seconds(plan: Plan, key: str) -> float | None:
    """Seconds that a structure's training run took; None where the cache has no valid one."""
    folder = training_path(plan, key)
    stored = load_value(folder) if is_whole(folder) else None
    if not (isinstance(stored, tuple) and len(stored) == 2):
        return None
    training, seconds = stored
    fit = isinstance(training, Training) and isinstance(seconds, float) and math.isfinite(seconds)
    return seconds if fit else None


def training_run(plan: Plan, prepared_key: str) -> Training:
    """Run the training designs with all modes: their displacements and growing modes."""
    points = tuple(
        replace(d, point_id="training", structure=prepared_key) for d in training_designs(plan)
    )
    task = batch_task(plan, points, ALL_MODES)
    system = task.reference.system
    starts = list(zip(points, set_up_all(task, points, NewGaps()), strict=True))
    designs = [
        perturbed(
            system, start_or_failure, TRAINING_VELOCITY_RATIO * abs(p.values["sliding_speed"])
        )
        for p, start_or_failure in starts
        if isinstance(start_or_failure, MotionPoint)
    ]
    settings = settings_of(task.section.training, 0)
    settings = replace(
        settings, save_every=max(1, settings.n_steps // SNAPSHOTS_PER_POINT), save_q=True
    )
    finished = [m for m in simulate(system, designs, settings) if m.outcome == "ok"]
    if not finished:
        raise SquealstudyError(
            f"{plan.study.source.path}: no training run for pod_vectors succeeded"
        )
    return Training(
        np.concatenate([motion.q_history for motion in finished]),
        np.hstack([motion.point.growing.right for motion in finished]),
    )
