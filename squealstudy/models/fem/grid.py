"""Solids cut out of one cylindrical grid: r, theta, z lines and a mask of active cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from skfem import MeshHex2

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class Block:
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
    blocks : tuple of Block
        Of which the solid is the union.
    """

    mesh: MeshHex2
    centres: np.ndarray
    material: np.ndarray
    blocks: tuple[Block, ...] = ()


def grid_lines(breaks: Sequence[float], size: float) -> np.ndarray:
    """Lines through all `breaks` with cells no longer than about `size`.

    Every geometric break is a line, so that refining never moves the geometry.
    """
    ends = np.unique(np.round(np.asarray(breaks, dtype=float), 12))
    parts = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / size - 1e-6))), endpoint=False)
        for a, b in pairwise(ends)
    ]
    return np.append(np.concatenate(parts), ends[-1])


def cylindrical_mesh(
    r: np.ndarray, theta: np.ndarray, z: np.ndarray, blocks: Sequence[Block]
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
    return CylindricalMesh(mesh, centres[:, cells], names[owner[cells]], tuple(blocks))


def _mesh_of_cells(ijk: np.ndarray, r: np.ndarray, theta: np.ndarray, z: np.ndarray) -> MeshHex2:
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
