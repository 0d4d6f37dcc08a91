"""Levels, frequency and modal energies of vibration over a swept parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.plots.over_time import PALETTE, friction_label
from squealstudy.plots.style import (
    Quantity,
    cross_out,
    empty_figure,
    error_reach,
    figure_at,
    finish,
    joined,
    labelled,
    legend_below,
    quantity,
    set_scales,
    set_ticks,
    whole_figure,
)
from squealstudy.plots.tables import describe, slice_points
from squealstudy.tables.energy_ranking import transient_parameters
from squealstudy.wording import LASTING, UNDECIDED, in_digits, plural, real_mode_number

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MAX_LABELLED_POINTS = 36  # design points for whose names there is room
MAX_COLOURED_MODES = 6  # modes with a colour of their own
MIN_SHOWN_ENERGY_SHARE = 0.02  # modes whose largest energy share is smaller have no colour
BAR_WIDTH_RATIO = 0.8  # width of a bar over the least distance between design points
LOUDEST_LINE = "loudest line"
LEAST_DRAWN_PERCENT = 0.1  # of the energy; a thinner bar would be only its edge
OTHER_MODES, OUTSIDE = "other sensed modes", "outside the sensed modes"
PALE = {OTHER_MODES: "#C8C8C8", OUTSIDE: "white"}
CLASSES: dict[str, dict[str, Any]] = {
    "limit_cycle": {"marker": "o", "color": COLOURS[1]},
    "irregular": {"marker": "D", "color": COLOURS[3]},
    "growing": {"marker": "^", "color": COLOURS[0]},
    "undecided": {"marker": "s", "color": GREY, "markerfacecolor": "white"},
    "stable": {"marker": "o", "color": COLOURS[2], "markerfacecolor": "white"},
}
REMARKS = {"growing": " (not saturated)", "undecided": " (may decay or last)"}
ENDS = ("low", "high")


def _lines(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture of all design points if several parameters vary, and one along each parameter."""
    varied = transient_parameters(results.points, varied=True)
    if len(varied) > 1:
        yield "", {}
    for name in varied:
        fixed = results.nominal_others(name)
        if len(sweep_line(results.points, name, fixed)) > 1:
            yield f"_{results.file_word(name)}", {"along": name, "fixed": fixed}


@register_plot(_lines, points=("class", "torque_rms"), modes=("energy_share",))
def levels(
    results: Results,
    along: str | None = None,
    fixed: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """RMS, mean and frequency of the torque over a study, and which modes have the energy.

    Parameters
    ----------
    results : Results
        Of a transient study.
    along : str or None
        A varied parameter; None: all design points in their order, named by what differs from the
        first.
    fixed : mapping of parameter -> value or None
        Values of other parameters; if lines are left to choose from, that with the most vibrating
        points is shown.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        For an unknown parameter, or a value that the study does not have.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("hoffmann_flutter")[0])
    >>> results = sq.run(study.with_({"transient.duration": 0.5}, friction=[0.76, 0.8]))
    >>> results.plot.levels(along="friction").savefig("levels.png")
    """
    points, modes, units = results.points, results.modes, results.units
    if not len(points):
        return empty_figure("no design points", ax)
    line = points if along is None else sweep_line(points, along, fixed)
    failed = (line["status"] != "ok").to_numpy(bool)
    if failed.all():
        reasons = ", ".join(sorted(set(line["status"])))
        return empty_figure(f"{plural(len(line), 'point')}, all failed: {reasons}", ax)
    width = 9.0 if along is not None else float(np.clip(2.0 + 0.6 * len(line), 9.0, 24.0))
    figure = figure_at(ax, width, 9.2)
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[1.7, 1.0, 1.0, 1.7])
    over = None if along is None else quantity(along, points[along], units)
    x = np.arange(0.0, len(line)) if over is None else over.scaled(line[over.name])
    row = _Row(line=line, x=x, over=over, units=units)
    if over is not None:
        set_scales(axes[0], over)
    _levels(axes[0], row)
    _means(axes[1], row)
    _frequencies(axes[2], row)
    _share_bars(axes[3], row, modes)
    for panel in axes[:3]:
        cross_out(panel, x[failed])
    _abscissa(axes[3], row)
    legend_below(figure, labelled(axes[3]))
    others = [n for n in transient_parameters(points, varied=True) if n != along]
    where = "" if along is None else describe(line.iloc[0], points, others, units)
    figure.suptitle(_title(where, line), fontsize=9.5)
    return whole_figure(figure)


