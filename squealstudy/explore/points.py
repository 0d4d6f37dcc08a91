"""Design points on a page: values, status, and quantities that colour a map."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from squealstudy.explore.packed import packed_exact, packed_single, packed_whole, packed_words
from squealstudy.shown_units import prefixed
from squealstudy.study.toml_text import toml_text

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

Content = dict[str, Any]  # what JSON can hold
NOT_OK = "no result"
LONG = 1e5  # numbers that would be this large even with a prefix are shown without it
CLOSER = "_closer"  # ending of the name of a study of a part of the map
# markers of words, beside their colours; the most important word has the first one
MARKERS = ("square", "diamond", "triangle", "circle_cross", "circle", "star")
NOT_OK_MARKER, NOT_OK_FILL = "x", "#000000"


def points_content(results: Results, points: pd.DataFrame) -> Content:
    """Ids, parameters, statuses and notes of some design points of results."""
    status = points["status"].astype(str)
    failures = points["message"].astype(str).where(status != "ok", "").tolist()
    outside = [""] * len(points)  # why a point is outside the validity of its model
    if "invalid_reason" in points:
        reasons = points["invalid_reason"].fillna("").astype(str)
        outside = [f"Outside validity: {reason}." if reason else "" for reason in reasons]
    notes = [f"{failure} {why}".strip() for failure, why in zip(failures, outside, strict=True)]
    return {
        "n": len(points),
        "ids": points["point_id"].astype(str).tolist(),
        "rows": points.index.tolist(),  # numbers of rows in the points table, from 0
        "status": status.tolist() if (status != "ok").any() else [],  # empty: all are ok
        "notes": {str(row): text for row, text in enumerate(notes) if text},
        "parameters": [_parameter(results, points, name) for name in _shown(results, points)],
    }


def _shown(results: Results, points: pd.DataFrame) -> list[str]:
    """Parameters that are swept or vary, in the order of the sweeps; the first one if none is.

    A sweep of a single value is among them: a study of a part of the map needs that value.
    """
    names = [n for n in dict.fromkeys([*results.swept, *results.parameters]) if n in points]
    return [n for n in names if n in results.swept or len(points[n].unique()) > 1] or names[:1]


def _parameter(results: Results, points: pd.DataFrame, name: str) -> Content:
    """Values of a parameter, and how the page shows them."""
    values = points[name].to_numpy(dtype=float)
    finite = values[np.isfinite(values)]
    unit_of_table, largest = results.units.get(name, ""), float(np.abs(finite).max(initial=0.0))
    unit, factor = prefixed(unit_of_table, largest)
    if largest * factor >= LONG:
        unit, factor = unit_of_table, 1.0
    return {
        "name": name,
        "unit": unit,
        "factor": factor,
        "temperature": results.units.get(name) == "degC",
        "swept": name in results.swept,
        "log": _by_factors(np.unique(finite)),
        "nominal": _number(results.manifest.get("nominal", {}).get(name)),
        "values": packed_exact(values),
    }


def _by_factors(x: np.ndarray) -> bool:
    """Whether ascending values over a decade or more are spaced by factors rather than by steps.

    It is by factors where steps of the logarithm vary, relative to their mean, less than half as
    much as steps of the values.
    """
    if len(x) < 3 or x[0] <= 0 or x[-1] < 10 * x[0]:
        return False
    steps, factors = np.diff(x), np.diff(np.log(x))
    return bool(np.std(factors) / np.mean(factors) < 0.5 * np.std(steps) / np.mean(steps))


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None


def measure(
    name: str, unit: str, values: np.ndarray, unstable: pd.Series | None = None, **more: Any
) -> Content:
    """A quantity of each design point that a map can show.

    `unstable` is the number of unstable modes of each point. By it, if it is given, a map tells
    unstable points from others: the sign of a growth rate may be that of round-off.
    """
    content = {"name": name, "unit": unit, "values": packed_single(values), **more}
    if unstable is not None:
        content["unstable"] = packed_whole((unstable.fillna(0) > 0).to_numpy(dtype=int))
    return content


def classes(
    name: str, words: Sequence[str], status: Sequence[str], fills: Mapping[str, str]
) -> Content:
    """A word of each design point, such as its class, which a map shows by colour and marker.

    `fills` are the colours of the possible words, at most as many as MARKERS. Failed points, and
    those with any other word, have the word NOT_OK.
    """
    shown_words = [
        w if s == "ok" and w in fills else NOT_OK for w, s in zip(words, status, strict=True)
    ]
    order = [*fills, NOT_OK]
    return {
        "name": name,
        "words": [word.replace("_", " ") for word in order],
        "fills": [*fills.values(), NOT_OK_FILL],
        "markers": [*MARKERS[: len(fills)], NOT_OK_MARKER],
        "values": packed_words(shown_words, order),
    }


def study_head(results: Results) -> str:
    """The study file without sweeps, for a study of a part of the map; empty if it is not known."""
    try:
        tables = tomllib.loads(str(results.manifest.get("study", "")))
        tables["study"]["name"] += CLOSER
    except (ValueError, RecursionError, KeyError, TypeError):
        return ""
    without_sweeps = {
        name: table for name, table in tables.items() if name not in ("sweep", "design")
    }
    return toml_text(without_sweeps)


def description(results: Results) -> str:
    """The description in the study file; empty where it has none."""
    try:
        study = tomllib.loads(str(results.manifest.get("study", ""))).get("study")
    except (ValueError, RecursionError):
        return ""
    return str(study.get("description", "")) if isinstance(study, dict) else ""
