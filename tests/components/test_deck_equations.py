"""Equations between displacements of a deck: *EQUATION, *MPC, turned axes, what is left of them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from component_meshes import STEEL, box
from test_deck_elements import two

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import _placed_mesh as moved
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

C, S = np.cos(0.3), np.sin(0.3)
AXES = np.array([[C, S, 0], [-S, C, 0], [0, 0, 1.0]])


def read(folder, *lines, turn=None, name="C3D8", **table):
    """Mesh, expansion E, K and M of a box of three elements with lines of a deck."""
    mesh = box(name, (3, 1, 1), materials={"S": STEEL})
    write_inp(mesh, folder / "a.inp", [line.format(*mesh.numbers) for line in lines])
    mesh = read_mesh(folder / "a.inp", ComponentTable(mesh="a.inp", **table))
    if turn is not None:
        mesh = moved(mesh, turn, np.ones(3))
    mesh, e = expanded(mesh)
    return (
        mesh,
        e,
        *(e.restricted(A).toarray() for A in (stiffness_matrix(mesh), mass_matrix(mesh))),
    )


def null_space(folder, rows):
    """K and M of the box on the motions without rows . u, as a basis gives them."""
    _, _, K, M = read(folder)
    G = np.zeros((len(rows), len(K)))
    for row, terms in enumerate(rows):
        for node, vector in terms:
            G[row, 3 * node : 3 * node + 3] += vector
    N = la.null_space(G)
    return N.T @ K @ N, N.T @ M @ N


def same(found, expected):
    roots, wanted = (la.eigh(*pair, eigvals_only=True) for pair in (found, expected))
    np.testing.assert_allclose(roots, wanted, atol=1e-9 * wanted[-1])


X, Y, Z = np.eye(3)
LINES = {
    "two": (
        ["*EQUATION", "2", "{0}, 1, 2., {1}, 1, -1."],
        [[(0, 2 * X), (1, -X)]],
    ),
    "several lines, a chain, two directions of one node": (
        ["*EQUATION", "3", "{0}, 1, 1., {1}, 2, -.5,", "{3}, 3, .25", "2",
         "{1}, 2, 1., {2}, 2, -1.", "2", "{0}, 2, 1., {5}, 3, 3."],
        [[(0, X), (1, -Y / 2), (3, Z / 4)], [(1, Y), (2, -Y)], [(0, Y), (5, 3 * Z)]],
    ),
    "one term": (["*EQUATION", "1", "{4}, 2, 3."], [[(4, Y)]]),
    "a node twice": (
        ["*EQUATION", "3", "{0}, 1, 1., {0}, 2, 1., {0}, 3, 2."],
        [[(0, X + Y + 2 * Z)]],
    ),
    "a set follows a node": (
        ["*NSET, NSET=FEW", "{0}, {1}", "*EQUATION", "2", "FEW, 3, 1., {6}, 3, -1."],
        [[(0, Z), (6, -Z)], [(1, Z), (6, -Z)]],
    ),
    "pin": (["*MPC", "PIN, {0}, {9}"], [[(0, v), (9, -v)] for v in (X, Y, Z)]),
    "nodes on a line": (
        ["*MPC", "STRAIGHT, {0}, {12}, {4}, {8}"],
        [[(k, v), (0, -(1 - t) * v), (12, -t * v)] for k, t in ((4, 1 / 3), (8, 2 / 3))
         for v in (Y, Z)],
    ),
    "nodes of a plane": (
        ["*NSET, NSET=P", "{0}, {1}, {2}, {3}", "*MPC", "PLANE, P"],
        [[(3, X), (1, -X), (2, -X), (0, X)]],
    ),
    "turned axes": (
        ["*NSET, NSET=T", "{0}", f"*TRANSFORM, NSET=T\n{C}, {S}, 0., {-S}, {C}, 0.",
         "*EQUATION", "2", "{0}, 1, 1., {7}, 1, -2.", "2", "{0}, 2, 1., {7}, 3, 1."],
        [[(0, AXES[0]), (7, -2 * X)], [(0, AXES[1]), (7, Z)]],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", LINES)
def test_equations_hold_and_nothing_else(tmp_path, case):
    lines, rows = LINES[case]
    _, e, K, M = read(tmp_path, *lines)
    assert len(K) == e.E.shape[0] - len(rows)
    for terms in rows:
        left = sum(e.E[3 * node : 3 * node + 3].T @ vector for node, vector in terms)
        assert abs(left).max() < 1e-14
    same((K, M), null_space(tmp_path, rows))


@pytest.mark.parametrize("case", LINES)
def test_equations_turn_with_the_component(tmp_path, case):
    lines, _ = LINES[case]
    turn = AXES @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
    same(read(tmp_path, *lines, turn=turn)[2:], read(tmp_path, *lines)[2:])


def test_the_distance_of_two_nodes(tmp_path):
    """BEAM of CalculiX; of Abaqus it is a rigid body of the nodes of one reference."""
    mesh, e, K, _ = read(tmp_path, "*MPC", "BEAM, {0}, {11}")
    along = mesh.nodes[0] - mesh.nodes[11]
    assert abs((e.E[:3] - e.E[33:36]).T @ along).max() < 1e-13
    assert len(K) == e.E.shape[0] - 1
    lines = ("*MPC", "BEAM, {0}, {11}", "BEAM, {1}, {11}", "BEAM, {2}, {11}", "BEAM, {3}, {11}")
    mesh, e, *_ = read(tmp_path, *lines, dialect="abaqus")
    (c,) = mesh.constraints
    assert (c.kind, c.reference, c.nodes.tolist()) == ("rigid", 11, [0, 1, 2, 3])


def test_a_node_without_elements_carries_others(tmp_path):
    lines = ("*NODE, NSET=DUMMY", "9000, 50., 0., 0.", "*NSET, NSET=FEW", "{0}, {1}, {2}")
    equation = ("*EQUATION", "2", "FEW, 1, 1., DUMMY, 1, -1.")
    mesh, _, K, M = read(tmp_path, *lines, *equation)
    rows = [[(0, X), (2, -X)], [(1, X), (2, -X)]]
    assert mesh.numbers[-1] == 9000
    same((K, M), null_space(tmp_path, rows))
    mesh, *_ = read(tmp_path, *lines, "*EQUATION", "2", "DUMMY, 1, 1., DUMMY, 2, -1.")
    assert not mesh.constraints
    assert "nodes of no element" in [note.why for note in mesh.passed_over]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("STRAIGHT, {0}, {4}", "expected more than 2 nodes of a straight MPC"),
        ("STRAIGHT, {0}, {4}, {9}", "node 3 of 3 of the MPC lies off the line"),
        ("PLANE, {0}, {4}, {8}, {12}", "no 3 of its nodes give a plane"),
        ("PLANE, {0}, {4}, {2}, {9}", "node 4 of 4 of the MPC lies off the plane"),
    ],
)
def test_lines_and_planes_that_are_none(tmp_path, line, message):
    with pytest.raises(ModelError, match=message):
        read(tmp_path, "*MPC", line)


def test_equations_of_no_displacement_are_told(tmp_path):
    mesh, *_ = read(tmp_path, "*EQUATION", "2", "{0}, 11, 1., {1}, 11, -1.")
    assert "an equation without displacements" in [note.why for note in mesh.passed_over]


def test_equations_that_contradict_or_repeat(tmp_path):
    twice = ("*EQUATION", "2", "{0}, 1, 1., {1}, 1, -1.", "2", "{0}, 1, 1., {2}, 1, -1.")
    with pytest.raises(ModelError, match=r"is to follow by \*EQUATION .* and \*EQUATION .*first"):
        read(tmp_path, *twice)
    circle = ("*EQUATION", "2", "{0}, 1, 1., {1}, 1, -1.", "2", "{1}, 1, 1., {0}, 1, -1.")
    with pytest.raises(ModelError, match="in a circle"):
        read(tmp_path, *circle)


def test_nodes_that_equations_join_may_lie_at_one_place(tmp_path):
    """Two cubes, one on the other, joined at four pairs of nodes."""
    rows = [f"2\n{n + 6}, {d}, 1., {n}, {d}, -1.\n" for n in (5, 6, 7, 8) for d in (1, 2, 3)]
    mesh = two(tmp_path, "*EQUATION\n" + "".join(rows))
    assert mesh.body_of.max() == 0
    with pytest.raises(ModelError, match="are not connected there"):
        two(tmp_path, "*EQUATION\n" + "".join(rows[:3]))


def test_the_axis_of_a_system_may_hold_nodes_that_no_equation_has(tmp_path):
    lines = ("*NSET, NSET=T", "{0}, {1}", "*TRANSFORM, NSET=T, TYPE=C", "0., 0., 0., 0., 0., 1.")
    equation = ("*EQUATION", "2", "{4}, 3, 1., {7}, 1, -2.")
    mesh, *_ = read(tmp_path, *lines, *equation)
    np.testing.assert_allclose(mesh.constraints[0].vectors[0], Z)


def test_what_only_follows_is_told(tmp_path):
    """The cut of a bolt stays shut, and a mean turn is one of a node that has no element."""
    lines = ("*NODE, NSET=P", "9000, 0., 0., 9.", "*PRE-TENSION SECTION, NODE=9000", "0., 0., 1.")
    mesh, _, K, _ = read(tmp_path, *lines, "*MPC", "MEANROT, {0}, {0}, {0}, {1}, {1}, {1}, 9000")
    assert len(K) == 3 * len(box("C3D8", (3, 1, 1)).nodes)
    told = {note.keyword: note.why for note in mesh.passed_over}
    assert "both sides of the cut stay together" in told["*PRE-TENSION SECTION"]
    assert "nothing holds node 9000, which has the mean turn of others" in told["*MPC"]
