"""Where a mode turns unstable and where stable again, in words."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.tables.families import RENUMBERED
from squealstudy.tables.stability import (
    BELOW_RANGE,
    BROKEN,
    INEXACT,
    INTERPOLATED,
    INTO,
    LEAVES,
    OUT_OF,
    REFINED_ONSETS,
)
from squealstudy.wording import amount, in_digits

if TYPE_CHECKING:
    import pandas as pd

SAME_ONSET = 1e-9  # relative difference of the same onset in two tables
# relative difference from which a mode's frequency at its onset is told beside that of its growth
OTHER_FREQUENCY = 0.004
TAKEN_OVER_NOTE = (
    "* before an onset: on some line this mode is unstable at less, too: there it continues an "
    "unstable mode of another number"
)

Row = Mapping[Hashable, Any]


def onset_in_words(row: Row, along: str, unit: str, onsets: pd.DataFrame | None) -> str:
    """Where a mode first turns unstable, with another frequency there; empty where not known."""
    save = ", save where an unstable mode takes its number" if row["taken_over"] else ""
    first = first_at(row, along, unit, _last_before(row, onsets))
    return f"{first}{other_frequency(row, onsets)}{save}"


def first_at(row: Row, along: str, unit: str, stable_at: float = math.nan) -> str:
    """Where a mode first turns unstable, in words; empty where that is not known.

    It may be stable again at larger values. `stable_at` is the last solved value before an onset
    that is only a bound, NaN where that is not known.
    """
    kind, onset = str(row["threshold_kind"]), row["threshold"]
    if kind == BELOW_RANGE:
        return _at_start(along)
    if not isinstance(onset, float) or np.isnan(onset):
        return ""
    mark = INEXACT.get(kind, "")
    if mark == "<= " and stable_at < onset:
        return f" first at {along} between {amount(stable_at, unit)} and {amount(onset, unit)}"
    about, below = "about " if mark == "~" else "", " or less" if mark == "<= " else ""
    return f" first at {along} {about}{amount(onset, unit)}{below}"


def _last_before(row: Row, onsets: pd.DataFrame | None) -> float:
    """Last solved value at which a mode is stable before an onset that is a bound; NaN if unknown.

    The least of all lines: on some line the mode may turn unstable just above it.
    """
    if onsets is None:
        return math.nan
    bounded = (onsets["track"] == row["track"]) & (onsets["direction"] == INTO)
    bounded &= ~onsets["status"].isin([*REFINED_ONSETS, RENUMBERED])
    lows = onsets["bracket_low"][bounded.to_numpy(bool)].to_numpy(float)
    return float(lows.min()) if len(lows) else math.nan


def onset_cell(row: Row, unit: str) -> str:
    """Table cell with the onset of a row of a ranking, with its marks."""
    threshold, kind = row["threshold"], row["threshold_kind"]
    if kind == BELOW_RANGE:
        return BELOW_RANGE
    if not isinstance(threshold, float) or threshold != threshold:
        return "-"
    mark = "*" * bool(row["taken_over"]) + INEXACT.get(kind, "")
    return f"{mark}{amount(round(threshold, 9), unit)}"


def other_frequency(row: Row, onsets: pd.DataFrame | None) -> str:
    """The frequency of a mode at its first onset; empty where it is that of its fastest growth."""
    if onsets is None:
        return ""
    of_mode = onsets[(onsets["track"] == row["track"]).to_numpy(bool)]
    if row["threshold_kind"] == BELOW_RANGE:
        at_least = of_mode["frequency_hz"][
            (of_mode["status"] == BELOW_RANGE.replace(" ", "_")).to_numpy(bool)
        ]
        return _elsewhere(sorted(at_least.dropna()), row["frequency_hz"])
    if row["threshold"] != row["threshold"]:
        return ""
    distance = (of_mode["onset"] - row["threshold"]).abs().fillna(np.inf)
    if not len(distance) or distance.min() > SAME_ONSET * abs(row["threshold"]):
        return ""
    return _elsewhere([float(of_mode["frequency_hz"][distance.idxmin()])], row["frequency_hz"])


def _elsewhere(frequencies: list[float], hz: float) -> str:
    """Ascending frequencies of a mode at its onset, in words; empty where all are near `hz`."""
    if not frequencies or max(abs(other - hz) for other in frequencies) <= OTHER_FREQUENCY * hz:
        return ""
    ends = dict.fromkeys(in_digits(end) for end in (frequencies[0], frequencies[-1]))
    return f" ({' to '.join(ends)} Hz there)"


def last_at(row: Row, onsets: pd.DataFrame | None, unit: str) -> str:
    """The value from which on a mode of one line is stable again, or no longer in the band.

    In words; empty where that is not known.
    """
    left_at = _left_band_at(row, onsets)
    if left_at is not None:
        return f", outside the band from {amount(left_at, unit)} on"
    turn = _turning_out(row, onsets)
    if turn is not None and turn["status"] == BROKEN:
        low, high = (amount(float(turn[f"bracket_{end}"]), unit) for end in ("low", "high"))
        return f", still at {low}, no longer from {high} on"
    end = _end(row, onsets, unit)
    return f", no longer from {end} on" if end else ""


def rows_with_ends(
    table: pd.DataFrame, onsets: pd.DataFrame, design: Mapping[str, float], unit: str
) -> dict[int, dict[Hashable, Any]]:
    """Rows of the tracks in a design's ranking, each with the `end` of its instability in words."""
    line = onsets
    for name, number in design.items():
        line = line[(line[name] == number).to_numpy(bool)] if len(line) else line
    rows = table[(table["track"] > 0).to_numpy(bool)].to_dict("records")
    return {int(row["track"]): {**row, "end": _end(row, line, unit)} for row in rows}


