"""Damping ratio over frequency of the modes at one design point, or at all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from squealstudy.colours import COLOURS, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.style import (
    UNSTABLE,
    damping_limits,
    finish,
    head,
    joined,
    one_panel,
    quantity,
    set_ticks,
    shade_unstable,
    track_name,
)
from squealstudy.plots.tables import describe, oscillating, worst_tracks
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW
from squealstudy.wording import did_you_mean, plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


DRAWN_COLUMNS = (  # columns of modes
    *(ROW, "track", "frequency_hz", "damping_ratio", "growth_rate", "unstable", "overdamped"),
)
MAX_LABELS = 10  # tracks named in one picture
LONGEST_NAME = 26  # characters of a line of a label
MIN_REL_SPAN = 0.02  # least span of the frequency axis over its mean frequency
STABLE_DOTS = 60_000  # most stable dots that are drawn; of more, every second, third, ... dot is
MAX_RIMMED_DOTS = 1_500  # more unstable dots are drawn without rims, which would hide the colours
# numbers of cells along the axes, each about 2 pixels wide; one unstable dot is drawn in a cell
N_CELLS = (450, 300)


def _all_and_worst(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture of all design points, and one of that with the fastest growth."""
    yield "", {}
    if len(results.points) > 1:
        ok = (results.points["status"] == "ok").to_numpy(bool)
        columns = [ROW, "unstable", "growth_rate"]
        modes = results.rows("modes", columns, lambda modes: ok[modes[ROW].to_numpy()])
        if modes["unstable"].any():
            fastest = int(modes["growth_rate"].to_numpy().argmax())
            row = int(modes[ROW].iloc[fastest])
            yield "_worst", {"point_id": str(results.points["point_id"].iloc[row])}


