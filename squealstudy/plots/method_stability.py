"""Map of a numerical method over two knobs: outcomes as colours, the prediction as a line."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke, withTickedStroke

from squealstudy.colours import COLOURS, DARK
from squealstudy.engine.pictures import register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.plane import Plane
from squealstudy.plots.stability_map import STABLE
from squealstudy.plots.style import (
    UNSTABLE,
    Quantity,
    figure_at,
    finish,
    head,
    joined,
    legend_below,
    quantity,
    whole_figure,
)
from squealstudy.tables.method_quality import WORKS
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

# outcome class: its colour and what it is called, from good to bad
CLASSES = {
    "converged": (STABLE, "converged"),
    "slow": (COLOURS[5], "slow"),
    "recovered": (COLOURS[2], "recovered"),
    "wrong": (UNSTABLE, "wrong, flagged"),
    "failed": (DARK, "failed, said so"),
}
ALARM = "#CC0066"
SHOWN_DECADES = 6.0  # decades on both sides of the boundary within which contours are interpolated
LEGEND_LINE_CHARACTERS = 48  # characters of a line in the legend
POINTS_PER_INTERVAL = 8  # interpolated between two values of a knob


@register_plot(cells=("outcome", "flagged", "predicted"))
def method_stability(results: Results, ax: Axes | None = None) -> Figure:
    """Cells of a grid coloured by outcome, with the predicted boundary as a line.

    An axis is logarithmic where the values of its knob are spaced so.

    Parameters
    ----------
    results : Results
        Of a method-stability study.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        For an outcome that is no class.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("linearisation")[0])
    >>> results = sq.run(study.with_({"knob[1].num": 4, "knob[2].num": 4}))
    >>> results.plot.method_stability().savefig("cells.png")
    """
    cells, facts = results.cells, results.manifest
    unknown = sorted(set(cells["outcome"]) - set(CLASSES))
    if unknown:
        raise ResultsError(f"outcome '{unknown[0]}' is none of {', '.join(CLASSES)}")
    figure = figure_at(ax, 8.5, 6.4)
    axes = figure.add_subplot()
    across, up = (quantity(name, cells[name], results.units) for name in facts["knobs"])
    x, y = (shown.scaled(cells[shown.name]) for shown in (across, up))
    plane = Plane(across=across, up=up, x=x, y=y)
    plane.frame(axes, cells)
    handles = _draw_classes(axes, plane, cells)
    handles += _draw_alarm(axes, plane, cells)
    handles += _draw_boundary(axes, plane, cells["predicted"], facts["boundary"])
    labels = (_label(shown, facts["words"]) for shown in (across, up))
    finish(axes, *labels)
    axes.grid(False)
    head(axes, facts["title"], tally(cells))
    legend_below(figure, handles, 3)
    return whole_figure(figure)


def _label(shown: Quantity, words: Mapping[str, str]) -> str:
    """Name, unit and meaning of a knob."""
    return joined(shown.label, words.get(shown.name, ""), by=": ")


def tally(cells: pd.DataFrame) -> str:
    """How far prediction and outcome agree, in words."""
    works, inside = cells["outcome"].isin(WORKS), cells["predicted"] < 1.0
    beyond = cells["predicted"] >= 1.0
    text = (
        f"works in {int((works & inside).sum())} of {plural(int(inside.sum()), 'cell')} within the "
        f"predicted boundary, in {int((works & beyond).sum())} of {int(beyond.sum())} beyond"
    )
    helped = int(((cells["outcome"] == "recovered") & beyond).sum())
    text += f" ({helped} of these by a help)" if helped else ""
    unknown = int((~inside & ~beyond).sum())
    text += f"; {plural(unknown, 'cell')} without a prediction" if unknown else ""
    alarms = int(_unflagged(cells).sum())
    return f"{text}; {alarms} wrong without a warning" if alarms else text


def _unflagged(cells: pd.DataFrame) -> np.ndarray:
    """Rows (n,) whose outcome is wrong without a warning."""
    wrong = (cells["outcome"] == "wrong").to_numpy(dtype=bool)
    silent: np.ndarray = wrong & ~cells["flagged"].to_numpy(dtype=bool)
    return silent


def _draw_classes(axes: Axes, plane: Plane, cells: pd.DataFrame) -> list[Patch | Line2D]:
    """Draw cells by class; return the legend entries of classes that occur, with their number."""
    outcome = cells["outcome"]
    names = list(CLASSES)
    class_numbers = outcome.map(names.index).to_numpy(dtype=float)
    colours = ListedColormap([colour for colour, _ in CLASSES.values()])
    plane.draw_cells(axes, class_numbers, cmap=colours, vmin=-0.5, vmax=len(names) - 0.5)
    return [
        Patch(facecolor=colour, edgecolor="0.6", label=f"{text} {_counts(cells, name)}")
        for name, (colour, text) in CLASSES.items()
        if (outcome == name).any()
    ]


def _counts(cells: pd.DataFrame, name: str) -> str:
    """Number of cells of a class; that of recovered ones for each help."""
    of_class = cells[cells["outcome"] == name]
    if name != "recovered" or "by" not in cells:
        return f"({len(of_class)})"
    return "\n".join(f"by {by} ({n})" for by, n in of_class["by"].value_counts().items())


def _draw_alarm(axes: Axes, plane: Plane, cells: pd.DataFrame) -> list[Patch | Line2D]:
    """Draw crosses on cells that are wrong without a warning; return their legend entry."""
    silent = _unflagged(cells)
    if not silent.any():
        return []
    style: dict[str, Any] = {
        "linestyle": "",
        "marker": "X",
        "color": ALARM,
        "markeredgecolor": "white",
    }
    axes.plot(
        plane.x[silent],
        plane.y[silent],
        markersize=11,
        markeredgewidth=1.5,
        zorder=4,
        **style,
    )
    return [Line2D([], [], markersize=10, label=f"WRONG, NOT FLAGGED ({silent.sum()})", **style)]


def _draw_boundary(
    axes: Axes, plane: Plane, predicted: pd.Series, boundary: str
) -> list[Patch | Line2D]:
    """Draw the line predicted = 1, with ticks to the side where failure is predicted."""
    number = predicted.to_numpy(dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, decades = plane.cells(np.log10(number))
        table = np.ma.masked_invalid(np.clip(decades, -SHOWN_DECADES, SHOWN_DECADES))
    name = (
        fill(f"predicted: {boundary}", LEGEND_LINE_CHARACTERS) if boundary else "predicted boundary"
    )
    crossed = min(table.shape) > 1 and table.count() and table.min() < 0.0 < table.max()
    if not crossed:
        side = "beyond it throughout" if table.count() and table.min() >= 0.0 else "not crossed"
        return [Line2D([], [], linestyle="", label=f"{name}: {side}")]
    x, finer = _between(plane.across, x, table.filled(np.nan))
    y, finest = _between(plane.up, y, finer.T)  # contours do not know of logarithmic axes
    fine = np.ma.masked_invalid(finest.T)
    lines = axes.contour(x, y, fine, [0.0], colors="black", linewidths=2.0, zorder=3)
    halo = withStroke(linewidth=4.0, foreground="white")
    lines.set_path_effects([halo, withTickedStroke(angle=60, spacing=10, length=0.5)])
    return [Line2D([], [], color="black", linewidth=2.0, label=name)]


def _between(
    shown: Quantity, values: np.ndarray, table: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ascending values (n,) and columns of a table (m, n), interpolated in each interval."""
    positions = shown.even(values)
    parts = np.interp(
        np.arange((len(positions) - 1) * POINTS_PER_INTERVAL + 1) / POINTS_PER_INTERVAL,
        range(len(positions)),
        positions,
    )
    return shown.uneven(parts), np.array([np.interp(parts, positions, row) for row in table])
