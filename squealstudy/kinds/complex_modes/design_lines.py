"""The answer of a grid along one parameter: from which value on, and what each design does to it.

Along the parameter of the onsets, friction as a rule, every choice of the other parameters is a
design. What a change of the brake is worth is read from a row a design, not from a line a mode.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.kinds.complex_modes.onset_words import (
    alike_together,
    first_at,
    last_at,
    onset_and_end,
    onset_in_words,
    rows_with_ends,
)
from squealstudy.screen import grid, notes
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
MOST_DESIGNS = 12  # of a table on a screen; each is a ranking of its own
MOST_MODES = 4  # named in the answer
MOST_ONSETS = 4  # modes whose onsets stand beside each other, a row a design
BELOW_TEXT = "below range"  # in place of an onset
ALIKE_ONSETS = 2e-3  # relative: designs whose first onsets are as near are not told apart

Row = Mapping[Hashable, Any]


class DesignLine(NamedTuple):
    """Onsets along their parameter at one choice of the other parameters.

    Attributes
    ----------
    design : dict of str -> float
        Values of the other parameters.
    unstable, solved : int
        Solved points, and those at which some mode is unstable.
    sure : bool
        All points are solved, stability is certain at each, and no table bends between them.
    onset : float
        Least value from which on a mode is unstable; NaN for none.
    kind : str
        How it is known (`tables.stability`); BELOW_RANGE where all values are beyond it.
    first, fastest : dict or None
        Rows of the ranking: of the mode of the onset, and of the one that grows fastest.
    modes : dict of int -> dict
        Row of each unstable track.
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
    """A row a design of a grid; none where there is one design alone, or too many for a screen."""
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
    """The row of a ranking whose mode turns unstable first; None where no onset is known."""
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
    """The modes of a ranking in the order in which they turn unstable; empty without onsets."""
    along = results.along
    if not along or results.design != GRID or results.boundary is not None:
        return ""
    tracked = table[(table["kind"] == group_kind(1)).to_numpy(bool)]
    tracked = tracked.assign(first=tracked["threshold"])
    tracked.loc[(tracked["threshold_kind"] == BELOW_RANGE).to_numpy(bool), "first"] = -np.inf
    tracked = tracked.sort_values("first", kind="stable")
    number_in_family = tracked.groupby(
        "family", sort=False
    ).cumcount()  # of tracks that are one mode, one
    tracked = tracked[(number_in_family < tracked["family_modes"]).to_numpy(bool)]
    unit = results.units.get(along, "")
    onsets = results.onsets if "onsets" in results.tables else None
    line = onsets if parameter_columns(results.points, varied=True) == [along] else None
    tracks_of = table["family"].value_counts()  # of one mode whose number changes, several
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
    divergence = [
        f"without oscillation{first_at(row, along, unit)}" for row in real_roots.to_dict("records")
    ]
    return "; ".join(filter(None, [", ".join(alike_together(texts, along)) + others, *divergence]))


