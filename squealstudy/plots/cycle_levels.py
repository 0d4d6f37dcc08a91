"""Levels of stable and unstable limit cycles over a swept parameter, with verdicts beneath."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.over_time import friction_label
from squealstudy.plots.style import (
    Quantity,
    cross_out,
    empty_figure,
    figure_at,
    finish,
    labelled,
    legend_below,
    quantity,
    set_scales,
    set_ticks,
    whole_figure,
)
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.run_levels import run_levels
from squealstudy.wording import (
    FAILED,
    IF_KICKED,
    NEUTRAL,
    NO_CYCLE,
    SQUEALS,
    SUSTAINED,
    UNDECIDED,
    by_ranges,
    did_you_mean,
    plural,
)

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

TITLE_WIDTH = 130  # characters of a line
STABLE: dict[str, Any] = {"marker": "o", "color": COLOURS[1], "label": "stable cycle"}
UNSTABLE: dict[str, Any] = {
    "marker": "o",
    "color": COLOURS[0],
    "markerfacecolor": "white",
    "label": "unstable cycle",
}
OTHER_STYLE: dict[str, Any] = {
    "marker": "s",
    "color": GREY,
    "label": "stability or level not known",
}
RUN: dict[str, Any] = {
    "marker": "x",
    "color": "black",
    "linestyle": "",
    "markersize": 8,
    "markeredgewidth": 1.6,
    "label": "run in time, motion that lasts",
}
BRANCHES: dict[bool | None, dict[str, Any]] = {  # by stability
    True: {"color": COLOURS[1], "label": "branch, stable"},
    False: {"color": COLOURS[0], "linestyle": (0, (4, 2)), "label": "branch, unstable"},
    None: {"color": GREY, "linestyle": ":", "label": "branch, stability not known"},
}
EVENTS = {
    "H": "H: Hopf point",
    "F": "F: fold",
    "NS": "NS: a second frequency",
    "PD": "PD: twice the period",
    "BP": "BP: branch point",
}
MIN_SHADED_ERROR = 1e-3  # relative error; a smaller one is hidden by the line
# markers of the lowest panel
MARKS = {SQUEALS: "s", IF_KICKED: "D", UNDECIDED: "x", NEUTRAL: "_", NO_CYCLE: "P"}
VERDICTS = {  # colours of the lowest panel
    SQUEALS: COLOURS[0],
    IF_KICKED: COLOURS[3],
    UNDECIDED: GREY,
    NEUTRAL: COLOURS[4],
    NO_CYCLE: COLOURS[2],
}


def _lines(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture along each varied parameter, at the nominal values of the others."""
    for name in parameter_columns(results.points, varied=True):
        fixed = results.nominal_others(name)
        if len(_line(results.points, name, fixed)) > 1:
            yield f"_{results.file_word(name)}", {"along": name, "fixed": fixed}


