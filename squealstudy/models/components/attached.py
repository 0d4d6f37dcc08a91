"""Masses and springs on sets of points, from a model file or added by a study.

A mass at a place of its own follows the rigid motion that best fits the displacements of the set's
points, in least squares weighted by area (a distributing coupling, RBE3 in Nastran). It adds no
stiffness to the set.
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

MOST_NODES = 600  # most nodes of a set with a mass at its own place, which couples all pairs
Owned = tuple[str, Surface]  # a component, and points on it
# points (n, 3) -> three directions (n, 3) at them
Directions = Callable[[np.ndarray], Sequence[np.ndarray]]
Rows = Callable[..., sp.csr_matrix]  # parts (component, rows over its nodes) -> over an assembly


def component_matrices(
    geometry: Geometry, name: str, overrides: Mapping[KeyPath, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K [N/m] and M [kg] (n, n) of a component with the model file's point masses on it.

    Raises
    ------
    PlacedError
        The set of a mass does not exist, or cannot carry a mass at a place of its own.
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
    """Rotary inertia [kg m2] at the mean rotation of a set, over the component's coordinates."""
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
        Where the mass is [m]. None spreads it over the points by area.

    Raises
    ------
    ModelError
        The points have too many nodes for a mass at `position`, or no mean rotation.
    """
    if position is None:
        rows = sp.vstack([points.observe(axis) for axis in np.eye(3)])
        share = np.tile(mass * points.area / points.area.sum(), 3)
        return (rows.T @ sp.diags(share) @ rows).tocsr()
    nodes = len(np.unique(points.shape.indices))
    if nodes > MOST_NODES:
        raise ModelError(
            f"the set has {nodes} nodes, and a mass at another place couples all of them: expected "
            f"at most {MOST_NODES}; name a smaller set, or leave out 'at'"
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
    """Springs from points to ground, spread over them by area, or between the means of two sets.

    Parameters
    ----------
    name : str
    side, other_side : (str, Surface)
        A component and points on it; `other_side` is None for ground.
    stiffness : sequence of float (3)
        Total stiffness in each direction, N/m.
    directions : callable
        Three directions (n, 3) at points (n, 3).
    rows : callable
        Takes any number of (component, rows over the displacements of its nodes); returns rows
        over the coordinates of the assembly, csr_matrix (k, n_dof).
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
    """Three directions (n, 3) at points (n, 3): x, y and z, or radial, tangential and axial.

    Raises
    ------
    ModelError
        Cylindrical axes without a rotation, or a point on the axis of rotation.
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
