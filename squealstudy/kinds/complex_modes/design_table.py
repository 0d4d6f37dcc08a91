"""Tables of few designs: one with the first onset of each, one with the onset of each mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.kinds.complex_modes.design_lines import (
    BELOW_TEXT,
    DesignLine,
    Row,
    by_mode,
    modes_of_several_numbers,
)
from squealstudy.kinds.complex_modes.onset_words import onset_and_end
from squealstudy.kinds.complex_modes.silent_modes import silent_tracks
from squealstudy.screen import grid, notes
from squealstudy.tables.mode_ranking import frequency_text, group_kind
from squealstudy.tables.stability import BELOW_RANGE, INEXACT
from squealstudy.wording import amount, in_digits, plural, track_number

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MOST_ONSETS = 4  # modes with a column of onsets
BOUND_NOTE = ", <= if the point before is unstable"
NONE = "none"  # in place of the onset of a mode that is stable at every point of a design


def design_table(
    results: ResultTables, lines: list[DesignLine], table: pd.DataFrame
) -> list[RenderableType]:
    """Tables with a row for each design, and their legends.

    The first has the first onset and the fastest growth, the second the onset of each mode. `table`
    is the ranking over all designs, which tells which tracks are one mode.
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
    nominal = results.nominal_others(along)
    as_it_is = ""
    if set(names) <= set(nominal):
        as_it_is = ", ".join(amount(nominal[n], units.get(n, "")) for n in names)
    tables: Mapping[str, list[str]] = results.manifest.get("tables", {})
    followers = [name for name, over in tables.items() if set(over) & set(names)]
    follow = "follows" if len(followers) == 1 else "follow"
    with_it = f", which {' and '.join(followers)} {follow}" if followers else ""
    unit = units.get(along, "")
    by_modes = _onsets_by_mode(
        designs,
        lines,
        modes_of_several_numbers(table),
        unit,
        silent_tracks(results, lines, table),
        f"{along} {most}",
    )
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


def _onsets_by_mode(
    designs: list[str],
    lines: list[DesignLine],
    families: Mapping[int, list[int]] | None = None,
    unit: str = "",
    silent: Sequence[set[int]] = (),
    largest: str = "",
) -> list[RenderableType]:
    """Table of the onset of each mode at each design; none for a single unstable mode.

    A change of design may move the onset of a mode and leave the first onset of all as it is. Where
    modes are many the fastest has a column, then those come first that some design silences.
    `silent` are the tracks of `silent_tracks` for each design, and `largest` is the parameter's
    largest value, in words.
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
    onsets = [
        [
            NONE if row is None and track in silent_there else onset_and_end(row, unit)
            for track, row in zip(chosen, rows, strict=True)
        ]
        for rows, silent_there in zip(of_design, silent or [set()] * len(lines), strict=True)
    ]
    title, unknown = "onset of", "no onset is known of the mode, which may have another number"
    if not {text for texts in onsets for text in texts} - {"-", NONE, BELOW_TEXT}:  # no values
        title, unknown = "growth 1/s of", "no mode of this number grows"
        onsets = [[_growth_text(row) for row in rows] for rows in of_design]
    cells = " ".join(text for texts in onsets for text in texts)
    has_ends = " to " in cells
    shown = grid(
        f"text:{title}",
        *(f"{'text' if has_ends else 'value'}:{_mode_text(fastest[track])}" for track in chosen),
        rows=([design, *texts] for design, texts in zip(designs, onsets, strict=True)),
    )
    legend = []
    if any(NONE in texts for texts in onsets):
        legend += [f"{NONE}: at this design the mode is stable at every point, up to {largest}"]
    if any("-" in texts for texts in onsets):
        legend += [f"-: at this design {unknown}"]
    if has_ends:
        legend += [f"to: where the mode is stable again{BOUND_NOTE * (' to <= ' in cells)}"]
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
