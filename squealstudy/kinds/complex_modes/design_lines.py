"""The answer of a grid along one parameter: where modes turn unstable, and how designs change it.

The parameter is that of the onsets, as a rule friction. Every choice of the other parameters is a
design. What a change of the brake is worth is read from one row for each design, not from one line
for each mode.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.onset_words import (
    alike_together,
    first_at,
    last_at,
    onset_in_words,
    rows_with_ends,
)
from squealstudy.shown_units import prefixed
from squealstudy.tables.mode_ranking import (
    OVERDAMPED_GROUP,
    frequency_text,
    group_kind,
    parameter_columns,
    rank_modes,
)
from squealstudy.tables.stability import BELOW_RANGE, INEXACT
from squealstudy.wording import amount, in_digits, plural, track_number

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

GRID = "grid"
MOST_DESIGNS = 12  # most designs in a table on a screen; each needs a ranking of its own
MOST_MODES = 4  # named in the answer
BELOW_TEXT = "below range"  # in place of an onset
ALIKE_ONSETS = 2e-3  # first onsets with a smaller relative difference count as the same

Row = Mapping[Hashable, Any]


class DesignLine(NamedTuple):
    """Onsets along their parameter at one choice of the other parameters.

    Attributes
    ----------
    design : dict of str -> float
        Values of the other parameters.
    unstable : int
        Number of solved points at which some mode is unstable.
    solved : int
        Number of solved points.
    sure : bool
        All points are solved, stability is certain at each, and no table of values has a knot
        between them.
    onset : float
        Least value at which a mode turns unstable; NaN where none is known, or where one is
        unstable already at the first value.
    kind : str
        How the onset is known (`tables.stability`): BELOW_RANGE where a mode is unstable at the
        first value; empty where no onset is known.
    first, fastest : dict or None
        Rows of the ranking: of the mode with this onset, and of the one that grows fastest.
    modes : dict of int -> dict
        Row of the ranking of each unstable track, with its `end` (`rows_with_ends`).
    """

    design: dict[str, float]
    unstable: int
    solved: int
    sure: bool
    onset: float
    kind: str
    first: Row | None
    fastest: Row | None
    modes: Mapping[int, Row]


def design_lines(results: ResultTables) -> list[DesignLine]:
    """One line for each design of a grid; none for a single design or more than MOST_DESIGNS."""
    along = results.along
    if not along or results.design != GRID or results.boundary is not None:
        return []
    points = results.points
    others = [name for name in parameter_columns(points, varied=True) if name != along]
    designs = points[others].drop_duplicates() if others else points[:0]
    if not 2 <= len(designs) <= MOST_DESIGNS or points[others].isna().to_numpy().any():
        return []
    rows = designs.to_dict("records")
    return [_line(results, {str(n): float(v) for n, v in row.items()}) for row in rows]


def _line(results: ResultTables, values: dict[str, float]) -> DesignLine:
    """What a study knows of one design: its unstable points, modes and first onset."""
    where = " and ".join(f"{name} == {float(number)!r}" for name, number in values.items())
    points = results.points
    on_line = np.logical_and.reduce([points[name].to_numpy() == v for name, v in values.items()])
    solved = points[on_line & (points["status"] == "ok").to_numpy(bool)]
    largest_count = solved["n_unstable"]
    table = rank_modes(*results.ranked(where), results.along, "growth", None, where, results.onsets)
    first = first_onset(table)
    unit = results.units.get(results.along or "", "")
    return DesignLine(
        design=values,
        unstable=int((solved["n_unstable"] > 0).sum()),
        solved=len(solved),
        sure=bool(
            len(solved) == on_line.sum()
            and (solved["n_unstable_high"] == largest_count).all()
            and results.along not in results.manifest.get("knots_between", {})
        ),
        onset=float(first["threshold"]) if first else float("nan"),
        kind=str(first["threshold_kind"]) if first else "",
        first=first,
        fastest=table.iloc[0].to_dict() if len(table) else None,
        modes=rows_with_ends(table, results.onsets, values, unit),
    )


def first_onset(table: pd.DataFrame) -> Row | None:
    """Row of the mode of a ranking that turns unstable first; None where no onset is known."""
    below = table[(table["threshold_kind"] == BELOW_RANGE).to_numpy(bool)]
    if len(below):
        return below.iloc[0].to_dict()
    with_onset = table[table["threshold"].notna().to_numpy(bool)]
    return (
        with_onset.sort_values("threshold", kind="stable").iloc[0].to_dict()
        if len(with_onset)
        else None
    )


def onsets_in_words(results: ResultTables, table: pd.DataFrame) -> str:
    """Modes of a ranking in the order in which they turn unstable; empty where none is known."""
    along = results.along
    if not along or results.design != GRID or results.boundary is not None:
        return ""
    tracked = table[(table["kind"] == group_kind(1)).to_numpy(bool)]
    tracked = tracked.assign(first=tracked["threshold"])
    tracked.loc[(tracked["threshold_kind"] == BELOW_RANGE).to_numpy(bool), "first"] = -np.inf
    tracked = tracked.sort_values("first", kind="stable")
    # of tracks that stand for n modes, n are named
    number_in_family = tracked.groupby("family", sort=False).cumcount()
    tracked = tracked[(number_in_family < tracked["family_modes"]).to_numpy(bool)]
    unit = results.units.get(along, "")
    onsets = results.onsets if "onsets" in results.tables else None
    line = onsets if parameter_columns(results.points, varied=True) == [along] else None
    tracks_of = table["family"].value_counts()  # several where a mode changes its number
    n_told = len(tracked) if len(tracked) == MOST_MODES + 1 else MOST_MODES
    texts = [
        f"{track_number(row['track'])} at {frequency_text(row)} Hz"
        f"{onset_in_words(row, along, unit, onsets)}"
        f"{last_at(row, line if tracks_of[row['family']] == 1 else None, unit)}"
        for row in tracked[:n_told].to_dict("records")
    ]
    n_untold = len(tracked) - len(texts)
    others = f" and {plural(n_untold, 'other')}" if n_untold else ""
    real_roots = table[(table["kind"] == group_kind(OVERDAMPED_GROUP)).to_numpy(bool)]
    begins = [
        first_at(row, along, unit, _quiet_before(results, float(row["threshold"])))
        for row in real_roots.to_dict("records")
    ]
    divergence = [f"without oscillation{text}" for text in begins if text]
    return "; ".join(filter(None, [", ".join(alike_together(texts, along)) + others, *divergence]))


def _quiet_before(results: ResultTables, onset: float) -> float:
    """Last solved value before an onset, if surely no mode grows there on any line; else NaN."""
    along, points = results.along or "", results.points
    names = [name for name in parameter_columns(points, varied=True) if name != along]
    before = points[((points["status"] == "ok") & (points[along] < onset)).to_numpy(bool)]
    last = before.sort_values(along, kind="stable")
    last = last.drop_duplicates(names, keep="last") if names else last.iloc[-1:]
    is_quiet = len(last) and (last["n_unstable_high"] == 0).all()
    return float(last[along].min()) if is_quiet else float("nan")


def extremes_in_words(results: ResultTables, lines: list[DesignLine]) -> str:
    """A sentence on which design turns unstable first and which last.

    Empty where the first onset of a design is not known or is only a bound, or where all designs
    have the same one.
    """
    along = results.along or ""
    if len(lines) < 2:
        return ""
    first_onsets = [_first_value(line) for line in lines]
    ends = min(first_onsets), max(first_onsets)
    if _same_onset(*ends) or np.isnan(first_onsets).any():
        return ""
    if any(INEXACT.get(line.kind) for line in lines):  # it may be less than the earliest
        return ""
    top, unit = float(results.points[along].max()), results.units.get(along, "")
    texts = []
    for end in ends:
        at_end = [
            x for x, onset in zip(lines, first_onsets, strict=True) if _same_onset(onset, end)
        ]
        design = f"{len(at_end)} of the designs"
        if len(at_end) == 1:
            design = design_text(results, at_end[0])
        onset_text = f"{along} {amount(end, unit)}" if np.isfinite(end) else ""
        onset_text = onset_text or (BELOW_TEXT if end < 0 else f"none up to {amount(top, unit)}")
        texts.append(f"with {design} ({onset_text})")
    return f" The first onset is earliest {texts[0]} and latest {texts[1]}."


def growth_in_words(results: ResultTables, lines: list[DesignLine]) -> str:
    """A sentence on the designs whose fastest mode grows fastest and slowest.

    Empty where no mode grows at some design, where points failed, or where growth is alike.
    """
    fastest = [float(x.fastest["max_growth_rate"]) if x.fastest else np.nan for x in lines]
    if len(lines) < 2 or np.isnan(fastest).any() or len({line.solved for line in lines}) > 1:
        return ""
    if not (results.points["status"] == "ok").all():  # as many, but not at the same values
        return ""
    low, high = min(fastest), max(fastest)
    if high - low <= ALIKE_ONSETS * high:
        return ""
    texts = [
        f"with {design_text(results, lines[fastest.index(end)])} ({in_digits(end, 1)} 1/s)"
        for end in (high, low)
    ]
    return f" The fastest growth is largest {texts[0]} and least {texts[1]}."


def quiet_in_words(results: ResultTables, lines: list[DesignLine]) -> str:
    """A sentence on points without an unstable mode, of designs unstable at the least value.

    Empty where no design has such points.
    """
    along, points = results.along or "", results.points
    unit = results.units.get(along, "")
    designs_at: dict[str, list[str]] = {}
    for line in lines:
        of_design = [points[name].to_numpy() == v for name, v in line.design.items()]
        rows = points[np.logical_and.reduce(of_design)].sort_values(along)
        stable = ((rows["status"] == "ok") & (rows["n_unstable_high"] == 0)).to_numpy(bool)
        if line.kind != BELOW_RANGE or not stable.any():
            continue
        quiet, n_quiet = rows[along].to_numpy(float)[stable], int(stable.sum())
        first, last = (amount(v, unit, quiet[-1]) for v in (float(quiet[0]), float(quiet[-1])))
        first = first.removesuffix(prefixed(unit, quiet[-1])[0]).rstrip() if n_quiet > 1 else first
        gaps = ", not between" * (not stable[stable.argmax() :][:n_quiet].all())
        several = f" to {last} ({n_quiet} points{gaps})" if n_quiet > 1 else ""
        designs_at.setdefault(f"{first}{several}", []).append(design_text(results, line))
    if not designs_at:
        return ""
    name = f"{next(iter(lines[0].design))} "  # named once where designs differ in it alone
    texts = [
        f"{quiet} with {of[0]}"
        + "".join(f" or {d.removeprefix(name) if len(lines[0].design) == 1 else d}" for d in of[1:])
        for quiet, of in designs_at.items()
    ]
    n_others = sum(map(len, list(designs_at.values())[MOST_MODES:]))
    more = f" and at others with {plural(n_others, 'other design')}" if n_others else ""
    return f" No mode is unstable at {along} {'; '.join(texts[:MOST_MODES])}{more}."


def design_text(results: ResultTables, line: DesignLine) -> str:
    """The values of a design with their names."""
    return ", ".join(f"{n} {amount(v, results.units.get(n, ''))}" for n, v in line.design.items())


def _same_onset(onset: float, other: float) -> bool:
    """Whether two onsets, which may be infinite, count as the same."""
    is_near = np.isfinite([onset, other]).all() and abs(onset - other) <= ALIKE_ONSETS * abs(other)
    return bool(onset == other or is_near)


def _first_value(line: DesignLine) -> float:
    """Where a design turns unstable: -inf below the range, inf for never; NaN where not known."""
    if line.kind == BELOW_RANGE:
        return -np.inf
    if np.isfinite(line.onset):
        return line.onset
    return np.inf if line.sure and line.solved and not line.unstable else np.nan


def modes_of_several_numbers(table: pd.DataFrame) -> dict[int, list[int]]:
    """Tracks of each single mode that changes its number, by its least track number."""
    single_modes = table[((table["track"] > 0) & (table["family_modes"] == 1)).to_numpy(bool)]
    families = {int(str(n)): sorted(rows["track"]) for n, rows in single_modes.groupby("family")}
    return {number: tracks for number, tracks in families.items() if len(tracks) > 1}


def by_mode(modes: Mapping[int, Row], families: Mapping[int, list[int]]) -> dict[int, Row]:
    """Rows of a design by mode; tracks that are one mode share their first onset and top growth."""
    rows = dict(modes)
    for number, tracks in families.items():
        of_mode = [rows.pop(track) for track in tracks if track in rows]
        if of_mode:
            fastest = max(of_mode, key=lambda row: float(row["max_growth_rate"]))
            first = first_onset(pd.DataFrame(of_mode)) or fastest
            onset: Row = {n: first[n] for n in ("threshold", "threshold_kind", "taken_over")}
            name = ", ".join(map(track_number, tracks))
            rows[number] = {**fastest, **onset, "name": name, "end": ""}
    return rows
