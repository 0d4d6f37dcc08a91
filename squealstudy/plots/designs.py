"""Effect of designs on growth: the largest growth rate over friction, a line for each design."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.style import (
    cross_out,
    empty_figure,
    finish,
    head,
    joined,
    labelled,
    legend_of,
    one_panel,
    quantity,
    set_scales,
    shade_unstable,
)
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW
from squealstudy.tables.stability import INTO, OUT_OF, REFINED_ONSETS

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MOST_LINES = 8  # as many as there are colours
DASHES = ("-", "--", "-.", ":")
MARKERS = "osD^v<>p"
GRID = "grid"
NEUTRAL_SHARE = 1e-6  # growth below this share of the next point's growth counts as none


def _designs(results: Results) -> pd.DataFrame:
    """The designs of a study, one in each row: all varied parameters but that of the onsets."""
    points = results.points
    others = [name for name in parameter_columns(points, varied=True) if name != results.along]
    return points[others].drop_duplicates() if others else points[[]].head(1)


def _of_few_designs(results: Results) -> Iterator[tuple[str, Choices]]:
    """One picture of a grid with two to MOST_LINES designs."""
    is_grid = results.design == GRID and results.boundary is None
    if results.along and is_grid and 2 <= len(_designs(results)) <= MOST_LINES:
        yield "", {}


@register_plot(_of_few_designs, points=("status",), modes=("growth_rate",))
def designs(results: Results, ax: Axes | None = None) -> Figure:
    """Largest growth rate over friction, or the parameter of the onsets, a line for each design.

    Each point of a line is the largest growth rate of all modes of a design point. The line passes
    through its first refined onset, and through each refined value at which growth ends.

    Parameters
    ----------
    results : Results
        Of a complex-mode study over a grid of at most eight designs.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Raises
    ------
    ResultsError
        Where nothing is swept, or where there are more designs.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter")
    >>> results = sq.run(study.with_(friction=[0.2, 0.4], frequency_2=[75.0, 85.0]))
    >>> results.plot.designs().savefig("designs.png")
    """
    along, points, rows = results.along, results.points, _designs(results)
    if along is None or along not in points:
        raise ResultsError("nothing is swept: there is no parameter to draw growth over")
    if len(rows) > MOST_LINES:
        text = f"{len(rows)} designs, of which {MOST_LINES} can be told apart in one picture"
        raise ResultsError(f"{text}; results.plot.stability_map draws all")
    growth = _largest_growth(results)
    if not np.isfinite(growth).any():
        is_solved = (points["status"] == "ok").any()
        return empty_figure("no mode in the band" if is_solved else "no design point is solved", ax)
    figure, axes = one_panel(ax, 8.5, 5.5)
    over = quantity(along, points[along], results.units)
    set_scales(axes, over)
    has_onset = [
        _draw_line(axes, results, design, growth, number)
        for number, design in enumerate(rows.to_dict("records"))
    ]
    finish(axes, over.label, "Largest growth rate [1/s]")
    low, high = np.nanmin(growth), max(float(np.nanmax(growth)), 0.0)
    axes.set_ylim(min(1.15 * low, -0.08 * high), max(1.08 * high, -0.1 * low))
    shade_unstable(axes, above=True)
    bars = "bars: where it turns unstable or stable, refined" if any(has_onset) else ""
    head(axes, joined(f"largest growth rate over {along}, a line for each design", bars))
    legend_of(figure, ax, labelled(axes), 1)
    return figure


def _draw_line(
    axes: Axes, results: Results, design: dict[Hashable, float], growth: np.ndarray, number: int
) -> bool:
    """Draw the growth of one design; return whether a change of its stability is drawn."""
    points, along = results.points, str(results.along)
    on_line = np.ones(len(points), dtype=bool)
    for name, setting in design.items():
        on_line &= points[name].to_numpy() == setting
    line = points[on_line].sort_values(along)
    over = quantity(along, points[along], results.units)
    x, y = over.scaled(line[along]), growth[line.index.to_numpy()]
    colour, marker = COLOURS[number], MARKERS[number]
    axes.plot(x, y, marker, color=colour, markersize=4.5)
    cross_out(axes, x[(line["status"] != "ok").to_numpy(bool)])
    text = describe(line.iloc[0], points, list(map(str, design)), results.units)
    refined, refined_ends = _refined(results, design)
    onset, ends = refined * over.factor, refined_ends * over.factor
    row_after = _crossing(x, y, onset)
    if row_after:
        text = joined(text, f"from {onset:.4g} {over.unit}".rstrip(), by=": ")
    elif (line.loc[(line["status"] == "ok").to_numpy(bool), "n_unstable"][:1] > 0).any():
        text = joined(text, "unstable at the first value", by=": ")
    changes = [onset] if row_after else []
    changes += _ends(x, y, ends)
    order = np.argsort(np.append(x, changes), kind="stable")
    x, y = np.append(x, changes)[order], np.append(y, np.zeros(len(changes)))[order]
    axes.plot(
        changes, np.zeros(len(changes)), "|", color=colour, markersize=16, markeredgewidth=1.8
    )
    dash = DASHES[number % len(DASHES)]
    axes.plot(x, y, dash, color=colour, label=text, marker=marker, markevery=[])
    return bool(changes)


def _largest_growth(results: Results) -> np.ndarray:
    """Largest growth rate (n,) of each row of `points`, 1/s; NaN where it has no mode."""
    growth = np.full(len(results.points), -np.inf)
    for modes in results.batches("modes", [ROW, "growth_rate"]):
        np.maximum.at(growth, modes[ROW].to_numpy(), modes["growth_rate"].to_numpy(float))
    growth[~np.isfinite(growth)] = np.nan
    return growth


def _refined(results: Results, design: Mapping[Hashable, float]) -> tuple[float, np.ndarray]:
    """Least refined onset of a design, NaN for none, and values (n,) where modes turn stable."""
    onsets = results.onsets if "onsets" in results.tables else pd.DataFrame()
    if not {"onset", *map(str, design)} <= set(onsets.columns):
        return math.nan, np.array([])
    of_design = onsets["status"].isin(REFINED_ONSETS)
    for name, setting in design.items():
        of_design &= onsets[str(name)] == setting
    onset, end = (
        onsets.loc[(of_design & (onsets["direction"] == way)).to_numpy(bool), "onset"]
        for way in (INTO, OUT_OF)
    )
    return float(onset.min()), end.to_numpy(float)


def _ends(x: np.ndarray, y: np.ndarray, ends: np.ndarray) -> list[float]:
    """The values among `ends` at which the largest growth y (n,) turns negative between points x.

    `ends` are values at which some mode turns stable; another mode may still grow there.
    """
    last = []
    for k in np.flatnonzero((y[:-1] > 0) & (y[1:] <= 0)):
        between = ends[(ends > x[k]) & (ends < x[k + 1])]
        last += [float(between.max())] if len(between) else []
    return last


def _crossing(x: np.ndarray, y: np.ndarray, onset: float) -> int:
    """Index of the first value of x (n,) beyond an onset; 0 if growth y keeps its sign there."""
    row_after = int(np.searchsorted(x, onset))
    inside = 0 < row_after < len(x)
    turns = inside and y[row_after] > 0 and y[row_after - 1] < NEUTRAL_SHARE * y[row_after]
    return row_after if turns else 0