def _end(row: Row, onsets: pd.DataFrame | None, unit: str) -> str:
    """The value from which on a mode of one line is stable again; empty where not known."""
    turn = _turning_out(row, onsets)
    if turn is None:
        return ""
    if turn["status"] == BROKEN:
        return f"{INEXACT[BROKEN]}{amount(float(turn['bracket_high']), unit)}"
    about = "about " if turn["status"] == INTERPOLATED else ""
    return f"{about}{amount(float(turn['onset']), unit)}"


def _left_band_at(row: Row, onsets: pd.DataFrame | None) -> float | None:
    """The first value of one line at which an unstable mode is beyond the band; None if in it."""
    if onsets is None:
        return None
    of_mode = onsets[(onsets["track"] == row["track"]).to_numpy(bool)]
    ways = of_mode["direction"].tolist()
    if ways.count(LEAVES) != 1 or OUT_OF in ways or ways.count(INTO) > 1:
        return None
    return float(of_mode["bracket_high"][(of_mode["direction"] == LEAVES).to_numpy(bool)].iloc[0])


def _turning_out(row: Row, onsets: pd.DataFrame | None) -> Row | None:
    """The row of the onsets of one line from which on a mode is stable; None where not known."""
    if onsets is None:
        return None
    of_mode = onsets[(onsets["track"] == row["track"]).to_numpy(bool)]
    ends = of_mode[(of_mode["direction"] == OUT_OF).to_numpy(bool)].to_dict("records")
    begins = of_mode["onset"][(of_mode["direction"] == INTO).to_numpy(bool)].to_numpy(float)
    begins = np.nan_to_num(begins, nan=-np.inf)  # below the range
    if len(ends) != 1 or len(begins) > 1:
        return None  # it is unstable again further on, or throughout
    (turn,) = ends
    if turn["status"] == BROKEN:
        return turn
    is_placed = turn["status"] in (*REFINED_ONSETS, INTERPOLATED)  # others are at a design point
    return turn if is_placed and (begins < turn["onset"]).all() else None


def onset_and_end(row: Row | None, unit: str) -> str:
    """Table cell: where a mode turns unstable at a design, and stable again; "-" if not known."""
    if row is None:
        return "-"
    kind, onset = str(row["threshold_kind"]), row["threshold"]
    end = f" to {row['end']}" if row.get("end") else ""
    if kind == BELOW_RANGE:
        return f"{BELOW_RANGE}{end}"
    return f"{INEXACT.get(kind, '')}{amount(onset, unit)}{end}" if np.isfinite(onset) else "-"


def alike_together(texts: list[str], along: str) -> list[str]:
    """Texts of modes; those of modes unstable already at the least value are joined, and first."""
    at_start = re.compile(rf"{re.escape(_at_start(along))}(?: \((.*) there\))?$")
    pieces = [at_start.split(text) for text in texts]
    same = [piece for piece in pieces if len(piece) > 1]
    if len(same) < 2:
        return texts
    others = [text for text, piece in zip(texts, pieces, strict=True) if len(piece) == 1]
    names = ", ".join(name for name, *_ in same)
    there = [f"{name.partition(' at ')[0]} at {hz}" for name, hz, _ in same if hz]
    of_start = f" (there {', '.join(there)})" if there else ""
    every = "both" if len(same) == 2 else "all"
    return [f"{names}, {every}{_at_start(along)}{of_start}", *others]


def _at_start(along: str) -> str:
    return f" already at the least {along}"
