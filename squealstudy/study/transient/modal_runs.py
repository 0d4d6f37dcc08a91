"""A batch in the modal representation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from squealstudy.analysis.runs.modal_run import ModalRun
from squealstudy.analysis.runs.outcome import known_outcome
from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.analysis.transient.watch import Watch
from squealstudy.study.transient.batch import BatchTask, sampling, sensed_modes, settings_of
from squealstudy.study.transient.ready import Ready

LOOKS = 20  # at a run, evenly over its duration


@dataclass(frozen=True)
class Finished:
    """A run, its final state in coordinates that another run can start from, and its size."""

    run: ModalRun
    q: np.ndarray
    v: np.ndarray
    n_coordinates: int


class Integrate(Protocol):
    """Something that integrates as `analysis.transient.simulate.simulate` does."""

    def __call__(
        self,
        system: ModalSystem,
        designs: Sequence[TransientDesign],
        settings: TransientSettings,
        q0: np.ndarray,
        v0: np.ndarray,
        watch: Watch | None,
        /,
    ) -> list[TransientResult]:
        """Results in the order of the designs."""
        ...


def modal_runs(
    task: BatchTask,
    reference: ReferenceModes,
    ready: Sequence[Ready],
    integrate: Integrate = simulate,
) -> list[Finished]:
    """Integrate design points together; final states are in component-mode coordinates."""
    n = reference.system.n
    modes = sensed_modes(task.section, reference.system.omega2[: reference.n_exact], task.band_hz)
    system = replace(reference.system, sensors=np.eye(n)[modes - 1])
    designs = [replace(r.point.design, sensors=r.point.sensor_rows) for r in ready]
    omega = np.sqrt(np.maximum(reference.system.omega2[modes - 1], 0.0))
    m = len(modes)

    def run_of(k: int, result: TransientResult) -> ModalRun:
        q, v = result.displacement, result.velocity
        rows = (q[:, :m], v[:, :m], q[:, m:], v[:, m:])
        return ModalRun(result, ready[k].point, modes, omega, *rows, task.start is not None)

    settings = settings_of(task.section, sampling(task.section, task.band_hz))
    q, v = _continued(task, reference)
    results = integrate(
        system,
        designs,
        settings,
        np.array([r.q0 + q for r in ready]),
        np.array([r.v0 + v for r in ready]),
        _watch(task, settings, len(ready), run_of),
    )
    finished = []
    for k, result in enumerate(results):
        final = reference.phi @ np.stack([result.q, result.v], axis=1)
        finished.append(Finished(run_of(k, result), final[:, 0], final[:, 1], n))
    return finished


def _watch(
    task: BatchTask,
    settings: TransientSettings,
    count: int,
    run_of: Callable[[int, TransientResult], ModalRun],
) -> Watch | None:
    """Stops runs whose outcome is known, where the study asks for that."""
    section = task.section
    if section.stop == "end":
        return None

    def judge(k: int, result: TransientResult) -> str:
        return known_outcome(run_of(k, result), section.duration, section.settle_tolerance)

    return Watch([max(1, settings.n_steps // LOOKS)] * count, judge)


def _continued(task: BatchTask, reference: ReferenceModes) -> tuple[np.ndarray, np.ndarray]:
    """The earlier state that goes on (n,), zeros without one."""
    if task.start is None:
        return np.zeros(reference.system.n), np.zeros(reference.system.n)
    q, v = task.start.read()
    return reference.phi.T @ q, reference.phi.T @ v
