"""Error due to the slope of friction at zero sliding: a point runs again at twice the slope.

The friction law has a corner, which the finite slope k_t rounds off; this changes results by the
order of 1/k_t. The study's own run of a point and one at 2 k_t show by how much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.engine.measurement import MeasurementRequest
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.store import Store
from squealstudy.engine.workers import Progress
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.transient.measuring import measure_points, run_finding
from squealstudy.kinds.transient.section import PILOT_POINTS
from squealstudy.kinds.transient.tables import SCHEMA
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.tables.method_quality import run_errors

FIRST_ORDER_FACTOR = 2.0  # error at k_t over the change to 2 k_t if the error falls as 1 / k_t
CYCLE = "limit_cycle"
DECIDED = ("stable", CYCLE, "growing")  # classes whose levels two runs can compare
WHY_NOT_COMPARABLE = {  # by the class that both runs have
    "irregular": ": levels differ by chance too",
    "undecided": ": neither is known to have reached its level",
}
QUANTITIES = ("torque_rms", "growth_rate", "torque_mean", "dominant_frequency")
OK, UNDECIDED, FAILED, SKIPPED = "ok", "undecided", "failed", "skipped"


def slope_pilot(plan: Plan, store: Store, points: pd.DataFrame, report: Progress) -> dict[str, Any]:
    """Run a design point at 2 k_t, and compare it with the study's own run.

    Parameters
    ----------
    plan : Plan
        A plan with design points whose slope follows from a regularisation speed.
    store : Store
        Files of the finished study.
    points : DataFrame
        Its points table, in the order of the plan.
    report : callable
        Called with (stage, done, total).

    Returns
    -------
    dict
        ``status``: ``ok``; ``undecided`` where the two runs cannot be compared, as ``message``
        explains, though ``errors`` has their differences; ``failed`` or ``skipped``, without
        errors. ``point_id``. ``class`` and ``class_at_double``, of both runs. ``errors``: for each
        quantity that both runs have, ``value``, ``at_double``, ``error`` (twice their relative
        difference) and ``chance`` (twice the part of it that the 95 % bounds of both explain).
    """
    if not _needs_pilot(plan):
        return {"status": SKIPPED, "message": _why_skipped(plan)}
    chosen = _representative(plan, points)
    if chosen is None:
        return {"status": FAILED, "message": "every design point failed"}
    task = plan.tasks[chosen]
    at_k_t = run_finding(store.rows({task.point_id}, SCHEMA)[task.point_id])
    report("slope of friction", 0, 1)
    values = dict(task.values)
    values[REGULARISATION_SPEED.name] *= 0.5
    double = replace(task.with_values(values), point_id="double")
    try:
        at_double = measure_points(plan, [double], MeasurementRequest()).findings["0"]
    except (*FAILURES, SquealstudyError) as error:
        at_double = dict(zip(("status", "message"), reason(error), strict=True))
    report("slope of friction", 1, 1)
    return {"point_id": task.point_id, **_verdict(at_k_t, at_double)}


def _needs_pilot(plan: Plan) -> bool:
    choice = plan.study.section.slope_pilot
    if plan.study.section.changes:
        return False
    few = has_mesh(plan.study) and len(plan.tasks) < PILOT_POINTS
    return choice == "always" or (choice == "auto" and not few)


def _why_skipped(plan: Plan) -> str:
    if plan.study.section.slope_pilot == "never":
        return 'slope_pilot = "never"'
    if plan.study.section.changes:
        return "speed or pressure change, and no level lasts that could be compared"
    return f'fewer than {PILOT_POINTS} design points; slope_pilot = "always" would tell'


def _representative(plan: Plan, points: pd.DataFrame) -> int | None:
    """Row of the design point whose slope matters most: the limit cycle that sticks most.

    Only points whose slope follows from a regularisation speed count; None where all failed.
    """
    automatic = plan.tasks.column(SLOPE.name) == 0
    usable = points[automatic & (points["status"] == "ok").to_numpy()]
    if not len(usable):
        return None
    cycle, stick = usable["class"] == CYCLE, usable["stick_share"].fillna(0.0)
    level = usable["torque_rms"].fillna(0.0)
    order = np.lexsort((-level, -stick, ~(cycle & (stick > 0)), ~cycle))
    return int(np.flatnonzero(points["point_id"] == usable["point_id"].iloc[order[0]])[0])


def _verdict(at_k_t: Mapping[str, Any], at_double: Mapping[str, Any]) -> dict[str, Any]:
    """Facts on a run and one at twice the slope: differences, and whether they can be compared."""
    if at_double["status"] != "ok":
        why = f"at 2 k_t: {at_double['status']}: {at_double['message']}"
        return {"status": FAILED, "message": why}
    errors = {
        error.quantity: {
            "value": error.value,
            "at_double": error.truth,
            "error": FIRST_ORDER_FACTOR * error.error,
            "chance": FIRST_ORDER_FACTOR * error.chance,
        }
        for error in run_errors(at_k_t, at_double)[0]
        if error.quantity in QUANTITIES and np.isfinite(error.value)  # which both runs have
    }
    classes = {"class": at_k_t["class"], "class_at_double": at_double["class"]}
    return {"status": OK, "message": "", **classes, "errors": errors} | _doubt(classes, errors)


def _doubt(classes: Mapping[str, str], errors: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """Status and message where two runs cannot be compared; empty where they can."""
    class_at_k_t, class_at_double = classes.values()
    if class_at_k_t != class_at_double:
        why = f"{class_at_k_t} at k_t, {class_at_double} at 2 k_t"
        return {"status": UNDECIDED, "message": why}
    if class_at_k_t not in DECIDED:
        return {
            "status": UNDECIDED,
            "message": f"both runs are {class_at_k_t}{WHY_NOT_COMPARABLE.get(class_at_k_t, '')}",
        }
    if not errors:
        return {
            "status": UNDECIDED,
            "message": f"both runs are {class_at_k_t} and have nothing to compare",
        }
    return {}
