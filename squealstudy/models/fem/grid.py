"""Solids cut out of one cylindrical grid: r, theta, z lines and a mask of active cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshHex2

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class GridBlock:
    """A cylindrical box: (low, high) in r [m], theta [rad] and z [m], of one material name."""

    r: tuple[float, float]
    theta: tuple[float, float]
    z: tuple[float, float]
    material: str


@dataclass(frozen=True)
class CylindricalMesh:
    """Quadratic hexahedra that follow the cylinder, with the cell facts that models select by.

    Attributes
    ----------
    mesh : skfem.MeshHex2
        27-node geometry, Cartesian, metres.
    centres : ndarray (3, n_cells)
        Cell centres in (r, theta, z).
    material : ndarray (n_cells,) of str
        Material name of each cell.
    blocks : tuple of GridBlock
        Blocks whose union is the solid.
    lines : tuple of ndarray
        Lines of the grid in r [m], theta [rad] and z [m].
    numbers : ndarray (n_r, n_theta, n_z) of int
        Number of the cell between two lines of each direction; -1 where there is no cell.
    """

    mesh: MeshHex2
    centres: np.ndarray
    material: np.ndarray
    blocks: tuple[GridBlock, ...]
    lines: tuple[np.ndarray, np.ndarray, np.ndarray]
    numbers: np.ndarray

    def cells_at(self, points: np.ndarray) -> np.ndarray:
        """Number of the cell around each point (n, 3) [m]; -1 where there is none."""
        x, y, z = points.T
        turns = np.floor((np.arctan2(y, x) - self.lines[1][0]) / (2 * np.pi))
        theta = np.arctan2(y, x) - 2 * np.pi * turns
        indices, inside = [], np.ones(len(points), dtype=bool)
        for c, line in zip((np.hypot(x, y), theta, z), self.lines, strict=True):
            inside &= (c >= line[0]) & (c <= line[-1])
            indices.append(np.clip(np.searchsorted(line, c, side="right") - 1, 0, len(line) - 2))
        return np.where(inside, self.numbers[tuple(indices)], -1)


@dataclass(frozen=True)
class Interval:
    """Cells between two neighbouring breaks of a grid direction.

    Attributes
    ----------
    cells : int
        Equally long cells between the layers.
    low, high : tuple of float
        Lines of the layers beside the break at the low or at the high end: their distances from
        it, as shares of the local size there, ascending and below a half.
    """

    cells: int = 1
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()


def graded_lines(
    breaks: Sequence[float], intervals: Sequence[Interval], split: int = 1
) -> np.ndarray:
    """Lines through all `breaks`, with thin layers beside those that are re-entrant corners.

    Stresses are singular at a re-entrant corner: cells must become small towards it, or the body
    comes out too stiff however small the others are. The local size at a break is a b / (a + b) of
    the lengths of its two intervals. The number of lines follows from `intervals` alone, and every
    line is a smooth function of the breaks: frequencies are smooth in a length of the geometry.

    Parameters
    ----------
    breaks : sequence of float
        Ascending; every geometric break is a line, so that refining never moves the geometry.
    intervals : sequence of Interval
        One fewer than breaks.
    split : int
        Equal parts into which every cell is divided afterwards.
    """
    x = np.asarray(breaks, dtype=float)
    length = np.diff(x)
    size = np.zeros(len(x))
    size[1:-1] = length[:-1] * length[1:] / (length[:-1] + length[1:])
    parts = []
    for i, interval in enumerate(intervals):
        low = x[i] + size[i] * np.array([0.0, *interval.low])
        high = x[i + 1] - size[i + 1] * np.array([*interval.high[::-1], 0.0])
        middle = np.linspace(low[-1], high[0], interval.cells + 1)
        parts.append(np.concatenate([low[:-1], middle, high[1:]])[:-1])
    lines = np.append(np.concatenate(parts), x[-1])
    steps = np.arange(split) / split
    return np.append((lines[:-1, None] + np.diff(lines)[:, None] * steps).ravel(), lines[-1])


def cylindrical_mesh(
    r: np.ndarray, theta: np.ndarray, z: np.ndarray, blocks: Sequence[GridBlock]
) -> CylindricalMesh:
    """Mesh the union of `blocks` on the lines r [m], theta [rad], z [m].

    A cell is active where its centre lies in a block; later blocks win over earlier ones.
    A theta range of 2 pi is closed to a ring. Raises ModelError for an empty union.
    """
    centres = np.stack(
        np.meshgrid(*((x[1:] + x[:-1]) / 2 for x in (r, theta, z)), indexing="ij")
    ).reshape(3, -1)
    owner = np.full(centres.shape[1], -1)
    for index, block in enumerate(blocks):
        inside = np.ones(centres.shape[1], dtype=bool)
        for x, (low, high) in zip(centres, (block.r, block.theta, block.z), strict=True):
            inside &= (x > low) & (x < high)
        owner[inside] = index
    cells = np.flatnonzero(owner >= 0)
    if not len(cells):
        raise ModelError("the blocks of a component contain no cell of its grid")
    shape = (len(r) - 1, len(theta) - 1, len(z) - 1)
    ijk = np.stack(np.unravel_index(cells, shape))
    mesh = _mesh_of_cells(ijk, r, theta, z)
    names = np.array([block.material for block in blocks])
    numbers = np.full(centres.shape[1], -1)
    numbers[cells] = np.arange(len(cells))
    return CylindricalMesh(
        mesh,
        centres[:, cells],
        names[owner[cells]],
        tuple(blocks),
        (r, theta, z),
        numbers.reshape(shape),
    )


def _mesh_of_cells(ijk: np.ndarray, r: np.ndarray, theta: np.ndarray, z: np.ndarray) -> MeshHex2:
    """Mesh of the cells ijk of a grid in cylindrical coordinates, curved along theta."""
    ring = abs(theta[-1] - theta[0] - 2 * np.pi) < 1e-9
    n_theta = len(theta) - 1 if ring else len(theta)
    ref = MeshHex2.elem.doflocs  # (27, 3) in [0, 1], corners first
    corner = ijk[:, None, :] + ref[:8].T.astype(int)[:, :, None]  # (3, 8, n_cells)
    corner[1] %= n_theta
    ids = np.ravel_multi_index(corner, (len(r), n_theta, len(z)))
    used, t = np.unique(ids, return_inverse=True)
    t = t.reshape(ids.shape)
    blank = MeshHex2(np.zeros((3, len(used))), t, sort_t=False, validate=False)
    nodes = blank.dofs.element_dofs  # (27, n_cells)
    cyl = [
        x[ijk[a]] + ref[:, a, None] * (x[ijk[a] + 1] - x[ijk[a]])
        for a, x in enumerate((r, theta, z))
    ]
    doflocs = np.empty((3, nodes.max() + 1))
    doflocs[:, nodes] = np.stack([cyl[0] * np.cos(cyl[1]), cyl[0] * np.sin(cyl[1]), cyl[2]])
    return MeshHex2(doflocs, t, sort_t=False, validate=False)
