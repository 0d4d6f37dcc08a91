"""What a study in time depends on as a whole: earlier state, training, slowest speed."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from squealstudy.engine.keys import source_hash
from squealstudy.engine.plan import Plan
from squealstudy.kinds.transient.regularisation import (
    is_automatic,
    regularisation_facts,
    slowest_speed,
)
from squealstudy.kinds.transient.start import StartState, find_start
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import design_points
from squealstudy.study.source import SourceText

NO_MOTION = {"batch", "start", "start_point", "slope_pilot"}  # keys that change no run
MOST_TRAINING = 4  # design points of a training run
# they decide what is sampled, trained and run
TRANSIENT_SOURCES = ("kinds/transient",)
KEPT = 4  # plans


@lru_cache(maxsize=KEPT)
def start_of(plan: Plan) -> StartState | None:
    """The earlier state that a study continues; StudyFileError where it is not there."""
    return find_start(plan.study.section, SourceText(plan.study.path, plan.study.text))


def motion_identity(plan: Plan) -> list[Any]:
    """What a design point's motion depends on beside its parameters."""
    section, start = plan.study.section, start_of(plan)
    trained = training_designs(plan) if section.pod_vectors else ()
    return [
        section.model_dump(mode="json", exclude=NO_MOTION),
        start is None or "perturbation" in section.model_fields_set,
        "" if start is None else start.point_id,
        plan.study.definition.modes.stability_tolerance,
        [sorted(d.values.items()) for d in trained],
        source_hash(TRANSIENT_SOURCES),
        *filter(None, [section.integrator.outside_source()]),
    ]


def training_designs(plan: Plan) -> tuple[DesignPoint, ...]:
    """Designs of a training run: the nominal one, and those at the ends of the sweeps."""
    chosen = {int(f(column)) for column in plan.coordinates.T for f in (np.argmin, np.argmax)}
    nominal = DesignPoint(plan.study.model, plan.study.options, plan.nominal_values)
    ends = (plan.designs[i] for i in sorted(chosen))
    return (nominal, *(d for d in ends if d.values != nominal.values))[:MOST_TRAINING]


@lru_cache(maxsize=KEPT)
def regularisation_of(plan: Plan) -> dict[str, Any] | None:
    """What the slopes of friction follow from; None where they are given."""
    study = plan.study
    automatic = sum(is_automatic({**study.values, **point}) for point in plan.swept)
    slowest = slowest_speed(study, design_points(study))
    return regularisation_facts(plan.designs, slowest, automatic)
