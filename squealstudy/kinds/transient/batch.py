"""A batch of design points as a worker receives it, and the modes that its points share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from squealstudy.engine.cache import load_value, prepared_model, prepared_path
from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.kinds.transient.plan_facts import (
    TRANSIENT_SOURCES,
    StartState,
    start_of,
    training_designs,
)
from squealstudy.kinds.transient.schedules import Schedules, schedules_of
from squealstudy.kinds.transient.section import STUCK, TransientSection
from squealstudy.mechanics.motion_points import reference_modes
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.settings import MotionSettings, steps_between_rows
from squealstudy.motion.shared_modes import (
    SharedModes,
    Training,
    truncated,
    with_pod,
)
from squealstudy.study.design import DesignPoint

MOST_OF_BATCH = 64  # most design points in a batch of a model without a mesh
MAX_ROWS_OF_BATCH = 100_000  # rows of all histories of a batch: some 50 MB
TRAINING_KEYS = {"step", "duration", "friction"}


@dataclass(frozen=True)
class MotionBasis:
    """Which of the reference's modes a basis has, and which vectors complete them.

    Attributes
    ----------
    modes_below : float or None
        Frequency below which modes are kept, Hz; None keeps all.
    pod_vectors : int
        Number of further vectors, from proper orthogonal decomposition (POD).
    training : Path or None
        Folder of the snapshots and growing modes of a run with all modes, from which these vectors
        are made; None: no such vectors.
    """

    modes_below: float | None = None
    pod_vectors: int = 0
    training: Path | None = None


ALL_MODES = MotionBasis()


def mode_keys(plan: Plan) -> tuple[ModeKey, ...]:
    """Component modes that the study names, sorted."""
    keys = {(p.component, m) for p in plan.first.mode_parameters() for m in p.modes}
    return tuple(sorted(keys))


def full_choice(plan: Plan, prepared_key: str) -> MotionBasis:
    """The basis that the study file asks for."""
    section = plan.study.section
    training = training_path(plan, prepared_key) if section.pod_vectors else None
    return MotionBasis(section.modes_below, section.pod_vectors, training)


def truncated_choice(plan: Plan) -> MotionBasis:
    """The basis that the study asks for but without POD vectors, which need a training run."""
    return MotionBasis(plan.study.section.modes_below)


def training_path(plan: Plan, prepared_key: str) -> Path:
    """Folder of the cache for the study's training run, whether it exists or not."""
    section = plan.study.section.training
    settings = section.model_dump(mode="json", include=TRAINING_KEYS)
    values = [sorted(d.values.items()) for d in training_designs(plan)]
    code = [source_hash(), source_hash(TRANSIENT_SOURCES)]
    name = content_hash([code, settings, values, mode_keys(plan), list(plan.band_hz)])
    return prepared_path(prepared_key) / "training" / name


@dataclass(frozen=True)
class BatchTask:
    """Design points of one structure that advance together.

    Attributes
    ----------
    points : tuple of DesignPoint
    section : TransientSection
    integrator : Integrator
    operating : OperatingPoint
        Operating point of the study's [parameters], at which the shared reference modes are made.
    component_modes : tuple of (component, mode)
        All component modes that any design point of the study changes.
    basis : MotionBasis
    band_hz : (low, high)
        Band in which growing modes are followed, Hz.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    start : StartState or None
        State that all runs begin with; None: they begin as `section` says.
    schedules : Schedules or None
        Speed and pressure over time; None where both are constant.
    cutoff_hz : float
        Frequency up to which assembly modes are exact in the basis, Hz.
    """

    points: tuple[DesignPoint, ...]
    section: TransientSection
    integrator: Integrator
    operating: OperatingPoint
    component_modes: tuple[ModeKey, ...]
    basis: MotionBasis
    band_hz: tuple[float, float]
    tolerance: float
    start: StartState | None
    schedules: Schedules | None
    cutoff_hz: float

    @property
    def hybrid(self) -> bool:
        """Whether contact layers are modelled by finite elements (the hybrid representation)."""
        return self.section.representation == "hybrid"

    @property
    def reference(self) -> SharedModes:
        """The modes that the points share."""
        key = self.points[0].structure
        return shared_reference(key, self.operating, self.component_modes, self.basis)

    @property
    def perturbation(self) -> float:
        """Initial velocity [m/s]; 0 for a continued or stuck start unless the study gives one."""
        starts_elsewhere = self.start is not None or self.section.start == STUCK
        if starts_elsewhere and "perturbation" not in self.section.model_fields_set:
            return 0.0
        return self.section.perturbation

    def settings(self) -> MotionSettings:
        """Settings of the integration, with as many rows as summaries need."""
        return self._settings

    @cached_property
    def _settings(self) -> MotionSettings:
        section = self.section
        every = steps_between_rows(section.save_every, section.step, self.band_hz[1])
        return replace(settings_of(self.section, every), integrator=self.integrator)


