"""Pictures of components from files: an assembly with its contact faces, and free modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from squealstudy.models.cells import NONE
from squealstudy.shapes.picture import PIXEL_COLUMNS, SAMPLES_PER_PIXEL, VIEW_DEG
from squealstudy.shapes.surface import Camera, picture, triangles, with_middles

GREYS = ("#cfd6da", "#b9c3c9", "#dcdcd4", "#c3bfb4", "#aab4ba", "#d4cdd6")
GAP_OVER_DIAGONAL = 0.35  # distance between neighbours over the assembly's diagonal


@dataclass(frozen=True)
class Body:
    """Drawing of a component.

    Attributes
    ----------
    nodes : ndarray (n, 3)
        Coordinates of its nodes, m.
    facets : ndarray (m, 8) of int
        Its surface, in the form of `ComponentCells.facets`.
    faces : dict of str -> sequence of ndarray (p, k) of int
        For each coloured face, nodes of its facets in groups of equal k = 3, 4, 6 or 8.
    """

    nodes: np.ndarray
    facets: np.ndarray
    faces: Mapping[str, Sequence[np.ndarray]]


def eight(nodes: np.ndarray) -> np.ndarray:
    """Facets (p, k) of 3, 4, 6 or 8 nodes as (p, 8): corners, middles of edges, NONE if absent."""
    n, k = nodes.shape
    corners = 3 if k in (3, 6) else 4
    eight_nodes = np.full((n, 8), NONE)
    eight_nodes[:, :corners] = nodes[:, :corners]
    if k > corners:
        eight_nodes[:, 4 : 4 + corners] = nodes[:, corners:]
    return eight_nodes


def draw_assembly(bodies: Mapping[str, Body], axis: np.ndarray) -> Figure:
    """Picture of the assembly, and of its components drawn apart along an axis, seen from below.

    Contact faces have colours of their own.
    """
    names = list(dict.fromkeys(face for body in bodies.values() for face in body.faces))
    bright = [mpl.colormaps["tab10"](i % 10) for i in range(len(names))]
    greys = [GREYS[i % len(GREYS)] for i in range(len(bodies))]
    colours = ListedColormap([*greys, *bright])
    mapped = ScalarMappable(
        BoundaryNorm(np.arange(len(greys) + len(names) + 1), colours.N), colours
    )
    figure: Any = Figure(figsize=(14.0, 7.0), layout="constrained")
    together = np.vstack([b.nodes for b in bodies.values()])
    diagonal = float(np.linalg.norm(np.ptp(together, axis=0)))
    order = sorted(bodies, key=lambda name: float(bodies[name].nodes.mean(axis=0) @ axis))
    below = (VIEW_DEG[0], -VIEW_DEG[1])
    views = ((0.0, VIEW_DEG), (GAP_OVER_DIAGONAL * diagonal, below))
    for axes, (spacing, view) in zip(figure.subplots(1, 2), views, strict=True):
        points, values, facets = [], [], []
        start = 0
        for number, (name, body) in enumerate(bodies.items()):
            moved_apart = body.nodes + spacing * order.index(name) * axis
            coloured = [
                (eight(nodes), len(greys) + names.index(face))
                for face, groups in body.faces.items()
                for nodes in groups
            ]
            uncoloured = _without(body.facets, [f for f, _ in coloured])
            for part_facets, colour in [(uncoloured, number), *coloured]:
                used = np.where(part_facets == NONE, NONE, part_facets + start)
                facets.append(used)
                points.append(moved_apart)
                values.append(np.full(len(moved_apart), colour + 0.5))
                start += len(moved_apart)
        _draw(axes, np.vstack(points), np.concatenate(values), np.vstack(facets), mapped, view)
    handles = [Patch(color=c, label=n) for c, n in zip([*greys, *bright], [*bodies, *names])]  # noqa: B905
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9)
    return figure


def _without(facets: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """Facets that are not among the others, compared by their corners."""
    taken = {tuple(sorted(corners)) for other in others for corners in other[:, :4].tolist()}
    not_among = [tuple(sorted(corners)) not in taken for corners in facets[:, :4].tolist()]
    return facets[np.array(not_among, dtype=bool)]


def _draw(
    axes: Any,
    points: np.ndarray,
    values: np.ndarray,
    facets: np.ndarray,
    colours: ScalarMappable,
    view: tuple[float, float],
    smooth: bool = False,
) -> None:
    """Draw a surface with coloured values, seen from one side."""
    surface = triangles(facets, len(points))
    points, values = with_middles(facets, points), with_middles(facets, values, smooth=smooth)
    camera = Camera.at(*view)
    on_screen = camera.seen(points[np.unique(surface.nodes)])[:, :2]
    low, high = on_screen.min(axis=0), on_screen.max(axis=0)
    edge = 0.02 * float((high - low).max())
    window = (low[0] - edge, high[0] + edge, low[1] - edge, high[1] + edge)
    image = picture(points, surface, values, camera, window, SAMPLES_PER_PIXEL * PIXEL_COLUMNS)
    axes.imshow(image.colours(colours), extent=window, interpolation="antialiased")
    axes.set_axis_off()


DISPLACEMENT_OVER_DIAGONAL = 0.06  # largest displacement that is drawn, over the part's diagonal
MODES_PER_ROW = 3  # modes in a row


def draw_free_modes(
    nodes: np.ndarray, facets: np.ndarray, modes: Sequence[tuple[str, np.ndarray]]
) -> Figure:
    """Picture of the free modes of a component, deformed and coloured by displacement.

    Parameters
    ----------
    nodes : ndarray (n, 3)
        Coordinates of its nodes, m.
    facets : ndarray (m, 8) of int
        Its surface, in the form of `ComponentCells.facets`.
    modes : sequence of (str, ndarray (n, 3))
        Title and displacements, of any size, of each mode.
    """
    rows = -(-len(modes) // MODES_PER_ROW)
    figure: Any = Figure(figsize=(14.0, 4.4 * rows), layout="constrained")
    colours = ScalarMappable(Normalize(0.0, 1.0), mpl.colormaps["viridis"])
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    panels = figure.subplots(rows, MODES_PER_ROW, squeeze=False).ravel()
    for axes in panels[len(modes) :]:
        axes.set_axis_off()
    for axes, (title, displacements) in zip(panels, modes, strict=False):
        far = np.linalg.norm(displacements, axis=1)
        share = far / far.max()
        deformed = nodes + DISPLACEMENT_OVER_DIAGONAL * diagonal * displacements / far.max()
        _draw(axes, deformed, share, facets, colours, VIEW_DEG, smooth=True)
        axes.set_title(title)
    return figure
