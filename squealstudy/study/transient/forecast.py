"""What a transient study will do before it runs: compiled kernels, warnings, seconds a step."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import stick_number
from squealstudy.analysis.transient.warmup import warm_kernels
from squealstudy.study.cache import is_prepared
from squealstudy.study.plan import Plan
from squealstudy.study.transient.basis import truncated_choice
from squealstudy.study.transient.batch import BatchTask, batch_task, reference_of, settings_of
from squealstudy.study.transient.ready import Ready, set_up
from squealstudy.study.transient_section import TransientSection
from squealstudy.study.working_points import NewGaps

TIMED_STEPS = 300
MOST_ENDS = 6  # design points looked at for warnings
STICK_LIMIT = 1e3  # h k_t |T|^2 / 2: a margin of ten below where steps failed on the medium brake


def warm(section: TransientSection) -> float:
    """Compile the kernels here, before workers ask for them; seconds."""
    return warm_kernels(section.storage == "single")


def warnings(plan: Plan) -> list[str]:
    """Growth above the band and friction too stiff for the step, at the ends of the sweeps.

    Empty where the first structure is not in the cache yet.
    """
    if not is_prepared(plan.structures[0].key):
        return []
    above: dict[str, float] = {}
    stiff: list[tuple[float, float]] = []
    for task in _ends(plan):
        reference = reference_of(task)
        ready = set_up(task, reference, task.points[0], NewGaps())
        if isinstance(ready, Ready):
            modes, design = ready.point.modes, ready.point.design
            if modes.n_above:
                text = f"{modes.frequency_above:.0f} Hz at {modes.growth_above:.0f} 1/s"
                above[text] = modes.growth_above
            number = stick_number(reference.system, design, task.section.step)
            stiff.append((number, design.friction.k_t))
    return [*_above(plan, above), *_stiff(plan, stiff), *_still(plan)]


def _ends(plan: Plan) -> list[BatchTask]:
    """Design points where a sweep is at its first or last value, one each."""
    chosen = [len(plan.tasks) - 1, 0]
    for column in plan.coordinates.T:
        chosen += [int(np.argmax(column)), int(np.argmin(column))]
    key = plan.structures[0].key
    tasks = [plan.tasks[i] for i in dict.fromkeys(chosen) if plan.tasks[i].prepared_key == key]
    basis = truncated_choice(plan)
    return [batch_task(plan, Path(), (task,), basis) for task in tasks[:MOST_ENDS]]


def _above(plan: Plan, above: dict[str, float]) -> list[str]:
    if not above:
        return []
    worst = max(above, key=lambda text: above[text])
    return [
        f"a mode above the band of {plan.band_hz[1]:g} Hz is unstable too ({worst}): it will grow "
        "in time; structural damping (damping_ratio, or stiffness_damping that rises with "
        "frequency) holds it"
    ]


def _still(plan: Plan) -> list[str]:
    section = plan.study.definition.transient
    if section.perturbation or section.continued:
        return []
    return ["perturbation is 0: steady sliding stays as it is, unstable or not"]


def _stiff(plan: Plan, stiff: list[tuple[float, float]]) -> list[str]:
    number, slope = max(stiff, default=(0.0, 0.0))
    if number <= STICK_LIMIT:
        return []
    step = plan.study.definition.transient.step * STICK_LIMIT / number
    return [
        f"friction is too stiff for the step: h k_t |T|^2 / 2 is {number:.3g} with k_t = "
        f"{slope:.3g} N s/m3, steps converge up to {STICK_LIMIT:g}; a step of {step:.2g} s or a "
        f"contact.kt of {slope * STICK_LIMIT / number:.2g} would do"
    ]


def time_steps(task: BatchTask) -> tuple[float, int, int] | None:
    """Seconds of the first steps of a point, their number, and that of the whole run."""
    reference = reference_of(task)
    ready = set_up(task, reference, task.points[0], NewGaps())
    if not isinstance(ready, Ready):
        return None
    warm(task.section)
    whole = settings_of(task.section, 0)
    steps = min(TIMED_STEPS, whole.n_steps)
    settings = replace(whole, duration=steps * whole.step)
    started = time.perf_counter()
    simulate(reference.system, [ready.point.design], settings, ready.q0, ready.v0)
    return time.perf_counter() - started, steps, whole.n_steps
