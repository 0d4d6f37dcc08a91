"""Sound power that a vibrating component radiates, and motion of its points.

The equivalent radiated power is rho c times the integral of the mean square of the normal velocity
over the surface. Each part of the surface is taken to radiate like a plane wave, with a radiation
efficiency of one: an upper bound at high frequencies (Cremer, Heckl & Petersson 2005,
Structure-Borne Sound, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.assembly import Component
from squealstudy.shapes.surface import triangles, with_middles

AIR_IMPEDANCE_PA_S_PER_M = 413.3  # rho c at 20 C and 1013 hPa, Pa s/m
TRIANGLES_PER_CHUNK = 20_000  # triangles that are integrated at once


@dataclass(frozen=True)
class Place:
    """A place on a component.

    Attributes
    ----------
    rows : ndarray (d, n)
        Displacements of the place by n coordinates; one row if it is a degree of freedom.
    distance : float
        Distance from the point that was given, m.
    """

    rows: np.ndarray
    distance: float = 0.0


def mean_square_form(component: Component, block: np.ndarray) -> np.ndarray:
    """Matrix G (k, k) [m2]: v^T G v is the integral of v_n^2 over the whole surface.

    Parameters
    ----------
    component : Component
        A meshed component.
    block : ndarray (n, k)
        Displacements of its degrees of freedom by k coordinates.

    Notes
    -----
    Velocities are linear over each triangle of the surface, and their squares are integrated
    exactly: area/12 (sum v_i^2 + (sum v_i)^2).
    """
    assert component.cells is not None
    facets, n = component.cells.facets, len(component.coordinates)
    surface = triangles(facets, n).nodes
    points = with_middles(facets, component.coordinates)
    displacements = component.at_nodes(block).reshape(n, 3, -1)
    displacements = with_middles(facets, displacements)
    G = np.zeros((block.shape[1],) * 2)
    for first in range(0, len(surface), TRIANGLES_PER_CHUNK):
        nodes = surface[first : first + TRIANGLES_PER_CHUNK]
        a, b, c = (points[nodes[:, i]] for i in range(3))
        twice = np.cross(b - a, c - a)
        area = 0.5 * np.linalg.norm(twice, axis=1)
        normal = twice / np.maximum(2.0 * area, 1e-300)[:, None]
        normal_motion = np.einsum("md,mcdk->mck", normal, displacements[nodes])
        normal_motion = np.concatenate(
            [normal_motion, normal_motion.sum(axis=1, keepdims=True)], axis=1
        )
        rows = (np.sqrt(area / 12.0)[:, None, None] * normal_motion).reshape(-1, G.shape[0])
        G += rows.T @ rows
    return G


def place(component: Component, block: np.ndarray, at: tuple[float, ...] | int) -> Place:
    """The node nearest to a point [m], or a degree of freedom by its number from 1.

    Raises
    ------
    ModelError
        Where the component does not have the degree of freedom.
    """
    if isinstance(at, int):
        if at > len(block):
            raise ModelError(f"'{component.name}' has degrees of freedom 1 to {len(block)}")
        return Place(block[at - 1 : at])
    distances = np.linalg.norm(component.coordinates - np.array(at), axis=1)
    node = int(np.argmin(distances))
    displacements = component.at_nodes(block).reshape(len(distances), 3, -1)
    return Place(displacements[node], float(distances[node]))
