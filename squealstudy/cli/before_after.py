"""Text that `squealstudy compare` prints of two studies of complex modes: effects of a change."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from rich.console import RenderableType
from rich.text import Text

from squealstudy.engine.results import Results
from squealstudy.kinds.complex_modes.outside_text import grows_outside
from squealstudy.screen import grid, notes, plain
from squealstudy.tables.before_after import REL_TOLERANCE, SIDES, first_of
from squealstudy.tables.stability import BELOW_RANGE, INEXACT
from squealstudy.wording import amount, in_digits, plural

ABOUT = {"~": "about {}", "<= ": "{} or less"}  # words for an inexact onset, by its mark
MOST_NAMED = 3  # most modes that are named where only one side has them

Row = Mapping[Hashable, Any]


def before_after(table: pd.DataFrame, before: Results, after: Results) -> list[RenderableType]:
    """The answer, differences of the studies, and a line for each mode, from `Results.compare`."""
    facts = table.attrs
    along, points = facts["along"], facts["points"]
    unit = facts["units"].get("onset_before", "")
    sentences = [*_onsets(table, along, unit), *_growth(table), *_counts(table), *_doubts(facts)]
    answer = f"{' '.join(sentences)}{_outside(before, after)}"
    changes = "; ".join(facts["changes"]) or "nothing in the study files and their versions"
    head = f"Before: {before.directory}; after: {after.directory}. What differs: {changes}."
    if not len(table):
        return [Text(plain(f"{answer}\n{head}"))]
    unpaired = _unpaired(table)
    rows = [_cells(row, facts, unpaired) for row in table.to_dict("records")]
    shown = grid(
        *(f"text:mode {side}" for side in SIDES),
        *(["value:onset"] if along else []),
        "value:growth 1/s",
        "value:unstable %",
        rows=rows,
    )
    kinds = {k for side in SIDES for k in table[f"onset_kind_{side}"]}
    marks = {INEXACT[kind] for kind in kinds if kind in INEXACT}
    legend = notes(
        "modes of one line: their frequencies are the nearest over the points where both grow, or "
        f"one where never both do, {100 * REL_TOLERANCE:g} % apart at most in the mean, and a "
        "component that holds most of the energy is the same in both; numbers of tracks belong to "
        "one study",
        "a -> b: before and after; growth, Hz: where growth is fastest; unstable: share of the "
        f"{plural(points, 'point')} that both studies have solved",
        *([f"onset: least {along} at which the mode turns unstable"] if along else []),
        *(["~ before an onset: interpolated, not refined"] if "~" in marks else []),
        *(["<= before an onset: an upper bound"] if "<= " in marks else []),
        *(
            ["-: none, or not known"]
            if any("-" in " ".join(row[2:]).split() for row in rows)
            else []
        ),
    )
    return [Text(plain(f"{answer}\n{head}")), "", shown, legend]


def _onsets(table: pd.DataFrame, along: str | None, unit: str) -> list[str]:
    """Sentence on how the change moves the first onset."""
    if not along or not len(table):
        return []
    rows = [first_of(table, side) for side in SIDES]
    onset_before, onset_after = (
        _onset(row, side, along, unit) for row, side in zip(rows, SIDES, strict=True)
    )
    sides = [row for row in rows if row is not None]
    if len(sides) < len(SIDES):
        none = [_none_to(table, side, along, unit) for side in SIDES]
        return [f"First onset before: {onset_before or none[0]}; after: {onset_after or none[1]}."]
    ends, errors = (
        [float(row[f"{name}_{side}"]) for row, side in zip(sides, SIDES, strict=True)]
        for name in ("onset", "onset_error")
    )
    difference, error = ends[1] - ends[0], sum(errors)
    if not math.isfinite(difference + error):  # bounds, and what no solved point is near to
        return [f"The first onset is {onset_before} before and {onset_after} after."]
    if abs(difference) <= error:
        return [
            f"The first onset stays within its error: {onset_before} before, {onset_after} after."
        ]
    way = "up" if difference > 0 else "down"
    return [f"The first onset moves {way}: {onset_before} before, {onset_after} after."]


def _onset(row: pd.Series | None, side: str, along: str, unit: str) -> str:
    """Text of a mode's onset before or after; empty where there is none."""
    if row is None:
        return ""
    kind, mode = str(row[f"onset_kind_{side}"]), _mode(row.to_dict(), side)
    if kind == BELOW_RANGE:
        return f"below the least {along} ({mode})"
    about = ABOUT.get(INEXACT.get(kind, ""), "{}")
    return f"{along} {about.format(amount(float(row[f'onset_{side}']), unit))} ({mode})"


def _growth(table: pd.DataFrame) -> list[str]:
    """Sentence on how the change alters the fastest growth."""
    fastest = [table[f"growth_rate_{side}"].max() for side in SIDES]
    if not len(table) or any(rate != rate for rate in fastest):
        return []
    errors = [
        float(table[f"growth_rate_error_{side}"][table[f"growth_rate_{side}"] == rate].max())
        for side, rate in zip(SIDES, fastest, strict=True)
    ]
    texts = [in_digits(rate, 1) for rate in fastest]
    if abs(fastest[1] - fastest[0]) <= sum(errors):
        return [f"The fastest growth stays within its error, at {texts[1]} 1/s."]
    way = "rises" if fastest[1] > fastest[0] else "falls"
    return [f"The fastest growth {way} from {texts[0]} to {texts[1]} 1/s."]


