"""Texts and tables for complex modes of random designs: probabilities and Sobol indices."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.errors import ResultsError
from squealstudy.screen import grid, notes
from squealstudy.study.sweeps import SOBOL_INDICES
from squealstudy.tables.mode_ranking import settings_of
from squealstudy.tables.robustness import GROWTH, robust_table
from squealstudy.tables.sobol import base_rows, sobol_table
from squealstudy.wording import (
    all_of,
    band_text,
    in_digits,
    named_tracks,
    percent,
    plural,
    track_number,
)

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

# legend of the mark before a mode that tracking was not sure of
DOUBTFUL_NUMBER = (
    "~ before a mode: somewhere it was not sure which of two neighbouring modes has this number"
)
LEAST_SHOWN = 0.01  # the answer names parameters whose Sobol index may be at least this
MOST_NAMED = 3  # modes, and parameters, named in the answer
WHICH_PARAMETER = (
    f'[design] type = "{SOBOL_INDICES}" tells which parameter the scatter of growth comes from.'
)
Names = Mapping[int, tuple[str, bool]]
Row = dict[Hashable, Any]


def probabilities(
    table: pd.DataFrame,
    sampled: bool = False,
    names: Names | None = None,
    units: Mapping[str, str] | None = None,
    band_hz: Sequence[float] | None = None,
) -> list[RenderableType]:
    """The table of `tables.robustness` with its legend; its first row is of any mode.

    `sampled`: the points are the two independent samples of a design for Sobol indices. `names` are
    those of tracks (`Results.track_names`), `units` those of parameters, and `band_hz` is the band
    of the study.
    """
    titles = ("mode", "Hz", "known at", "unstable %", "interval %", "growth +- std")
    shown = grid(
        *titles,
        "worst 1/s",
        "text:worst at",
        rows=(_probability(row, units or {}) for row in table.to_dict("records")),
    )
    return [
        shown,
        notes(
            f"modes {band_text(band_hz)} count" if band_hz else "",
            *_robust_legend(table, sampled),
            *named_tracks(table["track"], names or {}),
        ),
    ]


def _probability(row: Row, units: Mapping[str, str]) -> list[str]:
    """Cells of a row on the probability that a mode, or any mode, is unstable."""
    low, high = row["unstable_points_low"], row["unstable_points_high"]
    n_certain = row["points"] - row["unknown_points"]
    bounds = f" ({percent(low / n_certain, high / n_certain)})" if low < high else ""
    return [
        _number(row) if row["quantity"] == "track" else str(row["quantity"]),
        _figure(row["frequency_hz"], 0, unknown=""),
        str(n_certain),
        f"{100 * row['probability']:.1f}{bounds}",
        percent(row["probability_low"], row["probability_high"]),
        f"{_figure(row['growth_mean'])} +- {_figure(row['growth_std'])}",
        _figure(row["max_growth_rate"]),
        ", ".join(settings_of(row["at"], units).values()),
    ]


def _number(row: Row) -> str:
    return f"{'~' if row['ambiguous'] else ''}{track_number(row['track'])}"


def _numbering(table: pd.DataFrame) -> list[str]:
    """Texts on tracks that are one mode, and on tracks that may be two modes."""
    rows = table[table["quantity"] == "track"].drop_duplicates("track")
    listed = [
        all_of([track_number(int(n)) for n in tracks.split(", ")])
        for tracks in rows["tracks"]
        if ", " in tracks
    ]
    texts = [f"{names} are one unstable mode, which changes its number" for names in listed]
    if rows["ambiguous"].any():
        texts.append(f"{DOUBTFUL_NUMBER}; its line may then be of both")
    return texts


def families_in_words(table: pd.DataFrame) -> list[str]:
    """Sentences on tracks of a ranking that are one mode, or modes that swap numbers."""
    sentences = []
    for _, family_tracks in table[(table["track"] > 0).to_numpy(bool)].groupby(
        "family", sort=False
    ):
        if len(family_tracks) > 1:
            first = family_tracks.iloc[0]
            n_modes = int(first["family_modes"])
            percentage = in_digits(100 * first["family_points"] / first["points"], 1)
            sentences.append(
                f"{all_of([track_number(n) for n in sorted(family_tracks['track'].tolist())])} "
                + (
                    "are one unstable mode, which changes its number between design points: it is "
                    f"unstable at {percentage} % of them"
                    if n_modes == 1
                    else f"stand for {n_modes} modes that swap numbers between design "
                    "points, so that a line may be of both: at least one is unstable at "
                    f"{percentage} % of them"
                )
            )
    return sentences


def random_answer(results: ResultTables) -> list[str]:
    """How probable instability is, of which modes, and what the scatter of growth comes from.

    One text; none where too many points failed to tell.
    """
    n, d = len(results.points), len(results.swept)
    of_indices = results.design == SOBOL_INDICES
    modes = results.rows("modes", GROWTH)
    try:
        drawn = base_rows(n, d) if of_indices else None
        table = robust_table(results.points, modes, drawn, onsets=results.onsets)
        first, *others = table.to_dict("records")
        texts = [_probability_text(first, others, results.fact("band_hz"))]
        if of_indices:
            points, swept = results.points, results.swept
            texts += _scatter(sobol_table(points, modes, swept, 0, onsets=results.onsets))
        elif d > 1:
            texts += [WHICH_PARAMETER]
    except ResultsError:
        return []
    return [" ".join(texts)]


def _probability_text(first: Row, others: Sequence[Row], band_hz: Sequence[float]) -> str:
    """The first row of `robust_table`, that of any mode, in words, with the most unstable modes."""
    n_points = first["points"] - first["unknown_points"]
    interval = percent(first["probability_low"], first["probability_high"])
    low, high = first["unstable_points_low"], first["unstable_points_high"]
    maybe = f", within their errors at {percent(low / n_points, high / n_points)} %"
    left_out = f", {first['failed_points']} not ok left out" if first["failed_points"] else ""
    named = [_mode_probability(row) for row in others if row["unstable_points"]][:MOST_NAMED]
    n_others = sum(row["unstable_points"] > 0 for row in others) - len(named)
    more = f" and {plural(n_others, 'other')}" if n_others > 0 else ""
    which = f": {', '.join(named)}{more}" if named else ""  # none is unstable at these points
    return (
        f"A mode {band_text(band_hz)} is unstable at {_unstable_percent(first)} % of "
        f"{plural(n_points, 'random design point')}{maybe if low < high else ''} (95 % interval "
        f"{interval} %{left_out}){which}. The fastest growth is "
        f"{_figure(first['max_growth_rate'])} 1/s."
    )


def _mode_probability(row: Row) -> str:
    if row["quantity"] != "track":
        return f"{row['quantity']} at {_unstable_percent(row)} %"
    names = "/".join(track_number(int(track)) for track in str(row["tracks"]).split(", "))
    return f"{names} near {_figure(row['frequency_hz'], 0)} Hz at {_unstable_percent(row)} %"


def _unstable_percent(row: Row) -> str:
    return in_digits(100 * row["probability"], 1)


def _scatter(table: pd.DataFrame) -> list[str]:
    """A sentence on the parameters with the largest total Sobol indices of the fastest growth."""
    rows = table[(table["quantity"] == "largest") & (table["total_high"] >= LEAST_SHOWN)]
    largest = rows.sort_values("total", ascending=False)[:MOST_NAMED].to_dict("records")
    listed = [
        f"{row['parameter']} {row['total']:.2f} ({row['total_low']:.2f} to {row['total_high']:.2f})"
        for row in largest
    ]
    text = f"Total Sobol indices of the growth of the fastest mode: {', '.join(listed)}."
    return [text] if listed else []


def _robust_legend(table: pd.DataFrame, sampled: bool) -> list[str]:
    """Texts on what the columns mean, and what is left out."""
    first = table.iloc[0]
    drawn = "points of the two independent samples" if sampled else "points"
    failed = int(first["failed_points"])
    counted = "all are ok"
    if failed:
        low, total = first["unstable_points"], first["points"] + failed
        bounds = percent(low / total, (low + failed) / total)
        counted = f"{failed} are not ok and count neither way: with them any is {bounds} %"
    texts = [
        f"of {first['points'] + failed} {drawn}, {counted}",
        "worst: of all solved points" if sampled else "",
        "interval: 95 % (Clopper-Pearson) for independent draws, wide for a Sobol sequence or "
        "Latin hypercube",
        "growth +- std: mean and scatter of the growth rate, 1/s, where the mode is in the band, "
        "stable or not; any: the fastest mode of each point; Hz: where the mode grows fastest",
    ]
    if (table["unstable_points_low"] < table["unstable_points_high"]).any():
        texts.append(
            "unstable % in brackets: from points where the mode is unstable whatever its error to "
            "points where it may be"
        )
    if (table["quantity"] == "divergence").any():
        texts.append("divergence: a real root, where one grows, without oscillation; part of any")
    if table["unknown_points"].any():
        texts.append(
            "known at: elsewhere the mode may stand under another number; unstable % is of the "
            "points where it is known"
        )
    absent_tracks = table[(table["quantity"] == "track") & (table["absent_points"] > 0)]
    if len(absent_tracks):
        counts = zip(absent_tracks["absent_points"], absent_tracks["track"], strict=True)
        listed = ", ".join(f"{n} of {track_number(track)}" for n, track in counts)
        texts.append(
            f"points where a mode has left the band or does not oscillate, not unstable: {listed}"
        )
    texts += _numbering(table)
    names = ", ".join(settings_of(first["at"], {}))
    return [*texts, f"worst at: {names}" if names else ""]


def _figure(value: float, digits: int = 1, unknown: str = "-") -> str:
    return in_digits(value, digits) if value == value else unknown


def indices(table: pd.DataFrame, names: Names | None = None) -> list[RenderableType]:
    """The table of `tables.sobol` with its legend; `names` are those of `probabilities`."""
    with_indices = table.dropna(subset=["first", "total"])
    first = ~with_indices["track"].duplicated()
    pairs = zip(with_indices.to_dict("records"), first, strict=True)
    shown = grid(
        *("growth of", "Hz", "word:parameter", "first", "interval", "total", "interval"),
        rows=(_indices(row, new) for row, new in pairs),
    )
    quantities = table.drop_duplicates("track").set_index("track")
    dropped = quantities["dropped_groups"]
    dropped = dropped[dropped.index.isin(with_indices["track"]) & (dropped > 0).to_numpy()]
    numbers = [track_number(t) if t else "the fastest" for t in dropped.index.tolist()]
    listed = ", ".join(f"{n} of {number}" for n, number in zip(dropped, numbers, strict=True))
    rare = ", ".join(
        map(track_number, np.setdiff1d(table["track"], with_indices["track"]).tolist())
    )
    legend = notes(
        "Sobol indices of the growth rate, 95 % bootstrap intervals, from "
        f"{plural(quantities['groups'].iloc[0], 'group')} of points",
        f"groups dropped for a failed point or a mode that is not there: {listed}; the others are "
        "no sample of the distributions, and indices and intervals are of them"
        if listed
        else "",
        f"modes found at too few points for indices: {rare}" if rare else "",
        *_numbering(with_indices),
        *named_tracks(table["track"], names or {}),
    )
    return [shown, legend]


def _indices(row: Row, new: bool) -> list[str]:
    """Cells of a row on Sobol indices of a parameter."""
    name = "fastest mode" if row["quantity"] == "largest" else _number(row)
    cells = [name, _figure(row["frequency_hz"], 0, unknown="")] if new else ["", ""]
    cells.append(str(row["parameter"]))
    for index in ("first", "total"):
        estimate, low, high = (f"{row[index + end]:z.3f}" for end in ("", "_low", "_high"))
        cells += [estimate, f"{low} to {high}"]
    return cells
