"""A page with moving modes of a design point: one HTML file without network, drawn by WebGL."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import Colormap

from squealstudy.errors import ModelError
from squealstudy.models.cells import NONE
from squealstudy.shapes.names import name_of
from squealstudy.shapes.parts import ShapePart
from squealstudy.shapes.picture import (
    AMPLITUDE_COLOURS,
    COLOURED_DECADES,
    DENSITY_COLOURS,
    PERCENT_PER_CM3,
    VIEW_DEG,
    density_range,
    exploded_shifts,
    sources,
    title,
    words,
)
from squealstudy.shapes.shape import Shape
from squealstudy.shapes.surface import Camera, middles, triangles, with_middles

TEMPLATE = Path(__file__).with_name("page.html")
DATA_SCRIPT = re.compile(r'<script id="data" type="application/json">([^<]*)</script>')
MAX_INT16, MAX_BYTE = 32767, 255  # largest numbers of 16 bits with a sign, and of 8 bits


def page(shapes: Sequence[Shape]) -> str:
    """The page of some modes of one design point.

    Coordinates and displacements are rounded to 1/32767 of the largest coordinate and displacement,
    in 16 bits; the density of energy is rounded to 8 bits of its logarithm.

    Raises
    ------
    ModelError
        Where there is no shape, shapes are of several design points, or have no surface.
    """
    if len({shape.label.point_id for shape in shapes}) != 1:
        raise ModelError("a page needs shapes of one design point")
    first = shapes[0]
    drawn = _SurfacePoints(first)
    if not len(drawn.used):
        raise ModelError("no component of this model has cells: there is no surface to draw")
    positions = drawn.of(first.coordinates)
    on_screen = Camera.at(*VIEW_DEG).seen(positions - _middle(positions))[:, :2]
    grain = float(np.abs(positions).max()) / MAX_INT16
    parts: list[dict[str, Any]] = []
    surfaces: list[np.ndarray] = []
    edges: list[np.ndarray] = []
    for part, shift in zip(first.parts, exploded_shifts(first), strict=True):
        surface, lines = drawn.triangles(part), drawn.number[_edges(part.facets)]
        parts.append(
            {
                "name": words(part.name),
                "shift": shift.tolist(),
                "triangles": [sum(s.size for s in surfaces), surface.size],
                "edges": [sum(e.size for e in edges), lines.size],
            }
        )
        surfaces.append(surface)
        edges.append(lines)
    label = first.label
    contents = {
        "title": f"{label.study}, design point {label.row}",
        "point": " ".join(title(first)[1:]),
        "view": VIEW_DEG,
        "grain": grain,
        "size": float(np.linalg.norm(np.ptp(positions, axis=0))),
        "middle": _middle(positions).tolist(),
        "fill": (2 * np.abs(on_screen).max(axis=0)).tolist(),
        "places": _packed(np.round(positions / grain).astype("<i2")),
        "triangles": _packed(np.concatenate(surfaces).astype("<u4")),
        "edges": _packed(np.concatenate(edges).astype("<u4")),
        "colours": _packed(np.vstack([_colours(AMPLITUDE_COLOURS), _colours(DENSITY_COLOURS)])),
        "parts": parts,
        "modes": [_mode(shape, drawn) for shape in shapes],
    }
    return _filled(contents)


def made_again(text: str) -> str:
    """A new page with the numbers of a page of unknown origin; empty if it is no such page."""
    match = DATA_SCRIPT.search(text)
    try:
        return _filled(json.loads(match[1])) if match else ""
    except (ValueError, RecursionError):
        return ""


def _filled(data: Any) -> str:
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return TEMPLATE.read_text(encoding="utf-8").replace("@DATA@", text)


class _SurfacePoints:
    """The points of a surface: its nodes, then the middles of its facets.

    Attributes
    ----------
    used : ndarray (n,) of int
        Nodes of the surface.
    number : ndarray (n_nodes,) of int
        Index of each node among these; NONE for nodes inside.
    """

    def __init__(self, shape: Shape) -> None:
        facets = np.concatenate([part.facets for part in shape.parts])
        self.used = np.unique(facets[facets != NONE])
        self.number = np.full(len(shape.coordinates), NONE)
        self.number[self.used] = np.arange(len(self.used))
        self._facets = np.where(facets == NONE, NONE, self.number[facets])
        self._first = dict(
            zip(
                (part.name for part in shape.parts),
                np.cumsum([0, *(middles(part.facets).sum() for part in shape.parts)]),
                strict=False,
            )
        )

    def of(self, values: np.ndarray, smooth: bool = True) -> np.ndarray:
        """Values (n_nodes, ...) of the nodes at the points of the surface."""
        return with_middles(self._facets, values[self.used], smooth)

    def triangles(self, part: ShapePart) -> np.ndarray:
        """Points of the triangles (n, 3) of a part."""
        facets = np.where(part.facets == NONE, NONE, self.number[part.facets])
        return triangles(facets, len(self.used) + int(self._first[part.name])).nodes


def _middle(positions: np.ndarray) -> np.ndarray:
    middle: np.ndarray = (positions.min(axis=0) + positions.max(axis=0)) / 2
    return middle


def _mode(shape: Shape, surface: _SurfacePoints) -> dict[str, Any]:
    """Entry of one mode on the page."""
    label, u = shape.label, surface.of(shape.displacement)
    low, high = density_range(shape)
    density = surface.of(np.nan_to_num(shape.density) * PERCENT_PER_CM3, smooth=False)
    level = np.log10(np.maximum(density, low) / low) / COLOURED_DECADES
    growth = "" if label.motion else f", {shape.growth_rate:+.4g} 1/s"
    return {
        "name": f"{label.number}: {shape.frequency_hz:.1f} Hz{growth}",
        "facts": "; ".join([name_of(shape).text, *sources(shape)]),
        "low": f"{low:.2g}",
        "high": f"{high:.2g}",
        "real": _packed(np.round(np.clip(u.real, -1.0, 1.0) * MAX_INT16).astype("<i2")),
        "imag": _packed(np.round(np.clip(u.imag, -1.0, 1.0) * MAX_INT16).astype("<i2")),
        "energy": _packed(np.round(np.clip(level, 0.0, 1.0) * MAX_BYTE).astype(np.uint8)),
    }


def _edges(facets: np.ndarray) -> np.ndarray:
    """Ends (n, 2) of the straight pieces of all edges of facets (m, 8); each piece once."""
    pieces = []
    for k in range(4):
        start, end = facets[:, k], facets[:, (k + 1) % 4]
        end = np.where(end == NONE, facets[:, 0], end)
        middle = facets[:, 4 + k]
        real, halved = start != NONE, middle != NONE
        pieces.append(np.column_stack([start, np.where(halved, middle, end)])[real])
        pieces.append(np.column_stack([middle, end])[real & halved])
    return np.unique(np.sort(np.concatenate(pieces), axis=1), axis=0)


def _colours(colours: Colormap) -> np.ndarray:
    """A colour map (256, 3) as bytes."""
    colour_bytes: np.ndarray = colours(np.linspace(0.0, 1.0, 256), bytes=True)[:, :3]
    return colour_bytes


def _packed(array: np.ndarray) -> str:
    return b64encode(np.ascontiguousarray(array).tobytes()).decode()
