"""Answers a study of complex modes in sentences: what is unstable, and from where on."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.kinds.complex_modes.design_lines import (
    MOST_MODES,
    DesignLine,
    Row,
    by_mode,
    design_text,
    extremes_in_words,
    first_onset,
    growth_in_words,
    modes_of_several_numbers,
    onsets_in_words,
    quiet_in_words,
)
from squealstudy.kinds.complex_modes.onset_table import BELOW, first_onsets
from squealstudy.kinds.complex_modes.onset_words import (
    alike_together,
    last_at,
    onset_in_words,
)
from squealstudy.kinds.complex_modes.outside_text import grows_outside
from squealstudy.kinds.complex_modes.random_screen import random_answer
from squealstudy.screen import Rows
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.mode_ranking import (
    OVERDAMPED_GROUP,
    frequency_text,
    group_kind,
    parameter_columns,
)
from squealstudy.tables.stability import BELOW_RANGE
from squealstudy.wording import all_of, amount, band_text, in_digits, plural, track_number

LOADS = {"pressure", "normal_force"}  # parameters that press the contact
OPEN, LARGEST_PRESSURE = "open_share", "contact_pressure_max"  # columns of points
MOST_TOLD_DESIGNS = 3  # most designs that the answer tells, each with its modes
LEAST_CONTACT_CHANGE = 0.1  # percent; smaller changes are not told

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables


def how_many(results: ResultTables, table: pd.DataFrame, onsets: str) -> str:
    """How many modes are unstable, in which band, and where: `onsets_in_words`."""
    tracked = table[(table["kind"] == group_kind(1)).to_numpy(bool)]
    named = int(tracked.drop_duplicates("family")["family_modes"].sum())
    n_real = int((table["kind"] == group_kind(OVERDAMPED_GROUP)).sum())  # grow without oscillation
    others, points = len(table) - len(tracked) - n_real, results.points
    most = int(points["n_modes"].max()) if "n_modes" in points else named
    first = plural(named, "mode") if named else ""
    if named > most:  # tracks of designs that nothing joins, or modes that pass through the band
        first = f"{named} tracks of modes, at most {most} at one point,"
    groups = plural(others, "group of modes", "groups of modes") if others else ""
    text = all_of([part for part in (first, groups, "real roots" * bool(n_real)) if part])
    text += f" {'is' if named + others == 1 and not n_real else 'are'} unstable "
    text += band_text(results.fact("band_hz"))
    return text + (f": {onsets}" if onsets else "")


def answer(
    results: ResultTables, table: pd.DataFrame, lines: list[DesignLine]
) -> list[RenderableType]:
    """Answer in sentences; empty where the ranking alone says it."""
    if results.design in RANDOM_DESIGNS and len(table):
        outside = grows_outside(results.manifest, results.units)
        return [*(f"{text}{outside}" for text in random_answer(results)), ""]
    if len(table) and results.boundary is not None:
        outside = grows_outside(results.manifest, results.units)
        return [f"{how_many(results, table, '')}: {_over_the_map(results, table)}.{outside}", ""]
    onsets = onsets_in_words(results, table) if len(table) else ""
    if not onsets:
        return []
    unstable = what_is_unstable(results, table, lines, onsets)
    text = extremes_in_words(results, lines) + quiet_in_words(results, lines)
    text += "" if lines else _many_in_words(results)
    text += _growth_in_words(results, lines) or growth_in_words(results, lines)
    text += grows_outside(results.manifest, results.units)
    if "\n" in unstable:  # a line for each design
        text = text.replace(" ", "\n", 1)
    return [f"{unstable}.{text}", ""]


def _many_in_words(results: ResultTables) -> str:
    """Sentences on many designs that are unstable at the least value, and on what is stable.

    Empty where some design is not, of which the table of onsets tells; and of one design.
    """
    along, points = results.along or "", results.points
    if "onsets" not in results.tables:
        return ""
    first = first_onsets(results, along)["onset"]
    if not len(first) or not (first == BELOW).to_numpy(bool).all():
        return ""
    is_solved = (points["status"] == "ok").to_numpy(bool)
    of_solved = points[is_solved]
    n_quiet = int((of_solved["n_unstable_high"] == 0).sum())
    names = [str(name) for name in first.index.names]
    each = f"values of {names[0]}" if len(names) == 1 else "designs"
    text = f" At the least {along} some mode is unstable at each of the {len(first)} {each}."
    if n_quiet:
        return (
            f"{text} No mode is unstable at {n_quiet} of {plural(len(of_solved), 'solved point')}."
        )
    if (of_solved["n_unstable"] > 0).all():
        text += " Some mode is unstable at every solved point."
    return text


def _over_the_map(results: ResultTables, table: pd.DataFrame) -> str:
    """First onset, most widespread mode and fastest growth on a boundary map."""
    wide = table.iloc[int(table["family_points"].to_numpy().argmax())]
    fast = table.iloc[int(table["max_growth_rate"].to_numpy().argmax())]
    along = results.along or ""
    row = first_onset(table)
    unit = results.units.get(along, "")
    first = onset_in_words(row, along, unit, None).strip() if row else ""
    share = in_digits(100 * wide["family_points"] / wide["points"])
    fastest = f"{row_text(fast)} fastest, by {in_digits(fast['max_growth_rate'], 1)} 1/s"
    text = f"{first}{', ' * bool(first)}{row_text(wide)} most widespread ({share} % of the nodes)"
    return f"{text}, {fastest}"


def what_is_unstable(
    results: ResultTables, table: pd.DataFrame, lines: list[DesignLine], onsets: str | None = None
) -> str:
    """Which modes are unstable, in a line for each design where designs are few; no full stop.

    `onsets` is `onsets_in_words`, made here by default.
    """
    by_design = _of_each_design(results, table, lines)
    if by_design:
        return by_design
    onsets = onsets_in_words(results, table) if onsets is None else onsets
    return f"{f'Over all {len(lines)} designs ' if lines else ''}{how_many(results, table, onsets)}"


def _of_each_design(results: ResultTables, table: pd.DataFrame, lines: list[DesignLine]) -> str:
    """Unstable modes of each of few designs, in the order of their onsets.

    Empty for more than MOST_TOLD_DESIGNS designs, or where modes without a number are unstable too.
    """
    along, onsets = results.along or "", results.onsets
    if not 2 <= len(lines) <= MOST_TOLD_DESIGNS or (table["kind"] != group_kind(1)).any():
        return ""
    families, texts = modes_of_several_numbers(table), []
    at_once = table.set_index("track")[["family", "family_modes"]]
    for line in lines:
        of_design = [onsets[n].to_numpy() == v for n, v in line.design.items()]
        on_line = onsets[np.logical_and.reduce(of_design)]
        rows = list(by_mode(line.modes, families).items())
        rows.sort(key=lambda item: _first_value(item[1]))
        modes_in_words: list[str] = []
        n_named: Counter[int] = Counter()  # by family
        for track, row in rows:
            family, most = map(int, at_once.loc[track])
            n_named[family] += 1
            if n_named[family] <= most:  # of tracks that stand for n modes, n are named
                name = str(row.get("name", track_number(track))).replace(", ", "/")
                hz, unit = frequency_text(row), results.units.get(along, "")
                modes_in_words.append(
                    f"{name}{f' at {hz} Hz' if hz else ''}"
                    f"{onset_in_words(row, along, unit, on_line)}"
                    f"{last_at(row, on_line if '/' not in name else None, unit)}"
                )
        n_told = len(modes_in_words) if len(modes_in_words) == MOST_MODES + 1 else MOST_MODES
        named = ", ".join(alike_together(modes_in_words[:n_told], along))
        more = (
            f" and {plural(len(modes_in_words) - n_told, 'other')}"
            if len(modes_in_words) > n_told
            else ""
        )
        nothing = "nothing" if line.sure and line.solved else "nothing that is known"
        texts.append(f"with {design_text(results, line)} {named or nothing}{more}")
    each = ";\n".join(texts)  # a line each on a screen
    return f"Unstable {band_text(results.fact('band_hz'))}:\n{each}"


def _first_value(row: Row) -> float:
    """Sort key: where a mode turns unstable; inf where that is not known."""
    if row["threshold_kind"] == BELOW_RANGE:
        return -math.inf
    onset = float(row["threshold"])
    return math.inf if math.isnan(onset) else onset


def row_text(row: pd.Series) -> str:
    """Name and frequency of the mode in a row of the ranking."""
    values = row.to_dict()
    hz = frequency_text(values)
    name = track_number(values["track"]) if values["track"] > 0 else str(values["kind"])
    return f"{name} at {hz} Hz" if hz else name


def _growth_in_words(results: ResultTables, lines: list[DesignLine]) -> str:
    """A sentence on where the fastest mode grows least and most.

    Empty unless some mode is unstable at every solved point of every design.
    """
    if not lines or any(line.kind != BELOW_RANGE or line.unstable < line.solved for line in lines):
        return ""
    fastest = results.table("modes").groupby("point_id")["growth_rate"].max()
    points = results.points[results.points["point_id"].isin(fastest.index).to_numpy(bool)]
    growth = points["point_id"].map(fastest).to_numpy(float)
    texts = []
    for row in (growth.argmin(), growth.argmax()):
        values = [
            f"{name} {amount(float(points[name].iloc[row]), results.units.get(name, ''))}"
            for name in parameter_columns(points, varied=True)
        ]
        texts.append(f"{in_digits(growth[row], 1)} 1/s at {', '.join(values)}")
    every = "every point" if all(line.sure for line in lines) else "every solved point"
    return f" Some mode grows at {every}, the fastest by {texts[0]} to {texts[1]}."


def contact_rows(results: ResultTables, lines: list[DesignLine]) -> Rows:
    """Row on the open share of the contact, and how designs change it; none where all is closed."""
    points, along = results.points, results.along or ""
    if not lines or not {OPEN, LARGEST_PRESSURE} <= set(points.columns):
        return []
    solved = points[(points["status"] == "ok").to_numpy(bool)]
    at_same = solved.groupby(along)[[OPEN, LARGEST_PRESSURE]]
    low, high = at_same.min(), at_same.max()
    opened = 100 * float((high[OPEN] - low[OPEN]).max())
    least, most = low[LARGEST_PRESSURE], high[LARGEST_PRESSURE]
    lost = bool(((least == 0.0) & (most > 0.0)).any())  # a design that nothing presses
    pressed = 100 * float((most / least.where(least > 0.0) - 1.0).max())
    if not high[OPEN].max() > 0.0 or not np.fmax(opened, pressed) >= LEAST_CONTACT_CHANGE:
        return []
    ends = [in_digits(100 * float(end), 1) for end in (low[OPEN].min(), high[OPEN].max())]
    text = (
        f"{' to '.join(dict.fromkeys(ends))} % of its area is open in steady sliding; between "
        f"designs at the same {along} that differs by up to {in_digits(opened, 1)} % of the area"
    )
    if not LOADS & set(lines[0].design):  # else it differs because the load does
        by = f"by up to {in_digits(pressed, 1)} %"
        text += f", and the largest pressure {'from none to some' if lost else by}"
    return [("contact", text)]
