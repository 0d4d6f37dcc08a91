"""Turns of reference nodes: chains of couplings, rotary inertia, offsets, springs against turns."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from component_meshes import STEEL, box
from test_deck_discrete import matrices

from squealstudy.errors import ModelError
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

BOX = box("C3D8", (3, 1, 1), materials={"S": STEEL})
K0, M0 = stiffness_matrix(BOX).toarray(), mass_matrix(BOX).toarray()
X0 = BOX.nodes
FACE = np.flatnonzero(X0[:, 0] == 3.0)
OTHER = np.flatnonzero(X0[:, 0] == 0.0)
REF = np.array([4.0, 0.5, 1.0])
REF2 = np.array([-1.0, 1.0, 0.5])


def turned(r):
    """Displacement (3, 3) at r of unit turns."""
    return np.column_stack([np.cross(e, r) for e in np.eye(3)])


def moved(followers, n_more):
    """Displacements of all nodes by those that are free and some freedoms more.

    `followers`: nodes and their rows (3, n_more) by these.
    """
    follows = {int(n): r for nodes, rows in followers for n, r in zip(nodes, rows, strict=True)}
    free = [k for k in range(len(X0)) if k not in follows]
    N = np.zeros((3 * len(X0), 3 * len(free) + n_more))
    for at, node in enumerate(free):
        N[3 * node : 3 * node + 3, 3 * at : 3 * at + 3] = np.eye(3)
    for node, rows in follows.items():
        N[3 * node : 3 * node + 3, 3 * len(free) :] = rows
    return N


def on(reference, nodes):
    """Rows (3, 6) of nodes of a rigid body with a reference place."""
    return [np.hstack([np.eye(3), turned(X0[k] - reference)]) for k in nodes]


def same(found, expected):
    values, wanted = (la.eigvalsh(*pair) for pair in (found, expected))
    np.testing.assert_allclose(values, wanted, atol=1e-9 * wanted[-1])


def rigid(more=(), n=6, reference=REF):
    """K and M of the box with a rigid face, and what is added at its six freedoms."""
    N = moved([(FACE, on(reference, FACE))], n)
    K, M = N.T @ K0 @ N, N.T @ M0 @ N
    for name, block in more:
        (K if name == "K" else M)[-6:, -6:] += block
    return K, M


BODY = (
    "*NODE\n900, 4., .5, 1.\n*NSET, NSET=FACE\n"
    + ", ".join(str(n) for n in BOX.numbers[FACE])
    + "\n*RIGID BODY, NSET=FACE, REF NODE=900"
)
MASS = "*ELEMENT, TYPE=MASS, ELSET=EM\n901, 900\n*MASS, ELSET=EM\n1e-8"
INERTIA = "*ELEMENT, TYPE=ROTARYI, ELSET=EI\n902, 900\n*ROTARY INERTIA, ELSET=EI\n2e-8, 3e-8, 4e-8"
SPRING = "*ELEMENT, TYPE=SPRING1, ELSET=ES\n903, 900\n*SPRING, ELSET=ES\n5\n1e5"


def test_rotary_inertia_and_springs_of_a_reference_node(tmp_path):
    found = matrices(tmp_path, BODY, MASS, INERTIA, SPRING)[:2]
    inertia = np.diag([1e-8] * 3 + [2e-8, 3e-8, 4e-8])
    spring = np.diag([0, 0, 0, 0, 1e5, 0])
    in_si = rigid([("M", inertia), ("K", spring)])
    same(found, in_si)  # the same roots 1/s2 in mm and t


@pytest.mark.parametrize("angle", [0.0, 40.0])
def test_they_turn_with_the_component(tmp_path, angle):
    lines = (BODY, MASS, INERTIA, SPRING)
    plain = matrices(tmp_path, *lines)[:2]
    how = {"axis": [1, 2, 3], "angle": angle, "point": [5, 0, 1]}
    same(matrices(tmp_path, *lines, rotate=how)[:2], plain)


def test_inertia_without_a_coupling_is_told(tmp_path):
    line = "*ELEMENT, TYPE=ROTARYI, ELSET=EI\n902, 11\n*ROTARY INERTIA, ELSET=EI\n2e-8, 3e-8, 4e-8"
    K, M, body = matrices(tmp_path, line)
    assert ("*ROTARY INERTIA", "node 11: no coupling has it, so that its turns move nothing") in [
        (note.keyword, note.why) for note in body.mesh.passed_over
    ]
    np.testing.assert_allclose(la.eigvalsh(K, M)[-1], la.eigvalsh(K0, M0)[-1], rtol=1e-9)


def test_the_mean_turn_of_a_distributing_coupling(tmp_path):
    """Inertia about the axis of the box, against turns of the face as a rigid motion."""
    lines = BODY.replace("*RIGID BODY, NSET=FACE, REF NODE=900", "")
    lines += (
        "*SURFACE, NAME=F, TYPE=NODE\nFACE\n*COUPLING, CONSTRAINT NAME=C, REF NODE=900, SURFACE=F"
    )
    lines += "\n*DISTRIBUTING\n1, 6"
    K, M, _ = matrices(tmp_path, lines)
    K1, M1, _ = matrices(tmp_path, lines, MASS, INERTIA)
    np.testing.assert_allclose(K1, K, atol=1e-9 * abs(K).max())
    about = X0[FACE].mean(axis=0)
    moments = np.diag([2e-8, 3e-8, 4e-8]) * 1e3 * 1e-6  # kg m2
    for axis in np.eye(3):
        u = np.array([np.cross(axis, x - about) for x in X0]).ravel() * 1e-3
        expected = 1e-5 * np.sum(np.cross(axis, (REF - about) * 1e-3) ** 2)
        assert u @ (M1 - M) @ u == pytest.approx(expected + axis @ moments @ axis, rel=1e-9)


CHAIN = (
    BODY.replace("4., .5, 1.", "4., .5, 1.\n950, -1., 1., .5")
    + "\n*NSET, NSET=NEAR\n"
    + ", ".join(str(n) for n in BOX.numbers[OTHER])
    + ", 900\n*SURFACE, NAME=S, TYPE=NODE\nNEAR\n"
    "*COUPLING, CONSTRAINT NAME=C, REF NODE=950, SURFACE=S\n*KINEMATIC\n"
)


@pytest.mark.parametrize(("lines", "turning"), [("", True), ("1, 6", True), ("1, 3", False)])
def test_a_reference_node_turns_with_the_body_that_has_it(tmp_path, lines, turning):
    """Both faces as one rigid body; without the turn the first face turns by itself."""
    found = matrices(tmp_path, CHAIN + lines)[:2]
    n = 6 if turning else 9
    first, second = on(REF2, OTHER), []
    for k in FACE:
        at = np.hstack([np.eye(3), turned(REF - REF2)])  # the reference node of the first
        arm = turned(X0[k] - REF)
        if turning:
            second.append(at + np.hstack([np.zeros((3, 3)), arm]))
        else:
            second.append(np.hstack([at, arm]))
    first = [np.hstack([rows, np.zeros((3, n - 6))]) for rows in first]
    N = moved([(OTHER, first), (FACE, second)], n)
    same(found, (N.T @ K0 @ N, N.T @ M0 @ N))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (BODY + "\n" + INERTIA.replace("2e-8, 3", "2e-8, -3"), "expected moments of inertia"),
        (BODY + "\n" + INERTIA + ", 1e-9", "and no products"),
        (BODY + "\n" + SPRING.replace("\n5\n", "\n7\n"), "expected a direction 1 to 6, found 7"),
        (
            SPRING.replace("900", "11"),
            r"SPRING \(line \d+\): node 11 has no turns: expected",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path, lines, message):
    with pytest.raises(ModelError, match=message):
        matrices(tmp_path, lines)
