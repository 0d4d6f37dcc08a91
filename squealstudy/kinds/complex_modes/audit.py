"""Estimated errors held against full-order roots, at the design points that were checked so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from squealstudy.engine.names import MODES
from squealstudy.kinds.complex_modes.reference import reference_roots
from squealstudy.modes.full_order.pairs import paired_with_full_order

FACTORS = (2.0, 5.0)


def audited(
    directory: Path, ids: Sequence[str], references: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """True errors beside estimates over the light modes of the checked points among `ids`.

    Reads the modes table, which is to be there.

    Returns
    -------
    dict
        Numbers of points, modes and missed modes; largest true error and estimate relative to
        |lambda|; shares of modes whose true error is within each of FACTORS times the estimate.
        Both are against the full-order model.
    """
    checked = [i for i in ids if "roots" in references.get(i, {})]
    columns = ["point_id", "frequency_hz", "growth_rate", "error_estimate"]
    modes = pq.read_table(directory / MODES, columns=columns).to_pandas()
    true, estimate, missed = [np.zeros(0)], [np.zeros(0)], 0
    for point_id in checked:
        own = modes[modes["point_id"] == point_id]
        size, growth = 2 * np.pi * own["frequency_hz"].to_numpy(), own["growth_rate"].to_numpy()
        lam = growth + 1j * np.sqrt(np.maximum(size**2 - growth**2, 0.0))
        pairs = paired_with_full_order(lam, *reference_roots(references[point_id]))
        true.append(pairs.error / np.abs(pairs.full))
        estimate.append(own["error_estimate"].to_numpy()[pairs.row] / np.abs(pairs.full))
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
