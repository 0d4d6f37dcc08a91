"""Errors of a batch's runs due to the time step, from runs with other steps."""

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

    With few contact points each run is made again with other steps, runs of one length together.
    With many, only the first lasting run of the batch is continued with other steps, and all others
    are taken to err by the same shares of their levels.
    """

    def __init__(self, task: BatchTask, motions: Sequence[Motion]) -> None:
        self._task, self._motions = task, motions
        self._known: StepParts | None = None
        self._again: dict[int, RunsAgain] = {}  # by the identity of the run

    def of(self, motion: Motion, lasts: bool) -> StepParts:
        """Error due to the step in a run whose vibration lasts, or does not."""
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
        if self._known is None:
            self._known = step_parts(system, motion, settings)
        return self._known

    def again(self, motion: Motion) -> tuple[Motion, ...]:
        """Other steps' runs of one whose speed or pressure changes; () with many contact points."""
        system = replace(self._task.reference.system, sensed=motion.sensed)
        settings = self._task.settings()
        kernel = isinstance(settings.integrator, KernelIntegrator)
        done = motion.outcome == "ok" and kernel and has_few_points(system)
        if not done:
            return ()
        others = self._others(system, motion)
        return tuple(others[factor] for factor in (HALF, TWICE) if factor in others)

    def _others(self, system: ModalSystem, motion: Motion) -> RunsAgain:
        """A run with other steps, made together with all runs of its length and outcome."""
        if id(motion) not in self._again:
            kind = motion.outcome, motion.time
            alike = [m for m in self._motions if (m.outcome, m.time) == kind]
            made = runs_again(system, alike, self._task.settings())
            self._again |= {id(m): others for m, others in zip(alike, made, strict=True)}
        return self._again.pop(id(motion))
