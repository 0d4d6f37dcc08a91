"""Labels beside points that do not lie on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg

DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
RINGS = (7.0, 16.0, 28.0, 42.0, 58.0, 76.0)  # distances from the point, in typographic points
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


def place_labels(axes: Axes, labels: Sequence[Label], fontsize: float = 8.5) -> None:
    """Write labels near their points, inside the axes, none on another.

    Places are tried outwards, in the order given; one that collides least is taken where all do.
    The layout of the figure must be complete but for these labels.
    """
    figure = axes.figure
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    scale = figure.dpi / 72
    frame = axes.get_window_extent()
    points = axes.transData.transform([(label.x, label.y) for label in labels])
    taken = [_box(x, y, (0, 0), 2 * MARKER * scale, 2 * MARKER * scale) for x, y in points]
    for label, (x, y) in zip(labels, points, strict=True):
        text = axes.text(label.x, label.y, label.text, fontsize=fontsize)
        extent = text.get_window_extent(canvas.get_renderer())
        text.remove()
        best, offset, direction = np.inf, (0.0, 0.0), (0, 0)
        for ring in RINGS:
            for dx, dy in DIRECTIONS:
                away = (dx * ring, dy * ring * 0.7)
                box = _box(
                    x + away[0] * scale, y + away[1] * scale, (dx, dy), extent.width, extent.height
                )
                cost = sum(_overlap(box, other) for other in taken) + _outside(box, frame.extents)
                if cost < best:
                    best, offset, direction, chosen = cost, away, (dx, dy), box
            if best == 0:
                break
        taken.append(chosen)
        axes.annotate(
            label.text,
            (label.x, label.y),
            offset,
            textcoords="offset points",
            ha=ALIGN[direction[0]],
            va=VALIGN[direction[1]],
            fontsize=fontsize,
            color=label.colour,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.6, "shrinkB": 2},
        ).set_in_layout(False)


def _box(
    x: float, y: float, direction: tuple[int, int], width: float, height: float
) -> tuple[float, float, float, float]:
    """Left, bottom, right, top of a text that extends from (x, y) in a direction."""
    left, bottom = x + (direction[0] - 1) / 2 * width, y + (direction[1] - 1) / 2 * height
    return left, bottom, left + width, bottom + height


def _overlap(a: Sequence[float], b: Sequence[float]) -> float:
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _outside(box: Sequence[float], frame: Sequence[float]) -> float:
    out = max(frame[0] - box[0], 0.0, box[2] - frame[2])
    out += max(frame[1] - box[1], 0.0, box[3] - frame[3])
    return 100.0 * out
