"""Rows of contact pairs over the degrees of freedom of a whole assembly.

A pair slides on the rotor, or is stuck or frictionless elsewhere, as the piston on its plate or an
ear on its abutment. A frictionless pair may be given friction along a direction of slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws import ContactLaw
from squealstudy.models.assembly import ContactInterface
from squealstudy.models.component_slices import expand_rows
from squealstudy.models.components.pairs import Pair
from squealstudy.models.linear_interfaces import SpringInterface

KINDS = ("sliding", "stuck", "frictionless")
SIDES = ("master", "slave")
STEEP = 1e-6  # a direction slides if more of it, over its length, is in the contact plane


@dataclass(frozen=True)
class Rotation:
    """Axis about which the rotor turns, by the right-hand rule.

    Attributes
    ----------
    point : ndarray (3,)
        A point on the axis, m.
    axis : ndarray (3,)
        Direction of the axis, of any length but zero.
    """

    point: np.ndarray
    axis: np.ndarray

    def __post_init__(self) -> None:
        if np.shape(self.point) != (3,) or np.shape(self.axis) != (3,):
            raise ModelError("rotation: point and axis need three numbers each")
        if not (np.isfinite(self.point).all() and 0 < np.linalg.norm(self.axis) < np.inf):
            raise ModelError("rotation: point and axis must be finite, the axis not zero")

    @property
    def direction(self) -> np.ndarray:
        """Unit vector of the axis."""
        axis = np.asarray(self.axis, dtype=float)
        return axis / np.linalg.norm(axis)

    def around(self, points: np.ndarray) -> np.ndarray:
        """Velocity (n, 3) [m/s] of points (n, 3) [m] at 1 rad/s."""
        return np.cross(self.direction, points - np.asarray(self.point, dtype=float))


@dataclass(frozen=True)
class ContactRows:
    """Contact points of one pair; see ContactInterface for the rows.

    Attributes
    ----------
    N, T, T_perp : csr_matrix (n, n_dof)
        Where nothing slides, T and T_perp are the motion of the master under the slave along two
        perpendicular directions of the contact plane; T is along the slip if one is given.
    area, gap0, radius, frictional : ndarray (n,)
        `radius` and `frictional` are 0 where nothing slides, but `frictional` is 1 with slip.
    points : ndarray (n, 3)
        Coordinates of the points, m.
    """

    N: sp.csr_matrix
    T: sp.csr_matrix
    T_perp: sp.csr_matrix
    area: np.ndarray
    gap0: np.ndarray
    radius: np.ndarray
    frictional: np.ndarray
    points: np.ndarray

    def ties(self, name: str, stiffness: float, in_static: bool = True) -> SpringInterface:
        """Springs of `stiffness` [N/m3] that hold stuck points along T and T_perp."""
        k = stiffness * self.area
        B = sp.vstack([self.T, self.T_perp]).tocsr()
        return SpringInterface(name, B, np.concatenate([k, k]), in_static)


def contact_rows(
    pair: Pair,
    slave: str,
    master: str,
    spans: dict[str, slice],
    n_dof: int,
    *,
    kind: str = "sliding",
    rotation: Rotation | None = None,
    rotor: str = "master",
    slip: np.ndarray | None = None,
) -> ContactRows:
    """Rows of a pair between the components `slave` and `master`.

    The sliding direction is the part of the rotor's velocity in the contact plane. `radius` is the
    arm of a force in that direction about the axis, and also the sliding speed at 1 rad/s.

    Parameters
    ----------
    pair : Pair
        Contact points.
    slave, master : str
        Names of the two components, keys of `spans`.
    spans, n_dof : dict of slice, int
        Degrees of freedom of each component, and the number of all (`component_slices`).
    kind : str
        ``sliding``, ``stuck`` (with `ContactRows.ties`) or ``frictionless``.
    rotation : Rotation, optional
        Needed for ``sliding``.
    rotor : str
        The side that turns: ``master`` or ``slave``.
    slip : ndarray (3,), optional
        Direction in which the master slips past the slave. It gives friction to a pair that does
        not slide on the rotor.

    Raises
    ------
    ModelError
        An unknown kind, side or component; no rotation; points that do not slide, as they are on
        the axis or the rotor moves along the normal; normals along the slip.
    """
    if kind not in KINDS:
        raise ModelError(f"contact kind '{kind}' is not known; there are {', '.join(KINDS)}")
    if rotor not in SIDES:
        raise ModelError(f"the rotor is master or slave, got '{rotor}'")
    for name, surface in ((slave, pair.slave), (master, pair.master)):
        if name not in spans:
            raise ModelError(f"contact: there is no component '{name}'")
        n_freedoms = spans[name].stop - spans[name].start
        if 3 * surface.shape.shape[1] != n_freedoms:
            raise ModelError(
                f"contact: component '{name}' has {n_freedoms} degrees of freedom, not three "
                f"for each of {surface.shape.shape[1]} nodes"
            )
    opening = -pair.slave.normal  # from the master towards the slave

    def relative(d: np.ndarray, sign: float = 1.0) -> sp.csr_matrix:
        """Displacement of the slave less that of the master along d (n, 3), times `sign`."""
        sides = (slave, sign * pair.slave.observe(d)), (master, -sign * pair.master.observe(d))
        return expand_rows(sides, spans, n_dof)

    n = len(pair.gap0)
    if kind == "sliding":
        if rotation is None:
            raise ModelError(f"contact of {slave} on {master}: sliding needs an axis of rotation")
        along, across, radius = sliding(pair, rotation, f"contact of {slave} on {master}")
        sign = -1.0 if rotor == "master" else 1.0
        frictional = np.ones(n)
    elif slip is not None:
        along, across = slipping(pair.slave.normal, slip)
        sign, radius, frictional = -1.0, np.zeros(n), np.ones(n)
    else:
        along, across = tangents(opening)
        sign, radius, frictional = -1.0, np.zeros(n), np.zeros(n)
    return ContactRows(
        N=relative(opening),
        T=relative(along, sign),
        T_perp=relative(across, sign),
        area=pair.slave.area,
        gap0=pair.gap0,
        radius=radius,
        frictional=frictional,
        points=pair.slave.points,
    )


def contact_interface(parts: Sequence[ContactRows], law: ContactLaw) -> ContactInterface:
    """The contact interface of an assembly: the points of all pairs, under one law."""
    N, T, T_perp = (
        sp.vstack([getattr(p, rows) for p in parts]).tocsr() for rows in ("N", "T", "T_perp")
    )
    area, gap0, radius, frictional = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("area", "gap0", "radius", "frictional")
    )
    points = np.concatenate([p.points for p in parts])
    return ContactInterface(N, T, T_perp, area, gap0, radius, law, frictional, points=points)


def sliding(
    pair: Pair, rotation: Rotation, where: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors along and across sliding (n, 3), and the arm (n,) [m] about the axis.

    Raises ModelError where points do not slide; `where` begins its message.
    """
    n = pair.slave.normal
    velocity = rotation.around(pair.slave.points)
    along = velocity - np.sum(velocity * n, axis=1, keepdims=True) * n
    size = np.linalg.norm(along, axis=1)
    speed = np.linalg.norm(velocity, axis=1)
    max_distance = np.linalg.norm(pair.slave.points - rotation.point, axis=1).max()
    at_rest = (speed <= STEEP * max_distance) | (size <= STEEP * speed)
    if at_rest.any():
        raise ModelError(
            f"{where}: {at_rest.sum()} of {len(n)} points do not slide: they lie on the axis of "
            "rotation, or the rotor moves along the normal there"
        )
    along /= size[:, None]
    # across points outwards wherever the contact plane is not parallel to the axis
    outward_sign = np.where(n @ rotation.direction > STEEP, -1.0, 1.0)[:, None]
    return along, outward_sign * np.cross(n, along), size


def slipping(n: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along and across slip (n, 3) in the planes of unit normals n (n, 3).

    Raises ModelError where `direction` (3,) is along a normal.
    """
    unit = direction / np.linalg.norm(direction)
    along = unit - (n @ unit)[:, None] * n
    size = np.linalg.norm(along, axis=1)
    if (along_normal := size <= STEEP).any():
        raise ModelError(
            f"{along_normal.sum()} of {len(n)} points have normals along its direction 'sliding': "
            "expected one in the contact plane"
        )
    along /= size[:, None]
    return along, np.cross(n, along)


def tangents(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (n, 3) perpendicular to the unit vectors n (n, 3) and to each other."""
    e = np.eye(3)[np.abs(n).argmin(axis=1)]
    first_tangent = e - np.sum(e * n, axis=1, keepdims=True) * n
    first_tangent /= np.linalg.norm(first_tangent, axis=1, keepdims=True)
    return first_tangent, np.cross(n, first_tangent)
