"""What a study will cost, from a few timed design points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from squealstudy.study.cache import is_prepared
from squealstudy.study.complex_modes.window_tasks import basis_tasks
from squealstudy.study.family_cache import load_any
from squealstudy.study.kind import Kind
from squealstudy.study.kinds import kind_named
from squealstudy.study.method import BASIS_SOLVES, OVER_A_BASIS, SERVED
from squealstudy.study.plan import Plan
from squealstudy.study.process import peak_memory_mb
from squealstudy.study.tasks import PointTask

TIMED_POINTS, MOST_TIMING = 3, 20.0  # s, from which on no other point is timed
BRIEF = 1.0  # s: the first call of a process may owe that much to imports
OVERHEAD = (0.5, 5.0)  # s of a run beside its points: workers, tracking, tables
FACTORS = {"exact": (0.9, 2.0), "estimated": (0.5, 1.5)}  # of the least and the longest time


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

    Points of exact methods take what the timed ones did, up to twice that with those in between
    that tracking and onsets solve; those of reanalysis the share of an exact point that they take
    on the brake, after a basis for each structure that has none in the cache. Runs that end once
    their outcome is known may be over soon.

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
    own, bases = cost.point_s, 0.0
    complex_modes = plan.study.definition.study.kind == "complex_modes"
    served = SERVED.get(plan.method.name) if complex_modes else None
    if served is not None:
        own *= served
    if complex_modes and plan.method.name in OVER_A_BASIS:
        new = sum(not task.path.is_file() for task in basis_tasks(plan))
        bases = new * BASIS_SOLVES * cost.point_s
    build = cost.n_missing_structures * (cost.structure_s or 0.0)
    build /= 1 if cost.n_missing_structures == 1 else min(jobs, max(cost.n_missing_structures, 1))
    low, high = FACTORS["exact" if served is None else "estimated"]
    if plan.study.definition.transient.stop != "end" and not complex_modes:
        low = 0.0
    points = [n * own / min(jobs, n) + bases for n in (missing, most or missing)]
    return build + low * points[0] + OVERHEAD[0], build + high * points[1] + OVERHEAD[1]


def _timed(kind: Kind, plan: Plan, tasks: Sequence[PointTask]) -> list[float]:
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