def _counts(table: pd.DataFrame) -> list[str]:
    """Sentences on numbers of unstable modes and points, and on modes that one side alone has."""
    facts = table.attrs
    if not len(table):
        points = plural(facts["points"], "point")
        return [f"No mode is unstable, neither before nor after, at any of the {points} of both."]
    facts_before, facts_after = (facts[side] for side in SIDES)
    n_modes = [int((table[f"mode_{side}"] != "").sum()) for side in SIDES]
    modes = " and ".join(
        f"{plural(n, 'mode')} {side}" for n, side in zip(n_modes, SIDES, strict=True)
    )
    texts = [
        f"Unstable: {modes}, at {facts_before['unstable']} and {facts_after['unstable']} of the "
        f"{plural(facts['points'], 'point')} of both."
    ]
    unpaired = _unpaired(table)
    for side in SIDES:
        alone = table[_alone(table, side)]
        named = [_mode(row, side) for row in alone[:MOST_NAMED].to_dict("records")]
        more = len(alone) - len(named)
        rest = f" and {plural(more, 'other')}" if more else ""
        only = f"Without a partner {side}" if unpaired else f"Only {side}"
        texts += [f"{only}: {', '.join(named)}{rest}."] if named else []
    if unpaired:
        texts += [
            "A mode whose frequency changes by more than "
            f"{100 * REL_TOLERANCE:g} % may be without a partner on both sides."
        ]
    return texts


def _alone(table: pd.DataFrame, side: str) -> np.ndarray:
    """Mask of the rows with modes that have no partner on the other side."""
    other = SIDES[1 - SIDES.index(side)]
    return (table[f"mode_{other}"] == "").to_numpy(bool)


def _unpaired(table: pd.DataFrame) -> bool:
    """Whether both sides have modes without a partner: two may be one that has moved far."""
    return all(_alone(table, side).any() for side in SIDES)


def _doubts(facts: Mapping[Hashable, Any]) -> list[str]:
    """Sentences on points where it is uncertain or not known what grows."""
    texts = []
    for what, text in (("uncertain", "Stability is uncertain at"), ("failed", "Failed:")):
        counts = " and ".join(f"{plural(facts[side][what], 'point')} {side}" for side in SIDES)
        texts += [f"{text} {counts}."] if any(facts[side][what] for side in SIDES) else []
    return texts


def _none_to(table: pd.DataFrame, side: str, along: str, unit: str) -> str:
    """Text that one side has no known onset, with the value up to which that is certain."""
    facts = table.attrs[side]
    sure = not any(facts[doubt] for doubt in ("unstable", "uncertain", "failed", "knots"))
    return f"none up to {along} {amount(facts['top'], unit)}" if sure else "none known"


def _outside(before: Results, after: Results) -> str:
    """Text on growth outside the band, to which a mode of the band may have moved."""
    texts = (
        (side, grows_outside(results.manifest, results.units))
        for side, results in zip(SIDES, (before, after), strict=True)
    )
    return "".join(f" {side.capitalize()}:{text}" for side, text in texts if text)


def _mode(row: Row, side: str) -> str:
    """Text of a mode's name and frequency before or after; empty where it is not unstable."""
    name, hz = row[f"mode_{side}"], row[f"frequency_{side}_hz"]
    return f"{name} at {in_digits(hz)} Hz" if hz == hz else str(name)


def _cells(row: Row, facts: Mapping[Hashable, Any], unpaired: bool) -> list[str]:
    """Cells of a row of the table on screen, for a mode before and after a change."""
    rates = [row[f"growth_rate_{side}"] for side in SIDES]
    unknown = {side for side in SIDES if unpaired and not row[f"mode_{side}"]}
    shares = [
        "-" if side in unknown else f"{100 * row[f'unstable_points_{side}'] / facts['points']:.0f}"
        for side in SIDES
    ]
    onsets = ["-" if side in unknown else _onset_cell(row, side, facts[side]) for side in SIDES]
    return [
        *(_mode(row, side).replace(" at ", " ") or "-" for side in SIDES),
        *([" -> ".join(onsets)] if facts["along"] else []),
        " -> ".join(in_digits(rate, 1) if rate == rate else "-" for rate in rates),
        " -> ".join(shares),
    ]


def _onset_cell(row: Row, side: str, facts: Mapping[str, Any]) -> str:
    """Text of the onset of a mode on one side of the comparison, or why there is none."""
    kind, onset = str(row[f"onset_kind_{side}"]), row[f"onset_{side}"]
    if kind == BELOW_RANGE:
        return BELOW_RANGE
    if onset == onset:
        return f"{INEXACT.get(kind, '')}{onset:.4g}"
    doubt = facts["uncertain"] or facts["failed"] or facts["knots"]
    is_stable = not row[f"mode_{side}"] and not doubt
    return f"none up to {facts['top']:g}" if is_stable else "-"
