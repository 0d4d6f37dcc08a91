"""Errors of every mode of a study: of its rung, of the reduction, and both against full order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.kinds.complex_modes.columns import ModeColumns
from squealstudy.kinds.complex_modes.reduction import Sample, carried_errors, is_reduced
from squealstudy.kinds.complex_modes.reference import reference_roots
from squealstudy.modes.full_order.pairs import LIGHT, paired_with_full_order

COVERED = 0.95  # share of the checked modes whose error an estimate is to reach


class ModeErrors(NamedTuple):
    """Estimated errors (N,) of the modes of all points, rad/s; NaN where one is not known.

    Attributes
    ----------
    rung : ndarray
        Against the component-mode model: what another rung of reanalysis can lower.
    reduction : ndarray
        Of the component-mode model against the full-order one; zero where there is none.
    """

    rung: np.ndarray
    reduction: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Against the full-order model."""
        total: np.ndarray = self.rung + self.reduction
        return total


def mode_errors(
    plan: Plan,
    columns: ModeColumns,
    samples: Sequence[tuple[int, Sample]],
    references: Mapping[str, Mapping[str, Any]],
) -> tuple[ModeErrors, dict[str, Any]]:
    """Errors of all modes, and facts for the manifest.

    Full-order solutions of some points are evidence: where their modes err by more than estimated,
    all errors of the reduction grow by that factor. They never shrink.
    """
    reduction = carried_errors(plan, columns, samples)
    widened = 1.0
    if is_reduced(plan):
        widened = widening(plan, columns, reduction, references)
    errors = ModeErrors(columns.error_rung, widened * reduction)
    judged = np.abs(columns.lam.real) < LIGHT * np.abs(columns.lam)
    judged |= columns.lam.real > 0
    facts = {
        "reduced": is_reduced(plan),
        "reduction_sample_points": len(samples),
        "reduction_widened": widened,
        "largest_rung": _largest(errors.rung, columns.lam, judged),
        "largest_reduction": _largest(errors.reduction, columns.lam, judged),
    }
    return errors, facts


def _largest(error: np.ndarray, lam: np.ndarray, judged: np.ndarray) -> float | None:
    """Largest relative error of judged modes; None where none is known."""
    known = judged & np.isfinite(error)
    relative = error[known] / np.maximum(np.abs(lam[known]), np.finfo(float).tiny)
    return float(relative.max()) if len(relative) else None


def widening(
    plan: Plan,
    columns: ModeColumns,
    reduction: np.ndarray,
    references: Mapping[str, Mapping[str, Any]],
) -> float:
    """Factor, at least 1, by which checked modes ask for larger errors of the reduction."""
    ends = np.append(0, np.cumsum(columns.counts))
    ratios = [np.zeros(0)]
    for point, task in enumerate(plan.tasks):
        reference = references.get(task.point_id, {})
        if "roots" in reference and ends[point + 1] > ends[point]:
            own = slice(ends[point], ends[point + 1])
            pairs = paired_with_full_order(columns.lam[own], *reference_roots(reference))
            true = pairs.error - columns.error_rung[own][pairs.row]
            told = pairs.told & (true > 0)
            estimate = reduction[own][pairs.row]
            ratios.append(true[told] / np.maximum(estimate[told], np.finfo(float).tiny))
    found = np.concatenate(ratios)
    found = found[np.isfinite(found)]
    return max(1.0, float(np.quantile(found, COVERED))) if len(found) else 1.0
