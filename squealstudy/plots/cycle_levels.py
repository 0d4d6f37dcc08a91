"""Amplitude of limit cycles over a swept parameter: stable and unstable ones, beside verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.over_time import friction_label
from squealstudy.plots.style import (
    COLOURS,
    DARK,
    GREY,
    cross_out,
    empty_figure,
    finish,
    labelled,
    legend_below,
    new_figure,
    quantity,
    set_scales,
    set_ticks,
)
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

STABLE: dict[str, Any] = {"marker": "o", "color": COLOURS[1], "label": "stable cycle"}
UNSTABLE: dict[str, Any] = {
    "marker": "o",
    "color": COLOURS[0],
    "markerfacecolor": "white",
    "label": "unstable cycle: the kick that is needed",
}
OTHER: dict[str, Any] = {"marker": "s", "color": GREY, "label": "stability or level not known"}
VERDICTS = {  # heights and colours of the strip
    "squeals": COLOURS[0],
    "squeals_if_kicked": COLOURS[3],
    "undecided": GREY,
    "no_cycle_found": COLOURS[2],
}


def _lines(results: Results) -> Iterator[tuple[str, Choices]]:
    """A line along each varied parameter through the nominal values of the others."""
    for name in parameter_columns(results.points, varied=True):
        fixed = results.nominal_others(name)
        if len(_line(results.points, name, fixed)) > 1:
            yield f"_{results.file_word(name)}", {"along": name, "fixed": fixed}


@register_plot(_lines, points=("verdict",), cycles=("contact_velocity", "stable", "same_as"))
def cycle_levels(results: Results, along: str, fixed: Mapping[str, float] | None = None) -> Figure:
    """Levels of the limit cycles of all families over a parameter, and the verdicts.

    Parameters
    ----------
    results : Results
        Of a study of limit cycles.
    along : str
        A varied parameter.
    fixed : mapping of parameter -> value or None
        The line to show.

    Raises
    ------
    ResultsError
        For an unknown parameter, or a line that the study does not have.
    """
    points, units = results.points, results.units
    if along not in parameter_columns(points, varied=True):
        raise ResultsError(f"'{along}' is not varied in this study")
    line = _line(points, along, fixed)
    if not len(line):
        return empty_figure("no design points")
    over = quantity(along, points[along], units)
    cycles = results.table("cycles")
    cycles = cycles[(cycles["same_as"] == "").to_numpy(bool)].merge(
        line[["point_id", along]], on="point_id"
    )
    figure = new_figure(9.0, 7.4)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=[1.6, 1.6, 0.9])
    set_scales(axes[0], over)
    what, unit = friction_label(units)
    for panel, column, label in (
        (axes[0], "torque_rms", f"{what.capitalize()} RMS [{unit}]"),
        (axes[1], "contact_velocity", "Contact velocity [m/s]"),
    ):
        _cycles(panel, over.scaled(cycles[along]), cycles, column)
        panel.set_ylim(bottom=0.0)
        finish(panel, "", label)
    x = over.scaled(line[along])
    _growth(axes[2], x, line)
    cross_out(axes[2], x[(line["status"] != "ok").to_numpy(bool)])
    set_ticks(axes[2].xaxis, over, line[along])
    finish(axes[2], over.label, "Growth [1/s]")
    legend_below(figure, [*labelled(axes[0]), *labelled(axes[2])], 3)
    others = [n for n in parameter_columns(points, varied=True) if n != along]
    count = plural(len(cycles), "cycle")
    where = describe(line.iloc[0], points, others, units)
    figure.suptitle(f"{where}; {count}" if where else count, fontsize=9.5)
    return figure


def _line(points: pd.DataFrame, along: str, fixed: Mapping[str, float] | None) -> pd.DataFrame:
    """Points at the fixed values, ascending."""
    chosen = points
    for name, value in (fixed or {}).items():
        chosen = chosen[np.isclose(chosen[name], value, rtol=1e-6, atol=0.0)]
    return chosen.sort_values(along, kind="stable")


def _cycles(axes: Axes, x: np.ndarray, cycles: pd.DataFrame, column: str) -> None:
    known = cycles["stable"].notna().to_numpy(bool)
    stable = cycles["stable"].fillna(False).to_numpy(bool)
    y = cycles[column].to_numpy(float)
    for own, style in ((known & stable, STABLE), (known & ~stable, UNSTABLE), (~known, OTHER)):
        if own.any():
            axes.plot(x[own], y[own], linestyle="", markersize=5.5, **style)


def _growth(axes: Axes, x: np.ndarray, line: pd.DataFrame) -> None:
    """Fastest growth of the complex modes, coloured by verdict."""
    growth = line["max_growth_rate"].to_numpy(float)
    axes.axhline(0.0, color=DARK, linewidth=0.8)
    for name, colour in VERDICTS.items():
        own = (line["verdict"] == name).to_numpy(bool)
        if own.any():
            style: dict[str, Any] = {"linestyle": "", "marker": "s", "markersize": 5}
            axes.plot(x[own], growth[own], color=colour, label=name.replace("_", " "), **style)
