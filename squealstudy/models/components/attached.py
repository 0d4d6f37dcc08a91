"""Masses and springs on sets of points: what a model file has, and what a study adds to a model.

A mass at a place moves as the rigid motion that is nearest to that of the set's points, weighted by
their areas (a distributing coupling, Nastran's RBE3). It adds no stiffness to the set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import body_matrices
from squealstudy.models.components.contact_rows import Rotation
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.file_matrices import symmetric
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import Numbers
from squealstudy.models.components.turn_rows import rigid_motion, turn_of
from squealstudy.models.fem.sampling import Surface
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.linear_interfaces import SpringInterface

MOST_NODES = 600  # of a set that moves one mass: every pair of them is coupled
Owned = tuple[str, Surface]  # a component, and points on it
Directions = Callable[[np.ndarray], Sequence[np.ndarray]]  # points (n, 3) -> three of (n, 3)
Rows = Callable[..., sp.csr_matrix]  # parts (component, rows over its nodes) -> over an assembly


def component_matrices(
    geometry: Geometry, name: str, overrides: Mapping[KeyPath, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M of a component as `body_matrices`, the masses on it among them.

    Raises
    ------
    PlacedError
        A set that is not there, or that cannot carry a mass at another place.
    ModelError
        Values that no material can have.
    """
    K, M = body_matrices(geometry.brake, name, overrides)
    numbers = Numbers(geometry.file, overrides)
    for number, table in enumerate(geometry.file.point_mass):
        keys: KeyPath = ("point_mass", number)
        owner, points = geometry.points(table.on, (*keys, "on"))
        if owner == name:
            mass = numbers.at(*keys, "mass")
            position = None
            if table.at is not None:
                position = np.array(table.at) * LENGTH.factor(geometry.file.units)
            try:
                added = mass_on(points, mass, position)
            except ModelError as error:
                raise PlacedError((*keys, "on"), str(error)) from error
            M = M + geometry.bodies[name].expansion.restricted(added)
            if table.inertia is not None:
                moments = numbers.list_at(*keys, "inertia")
                M = M + _turned_mass(geometry, table.on, points, moments, (*keys, "on"))
    return K, symmetric(M)


def _turned_mass(
    geometry: Geometry, reference: str, points: Surface, moments: Sequence[float], keys: KeyPath
) -> sp.csr_matrix:
    """Rotary inertia at the turn of a set, over the component's degrees of freedom."""
    turn = turn_of(geometry, reference, points, keys)
    expansion = geometry.bodies[turn.component].expansion
    T = turn.by_displacements @ expansion.E + turn.by_turns @ expansion.turns
    return (T.T @ sp.diags(moments) @ T).tocsr()


def mass_on(points: Surface, mass: float, position: np.ndarray | None) -> sp.csr_matrix:
    """Mass matrix (3 n_nodes, 3 n_nodes) of a mass [kg] on points.

    Parameters
    ----------
    points : Surface
    mass : float
    position : ndarray (3,) or None
        Where it is, m; None: shared out over the points by area.

    Raises
    ------
    ModelError
        Points that cannot carry a mass at another place.
    """
    if position is None:
        rows = sp.vstack([points.observe(axis) for axis in np.eye(3)])
        share = np.tile(mass * points.area / points.area.sum(), 3)
        return (rows.T @ sp.diags(share) @ rows).tocsr()
    nodes = len(np.unique(points.shape.indices))
    if nodes > MOST_NODES:
        raise ModelError(
            f"the set has {nodes} nodes, and a mass at another place couples all of them: expected "
            f"at most {MOST_NODES}; name a smaller set, or leave out at"
        )
    follows = rigid_motion(points, position)
    return (mass * follows.T @ follows).tocsr()


def springs_on(
    name: str,
    side: Owned,
    other_side: Owned | None,
    stiffness: Sequence[float],
    directions: Directions,
    rows: Rows,
    in_static: bool = True,
) -> SpringInterface:
    """Springs from points to ground, shared out by area, or between the means of two sets.

    Parameters
    ----------
    name : str
    side, other_side : (str, Surface)
        Component and its points.
        `other_side` is None for ground.
    stiffness : sequence of float (3)
        In all, in each direction, N/m.
    directions : callable
        At points (n, 3): three of (n, 3).
    rows : callable
        (component, rows over its nodes), any number of them -> csr_matrix (k, n_dof).
    in_static : bool
        See `SpringInterface`.
    """
    component, points = side
    if other_side is None:
        share = points.area / points.area.sum()
        point_rows = [rows((component, points.observe(d))) for d in directions(points.points)]
        k = np.concatenate([per_area * share for per_area in stiffness])
        return SpringInterface(name, sp.vstack(point_rows).tocsr(), k, in_static)
    shares = [p.area / p.area.sum() for _, p in (side, other_side)]
    positions = np.vstack([side[1].points, other_side[1].points])
    centre = np.average(positions, axis=0, weights=np.concatenate(shares))
    mean_rows = []
    for d in directions(centre[None]):
        means = [
            sp.csr_matrix(share) @ p.observe(d[0])
            for share, (_, p) in zip(shares, (side, other_side), strict=True)
        ]
        mean_rows.append(rows((component, means[0]), (other_side[0], -means[1])))
    return SpringInterface(name, sp.vstack(mean_rows).tocsr(), np.array(stiffness), in_static)


def directions_at(points: np.ndarray, axes: str, rotation: Rotation | None) -> list[np.ndarray]:
    """Three directions (n, 3) at points (n, 3): x, y, z, or radial, around and along the axis.

    Raises
    ------
    ModelError
        Cylindrical axes without a rotation, or of a point on its axis.
    """
    if axes == "cartesian":
        return [np.tile(e, (len(points), 1)) for e in np.eye(3)]
    if rotation is None:
        raise ModelError("cylindrical axes need [rotation] with the axis")
    around = rotation.around(points)
    size = np.linalg.norm(around, axis=1, keepdims=True)
    if not (size > 1e-9 * np.abs(points - rotation.point).max()).all():
        raise ModelError("a point of the set lies on the axis of rotation")
    around = around / size
    axial = np.tile(rotation.direction, (len(points), 1))
    return [np.cross(around, axial), around, axial]
