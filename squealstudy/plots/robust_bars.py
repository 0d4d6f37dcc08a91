"""Robustness of a scattered design: probabilities of instability and Sobol indices as bars."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.plots.style import COLOURS, UNSTABLE, finish, new_figure, plural

ANY = "#505050"
SHOWN = 10  # tracks with a probability
QUANTITIES = 3  # growth rates with indices
HALF = 0.19  # of the height of one parameter's place, for each of its two bars
CAP = {"capsize": 2.5, "elinewidth": 1.1, "ecolor": "0.15"}


def robust_bars(
    probabilities: pd.DataFrame, indices: pd.DataFrame | None = None, top: int = SHOWN
) -> Figure:
    """Probability of instability of each mode; beside it the indices of the growth rates.

    Parameters
    ----------
    probabilities : DataFrame
        Of `analysis.robust.probability.robust_table`.
    indices : DataFrame or None
        Of `analysis.robust.sobol_table.sobol_table`; its first three growth rates that have indices
        are shown.
    top : int
        Tracks to show beside "any mode".
    """
    shown = probabilities.iloc[: top + 1]
    indices = None if indices is None else indices.dropna(subset=["first", "total"])
    quantities = [] if indices is None else list(indices["track"].unique()[:QUANTITIES])
    parameters = 0 if indices is None else indices["parameter"].nunique()
    height = max(1.7 + 0.36 * len(shown), 1.7 + 0.5 * parameters, 3.0)
    figure = new_figure(5.6 + 3.3 * len(quantities), height)
    panels = figure.subplots(
        1, 1 + len(quantities), width_ratios=[1.5] + [1.0] * len(quantities), squeeze=False
    )[0]
    _probabilities(panels[0], shown)
    for axes, track in zip(panels[1:], quantities, strict=True):
        own = None if indices is None else indices[indices["track"] == track]
        if own is not None:
            _indices(axes, own, first=axes is panels[1])
    if quantities:
        figure.legend(
            *panels[1].get_legend_handles_labels(),
            loc="outside lower right",
            ncols=2,
            fontsize=9,
            frameon=False,
        )
    return figure


def _probabilities(axes: Axes, shown: pd.DataFrame) -> None:
    place = np.arange(len(shown))
    percent = 100 * shown["probability"].to_numpy()
    low, high = (100 * shown[f"probability_{end}"].to_numpy() for end in ("low", "high"))
    colours = [ANY if q == "any" else UNSTABLE for q in shown["quantity"]]
    error = [np.maximum(percent - low, 0), np.maximum(high - percent, 0)]
    axes.barh(place, percent, 0.62, color=colours, xerr=error, error_kw=CAP)
    for y, x, row in zip(place, high, shown.to_dict("records"), strict=True):
        text = f"{100 * row['probability']:.1f} %, worst {row['max_growth_rate']:+.3g} 1/s"
        if row["unknown_points"]:  # elsewhere it may stand under another number
            text += f", known at {row['points'] - row['unknown_points']}"
        axes.annotate(text, (x, y), (5, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set_yticks(place, [_mode(row) for row in shown.to_dict("records")])
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.set_xlim(0.0, 1.75 * max(high.max(), 1.0))
    axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 100])
    finish(axes, "Probability of instability [%]", "")
    axes.grid(False, axis="y")
    failed = int(shown["failed_points"].iloc[0])
    note = f", {plural(failed, 'point')} failed" if failed else ""
    title = f"{plural(int(shown['points'].iloc[0]), 'point')}{note}; bars: confidence interval"
    axes.set_title(title, fontsize=9, loc="left")


def _mode(row: dict[object, object]) -> str:
    if row["quantity"] == "any":
        return "any mode"
    if row["quantity"] == "divergence":
        return "static divergence"
    return f"T{row['track']}   {in_digits(float(str(row['frequency_hz'])))} Hz"


def _indices(axes: Axes, own: pd.DataFrame, first: bool) -> None:
    """First and total index of each parameter with their intervals."""
    place = np.arange(len(own))
    for side, name, colour in ((-1, "first", COLOURS[5]), (1, "total", COLOURS[1])):
        value, low, high = (own[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high"))
        error = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
        axes.barh(
            place + side * HALF,
            value,
            2 * HALF,
            color=colour,
            xerr=error,
            error_kw=CAP,
            label=f"{name} index",
        )
    row = own.iloc[0]
    named = row["quantity"] == "largest"
    title = "fastest mode" if named else f"T{row['track']}  {in_digits(row['frequency_hz'])} Hz"
    dropped = int(row["dropped_groups"])
    note = f", {dropped} of {row['groups'] + dropped} groups dropped" if dropped else ""
    axes.set_title(f"Growth of {title}{note}", fontsize=9, loc="left")
    axes.set_yticks(place, own["parameter"] if first else [""] * len(own))
    axes.set_ylim(len(own) - 0.4, -0.6)
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    finish(axes, "Sobol index", "")
    axes.grid(False, axis="y")
