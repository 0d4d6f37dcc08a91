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
LONG = 1e5  # size from which a prefix does not make a number short
CLOSER = "_closer"  # ending of the name of a study that looks closer at a part
# markers, beside colours, of words in the order of their importance
MARKERS = ("square", "diamond", "triangle", "circle_cross", "circle", "x")


def points_content(results: Results, points: pd.DataFrame) -> Content:
    """Ids, parameters, statuses and notes of some design points of results."""
    status = points["status"].astype(str)
    said = points["message"].astype(str).where(status != "ok", "").tolist()
    broken = (
        points["invalid_reason"].fillna("").astype(str)
        if "invalid_reason" in points
        else [""] * len(points)
    )
    notes = [
        " ".join(filter(None, (text, why and f"Outside validity: {why}.")))
        for text, why in zip(said, broken, strict=True)
    ]
    return {
        "n": len(points),
        "ids": points["point_id"].astype(str).tolist(),
        "rows": points.index.tolist(),  # of the points table, which Python counts from 0
        "status": status.tolist() if (status != "ok").any() else [],
        "notes": {str(row): text for row, text in enumerate(notes) if text},
        "parameters": [_parameter(results, points, name) for name in _shown(results, points)],
    }


def _shown(results: Results, points: pd.DataFrame) -> list[str]:
    """Parameters that are swept or vary, in the order of the sweeps; the first one if none is.

    A sweep of a single value is among them, as a study that looks closer must have that value.
    """
    names = [n for n in dict.fromkeys([*results.swept, *results.parameters]) if n in points]
    return [n for n in names if n in results.swept or len(points[n].unique()) > 1] or names[:1]


def _parameter(results: Results, points: pd.DataFrame, name: str) -> Content:
    values = points[name].to_numpy(dtype=float)
    finite = values[np.isfinite(values)]
    unit_there, largest = results.units.get(name, ""), float(np.abs(finite).max(initial=0.0))
    unit, factor = prefixed(unit_there, largest)
    if largest * factor >= LONG:
        unit, factor = unit_there, 1.0
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
    """Whether ascending values over a decade or more are spaced by factors rather than by steps."""
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
    map_number = {"name": name, "unit": unit, "values": packed_single(values), **more}
    if unstable is not None:
        map_number["unstable"] = packed_whole((unstable.fillna(0) > 0).to_numpy(dtype=int))
    return map_number


def classes(
    name: str, words: Sequence[str], status: Sequence[str], fills: Mapping[str, str]
) -> Content:
    """A word of each design point, with a colour and a marker; failed points have a word, too."""
    shown_words = [
        w if s == "ok" and w in fills else NOT_OK for w, s in zip(words, status, strict=True)
    ]
    order = [*fills, NOT_OK]
    return {
        "name": name,
        "words": [word.replace("_", " ") for word in order],
        "fills": [*fills.values(), "#000000"],
        "markers": [*MARKERS[: len(fills)], MARKERS[-1]],
        "values": packed_words(shown_words, order),
    }


def study_head(results: Results) -> str:
    """The study file without sweeps, to look closer at a part; empty if the file is not known."""
    try:
        tables = tomllib.loads(str(results.manifest.get("study", "")))
        tables["study"]["name"] += CLOSER
    except (ValueError, RecursionError, KeyError, TypeError):
        return ""
    without_sweeps = {
        name: table for name, table in tables.items() if name not in ("sweep", "design")
    }
    return toml_text(without_sweeps)


def question(results: Results) -> str:
    """The description in the study file; empty where it has none."""
    try:
        study = tomllib.loads(str(results.manifest.get("study", ""))).get("study")
    except (ValueError, RecursionError):
        return ""
    return str(study.get("description", "")) if isinstance(study, dict) else ""
