"""Map of verdicts over two parameters, with the least kick where one starts squeal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from squealstudy.colours import FILLS, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.plane import Plane
from squealstudy.plots.style import figure_at, finish, joined, legend_below, quantity, whole_figure
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

N_CONTOURS = 5  # contours of the least kick
BORDERS = {"H": ("^", "Hopf point of a branch"), "F": ("D", "fold of a branch")}
LINES = {"H": ("-", "border of Hopf points"), "F": ("--", "border of folds")}


def _planes(results: Results) -> Iterator[tuple[str, Choices]]:
    """One picture of a study in which two parameters or more vary."""
    if len(parameter_columns(results.points, varied=True)) > 1:
        yield "", {}


@register_plot(
    _planes,
    points=("verdict", "threshold_velocity"),
    branches=("along", "value", "event"),
    borders=("along", "value", "over", "over_value", "event"),
)
def verdict_map(
    results: Results,
    x: str | None = None,
    y: str | None = None,
    fixed: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Cells of a grid, or scattered points, coloured by verdict; contours of the least kick.

    Hopf points and folds of branches along one of the two parameters are marked: along a branch
    verdicts change there. If they were continued over the other parameter (`borders_over`) they are
    lines. Contours are drawn on a grid with more than three kicks.

    Parameters
    ----------
    results : Results
        Of a study of limit cycles.
    x, y : str or None
        Two varied parameters; by default the first two.
    fixed : mapping of parameter -> value or None
        Values of other parameters; by default those of the point in the middle of the table.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        Where two parameters do not vary.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("verdict_map")[0])
    >>> changes = {"limit_cycles.borders_over": None, "sweep[2].values": [-5.9e17, -5.4e17]}
    >>> results = sq.run(study.with_(changes, friction=[0.4, 0.7]))
    >>> results.plot.verdict_map().savefig("verdicts.png")
    """
    points, units = results.points, results.units
    varied = parameter_columns(points, varied=True)
    free = [n for n in varied if n not in (x, y)]
    if [x, y].count(None) > len(free) or {x, y} - {None, *varied}:
        raise ResultsError(f"{results.directory}: a map needs two parameters that vary")
    across = x or free.pop(0)
    up = y or free.pop(0)
    others = [n for n in varied if n not in (across, up)]
    fixed_values = {n: points[n].iloc[len(points) // 2] for n in others} | dict(fixed or {})
    rows = points
    for name, fixed_value in fixed_values.items():
        rows = rows[np.isclose(rows[name], fixed_value, rtol=1e-6, atol=0.0)]
    if not len(rows):
        raise ResultsError(f"{results.directory}: no design point at these values")
    first, second = (quantity(n, points[n], units) for n in (across, up))
    plane = Plane(first, second, first.scaled(rows[across]), second.scaled(rows[up]))
    codes = [*FILLS]
    verdict = rows["verdict"].map({name: k for k, name in enumerate(codes)}).to_numpy(float)
    verdict[(rows["status"] != "ok").to_numpy(bool)] = np.nan
    figure = figure_at(ax, 8.5, 6.0)
    axes = figure.add_subplot()
    plane.frame(axes, rows)
    colours = ListedColormap([FILLS[name] for name in codes])
    norm = BoundaryNorm(np.arange(len(codes) + 1) - 0.5, len(codes))
    gridded = all(len(np.unique(v)) > 1 for v in (plane.x, plane.y)) and len(rows) > 3
    if gridded:
        plane.draw_cells(axes, verdict, cmap=colours, norm=norm)
    else:
        axes.scatter(plane.x, plane.y, c=verdict, cmap=colours, norm=norm)
    threshold = rows["threshold_velocity"].to_numpy(float)
    n_thresholds = int(np.isfinite(threshold).sum())
    if gridded and n_thresholds > 3:
        cells = plane.cells(threshold)
        lines = axes.contour(*cells[:2], np.ma.masked_invalid(cells[2]), N_CONTOURS, colors="0.15")
        axes.clabel(lines, fontsize=8, fmt="%.3g m/s")
    borders = _borders(axes, results, plane, rows, (across, up))
    counts = np.bincount(verdict[np.isfinite(verdict)].astype(int), minlength=len(codes))
    handles = [
        Patch(
            facecolor=FILLS[name], edgecolor=GREY, label=f"{name.replace('_', ' ')} ({counts[k]})"
        )
        for k, name in enumerate(codes)
        if counts[k]
    ]
    legend_below(figure, [*handles, *borders])
    finish(axes, plane.across.label, plane.up.label)
    axes.grid(False)
    design_text = describe(rows.iloc[0], points, others, units)
    lines_told = f"lines: least kick along the unstable cycle, of {n_thresholds} designs"
    n_failed = int((~np.isfinite(verdict)).sum())
    failed = f"{plural(n_failed, 'design')} failed, not shown" if n_failed else ""
    failed = "hatched: failed" if n_failed and gridded else failed
    axes.set_title(
        joined(design_text, lines_told if gridded and n_thresholds > 3 else "", failed),
        fontsize=9.5,
    )
    return whole_figure(figure)


def _borders(
    axes: Axes, results: Results, plane: Plane, rows: pd.DataFrame, names: tuple[str, str]
) -> list[Artist]:
    """Draw Hopf points and folds of branches that begin at the shown designs; legend entries."""
    branches = results.table("branches")
    drawn: list[Artist] = []
    for event, (marker, label) in BORDERS.items():
        if lines := _lines(axes, results, plane, rows, names, event):
            drawn.append(lines[0])
            continue
        is_event = (branches["event"] == event) & branches["along"].isin(names)
        of_designs = branches[is_event.to_numpy(bool)].merge(
            rows[["point_id", *names]], on="point_id"
        )
        if not len(of_designs):
            continue
        x, y = (
            of_designs[name].where(of_designs["along"] != name, of_designs["value"])
            for name in names
        )
        style: dict[str, Any] = {"color": "black", "markersize": 6, "label": label}
        drawn += axes.plot(
            plane.across.scaled(x), plane.up.scaled(y), marker, linestyle="", **style
        )
    return drawn


def _lines(
    axes: Axes,
    results: Results,
    plane: Plane,
    rows: pd.DataFrame,
    names: tuple[str, str],
    event: str,
) -> list[Artist]:
    """Draw the borders of an event over both parameters of the map, of the shown designs."""
    table = results.table("borders")
    is_event = (table["event"] == event) & table["point_id"].isin(rows["point_id"])
    is_event &= table["along"].isin(names) & table["over"].isin(names)
    style, label = LINES[event]
    drawn: list[Artist] = []
    for _, border in table[is_event.to_numpy(bool)].groupby("border_id", sort=False):
        x, y = (border["value"].where(border["along"] == n, border["over_value"]) for n in names)
        drawn += axes.plot(
            plane.across.scaled(x), plane.up.scaled(y), style, color="black", label=label
        )
    return drawn
