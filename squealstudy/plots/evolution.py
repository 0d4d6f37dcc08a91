"""Frequency and damping of all tracks along one parameter, and root loci of the fastest growing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.style import (
    MARKERS,
    UNSTABLE,
    Quantity,
    cross_out,
    damping_limits,
    finish,
    growth_limits,
    head,
    joined,
    legend_below,
    legend_of,
    new_figure,
    one_panel,
    quantity,
    set_scales,
    set_ticks,
    shade_unstable,
    track_name,
)
from squealstudy.plots.tables import (
    describe,
    from_where,
    oscillating,
    refined_onsets,
    slice_points,
    turns_in_words,
    unstable_counts,
    worst_tracks,
)
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW, rows_in
from squealstudy.wording import did_you_mean, plural, track_number

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


MAX_LOCI = 2  # root loci in a picture
# relative distance in frequency within which other tracks are shown in a locus
SHOWN_REL_FREQUENCY_DISTANCE = 0.03
STABLE_SIDE_OVER_GROWTH = 2.0  # extent of the stable side of a locus over the fastest growth
TITLE_LINE_CHARACTERS = 125  # in a line above a picture with loci, which is wider
LOCUS_LINE_CHARACTERS = 56  # in a line above a locus
LONGEST_NAME = 36  # characters that fit the title of a locus
VERTICAL = {
    "damping_ratio": ("Damping ratio [%]", 100.0),
    "growth_rate": ("Growth rate [1/s]", 1.0),
}
FREQUENCY = "frequency_hz"
COLUMNS = ("track", "track_ambiguous", "frequency_hz", "damping_ratio", "growth_rate", "unstable")


def _lines(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture for each parameter of a grid; one more where two parameters share their values."""
    points = results.points
    varied = parameter_columns(points, varied=True)
    for name in varied if results.manifest.get("grid_shape") else []:
        yield f"_{results.file_word(name)}", {"along": name, "fixed": results.nominal_others(name)}
    values = [np.unique(points[name].to_numpy()) for name in varied]
    if len(varied) == 2 and np.array_equal(values[0], values[1]):
        yield "_together", {"along": tuple(varied)}


@register_plot(_lines, points=("status",), modes=COLUMNS)
def evolution(
    results: Results,
    along: str | tuple[str, str] | None = None,
    fixed: Mapping[str, float] | None = None,
    show: str = "damping_ratio",
    ax: Axes | None = None,
) -> Figure:
    """Evolution of all tracks along one parameter, the unstable ones in colour.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    along : str or tuple of two str or None
        A varied parameter, or two with the same values, of which points are shown where both are
        equal; by default the parameter of the onsets.
    fixed : mapping of parameter -> value or None
        Values of other parameters; of several lines that with most unstable modes is shown.
    show : str
        "damping_ratio" or "growth_rate"; with `ax` also "frequency_hz".
    ax : matplotlib.axes.Axes or None
        Axes in which `show` alone is drawn. By default a new figure also has frequencies above it,
        and root loci beside them.

    Raises
    ------
    ResultsError
        For an unknown parameter, a value that the study does not have, or an unknown `show`.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter").with_(friction=[0.2, 0.4, 0.5])
    >>> results = sq.run(study)
    >>> results.plot.evolution(along="friction").savefig("evolution.png")
    """
    choices = [*VERTICAL] if ax is None else [*VERTICAL, FREQUENCY]
    if show not in choices:
        hint = did_you_mean(show, choices)
        raise ResultsError(f"'{show}' cannot be shown, expected {' or '.join(choices)}{hint}")
    if isinstance(along, tuple):
        results, along = _together(results, *along)
    line = study_line(results, along or results.along or "", fixed)
    tracks = line.unstable_tracks
    if ax is not None:
        return _alone(ax, line, show, _handles(line, results.track_names))
    figure = new_figure(11.5 if tracks else 8.0, 7.0)
    widths = [1.6, 1.0] if tracks else [1.0]
    left_figure, *right = figure.subfigures(1, len(widths), squeeze=False, width_ratios=widths)[0]
    upper, lower = left_figure.subplots(2, 1, sharex=True)
    set_scales(upper, line.shown)
    _draw(upper, line, "frequency_hz", 1.0)
    _draw(lower, line, show, VERTICAL[show][1])
    _finish(lower, line, show)
    finish(upper, "", "Frequency [Hz]")
    rows = min(MAX_LOCI, len(tracks))
    for row_number, track in enumerate(tracks[:rows]):
        _locus(right[0].add_subplot(rows, 1, row_number + 1), line, track)
    figure.suptitle(fill(_title(line), TITLE_LINE_CHARACTERS if tracks else 90), fontsize=10)
    legend_below(figure, _handles(line, results.track_names), 2 if results.track_names else 5)
    return figure


