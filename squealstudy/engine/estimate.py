"""What a study will cost, from a few timed design points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from squealstudy.engine.cache import is_prepared, load_any
from squealstudy.engine.model_kind import ModelKind
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import peak_memory_mb
from squealstudy.study.design import DesignPoint

TIMED_POINTS, MOST_TIMING = 3, 20.0  # s, from which on no other point is timed
BRIEF = 1.0  # s: the first call of a process may owe that much to imports
OVERHEAD = (0.5, 5.0)  # s of a run beside its points: workers, tracking, tables


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


def run_seconds(
    plan: Plan, cost: Estimate, missing: int, jobs: int, most: int | None = None
) -> tuple[float, float]:
    """Least and longest time of what is left of a study, without its pictures.

    By what the kind of study says that its points cost beside the timed ones (`Solves`).

    Parameters
    ----------
    plan : Plan
    cost : Estimate
        Whose `point_s` is known.
    missing : int
        Design points not solved yet, at least one.
    jobs : int
        Workers.
    most : int or None
        The same of a design that grows, at most.
    """
    assert cost.point_s is not None
    solves = plan.kind.solves(plan)
    build = cost.n_missing_structures * (cost.structure_s or 0.0)
    build /= 1 if cost.n_missing_structures == 1 else min(jobs, max(cost.n_missing_structures, 1))
    build += solves.checks * cost.point_s / jobs
    own, first = solves.point * cost.point_s, solves.shared * cost.point_s
    points = [n * own / min(jobs, n) + first for n in (missing, most or missing)]
    least, longest = solves.least * points[0], solves.longest * points[1]
    return build + least + OVERHEAD[0], build + longest + OVERHEAD[1]


def _timed(kind: ModelKind, plan: Plan, tasks: Sequence[DesignPoint]) -> list[float]:
    """Seconds of a few design points; where the first is brief it is timed once more."""
    seconds: list[float] = []
    for number, task in enumerate(tasks):
        spent = kind.time_point(plan, task)
        if spent and not number and spent < BRIEF:
            spent = min(spent, kind.time_point(plan, task) or spent)
        seconds += [spent] if spent else []
        if sum(seconds) > MOST_TIMING:
            break
    return seconds


def estimate(plan: Plan) -> Estimate:
    """Time a few design points, spread over the design, of structures that are in the cache."""
    kind = plan.kind
    ready = [key for key in plan.structures if is_prepared(key)]
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
    tasks = [t for t in plan.tasks if t.structure in set(ready)]
    step = max(1, (len(tasks) - 1) // max(1, TIMED_POINTS - 1))
    seconds = _timed(kind, plan, tasks[::step][:TIMED_POINTS])
    prepared = load_any(ready[0])
    return Estimate(
        missing,
        float(sum(prepared.timings.values())),
        sum(seconds) / len(seconds) if seconds else None,
        peak_memory_mb(),
        prepared.model.n,
        "" if seconds else "none of the timed design points has a working point",
    )