@dataclass(frozen=True)
class _Row:
    """Design points (n rows of the points table) drawn at `x` (n,).

    `over` is the parameter on the abscissa; None where points are only numbered.
    """

    line: pd.DataFrame
    x: np.ndarray
    over: Quantity | None
    units: Mapping[str, str]

    def is_class(self, name: str) -> np.ndarray:
        """Points (n,) of a class."""
        return (self.line["class"] == name).to_numpy(bool)

    def where_ok(self, name: str) -> np.ndarray:
        """A column (n,); NaN where a point failed, as what it reached until then is no level."""
        line = self.line
        values: np.ndarray = line[name].where(line["status"] == "ok").to_numpy(dtype=float)
        return values


def sweep_line(
    points: pd.DataFrame, along: str, fixed: Mapping[str, float] | None = None
) -> pd.DataFrame:
    """Rows of the points table along a parameter, ascending; ResultsError if there are none."""
    names = transient_parameters(points)
    if len(points) == 1 and along in names:
        return points
    lasting = points["class"].isin(LASTING).to_numpy(int)
    chosen, _ = slice_points(points[["point_id", "status", *names]], lasting, (along,), fixed)
    return points.loc[chosen.index].sort_values(along, kind="stable")


def design_names(points: pd.DataFrame, units: Mapping[str, str]) -> list[str]:
    """Name of each design point: what differs from the first, a line for each parameter."""
    names, first = transient_parameters(points, varied=True), points.iloc[0]
    texts = []
    for _, row in points.iterrows():
        changed = [n for n in names if row[n] != first[n]]
        shown = [quantity(n, points[n], units).text(row[n]) for n in changed]
        texts.append("\n".join(shown) or "as the first")
    return ["first", *texts[1:]]


