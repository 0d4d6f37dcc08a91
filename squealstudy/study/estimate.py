"""What a study will cost, from a few timed design points."""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.study.cache import is_prepared
from squealstudy.study.family_cache import load_any
from squealstudy.study.kinds import kind_named
from squealstudy.study.plan import Plan
from squealstudy.study.process import peak_memory_mb

TIMED_POINTS = 3


@dataclass(frozen=True)
class Estimate:
    """Expected cost of the design points.

    Attributes
    ----------
    n_missing_structures : int
        Reductions to be made first.
    structure_s : float or None
        Seconds of one reduction, from one made before for this study; None where there is none.
    point_s : float or None
        Seconds of one design point on one core; None where it cannot be timed yet.
    memory_mb : float or None
        Peak memory of this process after the timed points; each worker needs about as much.
    n_coordinates : int or None
        Degrees of freedom of the reduced model.
    reason : str
        Why a figure is missing.
    """

    n_missing_structures: int
    structure_s: float | None
    point_s: float | None
    memory_mb: float | None
    n_coordinates: int | None
    reason: str


def estimate(plan: Plan) -> Estimate:
    """Time a few design points, spread over the design, of structures that are in the cache."""
    kind = kind_named(plan.study.definition.study.kind)
    ready = [s.key for s in plan.structures if is_prepared(s.key)]
    missing = len(plan.structures) - len(ready)
    if not ready:
        return Estimate(
            missing,
            None,
            None,
            None,
            None,
            "no reduced model of this study is in the cache yet; --build makes the first one and "
            "times it",
        )
    tasks = [t for t in plan.tasks if t.prepared_key in set(ready)]
    step = max(1, (len(tasks) - 1) // max(1, TIMED_POINTS - 1))
    timed = (kind.time_point(plan, task) for task in tasks[::step][:TIMED_POINTS])
    seconds = [t for t in timed if t]
    prepared = load_any(ready[0])
    return Estimate(
        missing,
        float(sum(prepared.timings.values())),
        sum(seconds) / len(seconds) if seconds else None,
        peak_memory_mb(),
        prepared.model.n,
        "" if seconds else "none of the timed design points has a working point",
    )
