"""Masses on components of a model file: spread over a set, or at a place that follows its motion.

At a place: the mass moves as the rigid motion that is nearest to that of the set's points, weighted
by their areas (a distributing coupling, Nastran's RBE3). It adds no stiffness to the set.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.models.components.bodies import body_matrices
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.file_matrices import symmetric
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import KeyPath, Numbers, PlacedError
from squealstudy.models.fem.sampling import Surface

MOST_NODES = 600  # of a set that moves one mass: every pair of them is coupled
ON_A_LINE = 1e-8  # smallest moment of a set's points beside the largest: turns about it are free


def component_matrices(
    geometry: Geometry, name: str, given: Mapping[KeyPath, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M (3 n, 3 n) of a component as `body_matrices`, the masses on it among them.

    Raises
    ------
    PlacedError
        A set that is not there, or that cannot carry a mass at another place.
    ModelError
        Values that no material can have.
    """
    K, M = body_matrices(geometry.brake, name, given)
    numbers = Numbers(geometry.file, given)
    for number, table in enumerate(geometry.file.point_mass):
        keys: KeyPath = ("point_mass", number)
        owner, points = geometry.points(table.on, (*keys, "on"))
        if owner == name:
            mass = numbers.at(*keys, "mass")
            at = None
            if table.at is not None:
                at = np.array(table.at) * LENGTH.factor(geometry.file.units)
            M = M + (_spread(points, mass) if at is None else _moved(points, mass, at, keys))
    return K, symmetric(M)


def _spread(points: Surface, mass: float) -> sp.csr_matrix:
    """The mass shared out by area."""
    rows = sp.vstack([points.observe(axis) for axis in np.eye(3)])
    share = np.tile(mass * points.area / points.area.sum(), 3)
    return (rows.T @ sp.diags(share) @ rows).tocsr()


def _moved(points: Surface, mass: float, at: np.ndarray, keys: KeyPath) -> sp.csr_matrix:
    """The mass at a place, by the motion of the points there."""
    nodes = len(np.unique(points.shape.indices))
    if nodes > MOST_NODES:
        raise PlacedError(
            (*keys, "on"),
            f"the set has {nodes} nodes, and a mass at another place couples all of them: expected "
            f"at most {MOST_NODES}; name a smaller set, or leave out at",
        )
    follows = rigid_motion(points, at, keys)
    return (mass * follows.T @ follows).tocsr()


def rigid_motion(points: Surface, at: np.ndarray, keys: KeyPath) -> sp.csr_matrix:
    """Displacement (3, 3 n_nodes) at a place, of the rigid motion nearest to the points'."""
    weight = points.area / points.area.sum()
    centre = weight @ points.points
    G = _motions(points.points - centre)  # (n, 3, 6)
    moments = np.einsum("i,iab,iac->bc", weight, G, G)
    inertia = np.linalg.eigvalsh(moments[3:, 3:])
    if not inertia[0] > ON_A_LINE * inertia[-1]:
        raise PlacedError(
            (*keys, "on"), "the points of the set lie on a line: a mass cannot be at another place"
        )
    nearest = np.linalg.solve(moments, np.einsum("i,iab->bia", weight, G).reshape(6, -1))
    there = _motions((at - centre)[None])[0] @ nearest  # (3, 3 n) of point and axis
    columns = there.reshape(3, -1, 3)
    rows = [points.observe(axis) for axis in np.eye(3)]
    return sum(sp.csr_matrix(columns[:, :, a]) @ rows[a] for a in range(3)).tocsr()


def _motions(r: np.ndarray) -> np.ndarray:
    """Displacements (n, 3, 6) at r (n, 3) of unit translations and turns about the origin."""
    G = np.zeros((len(r), 3, 6))
    G[:, :, :3] = np.eye(3)
    for axis in range(3):
        G[:, :, 3 + axis] = np.cross(np.eye(3)[axis], r)
    return G