def batch_task(
    plan: Plan,
    points: tuple[DesignPoint, ...],
    basis: MotionBasis | None = None,
    integrator: Integrator | None = None,
) -> BatchTask:
    """The task of a batch for a worker; without others, basis and integrator are the study's."""
    section = plan.study.section
    return BatchTask(
        points=points,
        section=section,
        integrator=integrator or section.integrator,
        operating=plan.nominal,
        component_modes=mode_keys(plan),
        basis=basis or full_choice(plan, points[0].structure),
        band_hz=plan.band_hz,
        tolerance=plan.study.definition.modes.stability_tolerance,
        start=start_of(plan),
        schedules=schedules_of(plan),
        cutoff_hz=plan.settings.assembly_cutoff,
    )


def batch_size(plan: Plan) -> int:
    """Number of design points in a batch: as the study says, or more for models without a mesh."""
    section = plan.study.section
    if has_mesh(plan.study) or "batch" in section.model_fields_set:
        return int(section.batch)
    every = steps_between_rows(section.save_every, section.step, plan.band_hz[1])
    rows = section.duration / section.step / every
    return max(section.batch, min(MOST_OF_BATCH, int(MAX_ROWS_OF_BATCH / rows)))


@lru_cache(maxsize=4)
def shared_reference(
    prepared_key: str,
    operating: OperatingPoint,
    component_modes: tuple[ModeKey, ...],
    basis: MotionBasis,
) -> SharedModes:
    """Modes of the structure at the nominal working point, no component mode changed.

    Raises
    ------
    ParameterError
        Where the truncation keeps no mode.
    """
    if basis.modes_below is not None:
        all_modes = shared_reference(prepared_key, operating, component_modes, ALL_MODES)
        if basis.training is None:
            return truncated(all_modes, basis.modes_below)
        training: Training
        training, _seconds = load_value(basis.training)
        return with_pod(all_modes, basis.modes_below, training, basis.pod_vectors)
    return reference_modes(prepared_model(prepared_key), operating, component_modes)


def settings_of(section: TransientSection, every: int) -> MotionSettings:
    """Settings of runs as a section gives them, with one row for each `every` steps."""
    return MotionSettings(
        duration=section.duration,
        step=section.step,
        save_every=every,
        integrator=section.integrator,
        tolerance=section.balance_tolerance,
    )


def sensed_modes(
    section: TransientSection, omega2: np.ndarray, band_hz: tuple[float, float]
) -> np.ndarray:
    """Numbers (from 1) of the assembly modes that have modal sensors (THEORY.md eq. (85)).

    Raises
    ------
    ValueError
        Where a band has no modes, or a mode does not exist; the message says which.
    """
    sensors = band_hz if section.sensors is None else section.sensors
    n = len(omega2)
    if section.sensors is not None and all(isinstance(v, int) for v in sensors):
        if max(sensors) > n:
            raise ValueError(
                f"the assembly has {n} modes in this basis, got mode {max(sensors)}; "
                "a band in Hz is written with a point, [500.0, 8000.0]"
            )
        return np.array(sensors, dtype=int)
    f = np.sqrt(np.maximum(omega2, 0.0)) / (2 * np.pi)
    mode_numbers = np.flatnonzero((f >= sensors[0]) & (f <= sensors[1])) + 1
    if not len(mode_numbers):
        raise ValueError(
            f"no assembly mode lies between {sensors[0]:g} and {sensors[1]:g} Hz "
            f"(there are {n}, up to {f[-1]:.4g} Hz)"
        )
    return mode_numbers
