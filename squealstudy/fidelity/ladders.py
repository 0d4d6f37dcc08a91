"""Ladders of settings to choose from, each from the cheapest rung to the dearest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from squealstudy.engine.plan import has_mesh
from squealstudy.kinds.transient.plan_facts import slowest_speed
from squealstudy.models.operating import (
    IN_TIME_ONLY,
    REGULARISATION_SHARE,
    REGULARISATION_SPEED,
)
from squealstudy.study.definition import ResolvedStudy, given_keys

REDUCTION, BASIS, STEP, CONTACT = "reduction", "basis", "step", "contact points"
SLOPE = "slope of friction"
# cutoffs over the top of the band, and relative singular value below which enrichment is left out
REDUCTION_CANDIDATES = ((1.1, 1e-3), (1.1, 1e-4), (1.5, 3e-5), (2.0, 1e-5))
FIRST_CANDIDATE = (
    1  # number of the rung tried first; it suffices for all studies in studies/fidelity
)
# steps, in periods of the band's top over STEPS_A_PERIOD
STEP_CANDIDATES = (4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
STEPS_A_PERIOD = 62.5
CONTACT_POINTS_OPTION = "contact_points"  # key of [model]
# index of the step at which bases and contact points are compared, and bases trained
TRIAL_STEP = 2
LEAST_STEPS = 100  # smallest number of steps in a run
# top frequency of modes over that of the band, and number of POD vectors (studies/reduction.toml)
BASIS_CANDIDATES = ((1.0, 50), (2.0, 20), (1.0, 80), (2.0, 50), (1.0, 120))
CONTACT_POINTS = (2, 3, 4)  # points along a side of a facet
# regularisation speeds over that of a study without [fidelity]; softer friction saves no time
SATURATION_CANDIDATES = (1.0, 0.5, 0.25, 0.125)


@dataclass(frozen=True)
class Setting:
    """One setting: a label in words, and values of dotted keys of the study file."""

    label: str
    changes: Mapping[str, Any]


Ladder = tuple[Setting, ...]  # settings of one kind, cheapest first


def free_ladders(study: ResolvedStudy) -> dict[str, Ladder]:
    """The ladders of a study; those with a key that the file sets are left out."""
    if not study.kind.chooses_rung:
        ladders = _time_ladders(study)
    else:
        ladders = {REDUCTION: _reductions()} if has_mesh(study) else {}
    keys = given_keys(study)
    return {
        name: rungs
        for name, rungs in ladders.items()
        if not any(key in keys for rung in rungs for key in rung.changes)
    }


def _reductions() -> Ladder:
    """Settings of the reduction that are tried, from the smallest model on."""
    return tuple(
        Setting(
            f"modes to {factor:g} x band, enrichment to {tolerance:g}",
            {
                "reduction.component_cutoff_factor": factor,
                "reduction.assembly_cutoff_factor": factor,
                "reduction.tolerance": tolerance,
                "reduction.friction_training": True,
            },
        )
        for factor, tolerance in REDUCTION_CANDIDATES
    )


def _time_ladders(study: ResolvedStudy) -> dict[str, Ladder]:
    """Ladders of step and slope; also of basis and contact points for modal runs of a meshed model.

    A continued run keeps its contact points.
    """
    section = study.section
    steps = tuple(Setting(f"step {h:.3g} s", {"transient.step": h}) for h in _usable_steps(study))
    ladders = {STEP: steps} if len(steps) > 1 else {}
    if not set(IN_TIME_ONLY) & set(study.shown_parameters):
        ladders[SLOPE] = _saturations(study)
    if has_mesh(study) and section.representation == "modal":
        ladders[BASIS] = _bases(study)
        if not section.continued and CONTACT_POINTS_OPTION in study.options:
            ladders[CONTACT] = _contact_points()
    return ladders


def _usable_steps(study: ResolvedStudy) -> list[float]:
    """Steps [s] of which the duration has at least LEAST_STEPS."""
    unit = 1.0 / (STEPS_A_PERIOD * float(study.definition.modes.band[1]))
    duration = study.section.duration
    return [n * unit for n in STEP_CANDIDATES if LEAST_STEPS * n * unit <= duration]


def training_step(study: ResolvedStudy) -> dict[str, float]:
    """One step [s] for all training runs, so that runs with different steps share a basis.

    It is the step of the file if that sets one. Nothing is returned if the file sets the step of
    training.
    """
    keys, usable = given_keys(study), _usable_steps(study)
    if "transient.pod_step" in keys:
        return {}
    if "transient.step" in keys or len(usable) < 2:
        return {"transient.pod_step": study.section.step}
    return {"transient.pod_step": usable[min(TRIAL_STEP, len(usable) - 1)]}


def _bases(study: ResolvedStudy) -> Ladder:
    """Bases of runs in time that are tried, from the smallest to all modes."""
    top, training = float(study.definition.modes.band[1]), training_step(study)
    small = [
        Setting(
            f"modes to {factor * top:g} Hz and {vectors} POD vectors",
            {"transient.modes_below": factor * top, "transient.pod_vectors": vectors, **training},
        )
        for factor, vectors in BASIS_CANDIDATES
    ]
    return (*small, Setting("all modes", {}))


def _saturations(study: ResolvedStudy) -> Ladder:
    """Speeds below which points stick, the same at all design points, softest friction first."""
    stick_speed = REGULARISATION_SHARE * slowest_speed(study)
    speeds = [factor * stick_speed for factor in SATURATION_CANDIDATES]
    key = f"parameters.{REGULARISATION_SPEED.name}"
    return tuple(Setting(f"sticking below {s:.3g} m/s", {key: s}) for s in speeds)


def _contact_points() -> Ladder:
    return tuple(
        Setting(f"{n} x {n} contact points a facet", {f"model.{CONTACT_POINTS_OPTION}": n})
        for n in CONTACT_POINTS
    )
