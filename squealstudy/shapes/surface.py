"""Surfaces of shapes as triangles, and their orthographic pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.kernels.raster import FAR, corner_normals, draw_triangles
from squealstudy.models.cells import NONE

LINE_HALF_WIDTH_PIXELS = 0.8  # half the width of the lines between facets, pixels
CREASE_COSINE = np.cos(np.radians(40.0))  # sharper edges are not smoothed
# triangles of facets of 8, 4, 6 and 3 nodes, by indices of nodes or MIDDLE of the facet, and for
# each corner of a triangle whether the edge opposite to it is an edge of the facet
MIDDLE = 8
QUADRATIC_QUAD = (
    tuple(
        (a, b, MIDDLE) for a, b in ((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0))
    ),
    ((0, 0, 1),) * 8,
)
QUAD = (((0, 1, 2), (0, 2, 3)), ((1, 0, 1), (1, 1, 0)))
QUADRATIC_TRIANGLE = (
    ((0, 4, 6), (4, 1, 5), (6, 5, 2), (4, 5, 6)),
    ((0, 1, 1), (1, 0, 1), (1, 1, 0), (0, 0, 0)),
)
TRIANGLE = (((0, 1, 2),), ((1, 1, 1),))


@dataclass(frozen=True)
class Triangles:
    """A surface of triangles.

    Attributes
    ----------
    nodes : ndarray (n, 3) of int
        Corners of each triangle, counter-clockwise from outside.
    lines : ndarray (n, 3) of bool
        Whether the edge opposite to each corner is an edge of a facet.
    """

    nodes: np.ndarray
    lines: np.ndarray


def middles(facets: np.ndarray) -> np.ndarray:
    """Whether facets (n, 8) have a middle (n,): those of 8 nodes have.

    Without it the triangles of a long thin facet on a curved surface would face in all directions.
    """
    has_middle: np.ndarray = (facets[:, 3] != NONE) & (facets[:, 4] != NONE)
    return has_middle


def with_middles(facets: np.ndarray, values: np.ndarray, smooth: bool = True) -> np.ndarray:
    """Values (n_nodes, ...) at the nodes, followed by values in the middles of facets.

    These are by the shape functions of the 8-node facet, which may exceed the values at nodes;
    without `smooth` they are means of the four nearest nodes.
    """
    with_middle = facets[middles(facets)]
    nearest = values[with_middle[:, 4:]].mean(axis=1)
    if smooth:
        nearest = 2.0 * nearest - values[with_middle[:, :4]].mean(axis=1)
    return np.concatenate([values, nearest])


def triangles(facets: np.ndarray, n_nodes: int) -> Triangles:
    """Triangles of facets (n, 8), as `ComponentCells.facets` has them; points by `with_middles`."""
    four, halved = facets[:, 3] != NONE, facets[:, 4] != NONE
    has_middle = middles(facets)
    middle = np.full(len(facets), NONE)
    middle[has_middle] = n_nodes + np.arange(has_middle.sum())
    corners = np.column_stack([facets, middle])
    nodes, lines = [np.zeros((0, 3), dtype=int)], [np.zeros((0, 3), dtype=bool)]
    for chosen, (split, edges) in (
        (has_middle, QUADRATIC_QUAD),
        (four & ~halved, QUAD),
        (~four & halved, QUADRATIC_TRIANGLE),
        (~four & ~halved, TRIANGLE),
    ):
        nodes.append(corners[chosen][:, np.array(split)].reshape(-1, 3))
        lines.append(np.tile(np.array(edges, dtype=bool), (chosen.sum(), 1)))
    return Triangles(np.concatenate(nodes), np.concatenate(lines))


def smooth_normals(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Unit normals (n, 3, 3) at the corners of triangles (n, 3) of points (n_nodes, 3)."""
    a, b, c = (points[nodes[:, k]] for k in range(3))
    users = np.argsort(nodes.ravel(), kind="stable") // 3
    starts = np.append(0, np.cumsum(np.bincount(nodes.ravel(), minlength=len(points))))
    return corner_normals(nodes, np.cross(b - a, c - a), starts, users, CREASE_COSINE)


@dataclass(frozen=True)
class Camera:
    """A view from far away.

    Attributes
    ----------
    right, up, back : ndarray (3,)
        Unit vectors of the picture; `back` points to the viewer.
    """

    right: np.ndarray
    up: np.ndarray
    back: np.ndarray

    @classmethod
    def at(cls, azimuth: float, elevation: float) -> Camera:
        """A view from an azimuth about z and an elevation [deg], with z upwards in the picture."""
        a, e = np.radians([azimuth, elevation])
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(right, np.cross(back, right), back)

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Coordinates right, up and back (..., 3) of points (..., 3)."""
        in_view: np.ndarray = points @ np.column_stack([self.right, self.up, self.back])
        return in_view


@dataclass(frozen=True)
class Image:
    """Pixels of a view; NaN where there is no surface.

    Attributes
    ----------
    value : ndarray (rows, columns)
        Value to be coloured.
    light : ndarray (rows, columns)
        Light from 0, dark, to 1; negative on lines.
    """

    value: np.ndarray
    light: np.ndarray

    def colours(self, colour_of: object) -> np.ndarray:
        """RGBA (rows, columns, 4) by a ScalarMappable of matplotlib."""
        mapped = colour_of.to_rgba(np.nan_to_num(self.value))  # type: ignore[attr-defined]
        rgba = np.array(mapped, dtype=float)
        line = self.light < 0
        rgba[..., :3] *= (
            np.abs(np.nan_to_num(self.light))[..., None] * np.where(line, 0.62, 1.0)[..., None]
        )
        rgba[..., 3] = np.isfinite(self.light)
        return rgba


def picture(
    points: np.ndarray,
    surface: Triangles,
    values: np.ndarray,
    camera: Camera,
    window: tuple[float, float, float, float],
    columns: int,
) -> Image:
    """A lit surface with the edges of its facets.

    Parameters
    ----------
    points : ndarray (n_nodes, 3)
        Coordinates of the points, m.
    surface : Triangles
        Triangles of these points.
    values : ndarray (n_nodes,)
        Values to be coloured.
    camera : Camera
        The view.
    window : (left, right, bottom, top)
        Limits of the picture, m.
    columns : int
        Pixels from left to right.
    """
    left_edge, right, bottom, top = window
    scale = columns / (right - left_edge)
    rows = max(1, round((top - bottom) * scale))
    in_view = camera.seen(points)
    screen = np.column_stack(
        [(in_view[:, 0] - left_edge) * scale, (top - in_view[:, 1]) * scale, -in_view[:, 2]]
    )
    normals = smooth_normals(points, surface.nodes)
    depth = np.full((rows, columns), FAR)
    pixels, light = (np.full((rows, columns), np.nan) for _ in range(2))
    draw_triangles(
        screen[surface.nodes],
        values[surface.nodes],
        _lit(normals, camera),
        surface.lines,
        LINE_HALF_WIDTH_PIXELS,
        depth,
        pixels,
        light,
    )
    return Image(pixels, light)


def _lit(normals: np.ndarray, camera: Camera) -> np.ndarray:
    """Light (n, 3) at normals (n, 3, 3), of a lamp above the viewer's left shoulder and the sky."""
    lamp = camera.back + 0.45 * camera.up - 0.55 * camera.right
    lamp = lamp / np.linalg.norm(lamp)
    sky = 0.5 + 0.5 * np.abs(normals @ camera.up)
    lit: np.ndarray = np.clip(0.34 + 0.5 * np.abs(normals @ lamp) + 0.16 * sky, 0.0, 1.0)
    return lit
