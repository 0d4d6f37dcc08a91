"""Map of instability over two parameters: how many modes are unstable, or how fast they grow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import TickedStroke

from squealstudy.colours import COLOURS
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.boundary_lines import Boundary, stability_boundary
from squealstudy.plots.plane import MEASURES, MOST_DOTS, StudyPlane, study_plane
from squealstudy.plots.style import finish, joined, legend_below, one_panel
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

BOUNDARY = COLOURS[1]
STABLE = "#EFEFEF"
SEVERITY = "YlOrBr"
MOST_CLASSES = 12  # colours for counts; if there are more, counts share colours
JOIN_DASHES = (0, (4, 2))  # dashes of the line that joins onsets
MOST_ONSETS = 150  # onsets with large dots; those of more would hide the line
TITLE_LINE_CHARACTERS = 90  # characters in a line of the title
LEGEND_LINE_CHARACTERS = 95  # characters of a line of the legend


def _measures(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture for each measure, of a study in which two parameters or more vary."""
    if len(parameter_columns(results.points, varied=True)) > 1:
        for measure in MEASURES:
            yield f"_{measure}", {"measure": measure}


@register_plot(_measures, points=("status",), modes=("overdamped",), onsets=("onset",))
def stability_map(
    results: Results,
    x: str | None = None,
    y: str | None = None,
    fixed: Mapping[str, float] | None = None,
    measure: str = "count",
    ax: Axes | None = None,
) -> Figure:
    """Cells of a grid, or triangles between scattered points, coloured by instability.

    A cell has the value of the design point in it, on both sides of a boundary that passes through.
    A line separates points with an unstable mode from points without; ticks point to the unstable
    side (plots.boundary_lines). It is dashed, because it joins crossings by straight lines where
    nothing was solved: the onset may jump between them. Refined onsets are dots. For a parameter
    that is only 0 or 1, as a state of contact, they are drawn without the line, as there is nothing
    in between. Solved nodes of a boundary design are marked.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    x, y : str or None
        Two varied parameters; by default the first two.
    fixed : mapping of parameter -> value or None
        Values of other parameters; of several planes that with most unstable modes is shown.
    measure : str
        "count": number of unstable modes; "growth": growth rate of the fastest mode.
    ax : matplotlib.axes.Axes or None
        Axes to draw in, without a legend; by default those of a new figure.

    Raises
    ------
    ResultsError
        For an unknown parameter, measure or value.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("plane")
    >>> results = sq.run(study.with_(friction=[0.2, 0.4], frequency_2=[74.0, 80.0]))
    >>> results.plot.stability_map(x="friction", y="frequency_2").savefig("map.png")
    """
    free = [n for n in parameter_columns(results.points, varied=True) if n not in (x, y)]
    if [x, y].count(None) > len(free):
        raise ResultsError(f"{results.directory}: a map needs two parameters that vary")
    across = x or free.pop(0)
    plane = study_plane(results, (across, y or free.pop(0)), fixed, measure)
    figure, axes = one_panel(ax, 8.5, 6.2)
    plane.frame(axes, results.nodes[0])
    colours, norm = _colours(plane.value, measure)
    style: dict[str, Any] = {"cmap": colours, "norm": norm}
    if plane.gridded:
        drawn = plane.draw_cells(axes, plane.value, **style)
    else:
        drawn = _scattered(axes, plane, style)
    bar = figure.colorbar(drawn, ax=axes, label=MEASURES[measure], pad=0.015)
    if measure == "count":
        highest = int(np.nanmax(np.append(plane.value, 1.0)))
        bar.set_ticks(range(0, highest + 1, 1 + highest // MOST_CLASSES))
        bar.minorticks_off()
    if not plane.others_vary:
        boundary = stability_boundary(plane, results.onsets, results.along)
        if any(_is_switch(results, shown.name) for shown in (plane.across, plane.up)):
            boundary = boundary._replace(lines=[])
        handles = _boundary(axes, boundary, results.along, plane.gridded)
        if ax is None:
            legend_below(figure, handles, 1)
    finish(axes, plane.across.label, plane.up.label)
    axes.grid(False)
    failed = int((~plane.solved).sum())
    gathered = _gathered(plane)
    mark = "hatched" if plane.gridded else "x"
    if gathered:
        mark = "hatched where no other is in the cell" if plane.gridded else "not shown"
    title = joined(
        plane.elsewhere,
        gathered,
        _mark_solved(axes, plane, results.nodes[1]),
        f"{plural(failed, 'point')} failed ({mark})" if failed else "",
        _finding(plane, "point" if results.nodes[1] is None else "node"),
    )
    axes.set_title(fill(title, TITLE_LINE_CHARACTERS), fontsize=10, loc="left")
    return figure


def _colours(value: np.ndarray, measure: str) -> tuple[Colormap, Normalize]:
    """Colours and their scale: light grey for stable points, darker with a larger measure."""
    highest = float(np.nanmax(np.append(value, 0.0)))
    if measure == "count":
        classes = int(min(max(highest, 1), MOST_CLASSES))
        shades = colormaps[SEVERITY](np.linspace(0.2, 1.0, max(classes, 5))[:classes])
        limits = [-0.5, *np.linspace(0.5, max(highest, 1) + 0.5, classes + 1)]
        return ListedColormap([STABLE, *shades]), BoundaryNorm(limits, classes + 1)
    top = highest or 1.0
    colours = ListedColormap(colormaps[SEVERITY](np.linspace(0.1, 1.0, 256)))
    return colours.with_extremes(under=STABLE), Normalize(1e-9 * top, top)


def _finding(plane: StudyPlane, word: str) -> str:
    """At how many of the solved points of a plane a mode is unstable, in words."""
    count, solved = int((plane.unstable & plane.solved).sum()), int(plane.solved.sum())
    if count:
        return f"unstable at {count} of {plural(solved, word)}"
    if not solved:
        return "no design point is solved"
    return "no unstable mode" + ("" if plane.solved.all() else " where it is solved")


def _gathered(plane: StudyPlane) -> str:
    """Text on what a cell shows if points are too many to be told apart; else empty."""
    if plane.gridded:
        across, up = plane.merged
        return f"a cell: the largest of {across} x {up} points" if across * up > 1 else ""
    return "a cell: the largest of its points" if len(plane.x) > MOST_DOTS else ""


def _scattered(axes: Axes, plane: StudyPlane, style: dict[str, Any]) -> ScalarMappable:
    """Draw scattered points, and triangles between them if they span an area.

    Very many points are gathered in cells.
    """
    finite = np.isfinite(plane.value)
    if len(plane.x) > MOST_DOTS and finite.any():
        return plane.draw_bins(axes, plane.value, **style)
    triangles = plane.triangles(plane.value)
    if triangles is not None:
        axes.tripcolor(triangles, plane.value[finite], alpha=0.6, **style)
    axes.plot(plane.x[~finite], plane.y[~finite], "x", color="0.4")
    style = style | {"edgecolor": "0.3", "linewidth": 0.6, "s": 38, "zorder": 2}
    return axes.scatter(plane.x[finite], plane.y[finite], c=plane.value[finite], **style)


def _mark_solved(axes: Axes, plane: StudyPlane, solved: np.ndarray | None) -> str:
    """Draw dots at the solved nodes of a boundary design; text on how many they are, or ""."""
    if solved is None:
        return ""
    is_solved = solved[plane.rows]
    axes.plot(
        plane.x[is_solved], plane.y[is_solved], ".", color="0.25", markersize=2.5, markeredgewidth=0
    )
    return f"{is_solved.sum()} of {len(is_solved)} nodes solved (dots)"


def _is_switch(results: Results, parameter: str) -> bool:
    """Whether a parameter takes the values 0 and 1 alone."""
    return set(results.points[parameter]) == {0.0, 1.0}


def _boundary(axes: Axes, boundary: Boundary, along: str | None, cells: bool) -> list[Line2D]:
    """Draw the boundary, ticks to the unstable side; legend entries on how it was placed."""
    if not boundary.lines and not len(boundary.solved):
        return []
    for line in boundary.lines:
        (ticks,) = axes.plot(*line.T, color=BOUNDARY, linewidth=1.0)
        ticks.set_path_effects([TickedStroke(angle=-60, spacing=9, length=0.5)])
        axes.plot(*line.T, color=BOUNDARY, linewidth=1.8, linestyle=JOIN_DASHES)
    if many := len(boundary.solved):
        size = 4.5 if many <= MOST_ONSETS else 2.5
        axes.plot(*boundary.solved.T, "o", color=BOUNDARY, markersize=size)
    crossings, refined = boundary.crossings, boundary.refined
    how = "between design points, not refined"
    if refined:
        how = f"refined along {along}"
        how += f" at {refined} of {crossings} crossings" if refined < crossings else ""
    label = "boundary of stability of any mode, ticks to the unstable side: dashed where joined, "
    label += f"not solved; {how}"
    style: dict[str, Any] = {"color": BOUNDARY, "linewidth": 1.8, "linestyle": JOIN_DASHES}
    handles = []
    if boundary.lines:
        handles.append(Line2D([], [], label=fill(label, LEGEND_LINE_CHARACTERS), **style))
    if refined:
        dot: dict[str, Any] = {
            "color": BOUNDARY,
            "marker": "o",
            "markersize": 4.5,
            "linestyle": "none",
        }
        handles.append(Line2D([], [], label="onset, refined", **dot))
    if cells:
        side = "also beyond the boundary" if boundary.lines else "on both sides of an onset"
        label = f"a cell is coloured by the point in it, {side}; grey: none unstable"
        handles.append(Line2D([], [], linestyle="none", label=label))
    return handles
