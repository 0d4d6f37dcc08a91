"""Which modes a transient study keeps, and the training run that repairs a truncated basis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from squealstudy.study.cache import prepared_path
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.study.plan import Plan
from squealstudy.study.transient.plan_facts import TRANSIENT_SOURCES, training_designs
from squealstudy.system.design_state import ModeKey

TRAINING_KEYS = {"step", "duration", "friction"}


@dataclass(frozen=True)
class BasisChoice:
    """Which of the reference's modes are kept, and what repairs them.

    Attributes
    ----------
    modes_below : float or None
        Hz; None keeps all.
    pod_vectors : int
    training : Path or None
        Snapshots and growing modes of a run with all modes, of which `pod_vectors` are taken.
    """

    modes_below: float | None = None
    pod_vectors: int = 0
    training: Path | None = None


ALL_MODES = BasisChoice()


def mode_keys(plan: Plan) -> tuple[ModeKey, ...]:
    """Component modes that the study names, in order."""
    keys = {(p.component, m) for p in plan.designs[0].mode_parameters() for m in p.modes}
    return tuple(sorted(keys))


def full_choice(plan: Plan, prepared_key: str) -> BasisChoice:
    """The basis that the study asks for."""
    section = plan.study.section
    training = training_path(plan, prepared_key) if section.pod_vectors else None
    return BasisChoice(section.modes_below, section.pod_vectors, training)


def truncated_choice(plan: Plan) -> BasisChoice:
    """The same without POD vectors, for which no run is needed."""
    return BasisChoice(plan.study.section.modes_below)


def training_path(plan: Plan, prepared_key: str) -> Path:
    """Where what the study's training run gave is kept, there or not."""
    section = plan.study.section.training
    settings = section.model_dump(mode="json", include=TRAINING_KEYS)
    values = [sorted(d.values.items()) for d in training_designs(plan)]
    code = [source_hash(), source_hash(TRANSIENT_SOURCES)]
    name = content_hash([code, settings, values, mode_keys(plan), list(plan.band_hz)])
    return prepared_path(prepared_key) / "training" / f"{name}.npz"
