"""Masses on components of a model file: spread over a set, or at a place that follows its motion.

At a place: the mass moves as the rigid motion that is nearest to that of the set's points, weighted
by their areas (a distributing coupling, Nastran's RBE3). It adds no stiffness to the set.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import body_matrices
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.expansion import mean_motion
from squealstudy.models.components.file_matrices import symmetric
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import KeyPath, Numbers, PlacedError
from squealstudy.models.fem.sampling import Surface

MOST_NODES = 600  # of a set that moves one mass: every pair of them is coupled


def component_matrices(
    geometry: Geometry, name: str, given: Mapping[KeyPath, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M of a component as `body_matrices`, the masses on it among them.

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
            added = _spread(points, mass) if at is None else _moved(points, mass, at, keys)
            M = M + geometry.bodies[name].expansion.restricted(added)
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
    try:
        there = mean_motion(points.points, points.area, at)  # (3, n, 3) of point and axis
    except ModelError as error:
        message = f"{error}: a mass cannot be at another place"
        raise PlacedError((*keys, "on"), message) from error
    rows = [points.observe(axis) for axis in np.eye(3)]
    return sum(sp.csr_matrix(there[:, :, a]) @ rows[a] for a in range(3)).tocsr()
