"""Components of a shape: their surfaces and cells, and the elastic energy of cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.models.assembly import Assembly, Component
from squealstudy.models.cells import CellBlock


@dataclass(frozen=True)
class ShapePart:
    """A component of a shape.

    Attributes
    ----------
    name : str
        Name of the component.
    nodes : slice
        Its nodes among all.
    facets : ndarray (n, 8) of int
        Its surface, in the form of `ComponentCells.facets`, by indices among all nodes.
    blocks : tuple of CellBlock
        Its cells, by indices among all nodes; none if it is not meshed.
    volumes : ndarray (n_cells,)
        Volume of each cell, m3.
    cell_energy : ndarray (n_cells,)
        Share of each cell in the elastic energy of the whole mode. The sum is the share of the
        component, but for changes of its component modes, which belong to no cell.
    """

    name: str
    nodes: slice
    facets: np.ndarray
    blocks: tuple[CellBlock, ...]
    volumes: np.ndarray
    cell_energy: np.ndarray


def parts_of(
    assembly: Assembly, u: np.ndarray, elastic: float
) -> tuple[tuple[ShapePart, ...], np.ndarray]:
    """Components of a shape u (n_nodes, 3) with its elastic energy, and the energy's density.

    The density (n_nodes,) is a share of that energy in 1/m3; NaN at nodes without cells.
    """
    parts = []
    energy, volume = np.zeros(len(u)), np.zeros(len(u))
    for component in assembly.components:
        nodes = assembly.node_slices[component.name]
        parts.append(part := _shape_part(component, nodes, u[nodes], elastic))
        first = 0
        for _, cells in part.blocks:
            own_cells = slice(first, first + len(cells))
            for total, values in ((energy, part.cell_energy), (volume, part.volumes)):
                np.add.at(total, cells.ravel(), np.repeat(values[own_cells], cells.shape[1]))
            first = own_cells.stop
    density = np.divide(energy, volume, out=np.full(len(u), np.nan), where=volume > 0)
    return tuple(parts), density


def _shape_part(component: Component, nodes: slice, u: np.ndarray, elastic: float) -> ShapePart:
    """The part of a shape that one component makes up."""
    cells, start = component.cells, nodes.start
    if cells is None:
        none = np.zeros(0)
        return ShapePart(component.name, nodes, np.zeros((0, 8), dtype=int), (), none, none)
    facets = cells.facets
    return ShapePart(
        name=component.name,
        nodes=nodes,
        facets=np.where(facets < 0, facets, facets + start),
        blocks=tuple(CellBlock(kind, numbers + start) for kind, numbers in cells.blocks),
        volumes=cells.volumes,
        cell_energy=cells.energies(u.ravel()) / elastic,
    )
