"""Frequency and damping of all tracks along one parameter, and the root loci of the worst."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from squealstudy.errors import ResultsError
from squealstudy.plots.line import StudyLine, study_line
from squealstudy.plots.locus import draw_locus
from squealstudy.plots.style import (
    COLOURS,
    DARK,
    GREY,
    MARKERS,
    UNSTABLE,
    damping_limits,
    finish,
    growth_limits,
    new_figure,
    plural,
    set_ticks,
    shade_unstable,
    track_name,
)

LOCI = 2
VERTICAL = {
    "damping_ratio": ("Damping ratio [%]", 100.0),
    "growth_rate": ("Growth rate [1/s]", 1.0),
}


def evolution(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    along: str,
    fixed: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    show: str = "damping_ratio",
) -> Figure:
    """Evolution of all tracks along one parameter, the unstable ones in colour.

    Parameters
    ----------
    along : str
        A varied parameter.
    fixed : mapping of parameter -> value or None
        The line to show; of what is left open, the line with most unstable modes is taken.
    units : mapping of parameter -> unit, or None
    show : str
        "damping_ratio" or "growth_rate".

    Raises
    ------
    ResultsError
        For an unknown parameter, a value that the study does not have, or an unknown `show`.
    """
    if show not in VERTICAL:
        raise ResultsError(f"'{show}' cannot be shown, expected {' or '.join(VERTICAL)}")
    line = study_line(points, modes, along, fixed, units)
    tracks = line.unstable_tracks
    figure = new_figure(11.5 if tracks else 8.0, 7.0)
    widths = [1.6, 1.0] if tracks else [1.0]
    left, *right = figure.subfigures(1, len(widths), squeeze=False, width_ratios=widths)[0]
    upper, lower = left.subplots(2, 1, sharex=True)
    _draw(upper, line, "frequency_hz", 1.0)
    _draw(lower, line, show, VERTICAL[show][1])
    _finish(upper, lower, line, show)
    rows = min(LOCI, len(tracks))
    for place, track in enumerate(tracks[:rows]):
        draw_locus(right[0].add_subplot(rows, 1, place + 1), line, track)
    figure.suptitle(_title(line), fontsize=10)
    _legend(figure, line)
    return figure


def _draw(axes: Axes, line: StudyLine, name: str, factor: float) -> None:
    """One curve a track, broken where a point failed; rings mark ambiguous labels."""
    table = getattr(line, name) * factor
    stable = table.drop(columns=line.unstable_tracks)
    axes.plot(line.x, stable, color=GREY, linewidth=0.7, marker=".", markersize=1.5, zorder=1)
    for place, track in reversed(list(enumerate(line.unstable_tracks))):
        style: dict[str, Any] = {"color": line.colour(track), "zorder": 3, "linewidth": 1.5}
        marker = MARKERS[place] if place < len(MARKERS) else "."
        every = max(1, len(line.x) // 15)
        y = table[track]
        axes.plot(line.x, y, marker=marker, markersize=4.5, markevery=every, **style)
        ring = line.doubtful[track].to_numpy(bool)
        axes.plot(
            line.x[ring], y[ring], "o", markersize=9, markerfacecolor="none", markeredgecolor="0.2"
        )
    rows, loose = line.untracked["row"].to_numpy(), line.untracked[name].to_numpy() * factor
    unstable = line.untracked["unstable"].to_numpy(bool)
    axes.plot(line.x[rows[~unstable]], loose[~unstable], ".", color=GREY, markersize=3)
    axes.plot(line.x[rows[unstable]], loose[unstable], "x", color=UNSTABLE, markersize=5)


def _finish(upper: Axes, lower: Axes, line: StudyLine, show: str) -> None:
    """Scales, limits and labels of both axes, and what failed."""
    if line.shown.log:
        upper.set_xscale("log")
    set_ticks(lower.xaxis, line.shown, pd.Series(line.x / line.shown.factor))
    values = np.append(getattr(line, show).to_numpy(dtype=float), line.untracked[show])
    if show == "damping_ratio":
        lower.set_ylim(damping_limits(100 * values))
    else:
        lower.set_ylim(growth_limits(values))
    shade_unstable(lower, above=show == "growth_rate")
    place: dict[str, Any] = {
        "clip_on": False,
        "transform": lower.get_xaxis_transform(),
        "color": "0.2",
    }
    if line.failed.any():  # an unclipped curve without points would push the axes away
        lower.plot(line.x[line.failed], np.zeros(line.failed.sum()), "x", **place)
    finish(upper, "", "Frequency [Hz]")
    finish(lower, line.shown.label, VERTICAL[show][0])


def _title(line: StudyLine) -> str:
    n = len(line.unstable_tracks)
    loose = int(line.untracked["unstable"].sum())
    parts = [line.elsewhere, plural(n, "unstable track") if n or loose else "no unstable mode"]
    parts += [f"{plural(loose, 'unstable mode')} without track (x)"] if loose else []
    parts += [f"{plural(int(line.failed.sum()), 'point')} failed (x)"] if line.failed.any() else []
    return "; ".join(part for part in parts if part)


def _legend(figure: Figure, line: StudyLine) -> None:
    """The coloured tracks with their frequency at fastest growth."""
    named = line.worst.iloc[: len(COLOURS)]
    handles = [
        Line2D([], [], color=COLOURS[k], marker=MARKERS[k], label=track_name(t, f))
        for k, (t, f) in enumerate(zip(named["track"], named["frequency_hz"], strict=True))
    ]
    if len(line.worst) > len(COLOURS):
        handles.append(Line2D([], [], color=DARK, marker=".", label="other unstable tracks"))
    if line.doubtful.reindex(columns=line.unstable_tracks).to_numpy().any():
        ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none"}
        handles.append(Line2D([], [], linestyle="", color="0.2", label="ambiguous label", **ring))
    if handles:
        handles.append(Line2D([], [], color=GREY, linewidth=0.7, label="stable tracks"))
        figure.legend(
            handles=handles, loc="outside lower center", ncols=5, fontsize=9, frameon=False
        )