@register_plot(
    _lines,
    points=("verdict",),
    cycles=("contact_velocity", "stable", "same_as"),
    branches=("along", "value"),
)
def cycle_levels(
    results: Results,
    along: str,
    fixed: Mapping[str, float] | None = None,
    runs: Results | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Levels of the limit cycles of all modes over a parameter, and the verdicts.

    Branches along the parameter are lines with their events; unstable parts are dashed, and a grey
    band is the error of levels. Levels that only runs in time tell, of this study or of `runs`, are
    crosses.

    Parameters
    ----------
    results : Results
        Of a study of limit cycles.
    along : str
        A varied parameter.
    fixed : mapping of parameter -> value or None
        Values of other parameters that the shown points have; None: all points are shown.
    runs : Results or None
        Of a study in time of the same designs, whose lasting motions are shown too.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        For an unknown parameter, or a line that the study does not have.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("cycles_from_onset")[0])
    >>> results = sq.run(study.with_(friction=[0.298, 0.305]))
    >>> results.plot.cycle_levels(along="friction").savefig("levels.png")
    """
    points, units = results.points, results.units
    varied = parameter_columns(points, varied=True)
    if along not in varied:
        hint = did_you_mean(along, varied)
        raise ResultsError(f"'{along}' is not varied in this study{hint}")
    line = _line(points, along, fixed)
    if not len(line):
        return empty_figure("no design points", ax)
    if (line["status"] != "ok").all():
        return empty_figure(f"{plural(len(line), 'point')}, all failed", ax)
    over = quantity(along, points[along], units)
    cycles, verdicts = results.table("cycles"), results.table("verdicts")
    by_runs = run_levels(verdicts, cycles).merge(line[["point_id", along]], on="point_id")
    cycles = cycles[(cycles["same_as"] == "").to_numpy(bool)].merge(
        line[["point_id", along]], on="point_id"
    )
    branches = _branches(results, along, line)
    motions = None if runs is None else _runs(results, runs, line)
    if len(by_runs):  # runs of the study itself, whose contact velocity is not kept
        motions = by_runs if motions is None else pd.concat([motions, by_runs])
    figure = figure_at(ax, 9.0, 7.4)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=[1.6, 1.6, 0.9])
    set_scales(axes[0], over)
    name, unit = friction_label(units)
    for panel, column, label in (
        (axes[0], "torque_rms", f"{name.capitalize()} RMS [{unit}]"),
        (axes[1], "contact_velocity", "Largest contact velocity [m/s]"),
    ):
        _draw_branches(panel, over, branches, column)
        if column == "torque_rms":
            _shade_errors(panel, over, branches)
        _cycles(panel, over.scaled(cycles[along]), cycles, column)
        if motions is not None and column in motions:
            panel.plot(over.scaled(motions[along]), motions[column], **RUN)
        panel.set_ylim(bottom=0.0)
        finish(panel, "", label)
    x = over.scaled(line[along])
    _growth(axes[2], x, line)
    cross_out(axes[2], x[(line["status"] != "ok").to_numpy(bool)])
    set_ticks(axes[2].xaxis, over, line[along])
    finish(axes[2], over.label, "Growth [1/s]")
    legend_below(figure, [*labelled(axes[0]), *labelled(axes[2])], 3)
    event_letters = set(branches["event"]) & set(EVENTS)
    if event_letters:
        names = "; ".join(text for event, text in EVENTS.items() if event in event_letters)
        axes[0].set_title(names, fontsize=9, loc="right")
    others = [n for n in varied if n != along and (line[n] == line[n].iloc[0]).all()]
    where = describe(line.iloc[0], points, others, units)
    words = line["verdict"].where(line["status"] == "ok", FAILED).str.replace("_", " ")
    by_verdict = by_ranges(along, units.get(along, ""), line[along].tolist(), words.tolist())
    title = by_verdict or plural(len(cycles), "cycle")
    figure.suptitle(fill(f"{where}; {title}" if where else title, TITLE_WIDTH), fontsize=9.5)
    return whole_figure(figure)


def _line(points: pd.DataFrame, along: str, fixed: Mapping[str, float] | None) -> pd.DataFrame:
    """Rows of points at the fixed values, ascending along a parameter."""
    chosen = points
    for name, value in (fixed or {}).items():
        chosen = chosen[np.isclose(chosen[name], value, rtol=1e-6, atol=0.0)]
    return chosen.sort_values(along, kind="stable")


def _branches(results: Results, along: str, line: pd.DataFrame) -> pd.DataFrame:
    """Rows of the branches along the parameter that begin at designs of the line."""
    table = results.table("branches")
    of_line = (table["along"] == along) & table["point_id"].isin(line["point_id"])
    return table[of_line.to_numpy(bool)]


def _runs(results: Results, runs: Results, line: pd.DataFrame) -> pd.DataFrame:
    """Lasting motions of a study in time at designs of the line."""
    table = results.compare(runs)
    lasting = table["cycles_point_id"].isin(line["point_id"]) & table["class"].isin(SUSTAINED)
    return table[lasting.to_numpy(bool)]


def _draw_branches(axes: Axes, over: Quantity, branches: pd.DataFrame, column: str) -> None:
    """Draw branches as lines styled by stability, and their events with letters."""
    named = set()
    for _, branch in branches.groupby("cycle_id", sort=False):
        x, y = over.scaled(branch["value"]), branch[column].to_numpy(float)
        event = branch["event"].to_numpy(str) != ""
        stable = branch["stable"].to_numpy(object)
        state = [  # stability between two points, that of the end which is no event
            stable[k + 1] if event[k] else stable[k] for k in range(len(branch) - 1)
        ]
        start = 0
        for k in range(1, len(state) + 1):
            if k == len(state) or state[k] is not state[start]:
                is_stable = None if pd.isna(state[start]) else bool(state[start])
                style = dict(BRANCHES[is_stable])
                if is_stable in named:
                    style.pop("label")
                named.add(is_stable)
                axes.plot(x[start : k + 1], y[start : k + 1], linewidth=1.6, zorder=1, **style)
                start = k
        for index in np.flatnonzero(event):
            axes.plot(x[index], y[index], "D", color=DARK, markersize=4, zorder=3, clip_on=False)
            axes.annotate(
                branch["event"].iloc[index],
                (x[index], y[index]),
                xytext=(5, 5),
                textcoords="offset points",
                fontsize=9,
                color=DARK,
            )


def _shade_errors(axes: Axes, over: Quantity, branches: pd.DataFrame) -> None:
    """Shade the errors of levels about the lines of branches, where they can be seen."""
    if "level_error" not in branches:  # results of older versions
        return
    label = "error of a branch's level"
    for _, branch in branches.groupby("cycle_id", sort=False):
        level, error = (branch[n].to_numpy(float) for n in ("torque_rms", "level_error"))
        if not (error > MIN_SHADED_ERROR).any():
            continue
        low, high = level * np.maximum(1.0 - error, 0.0), level * (1.0 + error)
        x = over.scaled(branch["value"])
        axes.fill_between(x, low, high, color=GREY, alpha=0.3, linewidth=0, zorder=0, label=label)
        label = ""


def _cycles(axes: Axes, x: np.ndarray, cycles: pd.DataFrame, column: str) -> None:
    """Draw limit cycles with marks for stable, unstable and unknown stability."""
    has_stability = cycles["stable"].notna().to_numpy(bool)
    stable = cycles["stable"].fillna(False).to_numpy(bool)
    y = cycles[column].to_numpy(float)
    for rows, style in (
        (has_stability & stable, STABLE),
        (has_stability & ~stable, UNSTABLE),
        (~has_stability, OTHER_STYLE),
    ):
        if rows.any():
            axes.plot(x[rows], y[rows], linestyle="", markersize=5.5, **style)


def _growth(axes: Axes, x: np.ndarray, line: pd.DataFrame) -> None:
    """Draw the fastest growth of complex modes, with colours and markers of the verdicts."""
    growth = line["max_growth_rate"].to_numpy(float)
    axes.axhline(0.0, color=DARK, linewidth=0.8)
    for name, colour in VERDICTS.items():
        of_verdict = (line["verdict"] == name).to_numpy(bool)
        if of_verdict.any():
            style: dict[str, Any] = {"linestyle": "", "marker": MARKS[name], "markersize": 5}
            axes.plot(
                x[of_verdict],
                growth[of_verdict],
                color=colour,
                label=name.replace("_", " "),
                **style,
            )
