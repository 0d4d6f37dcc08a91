"""Sensitivities of one mode as bars: change of growth to first order and by reanalysis."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Patch

from squealstudy.colours import COLOURS
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.plots.style import (
    UNSTABLE,
    empty_figure,
    figure_at,
    finish,
    head,
    legend_below,
    name_rows,
    whole_figure,
)
from squealstudy.plots.tables import describe
from squealstudy.tables.sensitivity_ranking import (
    mode_sensitivities,
    parameter_text,
    rank_sensitivities,
    step_text,
)
from squealstudy.wording import in_digits

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

BAR_HEIGHT = 0.36
HATCH = "////"
PREDICTED, FINITE = "predicted_growth_change", "finite_growth_change"
TITLE_LINE_CHARACTERS = 80  # characters of a line of the title
MOST_PICTURES = 8  # modes that get a picture, the fastest growing first


def _modes(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture for each mode of the design point with the largest growth."""
    table = results.sensitivities
    if not len(table):
        yield "", {}
        return
    point = str(mode_sensitivities(table)["point_id"].iloc[0])
    of_point = table[table["point_id"] == point]
    for number in sorted(of_point["mode"].unique())[:MOST_PICTURES]:
        hz = float(of_point.loc[of_point["mode"] == number, "frequency_hz"].iloc[0])
        yield f"_{in_digits(hz)}_hz", {"mode": hz, "point_id": point}


@register_plot(_modes, points=(), sensitivities=(PREDICTED, FINITE))
def sensitivity(
    results: Results,
    mode: float | None = None,
    point_id: str | None = None,
    top: int = 20,
    ax: Axes | None = None,
) -> Figure:
    """Change of the growth rate at each parameter's step, to first order and by reanalysis.

    Parameters
    ----------
    results : Results
        Of a sensitivity study.
    mode : float or None
        Frequency [Hz], for the mode nearest to it; None: the mode with the largest growth rate.
    point_id : str or None
        The design point; None: that at which the mode grows fastest.
    top : int
        Number of parameters to show, those with the largest change.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        No mode within 10 % of the frequency.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten", friction=0.5).study("flutter").sensitivities()
    >>> sq.run(study).plot.sensitivity().savefig("sensitivity.png")
    """
    if not len(results.sensitivities):
        return empty_figure("no mode, no sensitivities", ax)
    rows = mode_sensitivities(results.sensitivities, mode, point_id)
    points = results.points
    point = points[points["point_id"] == rows["point_id"].iloc[0]].iloc[0]
    title = describe(point, points, results.parameters, results.units)
    return sensitivity_bars(rows, title, top, ax)


def sensitivity_bars(
    mode: pd.DataFrame, title: str = "", top: int = 20, ax: Axes | None = None
) -> Figure:
    """The figure of the rows of one mode; `title` has the parameters of the design point."""
    shown = rank_sensitivities(mode, top)
    figure = figure_at(ax, 10.0, 1.9 + 0.36 * len(shown))
    axes = figure.add_subplot()
    positions = np.arange(len(shown), dtype=float)
    hatches = [HATCH if near else "" for near in shown["near_coalescence"]]
    for offset, column, colour in (
        (-BAR_HEIGHT / 2, PREDICTED, COLOURS[1]),
        (BAR_HEIGHT / 2, FINITE, UNSTABLE),
    ):
        bars = axes.barh(positions + offset, shown[column], height=BAR_HEIGHT, color=colour)
        for bar, hatch in zip(bars, hatches, strict=True):
            if hatch and column == PREDICTED:
                bar.set_hatch(hatch)
                bar.set_edgecolor("white")
    axes.axvline(0.0, color="0.2", linewidth=1.0)
    finish(axes, "Change of the growth rate [1/s]", "")
    name_rows(axes, [f"{parameter_text(r)}   {step_text(r)}" for r in shown.to_dict("records")])
    first = shown.iloc[0]
    text = f"mode at {in_digits(first['frequency_hz'])} Hz, growth rate "
    text += f"{in_digits(first['growth_rate'], 1)} 1/s, condition {first['condition']:.1f}"
    if len(mode) > len(shown):
        text += f"; first {len(shown)} of {len(mode)} parameters"
    head(axes, text, *wrap(title, TITLE_LINE_CHARACTERS))
    _legend(figure, any(hatches))
    return whole_figure(figure)


def _legend(figure: FigureBase, hatched: bool) -> None:
    """Draw the legend; `hatched` tells that bars near coalescence are shown."""
    handles = [
        Patch(color=COLOURS[1], label="first order, from left and right vectors"),
        Patch(color=UNSTABLE, label="reanalysis"),
    ]
    if hatched:
        label = "near coalescence: the derivative does not hold over the step"
        handles.append(Patch(facecolor=COLOURS[1], edgecolor="white", hatch=HATCH, label=label))
    legend_below(figure, handles, 3, "right")
