"""Estimates errors that the time step makes in the levels of a batch of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from squealstudy.kinds.transient.batch import BatchTask
from squealstudy.motion.integrator import KernelIntegrator
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.level import NOT_ASKED, StepParts
from squealstudy.motion.step_errors import (
    HALF,
    TWICE,
    RunsAgain,
    has_few_points,
    runs_again,
    step_parts,
)
from squealstudy.motion.system import ModalSystem


class BatchSteps:
    """Errors that the time step makes in the levels of a batch's runs.

    With few contact points, each run is repeated with other steps; runs of equal length are
    repeated together. With many contact points, only the first run that lasts is continued with
    other steps: all other runs are assumed to err by the same shares of their levels.
    """

    def __init__(self, task: BatchTask, motions: Sequence[Motion]) -> None:
        self._task, self._motions = task, motions
        self._shared_error: StepParts | None = None
        self._again: dict[int, RunsAgain] = {}  # by the id of the run as a Python object

    def of(self, motion: Motion, lasts: bool) -> StepParts:
        """Error due to the step in a run; `lasts` tells whether its vibration lasts."""
        task = self._task
        if task.hybrid:
            if not lasts:
                return NOT_ASKED
            return StepParts.unknown("the hybrid representation is not run with another step")
        system = replace(task.reference.system, sensed=motion.sensed)
        settings = task.settings()
        if (few := has_few_points(system)) or not lasts:
            again = few and isinstance(settings.integrator, KernelIntegrator)
            others = self._others(system, motion) if again else None
            return step_parts(system, motion, settings, lasts, others)
        if self._shared_error is None:
            self._shared_error = step_parts(system, motion, settings)
        return self._shared_error

    def again(self, motion: Motion) -> tuple[Motion, ...]:
        """A run whose speed or pressure changes, repeated with other steps; () for many points."""
        system = replace(self._task.reference.system, sensed=motion.sensed)
        settings = self._task.settings()
        kernel = isinstance(settings.integrator, KernelIntegrator)
        done = motion.outcome == "ok" and kernel and has_few_points(system)
        if not done:
            return ()
        others = self._others(system, motion)
        return tuple(others[factor] for factor in (HALF, TWICE) if factor in others)

    def _others(self, system: ModalSystem, motion: Motion) -> RunsAgain:
        """Repeat a run with other steps, together with all runs of its length and outcome."""
        if id(motion) not in self._again:
            kind = motion.outcome, motion.time
            runs_of_kind = [m for m in self._motions if (m.outcome, m.time) == kind]
            repeated = runs_again(system, runs_of_kind, self._task.settings())
            self._again |= {id(m): others for m, others in zip(runs_of_kind, repeated, strict=True)}
        return self._again.pop(id(motion))
