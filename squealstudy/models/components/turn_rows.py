"""Rotations of sets: the mean rotation of points, or that of a superelement's node that has one."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.mean_motions import mean_motion, mean_turn
from squealstudy.models.fem.sampling import Surface
from squealstudy.models.file_table import KeyPath, PlacedError

POINTS = 3  # points a side of a facet
Rows = Callable[..., sp.csr_matrix]  # parts (component, rows over its nodes) -> over an assembly


class Turn(NamedTuple):
    """The rotation of a set.

    Attributes
    ----------
    component : str
    by_displacements, by_turns : csr_matrix (3, 3 n_nodes)
        Rotation by displacements [1/m] and by rotations of the component's nodes; one is zero.
    """

    component: str
    by_displacements: sp.csr_matrix
    by_turns: sp.csr_matrix


def turn_of(geometry: Geometry, reference: str, points: Surface, keys: KeyPath) -> Turn:
    """The rotation of a set; PlacedError where it has none."""
    name, nodes = geometry.nodes(reference, keys)
    body = geometry.bodies[name]
    n = 3 * len(body.nodes)
    nothing = sp.csr_matrix((3, n))
    if len(nodes) == 1:
        if not body.expansion.turning[nodes[0]]:
            raise PlacedError(keys, f"{reference} is one node, and has no turns: expected a face")
        dofs = 3 * nodes[0] + np.arange(3)
        return Turn(name, nothing, sp.csr_matrix((np.ones(3), (np.arange(3), dofs)), (3, n)))
    try:
        follows = mean_turn(points.points, points.area)
    except ModelError as error:
        raise PlacedError(keys, f"{reference}: {error}: expected a face") from error
    rows = [sp.csr_matrix(follows[:, :, a]) @ points.observe(np.eye(3)[a]) for a in range(3)]
    return Turn(name, sum(rows).tocsr(), nothing)


def rigid_motion(points: Surface, point: np.ndarray) -> sp.csr_matrix:
    """Displacement (3, 3 n_nodes) at `point` of the rigid motion that best fits that of the points.

    Raises
    ------
    ModelError
        The points lie on a line, or are fewer than three.
    """
    try:
        mean_rows = mean_motion(points.points, points.area, point)  # (3, n, 3) of point and axis
    except ModelError as error:
        raise ModelError(f"{error}: a mass cannot be at another place") from error
    rows = [points.observe(axis) for axis in np.eye(3)]
    return sum(sp.csr_matrix(mean_rows[:, :, a]) @ rows[a] for a in range(3)).tocsr()


class Coupled(NamedTuple):
    """Relative motions that a coupling holds.

    Attributes
    ----------
    B : csr_matrix (k, n_dof)
        A row for each.
    stiffness : ndarray (k,)
        N/m, of rotations N m.
    """

    B: sp.csr_matrix
    stiffness: np.ndarray


def coupled(
    geometry: Geometry, number: int, bedding: float, rows: Rows, turn_rows: Rows
) -> Coupled:
    """Relative motions of the node and the face of a coupling.

    `bedding` is the stiffness per area [N/m3]. PlacedError where the set of the node has several
    nodes or no rotations, and where node and face belong to the same component.
    """
    table = geometry.file.coupling[number]
    keys: KeyPath = ("coupling", number)
    component, nodes = geometry.nodes(table.node, (*keys, "node"))
    if len(nodes) != 1:
        text = f"{table.node} has {len(nodes)} nodes: expected a set of one node"
        raise PlacedError((*keys, "node"), text)
    node = geometry.points(table.node, (*keys, "node"))[1]
    turn = turn_of(geometry, table.node, node, (*keys, "node"))
    other, face = geometry.face(table.face, (*keys, "face"))
    if component == other:
        raise PlacedError(keys, f"expected two components, got two sets of {component}")
    surface = face.gauss_points(POINTS)[0]
    node_position = geometry.bodies[component].nodes[nodes[0]]
    arm = surface.points - node_position
    moves = [node.observe(axis) for axis in np.eye(3)]
    if table.kind == "distributing":
        mean = rigid_motion(surface, node_position)
        translation_rows = [rows((component, moves[a]), (other, -mean[a])) for a in range(3)]
        of_face = turn_of(geometry, table.face, surface, (*keys, "face"))
        turned = turn_rows((component, turn.by_turns)) - rows((other, of_face.by_displacements))
        moment = surface.area @ (np.sum(arm**2, axis=1)[:, None] - arm**2)
        stiffness = np.append(np.full(3, surface.area.sum()), moment)
        return Coupled(sp.vstack([*translation_rows, turned]).tocsr(), bedding * stiffness)
    relative_rows = []
    for axis, e in enumerate(np.eye(3)):
        ones = sp.csr_matrix(np.ones((len(arm), 1)))
        by_turn = sp.csr_matrix(np.cross(arm, e)) @ turn.by_turns  # (turn x arm) . e
        relative = rows((component, ones @ moves[axis]), (other, -surface.observe(e)))
        relative_rows.append(relative + turn_rows((component, by_turn)))
    return Coupled(sp.vstack(relative_rows).tocsr(), np.tile(bedding * surface.area, 3))
