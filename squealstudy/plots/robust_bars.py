"""Robustness of a random design: probabilities of instability and Sobol indices as bars."""

from __future__ import annotations

import contextlib
from collections.abc import Hashable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.style import (
    UNSTABLE,
    error_reach,
    figure_at,
    finish,
    head,
    labelled,
    legend_below,
    name_rows,
    signed,
    track_name,
    whole_figure,
)
from squealstudy.study.sweeps import RANDOM_DESIGNS, SOBOL_INDICES
from squealstudy.wording import in_digits, plural, track_number

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MAX_QUANTITIES = 3  # growth rates whose indices are shown
LONGEST_NAME = 44  # characters of a line
BAR_HEIGHT = 0.19  # height of each of a parameter's two bars, in rows
ERROR_BARS = {"capsize": 2.5, "elinewidth": 1.1, "ecolor": "0.15"}


def _random(results: Results) -> Iterator[tuple[str, Choices]]:
    """One picture of a random design with a solved point."""
    if results.design in RANDOM_DESIGNS and (results.points["status"] == "ok").any():
        yield "", {}


@register_plot(_random, points=("status",), modes=("track", "unstable", "overdamped"))
def robust(results: Results, top: int = 10, ax: Axes | None = None) -> Figure:
    """Probability of instability of each mode, and Sobol indices of growth rates beside it.

    Indices are shown for a design that is made for them, of the first three growth rates that have
    indices.

    Parameters
    ----------
    results : Results
        Of a complex-mode study with a random design.
    top : int
        Number of rows to show beside "any mode".
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        Where the design is not random, or every point failed.

    Examples
    --------
    >>> import squealstudy as sq
    >>> sweep = {"parameter": "friction", "start": 0.2, "stop": 0.6}
    >>> design = {"type": "latin_hypercube", "samples": 16}
    >>> study = sq.model("hulten").study("robust").with_({"design": design, "sweep": [sweep]})
    >>> sq.run(study).plot.robust().savefig("robust.png")
    """
    indices = None
    if results.design == SOBOL_INDICES:
        with contextlib.suppress(ResultsError):  # `squealstudy robust` says why
            indices = results.sobol_indices().dropna(subset=["first", "total"])
    return robust_bars(results.robust().iloc[: top + 1], indices, results.track_names, ax)


def robust_bars(
    shown: pd.DataFrame,
    indices: pd.DataFrame | None,
    names: Mapping[int, tuple[str, bool]] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """The figure of rows of both tables; without indices it has the probabilities alone."""
    quantities = [] if indices is None else list(indices["track"].unique()[:MAX_QUANTITIES])
    parameters = 0 if indices is None else indices["parameter"].nunique()
    height = max(1.7 + 0.36 * len(shown), 1.7 + 0.5 * parameters, 3.0)
    figure = figure_at(ax, 5.6 + 3.3 * len(quantities), height)
    panels = figure.subplots(
        1, 1 + len(quantities), width_ratios=[1.5] + [1.0] * len(quantities), squeeze=False
    )[0]
    _probabilities(panels[0], shown, names or {})
    for axes, track in zip(panels[1:], quantities, strict=True):
        if indices is not None:
            _indices(axes, indices[indices["track"] == track], first=axes is panels[1])
    if quantities:
        legend_below(figure, labelled(panels[1]), 2, "right")
    return whole_figure(figure)


def _probabilities(axes: Axes, shown: pd.DataFrame, names: Mapping[int, tuple[str, bool]]) -> None:
    """Draw the probability that each mode, or any, is unstable, with its interval."""
    positions = np.arange(len(shown))
    percent = 100 * shown["probability"].to_numpy()
    low, high = (100 * shown[f"probability_{end}"].to_numpy() for end in ("low", "high"))
    colours = [DARK if q == "any" else UNSTABLE for q in shown["quantity"]]
    axes.barh(
        positions,
        percent,
        0.62,
        color=colours,
        xerr=error_reach(percent, low, high),
        error_kw=ERROR_BARS,
    )
    for y, x, row in zip(positions, high, shown.to_dict("records"), strict=True):
        text = f"{100 * row['probability']:.1f} %, worst {signed(row['max_growth_rate'])} 1/s"
        if row["unknown_points"]:  # elsewhere it may stand under another number
            text += f", known at {row['points'] - row['unknown_points']}"
        axes.annotate(text, (x, y), (5, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set_xlim(0.0, 1.75 * max(high.max(), 1.0))
    axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 100])
    finish(axes, "Probability of instability [%]", "")
    name_rows(axes, [_mode(row, names) for row in shown.to_dict("records")])
    failed = int(shown["failed_points"].iloc[0])
    note = f", {plural(failed, 'point')} not ok" if failed else ""
    note += ", ~: maybe two modes" if shown["ambiguous"].any() else ""
    head(axes, f"{plural(int(shown['points'].iloc[0]), 'point')}{note}; black: 95 % interval")


def _mode(row: Mapping[Hashable, Any], names: Mapping[int, tuple[str, bool]]) -> str:
    if row["quantity"] == "any":
        return "any mode"
    if row["quantity"] == "divergence":
        return "non-oscillating"
    return _doubt(row) + track_name(row["track"], row["frequency_hz"], names, LONGEST_NAME)


def _doubt(row: Mapping[Hashable, Any] | pd.Series) -> str:
    """Mark before a mode whose number may have jumped, as on the screen."""
    return "~" if row["ambiguous"] else ""


def _indices(axes: Axes, indices: pd.DataFrame, first: bool) -> None:
    """Draw first and total index of each parameter, with their intervals."""
    positions = np.arange(len(indices))
    for side, name, colour in ((-1, "first", COLOURS[5]), (1, "total", COLOURS[1])):
        index, low, high = (indices[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high"))
        axes.barh(
            positions + side * BAR_HEIGHT,
            index,
            2 * BAR_HEIGHT,
            color=colour,
            xerr=error_reach(index, low, high),
            error_kw=ERROR_BARS,
            label=f"{name} index",
        )
    row = indices.iloc[0]
    named = row["quantity"] == "largest"
    title = (
        "fastest mode"
        if named
        else f"{_doubt(row)}{track_number(row['track'])}  {in_digits(row['frequency_hz'])} Hz"
    )
    dropped = int(row["dropped_groups"])
    note = f", {dropped} of {row['groups'] + dropped} groups dropped" if dropped else ""
    head(axes, f"Growth of {title}{note}")
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    finish(axes, "Sobol index", "")
    name_rows(axes, list(indices["parameter"]) if first else [""] * len(indices))
