"""Points of a solid that correspond between its variants, whatever their size and their mesh."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.models.fem.grid import Block
from squealstudy.models.fem.sampling import shape_functions
from squealstudy.models.fem.solid import Solid

AROUND = 40  # points of a closed ring in theta: more than two for each wave up to 19 of them
SIDES = (2, 8, 2)  # points of any other block in r, theta, z
TURN = 2 * np.pi * (1 - 1e-9)


def corresponding_rows(solid: Solid) -> sp.csr_matrix:
    """Observation of the displacement at the same relative places of each block of a solid.

    Every block of the grid has a fixed number of points at fixed shares of its extent in r, theta
    and z, so that row i of two variants of one solid (other measures, another mesh) is the motion
    of the same material point. Rows carry the square root of the mass for which they stand.

    Returns
    -------
    csr_matrix (3 p, 3 n_nodes)
        x, y, z of a point after each other.
    """
    points, shares = zip(*(_block_points(solid, b) for b in solid.grid.blocks), strict=True)
    xyz, share = np.vstack(points), np.concatenate(shares)
    mass = solid.M[::3, ::3].sum()
    weight = np.sqrt(mass * share / share.sum())
    return sp.kron(sp.diags(weight) @ shape_functions(solid, xyz), sp.eye(3)).tocsr()


def _block_points(solid: Solid, block: Block) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) [m] at the middles of equal parts of a block, and their volumes (p,) [m3]."""
    x, y, z = solid.grid.mesh.doflocs
    r, height = np.hypot(x, y), (z.min(), z.max())
    spans = [
        (max(block.r[0], r.min()), min(block.r[1], r.max())),
        block.theta,
        (max(block.z[0], height[0]), min(block.z[1], height[1])),
    ]
    ring = block.theta[1] - block.theta[0] >= TURN
    counts = (SIDES[0], AROUND if ring else SIDES[1], SIDES[2])
    lines = [
        a + (b - a) * (np.arange(n) + 0.5) / n for (a, b), n in zip(spans, counts, strict=True)
    ]
    radius, theta, z = (c.ravel() for c in np.meshgrid(*lines, indexing="ij"))
    points = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    cell = np.prod([(b - a) / n for (a, b), n in zip(spans, counts, strict=True)])
    return points, radius * cell
