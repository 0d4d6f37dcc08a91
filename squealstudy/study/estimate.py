"""What a study will cost, from a few timed design points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from squealstudy.modes.rung import Rung
from squealstudy.study.cache import is_prepared, load_any
from squealstudy.study.model_kind import ModelKind
from squealstudy.study.plan import Plan, checked_points, has_mesh
from squealstudy.study.process import peak_memory_mb
from squealstudy.study.tasks import PointTask

TIMED_POINTS, MOST_TIMING = 3, 20.0  # s, from which on no other point is timed
BRIEF = 1.0  # s: the first call of a process may owe that much to imports
OVERHEAD = (0.5, 5.0)  # s of a run beside its points: workers, tracking, tables
# of the least and the longest time: exact complex modes; reanalysis; other kinds of study
EXACT, REANALYSIS, OTHER = (0.9, 1.1), (0.5, 1.5), (0.8, 1.6)
BETWEEN = 1.5  # exact points that tracking and onsets may solve for each of the study, at most
SAMPLE = 3.0  # exact solves that a sample point of the reduction's error costs: of two models
FULL_ORDER = 60.0  # exact solves of a reduced brake that one of the full-order model costs, about


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

    Points of exact methods take what the timed ones did, and as many again or more may be solved
    between them by tracking and onsets; those of reanalysis the share of an exact point that they
    take on the brake, after a basis for each structure that has none in the cache. Points checked
    at full order and sample points of the reduction's error come on top. Runs that end once their
    outcome is known may be over soon.

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
    complex_modes = plan.kind.chooses_rung
    rung = plan.method.rung
    served = plan_share(plan, rung) if complex_modes else None
    if served is not None:
        own *= served
    if complex_modes and rung.over_a_basis:
        from squealstudy.study.complex_modes.problems import swept_structures

        new = sum(not structure.path.is_file() for structure in swept_structures(plan))
        bases = new * rung.setup_solves * cost.point_s
    build = cost.n_missing_structures * (cost.structure_s or 0.0)
    build /= 1 if cost.n_missing_structures == 1 else min(jobs, max(cost.n_missing_structures, 1))
    low, high = OTHER if not complex_modes else EXACT if served is None else REANALYSIS
    if plan.kind.may_end_early(plan):
        low = 0.0
    if complex_modes and served is None and _refines(plan):
        high += BETWEEN
    if complex_modes:
        from squealstudy.study.complex_modes.reduction import is_reduced, sample_points

        samples = len(sample_points(plan)) if is_reduced(plan) else 0
        build += (_check_seconds(plan, cost.point_s) + samples * SAMPLE * cost.point_s) / jobs
    points = [n * own / min(jobs, n) + bases for n in (missing, most or missing)]
    return build + low * points[0] + OVERHEAD[0], build + high * points[1] + OVERHEAD[1]


def plan_share(plan: Plan, rung: Rung) -> float | None:
    """Seconds of a point of a plan by a rung over those of an exact one; None where it is exact."""
    if rung.exact:
        return None
    varied = sum(not sweep.parameter.structural for sweep in plan.study.sweeps)
    return rung.relative_cost(len(plan.tasks) // len(plan.structures), varied)


def _refines(plan: Plan) -> bool:
    """Whether points are solved between those of the study."""
    modes = plan.study.definition.modes
    return (
        bool(plan.study.sweeps) and modes.track and (modes.refine_tracking or modes.refine_onsets)
    )


def _check_seconds(plan: Plan, point_s: float) -> float:
    """Seconds of the points that are checked at full order."""
    meshed = has_mesh(plan.study) and not plan.method.rung.unreduced
    return len(checked_points(plan)) * point_s * (FULL_ORDER if meshed else 1.0)


def _timed(kind: ModelKind, plan: Plan, tasks: Sequence[PointTask]) -> list[float]:
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
