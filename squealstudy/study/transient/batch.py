"""A batch of design points as a worker gets it, and the reference that its points share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from squealstudy.analysis.point import state_working_point
from squealstudy.analysis.transient.modal_basis import Training, truncated, with_pod
from squealstudy.analysis.transient.reference_modes import ReferenceModes, reference_modes
from squealstudy.analysis.transient.settings import TransientSettings
from squealstudy.models.operating import OperatingPoint
from squealstudy.study.plan import Plan
from squealstudy.study.tasks import PointTask
from squealstudy.study.transient.basis import ALL_MODES, BasisChoice, full_choice, mode_keys
from squealstudy.study.transient.plan_facts import start_of
from squealstudy.study.transient.start import StartState
from squealstudy.study.transient_section import TransientSection
from squealstudy.study.working_points import prepared_model
from squealstudy.system.design_state import DesignState, ModeKey

SAMPLES_A_PERIOD = 8  # of the highest frequency of the band: what summaries need


@dataclass(frozen=True)
class BatchTask:
    """Design points of one structure that advance together.

    Attributes
    ----------
    operating : OperatingPoint
        Of the study's [parameters]: where the shared reference modes are made.
    component_modes : tuple of (component, mode)
        All that any design point of the study changes.
    options : tuple of (name, value)
        Of the model: what its assembly is built from, beside the parameters.
    cutoff_hz : float
        Assembly modes up to here are in the basis, exact.
    """

    points: tuple[PointTask, ...]
    section: TransientSection
    operating: OperatingPoint
    component_modes: tuple[ModeKey, ...]
    basis: BasisChoice
    band_hz: tuple[float, float]
    tolerance: float
    start: StartState | None
    options: tuple[tuple[str, str | int], ...]
    cutoff_hz: float


def batch_task(
    plan: Plan, points: tuple[PointTask, ...], basis: BasisChoice | None = None
) -> BatchTask:
    """What a worker needs to know of a batch; `basis` other than the study's where given."""
    return BatchTask(
        points,
        plan.study.section,
        plan.nominal,
        mode_keys(plan),
        basis or full_choice(plan, points[0].prepared_key),
        plan.band_hz,
        plan.study.definition.modes.stability_tolerance,
        start_of(plan),
        tuple(sorted(plan.study.options.items())),
        plan.settings.assembly_cutoff,
    )


@lru_cache(maxsize=4)
def shared_reference(
    prepared_key: str,
    operating: OperatingPoint,
    component_modes: tuple[ModeKey, ...],
    basis: BasisChoice,
) -> ReferenceModes:
    """Modes of the structure at the nominal working point, no component mode changed.

    Raises
    ------
    ParameterError
        A truncation below the first mode.
    """
    if basis.modes_below is not None:
        whole = shared_reference(prepared_key, operating, component_modes, ALL_MODES)
        if basis.training is None:
            return truncated(whole, basis.modes_below)
        training = Training(**np.load(basis.training))
        return with_pod(whole, basis.modes_below, training, basis.pod_vectors)
    prepared = prepared_model(prepared_key)
    state = DesignState(operating)
    point = state_working_point(prepared, state)
    return reference_modes(prepared.model, point, state, component_modes)


def reference_of(task: BatchTask) -> ReferenceModes:
    """The modes that the points of a batch share."""
    key = task.points[0].prepared_key
    return shared_reference(key, task.operating, task.component_modes, task.basis)


def sampling(section: TransientSection, band_hz: tuple[float, float]) -> int:
    """Steps between rows that summaries are made from: a divisor of `save_every` where kept.

    Else a power of two: runs whose steps are halves of each other are then seen at equal times,
    and differences of what is found in them are those of the integration.

    Raises
    ------
    ValueError
        Where that has none of a useful size.
    """
    enough = 2 ** int(np.log2(max(1.0, 1.0 / (SAMPLES_A_PERIOD * band_hz[1] * section.step))))
    if section.save_every == 0:
        return enough
    best = max(d for d in range(1, enough + 1) if section.save_every % d == 0)
    if 4 * best < min(enough, section.save_every):
        near = max(1, round(section.save_every / enough)) * enough
        raise ValueError(
            f"{section.save_every} has no divisor near {enough}, the steps between samples that "
            f"summaries need; {near} does"
        )
    return best


def settings_of(section: TransientSection, every: int) -> TransientSettings:
    """The integrator's settings, a row kept every `every` steps."""
    return TransientSettings(
        section.duration,
        section.step,
        every,
        section.integrator,
        section.balance,
        10 * section.balance,
        contact_factor=section.contact_factor,
        prewarp=section.prewarp,
        single_storage=section.storage == "single",
    )


def sensed_modes(
    section: TransientSection, omega2: np.ndarray, band_hz: tuple[float, float]
) -> np.ndarray:
    """Numbers (from 1) of the assembly modes under modal sensors (THEORY.md eq. (85)).

    Raises
    ------
    ValueError
        A band without modes, or a mode that is not there; the message says which.
    """
    wanted = band_hz if section.sensors is None else section.sensors
    n = len(omega2)
    if section.sensors is not None and all(isinstance(v, int) for v in wanted):
        if max(wanted) > n:
            raise ValueError(
                f"the assembly has {n} modes in this basis, got mode {max(wanted)}; "
                "a band in Hz is written with a point, [500.0, 8000.0]"
            )
        return np.array(wanted, dtype=int)
    f = np.sqrt(np.maximum(omega2, 0.0)) / (2 * np.pi)
    found = np.flatnonzero((f >= wanted[0]) & (f <= wanted[1])) + 1
    if not len(found):
        raise ValueError(
            f"no assembly mode lies between {wanted[0]:g} and {wanted[1]:g} Hz "
            f"(there are {n}, up to {f[-1]:.4g} Hz)"
        )
    return found