def extremes_in_words(results: ResultTables, lines: list[DesignLine]) -> str:
    """Which design turns unstable first and which last, to follow others.

    Empty where that is not known of each, of a bound neither, or where they are alike.
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
    """Which design's fastest mode grows fastest, and which one's slowest, to follow others.

    Empty where some design has no mode that grows, or points that failed, or where they are alike.
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
    """Points of designs at which no mode is unstable, though one is at the least value.

    To follow others; empty where no design has such points.
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
    name = f"{next(iter(lines[0].design))} "  # once, where designs differ by it alone
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
    """Whether two values, infinite ones too, are not told apart."""
    is_near = np.isfinite([onset, other]).all() and abs(onset - other) <= ALIKE_ONSETS * abs(other)
    return bool(onset == other or is_near)


def _first_value(line: DesignLine) -> float:
    """Where a design turns unstable, infinite where beyond the range; NaN where not known."""
    if line.kind == BELOW_RANGE:
        return -np.inf
    if np.isfinite(line.onset):
        return line.onset
    return np.inf if line.sure and line.solved and not line.unstable else np.nan


def design_table(
    results: ResultTables, lines: list[DesignLine], table: pd.DataFrame
) -> list[RenderableType]:
    """A row a design: its first onset and fastest growth; what `design` stands for.

    `table` is the ranking over all designs, which tells what tracks are one mode.
    """
    along = results.along or ""
    units, top = results.units, float(results.points[along].max())
    names, most = list(lines[0].design), amount(top, units.get(along, ""))
    designs = [", ".join(amount(v, units.get(n, "")) for n, v in x.design.items()) for x in lines]
    rows = []
    for design, line in zip(designs, lines, strict=True):
        is_sure = line.sure and line.solved > 0
        onset = f"none up to {most}" if is_sure else "none known"
        onset = BELOW_TEXT if line.kind == BELOW_RANGE else onset
        if np.isfinite(line.onset):
            onset = f"{INEXACT.get(line.kind, '')}{amount(line.onset, units.get(along, ''))}"
        elif line.first is None and line.fastest is not None:
            onset = "-"
        rows.append(
            [
                design,
                onset,
                _mode_text(line.first),
                in_digits(line.fastest["max_growth_rate"], 1) if line.fastest else "-",
                _mode_text(line.fastest),
                f"{100 * line.unstable / line.solved:.0f} %" if line.solved else "-",
            ]
        )
    shown = grid(
        *("text:design", "first onset", "text:of", "growth 1/s", "text:of", "unstable"), rows=rows
    )
    today = results.nominal_others(along)
    as_it_is = ""
    if set(names) <= set(today):
        as_it_is = ", ".join(amount(today[n], units.get(n, "")) for n in names)
    tables: Mapping[str, list[str]] = results.manifest.get("tables", {})
    followers = [name for name, over in tables.items() if set(over) & set(names)]
    follow = "follows" if len(followers) == 1 else "follow"
    with_it = f", which {' and '.join(followers)} {follow}" if followers else ""
    unit = units.get(along, "")
    by_modes = _onsets_by_mode(designs, lines, modes_of_several_numbers(table), unit)
    meaning = f"design: {', '.join(names)}{with_it}"
    meaning += f"; as it is: {as_it_is}" if as_it_is else ""
    return [
        shown,
        notes(
            meaning,
            f"first onset: least {along} at which a mode turns unstable; growth: the fastest of "
            "all; Hz: where the mode grows fastest; unstable: share of its solved points",
        ),
        *(["", *by_modes] if by_modes else []),
    ]


def modes_of_several_numbers(table: pd.DataFrame) -> dict[int, list[int]]:
    """Tracks of each mode whose number changes, by the least of them."""
    single_modes = table[((table["track"] > 0) & (table["family_modes"] == 1)).to_numpy(bool)]
    families = {int(str(n)): sorted(rows["track"]) for n, rows in single_modes.groupby("family")}
    return {number: tracks for number, tracks in families.items() if len(tracks) > 1}


def by_mode(modes: Mapping[int, Row], families: Mapping[int, list[int]]) -> dict[int, Row]:
    """Rows of a design by mode: of tracks that are one the first onset, and the fastest growth."""
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


def _onsets_by_mode(
    designs: list[str],
    lines: list[DesignLine],
    families: Mapping[int, list[int]] | None = None,
    unit: str = "",
) -> list[RenderableType]:
    """The onset of each mode at each design; nothing where the row of a design has it all.

    A mode may turn unstable later than another by a change that leaves the first onset alone. Of
    many modes the fastest has a column, then those that some design silences.
    """
    by_line = [by_mode(line.modes, families or {}) for line in lines]
    fastest: dict[int, Row] = {}
    for track, row in ((t, row) for modes in by_line for t, row in modes.items()):
        if track not in fastest or row["max_growth_rate"] > fastest[track]["max_growth_rate"]:
            fastest[track] = row
    if len(fastest) < 2:
        return []
    by_growth = sorted(fastest, key=lambda t: -float(fastest[t]["max_growth_rate"]))
    others = sorted(by_growth[1:], key=lambda t: all(t in modes for modes in by_line))
    chosen = sorted([by_growth[0], *others[: MOST_ONSETS - 1]], key=by_growth.index)
    of_design = [[modes.get(track) for track in chosen] for modes in by_line]
    onsets = [[onset_and_end(row, unit) for row in rows] for rows in of_design]
    title, unknown = "onset of", "no onset is known of a mode of this number"
    if not {text for texts in onsets for text in texts} - {"-", BELOW_TEXT}:  # no value moves
        title, unknown = "growth 1/s of", "no mode of this number grows"
        onsets = [[_growth_text(row) for row in rows] for rows in of_design]
    has_ends = any(" to " in text for texts in onsets for text in texts)
    shown = grid(
        f"text:{title}",
        *(f"{'text' if has_ends else 'value'}:{_mode_text(fastest[track])}" for track in chosen),
        rows=([design, *texts] for design, texts in zip(designs, onsets, strict=True)),
    )
    legend = []
    if any("-" in texts for texts in onsets):
        legend += [f"-: at this design {unknown}"]
    if has_ends:
        legend += ["to: where the mode is stable again"]
    if len(fastest) > len(chosen):
        legend += [f"{plural(len(fastest) - len(chosen), 'mode')} left out"]
    return [shown, *([notes("; ".join(legend))] if legend else [])]


def _growth_text(row: Row | None) -> str:
    return in_digits(float(row["max_growth_rate"]), 1) if row else "-"


def _mode_text(row: Row | None) -> str:
    if row is None:
        return ""
    name = track_number(row["track"]) if row["kind"] == group_kind(1) else str(row["kind"])
    hz = frequency_text(row)  # empty of growth without oscillation
    return f"{row.get('name', name)} {hz} Hz" if hz else name