def _abscissa(axes: Axes, row: _Row) -> None:
    """Set ticks and label of the abscissa."""
    x, over = row.x, row.over
    if over is None:
        style: dict[str, Any] = {"rotation": 90, "fontsize": 7.5}
        every = -(-len(x) // MAX_LABELLED_POINTS)
        axes.set_xticks(x[::every], design_names(row.line, row.units)[::every], **style)
    else:
        set_ticks(axes.xaxis, over, row.line[over.name])
    if len(x) == 1 and not (over is not None and over.log):
        axes.set_xlim(x[0] - 1.5, x[0] + 1.5)
    finish(axes, "" if over is None else over.label, "Energy share [%]")
    axes.grid(False, axis="x")


def _title(where: str, line: pd.DataFrame) -> str:
    failed = line[(line["status"] != "ok").to_numpy()]
    reasons = ", ".join(sorted(set(failed["status"])))
    return joined(
        where, f"{plural(len(failed), 'point')} failed (x): {reasons}" if len(failed) else ""
    )


def _levels(axes: Axes, row: _Row) -> None:
    """Draw the RMS of torque or friction force with bounds, marked by class.

    A line joins the points of a parameter.
    """
    rms = row.where_ok("torque_rms")
    if row.over is not None:
        axes.plot(row.x, rms, color=GREY, linewidth=0.9, zorder=1)
    for name, style in CLASSES.items():
        of_class = row.is_class(name)
        if of_class.any():
            low, high = (
                row.line.loc[of_class, f"torque_rms_{end}"].to_numpy(float) for end in ENDS
            )
            label = name.replace("_", " ") + REMARKS.get(name, "")
            bar: dict[str, Any] = {"linestyle": "", "capsize": 3, "markersize": 6, "label": label}
            axes.errorbar(
                row.x[of_class],
                rms[of_class],
                error_reach(rms[of_class], low, high),
                **bar,
                **style,
            )
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    what, unit = friction_label(row.units)
    finish(axes, "", f"{what.capitalize()} RMS [{unit}]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8.5, frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=5)


def _means(axes: Axes, row: _Row) -> None:
    """Draw mean torque or friction force, and that of steady sliding."""
    static, mean = (row.where_ok(f"torque_{n}") for n in ("static", "mean"))
    joined = row.over is not None
    joint = {"linestyle": "-.", "linewidth": 1.0} if joined else {"linestyle": "", "marker": "_"}
    mean_style: dict[str, Any] = {
        "marker": "o",
        "markersize": 4,
        "color": COLOURS[1],
        "label": "mean",
    }
    axes.plot(row.x, static, color=DARK, markersize=15, label="steady sliding", **joint)
    axes.plot(row.x, mean, linewidth=1.2, linestyle="-" if joined else "", **mean_style)
    what, unit = friction_label(row.units)
    finish(axes, "", f"{what.capitalize()} [{unit}]")
    axes.legend(fontsize=8.5, frameon=False, loc="best")


def _frequencies(axes: Axes, row: _Row) -> None:
    """Draw the dominant frequency of lasting vibrations, and that of predicted instability."""
    line = row.line
    predicted = line["predicted_frequency_hz"].where(line["n_unstable"] > 0)
    axes.plot(
        row.x,
        predicted.to_numpy(dtype=float),
        linestyle="",
        marker="_",
        markersize=15,
        color=DARK,
        label="of the fastest complex mode",
    )
    for name in LASTING:
        of_class = row.is_class(name)
        line_hz = line.loc[of_class, "torque_line_hz"].to_numpy(dtype=float)
        if of_class.any():
            named = any(c.get_label() == LOUDEST_LINE for c in axes.get_lines())
            label = "" if named else LOUDEST_LINE
            axes.plot(
                row.x[of_class], line_hz, linestyle="", markersize=5, label=label, **CLASSES[name]
            )
    axes.margins(y=0.2)
    finish(axes, "", "Frequency [Hz]")
    axes.legend(fontsize=8.5, frameon=False, loc="best")


def _share_bars(axes: Axes, row: _Row, modes: pd.DataFrame) -> None:
    """Draw energy shares of the main modes, a bar at each point that keeps vibrating."""
    lasting = row.line["class"].isin(LASTING).to_numpy(bool)
    table = stacked_shares(row.line[lasting], modes)
    axes.set_ylim(0.0, 100.0)
    if not len(table):
        style: dict[str, Any] = {"ha": "center", "color": "0.4"}
        undecided = row.is_class(UNDECIDED).any()
        text = "undecided whether a vibration lasts" if undecided else "no vibration lasts"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, **style)
        return
    start, width = bar_places(row.x, row.over is not None and row.over.log)
    base = np.zeros(len(table))
    for k, name in enumerate(table.columns):
        height = 100 * table[name].to_numpy()
        if height.max() < LEAST_DRAWN_PERCENT:
            continue  # nothing of it is seen: no entry of the legend either
        axes.bar(
            start[lasting],
            height,
            width[lasting],
            base,
            align="edge",
            color=PALE.get(name, PALETTE[k % len(PALETTE)]),
            edgecolor="0.4",
            linewidth=0.5,
            label=name,
        )
        base = base + height


def bar_places(x: np.ndarray, log: bool) -> tuple[np.ndarray, np.ndarray]:
    """Left edges and widths (n,) of bars about `x`; all are equally wide on the axis."""
    position = np.log(x) if log else x
    half = 0.5 * BAR_WIDTH_RATIO * float(np.diff(np.unique(position)).min(initial=np.inf))
    half = half if np.isfinite(half) else 0.5 * BAR_WIDTH_RATIO
    edges = position - half, position + half
    left_edges, right = (np.exp(edge) for edge in edges) if log else edges
    return left_edges, right - left_edges


def stacked_shares(line: pd.DataFrame, modes: pd.DataFrame) -> pd.DataFrame:
    """Energy shares of main modes, other modes and the rest, a row for each of `line`."""
    line_modes = modes[modes["point_id"].isin(line["point_id"])]
    wide = line_modes.pivot_table("energy_share", "point_id", "mode", aggfunc="first")
    wide = wide.reindex(line["point_id"]).fillna(0.0)
    mean, peak = wide.mean(), wide.max()
    main = list(
        peak[peak >= MIN_SHOWN_ENERGY_SHARE]
        .sort_values(ascending=False, kind="stable")
        .index[:MAX_COLOURED_MODES]
    )
    main = sorted(main, key=lambda mode: -mean[mode])
    largest_shares = line_modes.sort_values("energy_share", kind="stable", na_position="first")
    frequency = largest_shares.drop_duplicates("mode", keep="last").set_index("mode")[
        "frequency_hz"
    ]
    table = wide[main].rename(
        columns=lambda mode: f"{real_mode_number(mode)}  {in_digits(frequency[mode])} Hz"
    )
    table[OTHER_MODES] = wide.drop(columns=main).sum(axis=1)
    table[OUTSIDE] = line["energy_outside_share"].fillna(0.0).to_numpy(dtype=float)
    return table
