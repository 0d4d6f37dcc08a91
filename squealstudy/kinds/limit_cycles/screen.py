"""Screens of studies of limit cycles: verdicts first, then levels."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Mapping
from itertools import zip_longest
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.cycles.verdicts import NOT_FOLLOWED
from squealstudy.engine.kind_screen import KindScreen
from squealstudy.errors import ResultsError
from squealstudy.kinds.limit_cycles.branch_words import border_rows, branch_rows
from squealstudy.kinds.limit_cycles.kick_words import untold_kicks
from squealstudy.kinds.limit_cycles.larger import larger_in_words
from squealstudy.screen import Rows, command_text, grid, notes
from squealstudy.wording import (
    FAILED,
    IF_KICKED,
    NO_CYCLE,
    SQUEALS,
    TORQUE,
    VERDICT_LETTERS,
    all_of,
    band_text,
    error_percent,
    figure,
    in_column,
    in_digits,
    motion_frequency,
    plural,
    small_percent,
    with_unit,
)

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

# characters of a reason that is no longer than the note that would stand for it
MAX_SHORT_REASON_CHARACTERS = 12
MAX_POINTS_WITHOUT_MAP = 8  # most design points that are shown without a map of letters
MOST_POINTS = 24  # design points listed; all of them are in the tables
MEASURED = re.compile(r"(?<![\w.])(?<!mode )(?<!modes )\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
# loudest harmonic of a motion up to which the answer tells the frequency of its period: beyond it,
# two motions that beat repeat together after many cycles, which nobody hears
MOST_HARMONICS_TOLD = 12
MOST_FOLLOWED = 3  # followed modes that are told
SAME_FREQUENCY = 0.02  # frequencies with a smaller relative distance are told as one
MOST_COLUMNS = 2  # parameters with a column of their own


class LimitCyclesScreen(KindScreen):
    """Whether each design squeals, squeals if kicked, or no cycle of it was found."""

    tables = ("points", "verdicts", "cycles", "branches", "borders", "curves", "velocities")
    found = ("branch", "borders")
    sure = ("cycles", "runs in time")

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """Raise ResultsError: such a study has verdicts, no ranking."""
        raise ResultsError(
            f"{results.directory}: a study of limit cycles has verdicts, no ranking of modes"
        )

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """A line for each design point, or a map of letters alone where there are too many."""
        points, units = results.points, results.units
        varied = [p for p in results.parameters if len(set(points[p])) > 1]
        shown_units = {p: units.get(p, "") for p in varied if len(varied) <= MOST_COLUMNS}
        listed = points.head(MOST_POINTS)
        unit = units.get(TORQUE, "N m")
        force = "force of friction" if unit == "N" else "torque"
        kicks = bool(points["threshold_velocity"].notna().any())
        columns = ["growth 1/s", f"RMS {unit}", "+- %", "Hz", *["kick m/s", "kick %"] * kicks]
        words = points["verdict"].where(points["status"] == "ok", FAILED).tolist()
        letters = (
            self.mapped(results, words, VERDICT_LETTERS)
            if len(points) > MAX_POINTS_WITHOUT_MAP
            else []
        )
        if letters and len(points) > MOST_POINTS:
            listed = listed[:0]
        reasons_listed = [_reason(row) for row in listed.to_dict("records")]
        reasons = merged_reasons(reasons_listed)
        why = footnotes([reasons[reason] for reason in reasons_listed])
        shown = grid(
            *(f"value:{with_unit(p, units)}" for p in shown_units),
            "word:verdict",
            *(f"value:{title}" for title in columns),
            "text:because",
            rows=(
                [*_cells(row, shown_units, kicks), why[reasons[_reason(row)]]]
                for row in listed.to_dict("records")
            ),
        )
        more = len(points) - len(listed)
        legend = notes(
            *(f"{letter}: {reason}" for reason, letter in why.items() if letter != reason),
            f"{more} more in the points table" if more else "",
            "growth: of the mode that grows fastest or decays slowest, of those followed and those "
            "unstable",
            f"RMS: of the {force}, about its mean; +-: its error; Hz: its frequency (x2: loudest "
            "at twice that; ~: loudest line, where no period is known)",
            "all of the loudest stable cycle that was found, or of a run in time that lasts",
            "kick m/s: speed of a contact point in the least kick along the unstable cycle that "
            "starts squeal; kicks of other shapes may need less; kick %: as share of the speed in "
            "the stable cycle"
            if kicks
            else "",
            "no cycle found: steady sliding is stable, and what was searched leads to no cycle"
            f"{_served(results)}; others are not excluded: a kick may still start squeal"
            if (points["verdict"] == NO_CYCLE).any()
            else "",
        )
        if not len(listed):
            return [
                self.verdict(results),
                "",
                *letters,
                notes("levels and reasons: the points table"),
            ]
        return [self.verdict(results), "", *letters, *([""] if letters else []), shown, legend]

    def verdict(self, results: ResultTables) -> str:
        """The number of designs of each verdict, with levels, frequencies and kicks."""
        points = results.points
        solved = points["status"] == "ok"
        counts_text = self.counted(results, points["verdict"].where(solved, FAILED).tolist())
        band = band_text(results.fact("band_hz"))
        counted = f"{plural(len(points), 'design')}, modes {band}: {counts_text}."
        levels = levels_in_words(points, results.units.get(TORQUE, "N m"))
        if levels:
            varied = [p for p in results.parameters if len(set(points[p])) > 1]
            unit = results.units.get(TORQUE, "N m")
            levels += larger_in_words(
                points, results.table("cycles"), results.table("branches"), varied, unit
            )
        if results.manifest.get("limit_cycles", {}).get("kick_along_mode"):
            levels += untold_kicks(results.table("verdicts"))
        return f"{counted}{levels}{self.followed_in_words(results)}"

    def followed_in_words(self, results: ResultTables) -> str:
        """Sentence on modes that squeal but were not followed, and on verdicts of followed ones.

        Empty where all modes that squeal were followed.
        """
        if not (results.points["verdict"] == SQUEALS).any():
            return ""
        verdicts = results.table("verdicts")
        is_followed = _is_followed(verdicts)
        alone = verdicts[~is_followed & (verdicts["verdict"] == SQUEALS).to_numpy(bool)]
        if not len(alone):
            return ""
        count = f"{alone['point_id'].nunique()} of {plural(len(results.points), 'design')}"
        text = f" At {count} it squeals by modes that were not followed, near "
        text += f"{_frequencies_text(alone)} Hz"
        followed_texts = []
        for number, rows in list(verdicts[is_followed].groupby("mode"))[:MOST_FOLLOWED]:
            of_point = dict(zip(rows["point_id"], rows["verdict"], strict=True))
            words = [of_point.get(point, "") for point in results.points["point_id"]]
            counts = Counter(filter(None, words)).most_common()
            became = ", ".join(f"{str(word).replace('_', ' ')} at {n}" for word, n in counts)
            if all(words):
                became = self.counted(results, words)
            followed_texts.append(f"mode {number} near {_frequencies_text(rows)} Hz: {became}")
        if followed_texts:
            verb = "was" if len(followed_texts) == 1 else "were"
            text += f"; followed {verb} {'; '.join(followed_texts)}"
        return f"{text}."

    def next_steps(self, results: ResultTables) -> Rows:
        """The page to explore; where a design squeals, also the search for a change."""
        squeals = results.points["verdict"].isin((SQUEALS, IF_KICKED)).any()
        change = [("least change", 'kind = "design" searches the least that silences it')]
        return [
            ("click through", command_text("explore", results.directory)),
            *(change if squeals else []),
        ]

    def facts(self, results: ResultTables) -> Rows:
        """Followed modes, cycles with the largest error of a level, branches and borders."""
        cycles, verdicts = results.table("cycles"), results.table("verdicts")
        distinct_cycles = cycles[(cycles["same_as"] == "").to_numpy(bool)]
        followed = verdicts[_is_followed(verdicts)]
        counts = followed["verdict"].value_counts()
        text = ", ".join(f"{n} {str(name).replace('_', ' ')}" for name, n in counts.items())
        rows = [("modes", f"followed, over all designs: {text}" if text else "none followed")]
        if len(distinct_cycles):
            bad = int((distinct_cycles["status"] != "ok").sum())
            error = distinct_cycles.loc[distinct_cycles["status"] == "ok", "level_error"].max()
            count_text = plural(len(distinct_cycles), "cycle")
            count_text += (
                f"; the largest error of a level is {error_percent(error)}"
                if bad < len(distinct_cycles)
                else ""
            )
            if bad:
                count_text += f"; {bad} too inexact to use"
            rows.append(("cycles", count_text))
        rows += _levels_of_runs(results)
        rows += branch_rows(results)
        return [*rows, *border_rows(results.table("borders"))]


def _levels_of_runs(results: ResultTables) -> Rows:
    """The largest error of the levels that runs in time decided; nothing without any."""
    points, cycles = results.points, results.table("cycles")
    if "torque_rms" not in points:
        return []
    levels = points[(points["torque_rms"] > 0).fillna(False).to_numpy(bool)]
    of_cycles = set(zip(cycles["point_id"], cycles["torque_rms"], strict=True))
    named = zip(levels["point_id"], levels["torque_rms"], strict=True)
    of_runs = levels[[name not in of_cycles for name in named]]
    if not len(of_runs):
        return []
    n_without = int(of_runs["level_error"].isna().sum())
    text = plural(len(of_runs), "level")
    if n_without < len(of_runs):
        text += f"; the largest error is {error_percent(of_runs['level_error'].max())}"
    if n_without:
        text += f"; the error of {n_without} is not known"
    return [("runs in time", text)]


def _is_followed(verdicts: pd.DataFrame) -> np.ndarray:
    """Whether the curve of each mode was followed, (n,) bool; all true in older results."""
    ends = verdicts.get("curve_end", pd.Series("", index=verdicts.index))
    return (ends != NOT_FOLLOWED).to_numpy(bool)


def _frequencies_text(rows: pd.DataFrame) -> str:
    """Frequencies [Hz] of modes, near ones told once: ``861, 3793 and 6306``."""
    distinct: list[float] = []
    for hz in sorted(rows["frequency_hz"].dropna()):
        if not distinct or hz > (1.0 + SAME_FREQUENCY) * distinct[-1]:
            distinct.append(float(hz))
    return all_of([in_digits(hz) for hz in distinct]) or "?"


def _served(results: ResultTables) -> str:
    """Number of modes whose curve is that of a design nearby, in words; empty for none."""
    named = results.table("verdicts").get("curve_of")  # older results have none
    served = 0 if named is None else int((named != "").sum())
    return (
        f" ({plural(served, 'mode')} by the curve of a design nearby: `curve_of`)" if served else ""
    )


def levels_in_words(points: pd.DataFrame, unit: str) -> str:
    """Sentences on levels of the loudest motions, and on kicks that start them; '' for none."""
    if "torque_rms" not in points or not (points["torque_rms"] > 0).any():
        return ""
    loud = points[(points["torque_rms"] > 0).fillna(False).to_numpy(bool)]
    what = "torque" if unit == "N m" else "force of friction"
    line = loud.get("torque_line_hz", pd.Series(math.nan, loud.index))
    is_slow = line > MOST_HARMONICS_TOLD * loud["frequency_hz"]
    hz = loud["frequency_hz"].mask(is_slow).fillna(line).dropna()
    frequency_text = f", at {_ends(hz, 1)} Hz" if len(hz) else ""
    text = (
        f" RMS of the {what} in what was seen to last: {_ends(loud['torque_rms'], 1)} {unit}"
        f"{frequency_text}."
    )
    kicked = points[points["threshold_velocity"].notna().to_numpy(bool)]
    if not len(kicked):
        return text
    speeds = f"{_ends(kicked['threshold_velocity'], 2)} m/s at a contact point"
    share = f"{_ends(100 * kicked['threshold_share'])} % of the speed in the cycle"
    n_kicked = int((points["verdict"] == IF_KICKED).sum())
    where = "Where it squeals if kicked"
    if len(kicked) < n_kicked:  # of a cycle that was continued to a design no threshold is known
        where = f"At {len(kicked)} of the {n_kicked} that squeal if kicked"
    return (
        f"{text} {where}, a kick along the unstable cycle by {speeds} starts it ({share}); "
        "kicks of other shapes may need less."
    )


def _ends(values: pd.Series, decimals: int = 0) -> str:
    """``19 to 92``; a single number where both are the same."""
    ends = dict.fromkeys(in_digits(float(v), decimals) for v in (values.min(), values.max()))
    return " to ".join(ends)


def _reason(row: Mapping[Hashable, Any]) -> str:
    """Why a design point has its verdict, or failed."""
    return str(row["reason"] if row["status"] == "ok" else row["message"])


def merged_reasons(reasons: list[str]) -> dict[str, str]:
    """Text for each reason: reasons that differ only by numbers share one, with ranges.

    Numbers of modes are kept, because two mode numbers are no range.
    """
    alike: dict[str, list[str]] = {}
    for reason in dict.fromkeys(reasons):
        alike.setdefault(MEASURED.sub("#", reason), []).append(reason)
    merged: dict[str, str] = {}
    for same in alike.values():
        text_parts = MEASURED.split(same[0])
        numbers = zip(*(MEASURED.findall(reason) for reason in same), strict=True)
        ranges = [
            " to ".join(dict.fromkeys((min(n, key=float), max(n, key=float)))) for n in numbers
        ]
        text = "".join(part + of for part, of in zip_longest(text_parts, ranges, fillvalue=""))
        merged |= dict.fromkeys(same, text)
    return merged


def footnotes(reasons: list[str]) -> dict[str, str]:
    """Mark in the table for each reason: a letter, where a long reason would be repeated."""
    distinct_reasons = list(dict.fromkeys(reasons))
    repeated = len(distinct_reasons) < len([r for r in reasons if r]) and len(
        distinct_reasons
    ) <= len(ascii_lowercase)
    long = any(len(reason) > MAX_SHORT_REASON_CHARACTERS for reason in distinct_reasons)
    return dict(
        zip(
            distinct_reasons,
            ascii_lowercase if repeated and long else distinct_reasons,
            strict=False,
        )
    )


def _cells(row: dict[Hashable, Any], units: Mapping[str, str], kicks: bool) -> list[str]:
    """Cells of a row of the table of designs on screen."""
    design_cells = [in_column(row[p], unit) for p, unit in units.items()]
    if row["status"] != "ok":
        return [*design_cells, f"failed: {row['status']}", *[""] * (6 if kicks else 4)]
    hz = motion_frequency(row["frequency_hz"], row.get("torque_line_hz", math.nan), 1)
    threshold = [figure(row["threshold_velocity"]), figure(100 * row["threshold_share"], ".0f")]
    return [
        *design_cells,
        str(row["verdict"]).replace("_", " "),
        figure(row["max_growth_rate"]),
        figure(row["torque_rms"]),
        small_percent(row["level_error"]),
        hz,
        *threshold * kicks,
    ]


SCREEN = LimitCyclesScreen()