def _together(results: Results, first: str, second: str) -> tuple[Results, str]:
    """The design points at which two parameters are equal, as one parameter."""
    name, points = f"{first} = {second}", results.points
    points = points[points[first] == points[second]]
    on_line = np.zeros(len(results.points), dtype=bool)
    on_line[rows_in(results.points, points)] = True
    columns = ["point_id", *COLUMNS, "overdamped"]
    modes = results.rows("modes", [ROW, *columns], lambda modes: on_line[modes[ROW].to_numpy()])
    modes = modes[columns]
    points = points.drop(columns=second).rename(columns={first: name})
    facts = results.manifest | {"units": {**results.units, name: results.units.get(first, "")}}
    return replace(results, manifest=facts).with_tables(points=points, modes=modes), name


def _draw(axes: Axes, line: StudyLine, name: str, factor: float) -> None:
    """Draw a curve for each track, broken where a point failed; rings mark doubtful numbers."""
    table = getattr(line, name) * factor
    stable = table.drop(columns=line.unstable_tracks)
    axes.plot(line.x, stable, color=GREY, linewidth=0.7, marker=".", markersize=1.5, zorder=1)
    for rank, track in reversed(list(enumerate(line.unstable_tracks))):
        style: dict[str, Any] = {"color": line.colour(track), "zorder": 3, "linewidth": 1.5}
        marker = MARKERS[rank] if rank < len(MARKERS) else "."
        every = max(1, len(line.x) // 15)
        y = table[track]
        axes.plot(line.x, y, marker=marker, markersize=4.5, markevery=every, **style)
        track_onsets = line.onsets[(line.onsets["track"] == track).to_numpy(bool)]
        if len(track_onsets):
            _through(axes, line.x, y.to_numpy(float), track_onsets, name, style)
        ring = line.doubtful[track].to_numpy(bool)
        axes.plot(
            line.x[ring], y[ring], "o", markersize=9, markerfacecolor="none", markeredgecolor="0.2"
        )
    rows, loose = line.untracked["row"].to_numpy(), line.untracked[name].to_numpy() * factor
    unstable = line.untracked["unstable"].to_numpy(bool)
    axes.plot(line.x[rows[~unstable]], loose[~unstable], ".", color=GREY, markersize=3)
    axes.plot(line.x[rows[unstable]], loose[unstable], "x", color=UNSTABLE, markersize=5)


def _through(
    axes: Axes, x: np.ndarray, y: np.ndarray, onsets: pd.DataFrame, name: str, style: dict[str, Any]
) -> None:
    """Lead the last curve through its track's refined onsets, and mark each by a bar."""
    at = onsets["x"].to_numpy(float)
    heights = onsets["frequency_hz"].to_numpy(float) if name == FREQUENCY else np.zeros(len(at))
    curve = axes.lines[-1]
    order = np.argsort(np.concatenate([x, at]), kind="stable")
    curve.set_data(np.concatenate([x, at])[order], np.concatenate([y, heights])[order])
    design = np.flatnonzero(order < len(x))
    curve.set_markevery([int(k) for k in design[:: max(1, len(x) // 15)]])
    axes.plot(at, heights, "|", color=style["color"], markersize=12, markeredgewidth=2, zorder=4)


def _alone(axes: Axes, line: StudyLine, show: str, handles: Sequence[Line2D]) -> Figure:
    """Draw one quantity in axes of the user."""
    set_scales(axes, line.shown)
    _draw(axes, line, show, VERTICAL.get(show, ("", 1.0))[1])
    if show == FREQUENCY:
        set_ticks(axes.xaxis, line.shown, pd.Series(line.x / line.shown.factor))
        cross_out(axes, line.x[line.failed])
        finish(axes, line.shown.label, "Frequency [Hz]")
    else:
        _finish(axes, line, show)
    head(axes, _title(line))
    figure, _ = one_panel(axes)
    legend_of(figure, axes, handles)
    return figure


def _finish(lower: Axes, line: StudyLine, show: str) -> None:
    """Set limits and labels of the axes of damping or growth, and cross out what failed."""
    set_ticks(lower.xaxis, line.shown, pd.Series(line.x / line.shown.factor))
    values = np.append(getattr(line, show).to_numpy(dtype=float), line.untracked[show])
    if show == "damping_ratio":
        lower.set_ylim(damping_limits(100 * values))
    else:
        lower.set_ylim(growth_limits(values))
    shade_unstable(lower, above=show == "growth_rate")
    cross_out(lower, line.x[line.failed])
    finish(lower, line.shown.label, VERTICAL[show][0])


def _title(line: StudyLine) -> str:
    """Title: how many tracks are unstable, and which points are not solved."""
    n = len(line.unstable_tracks)
    loose, failed = int(line.untracked["unstable"].sum()), int(line.failed.sum())
    none = "no unstable mode where it is solved" if failed else "no unstable mode"
    none = "no design point is solved" if failed and line.failed.all() else none
    unstable = plural(n, "unstable track") + from_where(line.onsets, line.shown)
    return joined(
        line.elsewhere,
        unstable if n or loose else none,
        f"{plural(loose, 'unstable mode')} without track (x)" if loose else "",
        f"real roots grow at {plural(line.n_diverging, 'point')}, not drawn"
        if line.n_diverging
        else "",
        f"{plural(failed, 'point')} failed (x)" if failed else "",
    )


def _handles(line: StudyLine, names: Mapping[int, tuple[str, bool]]) -> list[Line2D]:
    """The coloured tracks with their frequency at fastest growth, for the legend."""
    named = line.worst.iloc[: len(COLOURS)]
    handles = [
        Line2D([], [], color=COLOURS[k], marker=MARKERS[k], label=track_name(t, f, names))
        for k, (t, f) in enumerate(zip(named["track"], named["frequency_hz"], strict=True))
    ]
    if len(line.worst) > len(COLOURS):
        handles.append(Line2D([], [], color=DARK, marker=".", label="other unstable tracks"))
    if line.doubtful.reindex(columns=line.unstable_tracks).to_numpy().any():
        ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none"}
        handles.append(
            Line2D([], [], linestyle="", color="0.2", label="not sure which mode", **ring)
        )
    if len(line.onsets):
        bar: dict[str, Any] = {"marker": "|", "markersize": 10, "markeredgewidth": 2}
        handles.append(
            Line2D([], [], linestyle="", color="0.2", label=turns_in_words(line.onsets), **bar)
        )
    if handles and len(line.frequency_hz.columns) > len(line.worst):
        handles.append(Line2D([], [], color=GREY, linewidth=0.7, label="stable modes"))
    return handles


def _locus(axes: Axes, line: StudyLine, track: int) -> None:
    """Draw frequency over growth rate of a track and near ones; arrows end at the largest value."""
    frequency, growth = line.frequency_hz[track], line.growth_rate[track]
    low, high = (
        frequency.min() * (1 - SHOWN_REL_FREQUENCY_DISTANCE),
        frequency.max() * (1 + SHOWN_REL_FREQUENCY_DISTANCE),
    )
    fastest = float(growth.max()) if growth.max() > 0 else float(growth.abs().max()) or 1.0
    within = ((line.frequency_hz > low) & (line.frequency_hz < high)).any()
    for other in [*within.index[within].drop(track), track]:
        x, y = line.growth_rate[other].to_numpy(), line.frequency_hz[other].to_numpy()
        _path(axes, x, y, line.colour(int(other)), 2.0 if other == track else 1.0)
    axes.set_xlim(-STABLE_SIDE_OVER_GROWTH * fastest, 1.2 * fastest)
    axes.set_ylim(low, high)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.axvspan(0.0, 1.2 * fastest, color=UNSTABLE, alpha=0.08, linewidth=0, zorder=0)
    axes.axvline(0.0, color="0.2", linewidth=1.0, zorder=1)
    finish(axes, "Growth rate [1/s]", "Frequency [Hz]")
    name = line.shown.name if len(line.shown.name) <= LONGEST_NAME else "values"
    text = f"{track_number(track)}, from least {name} (open circle) to most (arrow)"
    head(axes, fill(text, LOCUS_LINE_CHARACTERS))


def _path(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str, width: float) -> None:
    """Draw a curve from a hollow dot to an arrow head."""
    axes.plot(x, y, color=colour, linewidth=width, marker=".", markersize=3 * width, zorder=width)
    finite = np.flatnonzero(np.isfinite(x))
    axes.plot(x[finite[:1]], y[finite[:1]], "o", color=colour, markerfacecolor="white", zorder=3)
    nonzero_steps = np.flatnonzero(np.hypot(np.diff(x), np.diff(y)) > 0)
    if len(nonzero_steps):
        k = nonzero_steps[-1]
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": colour, "linewidth": width}
        arrow |= {"mutation_scale": 14, "clip_box": axes.bbox}  # it may begin outside the axes
        tip = axes.annotate("", (x[k + 1], y[k + 1]), (x[k], y[k]), arrowprops=arrow)
        tip.set_in_layout(False)


@dataclass(frozen=True)
class StudyLine:
    """Modes of the design points on one line, in ascending order of the parameter.

    Attributes
    ----------
    shown : Quantity
        The parameter along the line.
    x : ndarray (n,)
        Its values as drawn.
    failed : ndarray (n,) of bool
        Points that failed.
    frequency_hz, growth_rate, damping_ratio : DataFrame (n, n_tracks)
        Frequency [Hz], growth rate [1/s] and damping ratio with a column for each track; NaN where
        a track has no mode.
    doubtful : DataFrame (n, n_tracks) of bool
        Whether it is not sure which mode has the track's number.
    untracked : DataFrame
        Modes without a track, with the point's index on the line as `row`.
    worst : DataFrame
        The mode of largest growth of each unstable track, fastest first.
    onsets : DataFrame
        Refined onsets: values ``x`` along the line, as drawn, at which a ``track`` turns unstable
        or stable (``direction``), with its ``frequency_hz`` there.
    n_diverging : int
        Number of points at which a real root grows, which is no mode.
    elsewhere : str
        Text on the values of other parameters, and why they were chosen.
    """

    shown: Quantity
    x: np.ndarray
    failed: np.ndarray
    frequency_hz: pd.DataFrame
    growth_rate: pd.DataFrame
    damping_ratio: pd.DataFrame
    doubtful: pd.DataFrame
    untracked: pd.DataFrame
    worst: pd.DataFrame
    onsets: pd.DataFrame
    n_diverging: int
    elsewhere: str

    @property
    def unstable_tracks(self) -> list[int]:
        """Tracks that are unstable on the line, fastest growth first."""
        return [int(track) for track in self.worst["track"]]

    def colour(self, track: int) -> str:
        """Colour of a track: its own if it grows fast, dark if unstable otherwise, else grey."""
        tracks = self.unstable_tracks
        if track not in tracks:
            return GREY
        return COLOURS[tracks.index(track)] if track in tracks[: len(COLOURS)] else DARK


def study_line(results: Results, along: str, fixed: Mapping[str, float] | None = None) -> StudyLine:
    """The line along a parameter; if `fixed` leaves a choice, that with the most unstable modes.

    Overdamped roots are left out. Raises ResultsError for an unknown parameter or value.
    """
    points, units = results.points, results.units
    line, why = slice_points(points, unstable_counts(results), (along,), fixed)
    line = line.sort_values(along, kind="stable")
    shown = quantity(along, points[along], units)
    position = np.full(len(points), -1)
    position[rows_in(points, line)] = np.arange(len(line))
    columns = [ROW, *COLUMNS, "overdamped"]
    modes = results.rows("modes", columns, lambda modes: position[modes[ROW].to_numpy()] >= 0)
    modes = modes.assign(row=position[modes[ROW].to_numpy()])
    rows, real = oscillating(modes), modes["overdamped"].to_numpy(bool)
    tracked = rows[(rows["track"] > 0).to_numpy()]
    tracked = tracked.assign(doubtful=tracked["track_ambiguous"].astype(float))

    def wide(name: str) -> pd.DataFrame:
        table = tracked.pivot_table(index="row", columns="track", values=name, aggfunc="first")
        return table.reindex(range(len(line)))

    others = [n for n in parameter_columns(points, varied=True) if n != along]
    return StudyLine(
        shown=shown,
        x=shown.scaled(line[along]),
        failed=(line["status"] != "ok").to_numpy(bool),
        frequency_hz=wide("frequency_hz"),
        growth_rate=wide("growth_rate"),
        damping_ratio=wide("damping_ratio"),
        doubtful=wide("doubtful") == 1.0,
        untracked=rows[(rows["track"] <= 0).to_numpy()],
        worst=worst_tracks(rows),
        n_diverging=int(modes["row"][real & modes["unstable"].to_numpy(bool)].nunique()),
        onsets=refined_onsets(results, shown, line, others),
        elsewhere=joined(describe(line.iloc[0], points, others, units), why, by=", "),
    )
