"""Rows by which dependent nodes follow others: couplings, and equations between displacements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.constraints import Coupling
from squealstudy.models.components.faces import facet_groups
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.mean_motions import ON_A_LINE, mean_motion, mean_turn
from squealstudy.models.components.mesh import SolidMesh

GAUSS = 3  # points a side of a facet, which weight the nodes of a face
Followed = tuple[np.ndarray, np.ndarray, np.ndarray]  # rows, columns, values


def facets_of(mesh: SolidMesh, faces: np.ndarray, name: str) -> Facets:
    """Facets of faces (p, 2)."""
    return Facets(mesh.nodes, tuple(g.nodes for g in facet_groups(mesh, faces)), name)


def solved(node: int, A: np.ndarray, columns: np.ndarray, values: np.ndarray) -> Followed | None:
    """Solve A u + values . q[columns] = 0, with A (m, 3) and values (m, k), for m entries of u.

    u are the displacements of the node. None where the equations do not determine m of them. The
    result has an entry of 0 for each, so that one that follows nothing is there and does not move.
    """
    chosen = _pivots(A)
    if chosen is None:
        return None
    others = np.setdiff1d(np.arange(3), chosen)
    column = np.append(3 * node + others, columns)
    follows = -np.linalg.solve(A[:, chosen], np.hstack([A[:, others], values]))
    at_row, k = np.nonzero(follows)
    zeros = np.zeros(len(A))
    rows = np.append(3 * node + chosen[at_row], 3 * node + chosen)
    return rows, np.append(column[k], 3 * node + chosen), np.append(follows[at_row, k], zeros)


def _pivots(A: np.ndarray) -> np.ndarray | None:
    """Column (m,) for which each row of A (m, 3) is solved: that of its largest entry.

    Rows are eliminated in their order. None where they depend on each other, or m > 3.
    """
    if len(A) > 3:
        return None
    remaining, pivots = A.astype(float).copy(), []
    for row in range(len(A)):
        k = int(np.abs(remaining[row]).argmax())
        if not abs(remaining[row, k]) > ON_A_LINE * np.abs(A[row]).max():
            return None
        pivots.append(k)
        remaining -= (
            np.outer(remaining[:, k] / remaining[row, k], remaining[row])
            * (np.arange(len(A)) > row)[:, None]
        )
    return np.array(pivots)


def rigid(mesh: SolidMesh, c: Coupling, turns: int) -> Followed:
    """Nodes of a rigid coupling: u = u_reference + rotation x (x - x_reference).

    In the directions of the coupling; `turns` is the column of the reference's first rotation.
    """
    arm = mesh.nodes[c.nodes] - mesh.nodes[c.reference]
    if _on_a_line(arm):
        raise mesh.error(
            f"{c.name}: its nodes lie on a line with the reference node, about which it could turn "
            "freely: expected nodes of a face"
        )
    if c.axes is not None:
        return _rigid_in_axes(mesh, c, arm, turns)
    rows, columns, values = [], [], []
    for direction in c.directions:
        axis = direction - 1
        followers = 3 * c.nodes + axis
        for column, coefficients in (
            (3 * c.reference + axis, np.ones(len(followers))),
            (turns + (axis + 1) % 3, arm[:, (axis + 2) % 3]),
            (turns + (axis + 2) % 3, -arm[:, (axis + 1) % 3]),
        ):
            rows.append(followers)
            columns.append(np.full(len(followers), column))
            values.append(coefficients)
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def _rigid_in_axes(mesh: SolidMesh, c: Coupling, arm: np.ndarray, turns: int) -> Followed:
    A = c.along(mesh.nodes[c.nodes])  # (n, m, 3)
    columns = np.append(3 * c.reference + np.arange(3), turns + np.arange(3))
    values = -np.concatenate([A, np.cross(arm[:, None], A)], axis=2)
    of_nodes = zip(c.nodes.tolist(), A, values, strict=True)
    return _together([_of_axes(node, a, columns, v) for node, a, v in of_nodes])


def _on_a_line(arm: np.ndarray) -> bool:
    moments = np.linalg.eigvalsh(np.sum(arm**2) * np.eye(3) - arm.T @ arm)
    return not moments[0] > ON_A_LINE * moments[-1]


def mean(mesh: SolidMesh, c: Coupling) -> Followed:
    """The reference node of a distributing coupling, by the mean motion of the nodes."""
    points, weight, shape = _weighted(mesh, c)
    try:
        follows = mean_motion(points, weight, mesh.nodes[c.reference])
    except ModelError as error:
        raise mesh.error(f"{c.name}: {error}") from error
    parts = []
    along = c.along(mesh.nodes[c.reference])
    if c.axes is None:
        follows[[axis for axis in range(3) if axis + 1 not in c.directions]] = 0.0
    else:
        follows = np.tensordot(along, follows, 1)
    for axis in range(3):
        A = sp.coo_matrix(sp.csr_matrix(follows[:, :, axis]) @ shape)
        parts.append((A.row, 3 * A.col + axis, A.data))
    rows, columns, values = _together(parts)
    if c.axes is None:
        return 3 * c.reference + rows, columns, values
    mean_columns, positions = np.unique(columns, return_inverse=True)
    by = sp.coo_matrix((-values, (rows, positions)), (len(along), len(mean_columns))).toarray()
    return _of_axes(c.reference, along, mean_columns, by)


def _of_axes(node: int, A: np.ndarray, columns: np.ndarray, values: np.ndarray) -> Followed:
    """As `solved`, for A with rows at right angles, which always have a solution."""
    equations = solved(node, A, columns, values)
    assert equations is not None
    return equations


def _together(parts: list[Followed]) -> Followed:
    rows, columns, values = zip(*parts, strict=True)
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def turn_of_mean(mesh: SolidMesh, c: Coupling) -> sp.csr_matrix:
    """Rotation of the reference node by the displacements of all nodes: (3 n, 3 n).

    Only the three rows of the reference node are not zero.
    """
    points, weight, shape = _weighted(mesh, c)
    n = len(mesh.nodes)
    total = sp.csr_matrix((3 * n, 3 * n))
    reference_rows = sp.csr_matrix(
        (np.ones(3), (3 * c.reference + np.arange(3), np.arange(3))), (3 * n, 3)
    )
    follows = mean_turn(points, weight)
    for axis in range(3):
        A = sp.coo_matrix(sp.csr_matrix(follows[:, :, axis]) @ shape)
        displacement_columns = sp.csr_matrix((A.data, (A.row, 3 * A.col + axis)), (3, 3 * n))
        total = total + reference_rows @ displacement_columns
    return total


def _weighted(mesh: SolidMesh, c: Coupling) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Points (p, 3) of a distributing coupling, weights (p,), and shape functions (p, n) there."""
    if len(c.faces):
        surface, _ = facets_of(mesh, c.faces, c.name).gauss_points(GAUSS)
        return surface.points, surface.area, surface.shape
    weight = np.ones(len(c.nodes))
    entries = (np.arange(len(c.nodes)), c.nodes)
    shape = sp.csr_matrix((weight, entries), (len(c.nodes), len(mesh.nodes)))
    return mesh.nodes[c.nodes], weight, shape
