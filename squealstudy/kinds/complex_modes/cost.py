"""What a study of complex modes costs beside its timed design points."""

from __future__ import annotations

from squealstudy.engine.model_kind import Solves
from squealstudy.engine.plan import Plan, checked_points, has_mesh
from squealstudy.kinds.complex_modes.problems import swept_structures
from squealstudy.kinds.complex_modes.reduction import is_reduced, sample_points
from squealstudy.modes.rung import Rung

# of the least and the longest time: exact complex modes; reanalysis
EXACT, REANALYSIS = (0.9, 1.1), (0.5, 1.5)
BETWEEN = 1.5  # exact points that tracking and onsets may solve for each of the study, at most
SAMPLE = 3.0  # exact solves that a sample point of the reduction's error costs: of two models
FULL_ORDER = 60.0  # exact solves of a reduced brake that one of the full-order model costs, about


def mode_solves(plan: Plan) -> Solves:
    """Points of reanalysis take their share of an exact one, after a basis for each structure.

    Tracking and onsets solve others between exact points; those checked at full order and the
    sample points of the reduction's error come on top.
    """
    rung, share = plan.method.rung, point_share(plan, plan.method.rung)
    least, longest = EXACT if share is None else REANALYSIS
    modes = plan.study.definition.modes
    refines = modes.track and (modes.refine_tracking or modes.refine_onsets)
    if share is None and plan.study.sweeps and refines:
        longest += BETWEEN
    bases = 0
    if rung.over_a_basis:
        bases = sum(not structure.has_basis for structure in swept_structures(plan))
    meshed = has_mesh(plan.study) and not rung.unreduced
    checks = len(checked_points(plan)) * (FULL_ORDER if meshed else 1.0)
    samples = len(sample_points(plan)) if is_reduced(plan) else 0
    return Solves(
        point=1.0 if share is None else share,
        shared=bases * rung.setup_solves,
        checks=checks + samples * SAMPLE,
        least=least,
        longest=longest,
    )


def point_share(plan: Plan, rung: Rung) -> float | None:
    """Seconds of a point of a plan by a rung over those of an exact one; None where it is exact."""
    if rung.exact:
        return None
    varied = sum(not sweep.parameter.structural for sweep in plan.study.sweeps)
    return rung.relative_cost(len(plan.tasks) // len(plan.structures), varied)
