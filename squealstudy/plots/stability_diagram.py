"""Damping ratio over frequency: which modes are unstable, at one design point or at all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.labels import Label, place_labels
from squealstudy.plots.style import (
    COLOURS,
    GREY,
    UNSTABLE,
    damping_limits,
    finish,
    head,
    joined,
    new_figure,
    quantity,
    set_ticks,
    shade_unstable,
    track_name,
)
from squealstudy.plots.tables import describe, oscillating, worst_tracks
from squealstudy.tables.mode_ranking import parameter_columns, point_codes
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

LABELS = 10  # tracks named in one picture
STABLE_DOTS = 60_000  # more are thinned out


def _all_and_worst(results: Results) -> Iterator[tuple[str, Choices]]:
    """All design points, and the one of fastest growth."""
    yield "", {}
    modes = results.modes
    if modes["unstable"].any() and len(results.points) > 1:
        fastest = int(modes["growth_rate"].to_numpy().argmax())
        yield "_worst", {"point_id": str(modes["point_id"].iloc[fastest])}


@register_plot(_all_and_worst, points=("status",), modes=("overdamped", "damping_ratio", "track"))
def stability_diagram(
    results: Results, point_id: str | None = None, colour_by: str | None = None
) -> Figure:
    """Frequency against damping ratio; unstable modes are highlighted and named by track.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    point_id : str or None
        One design point; None: all of them, coloured by a parameter.
    colour_by : str or None
        That parameter; None: the first that is varied.

    Raises
    ------
    ResultsError
        For an unknown point or parameter.
    """
    points, modes, units = results.points, results.modes, results.units
    shown = points if point_id is None else points[points["point_id"] == point_id]
    if not len(shown):
        raise ResultsError(f"the study has no design point '{point_id}'")
    varied = parameter_columns(points, varied=True)
    if colour_by is not None and colour_by not in parameter_columns(points):
        raise ResultsError(f"'{colour_by}' is no parameter of this study")
    table = modes[modes["point_id"].isin(shown["point_id"])]
    drawn = oscillating(table)
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set_ylim(damping_limits(100 * drawn["damping_ratio"].to_numpy()))
    colour = colour_by or (varied[0] if varied else None)
    if len(shown) == 1 or colour is None:
        _one_point(axes, drawn)
        title = describe(shown.iloc[0], points, varied or parameter_columns(points), units)
    else:
        values = points[colour].to_numpy()[point_codes(points, drawn)]
        shade = quantity(colour, points[colour], units)
        dots = _all_points(axes, drawn, values * shade.factor, shade.norm(points[colour]))
        bar = figure.colorbar(dots, ax=axes, label=shade.label, pad=0.015)
        set_ticks(bar.ax.yaxis, shade, points[colour])
        title = plural(len(shown), "design point")
    shade_unstable(axes)
    finish(axes, "Frequency [Hz]", "Damping ratio [%]")
    head(axes, title, _summary(shown, table))
    _edge_marks(axes, drawn)
    if not len(drawn):
        axes.text(0.5, 0.6, "no modes", transform=axes.transAxes, ha="center", color="0.4")
    place_labels(figure, axes, _labels(drawn), _obstacles(axes, drawn))
    return figure


def _one_point(axes: Axes, modes: pd.DataFrame) -> None:
    unstable = modes["unstable"].to_numpy(bool)
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    axes.scatter(x[~unstable], y[~unstable], s=28, facecolor="none", edgecolor=COLOURS[1])
    axes.scatter(x[unstable], y[unstable], s=42, color=UNSTABLE, zorder=3)


def _all_points(
    axes: Axes, modes: pd.DataFrame, colour: np.ndarray, norm: Normalize
) -> ScalarMappable:
    """Small dots for stable modes, rimmed ones for unstable modes, which are returned."""
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    unstable = modes["unstable"].to_numpy(bool)
    stable = np.flatnonzero(~unstable)
    stable = stable[:: max(1, -(-len(stable) // STABLE_DOTS))]
    style: dict[str, Any] = {"cmap": "viridis", "norm": norm}
    size = np.clip(8000 / max(len(modes), 1), 7, 24)
    axes.scatter(x[stable], y[stable], c=colour[stable], s=size, alpha=0.6, linewidth=0, **style)
    style |= {"edgecolor": "0.2", "linewidth": 0.3, "s": 13 + size}
    return axes.scatter(x[unstable], y[unstable], c=colour[unstable], **style)


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
    if len(modes["point_id"].unique()) > 1:
        worst = worst_tracks(modes, LABELS)
    else:
        unstable = modes[modes["unstable"].to_numpy(bool)]
        worst = unstable.sort_values("growth_rate", ascending=False).iloc[:LABELS]
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
        n = len(worst_tracks(drawn))
        text = f"{plural(n, 'unstable track')}, named where growth is fastest"
        loose = int((unstable["track"] <= 0).sum())
        text += f"; {plural(loose, 'unstable mode')} without track" if loose else ""
    high = damping_limits(100 * drawn["damping_ratio"].to_numpy())[1]
    heavy = int((100 * drawn["damping_ratio"] > high).sum())
    failed = int((points["status"] != "ok").sum())
    overdamped = len(modes) - len(drawn)
    diverging = int(modes["unstable"].sum()) - len(unstable)
    return joined(
        text,
        f"{heavy} above {high:.2g} % (▲)" if heavy else "",
        f"{plural(overdamped, 'overdamped root')} not shown" if overdamped else "",
        f"{diverging} of them unstable" if diverging else "",
        f"{plural(failed, 'point')} failed" if failed else "",
    )
