"""A batch in the modal representation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from squealstudy.analysis.runs.summary import ModalRun
from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.study.transient.batch import BatchTask, sampling, sensed_modes, settings_of
from squealstudy.study.transient.ready import Ready


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
    growth = [r.point.growth_rows.reshape(-1, n) for r in ready]
    system = replace(reference.system, sensors=np.vstack([np.eye(n)[modes - 1], *growth]))
    q, v = _continued(task, reference)
    results = integrate(
        system,
        [r.point.design for r in ready],
        settings_of(task.section, sampling(task.section, task.band_hz)),
        np.array([r.q0 + q for r in ready]),
        np.array([r.v0 + v for r in ready]),
    )
    omega = np.sqrt(np.maximum(reference.system.omega2[modes - 1], 0.0))
    ends = len(modes) + np.cumsum([0, *(len(g) for g in growth)])
    finished = []
    for k, (one, result) in enumerate(zip(ready, results, strict=True)):
        own = slice(ends[k], ends[k + 1])
        run = ModalRun(
            result,
            one.point,
            modes,
            omega,
            result.displacement[:, : len(modes)],
            result.velocity[:, : len(modes)],
            result.displacement[:, own],
            result.velocity[:, own],
            task.start is not None,
        )
        final = reference.phi @ np.stack([result.q, result.v], axis=1)
        finished.append(Finished(run, final[:, 0], final[:, 1], n))
    return finished


def _continued(task: BatchTask, reference: ReferenceModes) -> tuple[np.ndarray, np.ndarray]:
    """The earlier state that goes on (n,), zeros without one."""
    if task.start is None:
        return np.zeros(reference.system.n), np.zeros(reference.system.n)
    q, v = task.start.read()
    return reference.phi.T @ q, reference.phi.T @ v
