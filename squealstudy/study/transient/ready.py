"""A design point before it runs: its working point, its forecast and its perturbed start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.analysis.point import state_working_point
from squealstudy.analysis.transient.point import (
    TransientPoint,
    perturbed_start,
    transient_point,
)
from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.errors import ParameterError
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.study.rows import FAILURES, reason
from squealstudy.study.tasks import PointTask
from squealstudy.study.transient.batch import BatchTask
from squealstudy.study.transient.rows import failed_row
from squealstudy.study.working_points import NewGaps, known_gap, prepared_model


@dataclass(frozen=True)
class Ready:
    """A design point with its start.

    Attributes
    ----------
    q0, v0 : ndarray (n,)
        The perturbation in the reference's modes.
    perturbation : float
        Its largest velocity at a contact point, m/s.
    """

    task: PointTask
    point: TransientPoint
    q0: np.ndarray
    v0: np.ndarray
    perturbation: float


def set_up(
    task: BatchTask, reference: ReferenceModes, point: PointTask, gaps: NewGaps
) -> Ready | dict[str, Any]:
    """Working point, forecast and start of a design point; a failed row where there is none."""
    prepared, state = prepared_model(point.prepared_key), point.design.state()
    try:
        known = known_gap(point.prepared_key, point.design)
        steady = state_working_point(prepared, state, known)
        if known is None:
            gaps.add(point.prepared_key, point.design, steady.gap)
        made = transient_point(
            prepared.model,
            reference,
            task.component_modes,
            steady,
            state,
            point.design.values[SLOPE.name],
            point.design.values[REGULARISATION_SPEED.name],
            task.section.friction,
            task.band_hz,
            task.tolerance,
        )
    except ParameterError as error:
        return failed_row(point.point_id, 0.0, "parameter", f"{error.key}: {error.message}")
    except FAILURES as error:
        return failed_row(point.point_id, 0.0, *reason(error))
    size = perturbation(task)
    q0, v0 = perturbed_start(reference.system, made, size, task.section.perturb_modes)
    return Ready(point, made, q0, v0, size)


def perturbation(task: BatchTask) -> float:
    """Initial velocity [m/s]; none at a continued state unless the study gives one."""
    section = task.section
    if task.start is not None and "perturbation" not in section.model_fields_set:
        return 0.0
    return section.perturbation
