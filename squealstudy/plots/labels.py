"""Labels beside points that do not lie on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
RINGS = (7.0, 16.0, 28.0, 42.0, 58.0, 76.0)  # distances from the point, in typographic points
FLAT = 0.7  # of the distance, upwards and downwards
MARKER = 4.0  # half size of what a label should not cover, in typographic points
ALIGN = {1: "left", 0: "center", -1: "right"}
VALIGN = {1: "bottom", 0: "center", -1: "top"}


@dataclass(frozen=True)
class Label:
    """A text beside a point in data coordinates."""

    x: float
    y: float
    text: str
    colour: str = "black"


def place_labels(
    figure: Figure,
    axes: Axes,
    labels: Sequence[Label],
    avoid: np.ndarray,
    fontsize: float = 8.5,
) -> None:
    """Write labels near their points, inside the axes, none on another if that can be.

    In the order given, each takes the place that costs least: in distance, in covered labels and
    in covered points `avoid` (n, 2) in data coordinates. All else must have been drawn before.
    """
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout stays as the labels have found it
    scale = figure.dpi / 72
    frame = np.ravel(axes.get_window_extent().get_points())
    points = axes.transData.transform([(label.x, label.y) for label in labels])
    marker = np.full(2, 2 * MARKER * scale)
    taken = [_box(point, 0.0, (0, 0), marker) for point in points]
    dots = axes.transData.transform(avoid) if len(avoid) else np.zeros((0, 2))
    for label, point in zip(labels, points, strict=True):
        text = axes.text(label.x, label.y, label.text, fontsize=fontsize)
        extent = text.get_window_extent(canvas.get_renderer())
        text.remove()
        places = [
            (ring, direction, _box(point, ring * scale, direction, np.array(extent.size)))
            for ring in RINGS
            for direction in DIRECTIONS
        ]
        costs = [ring + _cost(box, taken, dots, frame) for ring, _, box in places]
        ring, direction, box = places[int(np.argmin(costs))]
        taken.append(box)
        _write(axes, label, ring, direction, fontsize)


def _write(
    axes: Axes, label: Label, ring: float, direction: tuple[int, int], fontsize: float
) -> None:
    """The text, with a thin line to its point where it is far."""
    note = axes.annotate(
        label.text,
        (label.x, label.y),
        (direction[0] * ring, direction[1] * ring * FLAT),
        textcoords="offset points",
        ha=ALIGN[direction[0]],
        va=VALIGN[direction[1]],
        fontsize=fontsize,
        color=label.colour,
        annotation_clip=False,
        zorder=5,
        arrowprops={"arrowstyle": "-", "color": "0.45", "linewidth": 0.7, "shrinkA": 0}
        | {"shrinkB": 2, "visible": ring > RINGS[0]},
    )
    note.set_path_effects([withStroke(linewidth=2.5, foreground="white", alpha=0.85)])
    note.set_in_layout(False)


def _box(
    point: np.ndarray, away: float, direction: tuple[int, int], size: np.ndarray
) -> np.ndarray:
    """Left, bottom, right, top of a text that extends from beside a point in a direction."""
    step = np.array(direction)
    corner = point + step * away * [1.0, FLAT] + (step - 1) / 2 * size
    return np.concatenate([corner, corner + size])


def _cost(
    box: np.ndarray, taken: Sequence[np.ndarray], dots: np.ndarray, frame: np.ndarray
) -> float:
    """What a label at `box` covers, and how far it leaves the frame."""
    others = np.array(taken)
    width = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    height = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    covered = (np.maximum(width, 0.0) * np.maximum(height, 0.0)).sum()
    hidden = ((dots >= box[:2]) & (dots <= box[2:])).all(axis=1).sum()
    outside = np.maximum(frame[:2] - box[:2], 0.0) + np.maximum(box[2:] - frame[2:], 0.0)
    return float(20 * covered + 8 * hidden + 100 * outside.sum())
