"""Rows of contact pairs: sliding, stuck, frictionless."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from touching import AXIS, moved, plane, rigid, rows_of

from squealstudy.errors import ModelError
from squealstudy.laws import contact_law
from squealstudy.models.components.contact_rows import Rotation, contact_interface, contact_rows
from squealstudy.models.components.pairs import pair


def test_sliding_is_that_of_the_rotor():
    rotation = Rotation(np.array([0.1, -0.2, 5.0]), np.array([0.0, 0.0, -3.0]))
    slave = plane(8, (2, 2), up=False, origin=(1, 0))
    master = plane(8, (3, 3), up=True, origin=(1, 0))
    p = pair(slave, master, search=1e-2)
    rows = rows_of(p, "sliding", rotation=rotation)
    arm = rows.points - rotation.point
    arm[:, 2] = 0
    np.testing.assert_allclose(rows.radius, np.linalg.norm(arm, axis=1), rtol=1e-12)
    n = len(slave.coordinates)
    turn = np.zeros((n + len(master.coordinates), 3))
    turn[n:] = rotation.around(master.coordinates)  # the master turns at 1 rad/s
    np.testing.assert_allclose(rows.T @ turn.ravel(), rows.radius, rtol=1e-10)
    np.testing.assert_allclose(rows.T_perp @ turn.ravel(), 0, atol=1e-12)
    np.testing.assert_allclose(rows.N @ turn.ravel(), 0, atol=1e-12)
    away = np.zeros_like(turn)
    away[n:] = turn[n:] * 0 + [0, 0, -1.0]  # the master moves away: the gap opens
    np.testing.assert_allclose(rows.N @ away.ravel(), 1, rtol=1e-12)
    reverse = rows_of(p, "sliding", rotor="slave", rotation=rotation)
    assert abs(rows.T + reverse.T).max() < 1e-15
    assert (rows.frictional == 1).all()


def test_sliding_on_a_cone_stays_in_the_contact_plane():
    """On an inclined face the direction is the part of axis x r in the plane."""
    tilt = 0.4
    slave, master = (
        plane(8, (2, 2), up=False, origin=(1, 0)),
        plane(8, (3, 3), up=True, origin=(1, 0)),
    )
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    slave, master = (replace(f, coordinates=f.coordinates @ turn.T) for f in (slave, master))
    p = pair(slave, master, search=1e-2)
    rows = rows_of(p, "sliding")
    velocity = AXIS.around(rows.points)
    normal = p.slave.normal
    part = velocity - np.sum(velocity * normal, axis=1)[:, None] * normal
    np.testing.assert_allclose(rows.radius, np.linalg.norm(part, axis=1), rtol=1e-12)
    np.testing.assert_allclose(abs(rows.N @ rigid(slave, master)).max(), 0, atol=1e-12)


def test_stuck_points_are_tied_and_do_not_rub():
    slave, master = plane(8, (2, 2), up=False), plane(4, (3, 3), up=True)
    p = pair(slave, master, search=1e-2)
    rows = rows_of(p, "stuck", rotation=None)
    assert not rows.frictional.any()
    assert not rows.radius.any()
    ties = rows.ties("abutment", 5.0)
    u = np.zeros(ties.B.shape[1])
    u[0 : 3 * len(slave.coordinates) : 3], u[1 : 3 * len(slave.coordinates) : 3] = 0.3, 0.4
    assert u @ ties.matrix() @ u == pytest.approx(5.0 * 0.25, rel=1e-12)  # k A |u|^2
    law = contact_law()
    both = contact_interface(
        [
            rows,
            rows_of(p, "sliding", rotation=Rotation(np.array([9.0, 0, 0]), np.array([0, 0, 1.0]))),
        ],
        law,
    )
    assert both.n_points == 2 * len(p.gap0)
    np.testing.assert_array_equal(both.frictional, np.repeat([0.0, 1.0], len(p.gap0)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "glued"}, "kind 'glued' is not known"),
        ({"kind": "sliding", "rotation": None}, "needs an axis"),
        ({"kind": "sliding", "rotor": "disc"}, "master or slave"),
        ({"kind": "sliding", "rotation": Rotation(np.zeros(3), np.array([0, 1.0, 0]))}, "slide"),
    ],
)
def test_rows_are_checked(arguments, message):
    slave, master = plane(4, (1, 1), up=False), plane(4, (1, 1), up=True)
    slave, master = (moved(f, -0.5, -0.5, 0) for f in (slave, master))
    p = pair(slave, master, search=1e-2)
    with pytest.raises(ModelError, match=message):
        rows_of(p, **arguments)
    with pytest.raises(ModelError, match="no component 'pad'"):
        contact_rows(p, "pad", "disc", {"disc": slice(0, 24)}, 24)
    with pytest.raises(ModelError, match="three for each"):
        contact_rows(p, "pad", "disc", {"pad": slice(0, 6), "disc": slice(6, 30)}, 30)


def test_rotation_is_checked():
    with pytest.raises(ModelError, match="not zero"):
        Rotation(np.zeros(3), np.zeros(3))
    with pytest.raises(ModelError, match="three numbers"):
        Rotation(np.zeros(2), np.ones(3))
