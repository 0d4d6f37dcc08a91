"""Where in two parameters modes are unstable: how many, or how strongly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.tri import Triangulation

from squealstudy.analysis.ranking import parameter_columns
from squealstudy.errors import ResultsError
from squealstudy.plots.style import Quantity, finish, new_figure, quantity, set_ticks, track_name
from squealstudy.plots.tables import describe, oscillating, slice_points, worst_tracks

BOUNDARIES = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#56B4E9")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
MEASURES = {"count": "Unstable modes", "growth": "Largest growth rate [1/s]"}


@dataclass(frozen=True)
class _Field:
    """Points of a map: drawn coordinates, the measure (NaN where a point failed), the measure's
    name, and damping ratios of the tracks with a boundary (n, tracks)."""

    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    measure: str
    damping: pd.DataFrame
    shown: tuple[Quantity, Quantity]


def stability_map(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    x: str,
    y: str,
    fixed: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    measure: str = "count",
    top: int = 4,
) -> Figure:
    """Cells of a grid (or triangles between scattered points) coloured by instability.

    Parameters
    ----------
    x, y : str
        Two varied parameters.
    fixed : mapping of parameter -> value or None
        The plane to show; of what is left open, the plane with most unstable modes is taken.
    units : mapping of parameter -> unit, or None
    measure : str
        "count" or "growth" (of the most unstable mode).
    top : int
        Number of tracks, fastest growth first, whose boundary of stability is drawn.

    Raises
    ------
    ResultsError
        For an unknown parameter, measure or value.
    """
    if measure not in MEASURES:
        raise ResultsError(f"'{measure}' cannot be shown, expected {' or '.join(MEASURES)}")
    if x == y:
        raise ResultsError(f"a map needs two parameters, got '{x}' twice")
    gridded = _is_grid(points, (x, y))
    plane = slice_points(points, modes, (x, y), fixed) if gridded else points
    rows = modes[modes["point_id"].isin(plane["point_id"])]
    worst = worst_tracks(oscillating(rows), top)
    field = _field(points, plane, rows, worst, (x, y), units, measure)
    figure = new_figure(8.5, 6.0)
    axes = figure.add_subplot()
    colours, norm = _colours(field)
    if gridded:
        drawn = _cells(axes, field, colours, norm)
    else:
        drawn = _triangles(axes, field, colours, norm)
    ...
    return figure
