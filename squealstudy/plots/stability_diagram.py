"""Damping ratio over frequency: which modes are unstable, at one design point or at all."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.analysis.ranking import parameter_columns
from squealstudy.errors import ResultsError
from squealstudy.plots.labels import Label, place_labels
from squealstudy.plots.style import (
    GREY,
    UNSTABLE,
    colour_bar,
    damping_limits,
    finish,
    new_figure,
    plural,
    quantity,
    shade_unstable,
    track_name,
)
from squealstudy.plots.tables import describe, oscillating, with_parameters, worst_tracks

LABELS = 10  # tracks named in one picture
STABLE_DOTS = 60_000  # more are thinned out


def stability_diagram(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    point_id: str | None = None,
    colour_by: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """Frequency against damping ratio; unstable modes are highlighted and named by track.

    Parameters
    ----------
    point_id : str or None
        One design point; None: all of them, coloured by a parameter.
    colour_by : str or None
        That parameter; None: the first that is varied.
    units : mapping of parameter -> unit, or None

    Raises
    ------
    ResultsError
        For an unknown point or parameter.
    """
    shown = points if point_id is None else points[points["point_id"] == point_id]
    if not len(shown):
        raise ResultsError(f"the study has no design point '{point_id}'")
    varied = parameter_columns(points, varied=True)
    if colour_by is not None and colour_by not in parameter_columns(points):
        raise ResultsError(f"'{colour_by}' is no parameter of this study")
    table = with_parameters(points, modes[modes["point_id"].isin(shown["point_id"])])
    drawn = oscillating(table)
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set_ylim(damping_limits(100 * drawn["damping_ratio"].to_numpy()))
    colour = colour_by or (varied[0] if varied else None)
    if len(shown) == 1 or colour is None:
        _one_point(axes, drawn)
        title = describe(shown.iloc[0], points, varied or parameter_columns(points), units)
    else:
        _all_points(axes, drawn, points[colour].to_numpy()[drawn["point"]], points[colour], units)
        title = plural(len(shown), "design point")
    shade_unstable(axes)
    finish(axes, "Frequency [Hz]", "Damping ratio [%]")
    axes.set_title(f"{title}\n{_summary(shown, table)}", fontsize=10, loc="left")
    _edge_marks(axes, drawn)
    place_labels(axes, _labels(drawn), _obstacles(axes, drawn))
    return figure


def _one_point(axes: Axes, modes: pd.DataFrame) -> None:
    unstable = modes["unstable"].to_numpy(bool)
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    axes.scatter(
        x[~unstable], y[~unstable], s=28, facecolor="none", edgecolor="#0072B2", label="stable"
    )
    axes.scatter(x[unstable], y[unstable], s=42, color=UNSTABLE, zorder=3, label="unstable")


def _all_points(
    axes: Axes,
    modes: pd.DataFrame,
    values: np.ndarray,
    parameter: pd.Series,
    units: Mapping[str, str] | None,
) -> None:
    shown = quantity(str(parameter.name), parameter, units)
    colour, norm = values * shown.factor, shown.norm(shown.scaled(parameter))
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    unstable = modes["unstable"].to_numpy(bool)
    stable = np.flatnonzero(~unstable)
    stable = stable[:: max(1, -(-len(stable) // STABLE_DOTS))]
    style = {"cmap": "viridis", "norm": norm}
    axes.scatter(x[stable], y[stable], c=colour[stable], s=7, alpha=0.6, linewidth=0, **style)
    dots = axes.scatter(
        x[unstable], y[unstable], c=colour[unstable], s=20, edgecolor="0.2", linewidth=0.3, **style
    )
    colour_bar(axes, dots, shown, parameter)


def _edge_marks(axes: Axes, modes: pd.DataFrame) -> None:
    """Carets at the upper edge for modes of heavier damping than the axis shows."""
    high = axes.get_ylim()[1]
    beyond = modes["frequency_hz"].to_numpy()[100 * modes["damping_ratio"].to_numpy() > high]
    if len(beyond):
        x = np.unique(np.round(beyond, -1))
        axes.plot(x, np.full(len(x), high), "^", color=GREY, markersize=5, clip_on=False)


def _obstacles(axes: Axes, modes: pd.DataFrame) -> np.ndarray:
    """Points that labels should not cover: the modes and the line of zero damping."""
    dots = np.column_stack([modes["frequency_hz"], 100 * modes["damping_ratio"]])
    line = np.column_stack([np.linspace(*axes.get_xlim(), 300), np.zeros(300)])
    return np.concatenate([dots[:: max(1, len(dots) // STABLE_DOTS)], line, line])


def _labels(modes: pd.DataFrame) -> list[Label]:
    worst = worst_tracks(modes, LABELS)
    return [
        Label(f, 100 * z, track_name(t, f))
        for f, z, t in zip(
            worst["frequency_hz"], worst["damping_ratio"], worst["track"], strict=True
        )
    ]


def _summary(points: pd.DataFrame, modes: pd.DataFrame) -> str:
    """What is in the picture and what is not."""
    drawn = oscillating(modes)
    unstable = drawn[drawn["unstable"].to_numpy(bool)]
    if len(points) == 1:
        text = f"{len(unstable)} of {plural(len(drawn), 'mode')} unstable"
    else:
        n = int(unstable.groupby("track").ngroups)
        text = f"{plural(n, 'unstable track')}, named where they grow fastest"
    high = damping_limits(100 * drawn["damping_ratio"].to_numpy())[1]
    heavy = int((100 * drawn["damping_ratio"] > high).sum())
    failed = int((points["status"] != "ok").sum())
    overdamped = len(modes) - len(drawn)
    parts = [text]
    parts += [f"{heavy} above {high:.2g} % (▲)"] if heavy else []
    parts += [f"{plural(overdamped, 'overdamped root')} not shown"] if overdamped else []
    parts += [f"{plural(failed, 'point')} failed"] if failed else []
    return "; ".join(parts)