@register_plot(_all_and_worst, points=("status",), modes=("overdamped", "damping_ratio", "track"))
def stability_diagram(
    results: Results,
    point_id: str | None = None,
    colour_by: str | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Damping ratio over frequency; unstable modes are highlighted and named by track.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    point_id : str or None
        A design point; None: all of them, coloured by a parameter.
    colour_by : str or None
        The parameter that colours them; None: the first varied one.
    ax : matplotlib.axes.Axes or None
        Axes to draw in; by default those of a new figure.

    Raises
    ------
    ResultsError
        For an unknown point or parameter.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter").with_(friction=[0.2, 0.4, 0.5])
    >>> results = sq.run(study)
    >>> results.plot.stability_diagram(colour_by="friction").savefig("diagram.png")
    """
    points, units = results.points, results.units
    is_drawn = np.ones(len(points), dtype=bool)
    if point_id is not None:
        is_drawn = (points["point_id"] == point_id).to_numpy(bool)
    shown = points[is_drawn]
    if not len(shown):
        raise ResultsError(f"the study has no design point '{point_id}'")
    varied = parameter_columns(points, varied=True)
    if colour_by is not None and colour_by not in parameter_columns(points):
        hint = did_you_mean(colour_by, results.parameters)
        raise ResultsError(f"'{colour_by}' is no parameter of this study{hint}")
    table = results.rows("modes", DRAWN_COLUMNS, lambda modes: is_drawn[modes[ROW].to_numpy()])
    drawn = oscillating(table)
    figure, axes = one_panel(ax)
    axes.set_ylim(damping_limits(100 * drawn["damping_ratio"].to_numpy()))
    colour = colour_by or (varied[0] if varied else None)
    if len(shown) == 1 or colour is None:
        _one_point(axes, drawn)
        title = describe(shown.iloc[0], points, varied or parameter_columns(points), units)
    else:
        values = points[colour].to_numpy()[drawn[ROW].to_numpy()]
        shade = quantity(colour, points[colour], units)
        dots = _all_points(axes, drawn, values * shade.factor, shade.norm(points[colour]))
        bar = figure.colorbar(dots, ax=axes, label=shade.label, pad=0.015)
        set_ticks(bar.ax.yaxis, shade, points[colour])
        title = plural(len(shown), "design point")
    _widen(axes)
    shade_unstable(axes)
    finish(axes, "Frequency [Hz]", "Damping ratio [%]")
    head(axes, title, _summary(shown, table, _named_modes(results, drawn, len(shown))))
    _edge_marks(axes, drawn)
    if not len(drawn):
        axes.text(0.5, 0.6, "no modes", transform=axes.transAxes, ha="center", color="0.4")
    names = _label_names(results.track_names, len(shown) == 1)
    labels = _labels(drawn, names)
    if ax is None:
        place_labels(figure, axes, labels, _obstacles(axes, drawn))
    # places cannot be searched on axes that were given: their figure is not finished yet
    for label in labels if ax is not None else ():
        _write(axes, label, LABEL_DISTANCES_POINTS[0], LABEL_DIRECTIONS[0])
    return figure


def _widen(axes: Axes) -> None:
    """Widen a narrow frequency axis, as of two coalesced modes, so that its numbers differ."""
    low, high = axes.get_xlim()
    min_span = MIN_REL_SPAN * (low + high) / 2
    if high - low < min_span:
        axes.set_xlim((low + high - min_span) / 2, (low + high + min_span) / 2)


def _one_point(axes: Axes, modes: pd.DataFrame) -> None:
    """Draw the modes of one design point: rings for stable modes, dots for unstable ones."""
    unstable = modes["unstable"].to_numpy(bool)
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    axes.scatter(x[~unstable], y[~unstable], s=28, facecolor="none", edgecolor=COLOURS[1])
    axes.scatter(x[unstable], y[unstable], s=42, color=UNSTABLE, zorder=3)


def _all_points(
    axes: Axes, modes: pd.DataFrame, colour: np.ndarray, norm: Normalize
) -> ScalarMappable:
    """Draw small dots for stable modes and rimmed ones for unstable modes; return the latter."""
    x, y = modes["frequency_hz"].to_numpy(), 100 * modes["damping_ratio"].to_numpy()
    unstable = modes["unstable"].to_numpy(bool)
    stable = np.flatnonzero(~unstable)
    stable = stable[:: max(1, -(-len(stable) // STABLE_DOTS))]
    style: dict[str, Any] = {"cmap": "viridis", "norm": norm}
    size = np.clip(8000 / max(len(modes), 1), 7, 24)
    axes.scatter(x[stable], y[stable], c=colour[stable], s=size, alpha=0.6, linewidth=0, **style)
    last = _last_of_each_cell(x, y, np.flatnonzero(unstable))
    dense = unstable.sum() > MAX_RIMMED_DOTS
    style |= {"edgecolor": "0.2", "linewidth": 0.0 if dense else 0.3}
    style["s"] = size if dense else 13 + size
    return axes.scatter(x[last], y[last], c=colour[last], **style)


def _last_of_each_cell(x: np.ndarray, y: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Indices of the dots that can be seen: where there are very many, the topmost in each cell."""
    if len(chosen) <= N_CELLS[0] * N_CELLS[1]:
        return chosen
    cells = np.zeros(len(chosen), dtype=np.int64)
    for values, count in zip((x[chosen], y[chosen]), N_CELLS, strict=True):
        low, span = values.min(), np.ptp(values)
        position = (values - low) / (span if span > 0 else 1.0) * (count - 1)
        cells = cells * count + np.rint(position).astype(np.int64)
    _, first = np.unique(cells[::-1], return_index=True)  # the last one is drawn on top
    return np.sort(chosen[::-1][first])


def _edge_marks(axes: Axes, modes: pd.DataFrame) -> None:
    """Draw carets at the upper edge for modes with more damping than the axis shows."""
    high = axes.get_ylim()[1]
    beyond = modes["frequency_hz"].to_numpy()[100 * modes["damping_ratio"].to_numpy() > high]
    if len(beyond):
        x = np.unique(np.round(beyond, -1))
        axes.plot(x, np.full(len(x), high), "^", color=GREY, markersize=5, clip_on=False)


def _obstacles(axes: Axes, modes: pd.DataFrame) -> np.ndarray:
    """Points (n, 2) that labels should not cover: the modes and the line of zero damping."""
    dots = np.column_stack([modes["frequency_hz"], 100 * modes["damping_ratio"]])
    line = np.column_stack([np.linspace(*axes.get_xlim(), 300), np.zeros(300)])
    return np.concatenate([dots[:: max(1, len(dots) // STABLE_DOTS)], line, line])


def _label_names(
    names: Mapping[int, tuple[str, bool]], single: bool
) -> dict[int, tuple[str, bool]]:
    """Names of tracks for labels; at a single design point without names that differ elsewhere."""
    return {track: named for track, named in names.items() if not (single and named[1])}


def _labels(modes: pd.DataFrame, names: Mapping[int, tuple[str, bool]]) -> list[Label]:
    """Labels of the fastest-growing unstable modes: of tracks if there are many design points."""
    if len(modes) and np.ptp(modes[ROW].to_numpy()) > 0:
        worst = worst_tracks(modes, MAX_LABELS)
    else:
        unstable = modes[modes["unstable"].to_numpy(bool)]
        worst = unstable.sort_values("growth_rate", ascending=False).iloc[:MAX_LABELS]
    return [
        Label(f, 100 * z, track_name(t, f, names, LONGEST_NAME))
        for f, z, t in zip(
            worst["frequency_hz"], worst["damping_ratio"], worst["track"], strict=True
        )
    ]


def _named_modes(results: Results, modes: pd.DataFrame, points: int) -> str:
    """How many modes are unstable, in words. Tracks of one family are one mode and count once."""
    numbers = worst_tracks(modes)["track"].to_numpy()
    if points == 1 or len(numbers) < 2:
        return plural(len(numbers), "unstable track") if len(numbers) else ""
    ranked = results.rank()
    families = ranked[ranked["track"].isin(numbers)].groupby("family")["family_modes"]
    count = int(np.minimum(families.first(), families.size()).sum())  # some numbers may be absent
    if count == len(numbers):
        return plural(count, "unstable track")
    return f"{plural(count, 'unstable mode')} of {len(numbers)} numbers"


def _summary(points: pd.DataFrame, modes: pd.DataFrame, named: str) -> str:
    """Subtitle: the unstable modes (`named`, in words), and what the picture leaves out."""
    drawn = oscillating(modes)
    unstable = drawn[drawn["unstable"].to_numpy(bool)]
    if len(points) == 1:
        text = f"{len(unstable)} of {plural(len(drawn), 'mode')} unstable"
    else:
        text = f"{named}, named where growth is fastest" if named else ""
        untracked = int((unstable["track"] <= 0).sum())
        text = joined(
            text, f"{plural(untracked, 'unstable mode')} without track" if untracked else ""
        )
        solved = (points["status"] == "ok").any()
        none = "no unstable mode that oscillates" if solved else "no design point is solved"
        text = text or none
    high = damping_limits(100 * drawn["damping_ratio"].to_numpy())[1]
    heavy = int((100 * drawn["damping_ratio"] > high).sum())
    failed = int((points["status"] != "ok").sum())
    overdamped = len(modes) - len(drawn)
    diverging = int(modes["unstable"].sum()) - len(unstable)
    return joined(
        text,
        f"{plural(heavy, 'mark')} above {high:.2g} % (▲)" if heavy else "",
        f"{plural(overdamped, 'overdamped root')} not shown" if overdamped else "",
        f"{diverging} of them unstable" if diverging else "",
        f"{plural(failed, 'point')} failed" if failed else "",
    )


LABEL_DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
LABEL_DISTANCES_POINTS = (7.0, 16.0, 28.0, 42.0, 58.0, 76.0)  # from the dot, typographic points
VERTICAL_DISTANCE_RATIO = 0.7  # distance of labels above and below a dot over that at its sides
LABEL_FONT_POINTS = 8.5  # font size of labels
MARKER_HALF_SIZE_POINTS = 4.0  # half size of a dot that labels avoid, in typographic points
ALIGN = {1: "left", 0: "center", -1: "right"}
VALIGN = {1: "bottom", 0: "center", -1: "top"}


@dataclass(frozen=True)
class Label:
    """A text beside a dot in data coordinates."""

    x: float
    y: float
    text: str
    colour: str = "black"


def place_labels(figure: Figure, axes: Axes, labels: Sequence[Label], avoid: np.ndarray) -> None:
    """Write labels near their dots, inside the axes, and if possible without overlap.

    Labels are placed in the given order, each at the place of least cost. The cost counts the
    distance from the dot, covered labels, and covered points `avoid` (n, 2) in data coordinates.
    Everything else must have been drawn before.
    """
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # keep the layout to which places of labels belong
    scale = figure.dpi / 72
    frame = np.ravel(axes.get_window_extent().get_points())
    points = axes.transData.transform([(label.x, label.y) for label in labels])
    marker = np.full(2, 2 * MARKER_HALF_SIZE_POINTS * scale)
    taken = [_box(point, 0.0, (0, 0), marker) for point in points]
    dots = axes.transData.transform(avoid) if len(avoid) else np.zeros((0, 2))
    for label, point in zip(labels, points, strict=True):
        text = axes.text(label.x, label.y, label.text, fontsize=LABEL_FONT_POINTS)
        extent = text.get_window_extent(canvas.get_renderer())
        text.remove()
        places = [
            (ring, direction, _box(point, ring * scale, direction, np.array(extent.size)))
            for ring in LABEL_DISTANCES_POINTS
            for direction in LABEL_DIRECTIONS
        ]
        costs = [ring + _cost(box, taken, dots, frame) for ring, _, box in places]
        ring, direction, box = places[int(np.argmin(costs))]
        taken.append(box)
        _write(axes, label, ring, direction)


def _write(axes: Axes, label: Label, ring: float, direction: tuple[int, int]) -> None:
    """Write a text, with a thin line to its dot if that is far."""
    note = axes.annotate(
        label.text,
        (label.x, label.y),
        (direction[0] * ring, direction[1] * ring * VERTICAL_DISTANCE_RATIO),
        textcoords="offset points",
        ha=ALIGN[direction[0]],
        va=VALIGN[direction[1]],
        fontsize=LABEL_FONT_POINTS,
        color=label.colour,
        annotation_clip=False,
        zorder=5,
        arrowprops={"arrowstyle": "-", "color": "0.45", "linewidth": 0.7, "shrinkA": 0}
        | {"shrinkB": 2, "visible": ring > LABEL_DISTANCES_POINTS[0]},
    )
    note.set_path_effects([withStroke(linewidth=2.5, foreground="white", alpha=0.85)])
    note.set_in_layout(False)


def _box(
    point: np.ndarray, away: float, direction: tuple[int, int], size: np.ndarray
) -> np.ndarray:
    """Left, bottom, right and top of a text of a size, `away` from a point in a direction."""
    step = np.array(direction)
    corner = point + step * away * [1.0, VERTICAL_DISTANCE_RATIO] + (step - 1) / 2 * size
    return np.concatenate([corner, corner + size])


def _cost(
    box: np.ndarray, taken: Sequence[np.ndarray], dots: np.ndarray, frame: np.ndarray
) -> float:
    """Cost of a label at `box`: what it covers, and how far it leaves the frame."""
    others = np.array(taken)
    width = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    height = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    covered = (np.maximum(width, 0.0) * np.maximum(height, 0.0)).sum()
    hidden = ((dots >= box[:2]) & (dots <= box[2:])).all(axis=1).sum()
    outside = np.maximum(frame[:2] - box[:2], 0.0) + np.maximum(box[2:] - frame[2:], 0.0)
    return float(20 * covered + 8 * hidden + 100 * outside.sum())
