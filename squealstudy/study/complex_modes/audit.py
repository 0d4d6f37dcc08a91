"""Estimated errors held against full-order roots, at the design points that were checked so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.analysis.full_order.modes import LIGHT
from squealstudy.study.complex_modes.columns import read_columns

PAIRED = 0.05  # relative distance within which a full-order root has a partner
FACTORS = (2.0, 5.0)


def audited(
    directory: Path, ids: Sequence[str], references: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """True errors beside estimates over the light modes of the checked points among `ids`.

    Returns
    -------
    dict
        Numbers of points, modes and missed modes; largest true error and estimate relative to
        |lambda|; shares of modes whose true error is within each of FACTORS times the estimate.
        True errors are against the full-order model, so they hold the error of the component-mode
        basis too, which estimates of the rungs above it leave out.
    """
    checked = [i for i in ids if "roots" in references.get(i, {})]
    columns = read_columns(directory, checked, shapes=False)
    true, estimate, missed = [np.zeros(0)], [np.zeros(0)], 0
    for number, point_id in enumerate(checked):
        own = columns.point == number
        full = np.array([complex(*pair) for pair in references[point_id]["roots"]])
        t, e, m = _compared(columns.lam[own], columns.error_estimate[own], full)
        true.append(t)
        estimate.append(e)
        missed += m
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


def _compared(
    lam: np.ndarray, estimate: np.ndarray, full: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Relative true errors and estimates of the light full-order roots, and how many have none."""
    light = full[np.abs(full.real) < LIGHT * np.abs(full)]
    if not len(light) or not len(lam):
        return np.zeros(0), np.zeros(0), len(light)
    nearest = np.abs(light[:, None] - lam[None, :]).argmin(axis=1)
    true = np.abs(lam[nearest] - light) / np.abs(light)
    near = true < PAIRED
    size = np.abs(light[near])
    return true[near], estimate[nearest[near]] / size, int((~near).sum())
