"""Estimates the errors of every mode of a study: of its rung and of the reduction.

`audited` compares these estimates with full-order roots at the points that were checked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.engine.store import MODES, Store
from squealstudy.kinds.complex_modes.full_order_check import reference_roots
from squealstudy.kinds.complex_modes.reduction_errors import (
    ReductionErrors,
    carried_errors,
    is_reduced,
)
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.modes.judged_roots import light_or_growing
from squealstudy.root_pairs import paired_with_full_order

ESTIMATE_COVERAGE = 0.95  # share of the checked modes whose error is at most its widened estimate


class ModeErrors(NamedTuple):
    """Estimated errors (N,) of the modes of all points, rad/s; NaN where one is not known.

    Attributes
    ----------
    rung : ndarray
        Error against the component-mode model, which another rung of reanalysis can lower.
    reduction : ndarray
        Error of the component-mode model against the full-order one; 0 without a reduction.
    """

    rung: np.ndarray
    reduction: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Estimated error of each mode against the full-order model (N,), rad/s."""
        total: np.ndarray = self.rung + self.reduction
        return total


def mode_errors(
    plan: Plan,
    columns: ModeColumns,
    samples: Sequence[tuple[int, ReductionErrors]],
    references: Mapping[str, Mapping[str, Any]],
) -> tuple[ModeErrors, dict[str, Any]]:
    """Errors of all modes, and facts for the manifest.

    Where points were also solved at full order and modes err by more than estimated, all errors of
    the reduction are multiplied by `widening`. They never become smaller.
    """
    reduction = carried_errors(plan, columns, samples)
    widened = 1.0
    if is_reduced(plan):
        widened = widening(plan, columns, reduction, references)
    errors = ModeErrors(columns.error_rung, widened * reduction)
    judged = light_or_growing(columns.lam)
    facts = {
        "reduced": is_reduced(plan),
        "reduction_sample_points": len(samples),
        "reduction_widened": widened,
        "largest_rung": _largest_rel_error(errors.rung, columns.lam, judged),
        "unknown_rung": int((judged & np.isnan(errors.rung)).sum()),
        "largest_reduction": _largest_rel_error(errors.reduction, columns.lam, judged),
    }
    return errors, facts


def _largest_rel_error(error: np.ndarray, lam: np.ndarray, judged: np.ndarray) -> float | None:
    """Largest relative error of judged modes; None where none is known."""
    is_finite = judged & np.isfinite(error)
    relative = error[is_finite] / np.maximum(np.abs(lam[is_finite]), np.finfo(float).tiny)
    return float(relative.max()) if len(relative) else None


def widening(
    plan: Plan,
    columns: ModeColumns,
    reduction: np.ndarray,
    references: Mapping[str, Mapping[str, Any]],
) -> float:
    """Factor of at least 1 with which ESTIMATE_COVERAGE of the checked modes err as estimated."""
    ends = np.append(0, np.cumsum(columns.counts))
    ratios = [np.zeros(0)]
    for point, name in enumerate(plan.tasks.ids.astype(str).tolist() if references else ()):
        reference = references.get(name, {})
        if "roots" in reference and ends[point + 1] > ends[point]:
            of_point = slice(ends[point], ends[point + 1])
            pairs = paired_with_full_order(columns.lam[of_point], *reference_roots(reference))
            true = pairs.error - columns.error_rung[of_point][pairs.row]
            is_judged = pairs.resolved & (true > 0)
            estimate = reduction[of_point][pairs.row]
            ratios.append(true[is_judged] / np.maximum(estimate[is_judged], np.finfo(float).tiny))
    all_ratios = np.concatenate(ratios)
    all_ratios = all_ratios[np.isfinite(all_ratios)]
    return max(1.0, float(np.quantile(all_ratios, ESTIMATE_COVERAGE))) if len(all_ratios) else 1.0


FACTORS = (2.0, 5.0)


def audited(
    store: Store,
    ids: Sequence[str],
    references: Mapping[str, Mapping[str, Any]],
    band_hz: tuple[float, float],
) -> dict[str, Any]:
    """True errors beside estimates over the light modes of the checked points among `ids`.

    The modes table must be written before.

    Returns
    -------
    dict
        Numbers of points, modes and missed modes; largest true error and estimate relative to
        |lambda|; shares of modes whose true error is within each of FACTORS times the estimate.
        Both are against the full-order model.
    """
    checked = [i for i in ids if "roots" in references.get(i, {})]
    columns = ["point_id", "frequency_hz", "growth_rate", "error_estimate"]
    modes = store.read_table(MODES, columns).to_pandas()
    true, estimate, missed = [np.zeros(0)], [np.zeros(0)], 0
    for point_id in checked:
        point_modes = modes[modes["point_id"] == point_id]
        size, growth = (
            2 * np.pi * point_modes["frequency_hz"].to_numpy(),
            point_modes["growth_rate"].to_numpy(),
        )
        lam = growth + 1j * np.sqrt(np.maximum(size**2 - growth**2, 0.0))
        pairs = paired_with_full_order(lam, *reference_roots(references[point_id]), band_hz)
        true.append(pairs.error / np.abs(pairs.full))
        estimate.append(point_modes["error_estimate"].to_numpy()[pairs.row] / np.abs(pairs.full))
        missed += pairs.missed
    t, e = np.concatenate(true), np.concatenate(estimate)
    within = {f"within_{k:g}x": float(np.mean(t <= k * e)) if len(t) else None for k in FACTORS}
    return {
        "points": len(checked),
        "modes": len(t),
        "missed_modes": missed,
        "largest_true_error": float(t.max(initial=0.0)),
        "largest_estimate": float(e.max(initial=0.0)),
        **within,
    }
