"""What decks of Abaqus generate: nodes, elements, numbers by *PARAMETER, local coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from component_meshes import STEEL, box
from test_component_inp import written
from test_component_judge import apart

from squealstudy.errors import ModelError
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

MATERIAL = """*MATERIAL, NAME=M
*DENSITY
7.8e-9
*ELASTIC
2.1e5, .3
*SOLID SECTION, ELSET=ALL, MATERIAL=M
"""
# a box of 4 x 2 x 3 cells: x counts by 1, y by 10, z by 100
BOX = (
    """*NODE, NSET=ENDS
1, 0., 0., 0.
5, 3., 0., 0.
21, 0., 2., 0.
25, 3., 2., 0.
*NGEN, NSET=LOW
1, 5
*NGEN, NSET=HIGH
21, 25, 1
*NFILL, NSET=BOTTOM
LOW, HIGH, 2, 10
*NODE, NSET=TOP
301, 0., 0., 2.5
305, 3., 0., 2.5
321, 0., 2., 2.5
325, 3., 2., 2.5
*NGEN, NSET=TOP
301, 305
321, 325
301, 321, 10
302, 322, 10
303, 323, 10
304, 324, 10
305, 325, 10
*NFILL
BOTTOM, TOP, 3, 100
*ELEMENT, TYPE=C3D8
1, 1, 2, 12, 11, 101, 102, 112, 111
*ELGEN, ELSET=ALL
1, 4, 1, 1, 2, 10, 10, 3, 100, 100
"""
    + MATERIAL
)


def same_matrices(mesh, expected):
    """K and M of both where nodes are in other orders."""
    order = np.lexsort(np.round(mesh.nodes, 9).T)
    wanted = np.lexsort(np.round(expected.nodes, 9).T)
    np.testing.assert_allclose(mesh.nodes[order], expected.nodes[wanted], atol=1e-12)
    rows, other = ((3 * o[:, None] + np.arange(3)).ravel() for o in (order, wanted))
    for matrix in (stiffness_matrix, mass_matrix):
        A, B = matrix(mesh), matrix(expected)
        assert apart(A[rows][:, rows], B[other][:, other]) < 1e-12


def test_nodes_and_elements_are_those_of_a_box(tmp_path):
    mesh = read_inp(written(tmp_path, BOX))
    assert len(mesh.node_set("BOTTOM")) == 15
    assert mesh.numbers[mesh.node_set("HIGH")].tolist() == [21, 22, 23, 24, 25]
    assert mesh.labels.max() == 1 + 3 + 10 + 200
    same_matrices(mesh, box("C3D8", (4, 2, 3), materials={"S": STEEL}))


def test_arcs_parabolas_and_local_coordinates(tmp_path):
    text = """*SYSTEM
10., 20., 30., 10., 21., 30.
*NODE
1, 5., 0., 0.
*SYSTEM
*NODE
9, 10., 20., 30.
22, 5., 20., 30.
61, 10., 15., 30.
3, 10., 15., 31.
*NGEN, LINE=C
1, 22, 7, 9
1, 61, 20, 9, , , , 0., 0., -1.
*NODE
100, 0., 0., 0.
104, 4., 0., 0.
*NGEN, LINE=P, SYSTEM=C, NSET=PARABOLA
100, 104, 1, , 2., 90., 0.
*ELEMENT, TYPE=C3D4, ELSET=ALL
1, 9, 1, 8, 3
2, 9, 21, 41, 3
3, 101, 102, 103, 9
"""
    path = written(tmp_path, text + MATERIAL)
    mesh = read_inp(path)
    of = {int(n): x for n, x in zip(mesh.numbers, mesh.nodes, strict=True)}
    c = np.array([10.0, 20.0, 30.0])
    np.testing.assert_allclose(of[1] - c, [0, 5, 0], atol=1e-12)  # axis 1 looks along y
    third = np.deg2rad(90 + 30)
    np.testing.assert_allclose(of[8] - c, [5 * np.cos(third), 5 * np.sin(third), 0], atol=1e-12)
    np.testing.assert_allclose(  # the other way about: 180 degrees in thirds
        of[21] - c, [5 * np.sin(np.pi / 3), 5 * np.cos(np.pi / 3), 0], atol=1e-12
    )
    np.testing.assert_allclose(of[102], [0, 2, 0], atol=1e-12)
    # through (0, 0), (0, 2), (4, 0) at 0, 1/2, 1: x = 8 t^2 - 4 t, y = 8 t (1 - t)
    np.testing.assert_allclose(of[101], [-0.5, 1.5, 0], atol=1e-12)
    np.testing.assert_allclose(of[103], [1.5, 1.5, 0], atol=1e-12)


def test_two_points_more_turn_a_system_in_space(tmp_path):
    more = "*SYSTEM\n1,2,3,1,2,4\n1,3,3\n*NODE\n900, 7., 8., 9.\n*EQUATION\n2\n900,1,1.,1,1,-1.\n"
    mesh = read_inp(written(tmp_path, BOX + more))
    place = mesh.nodes[mesh.numbers == 900][0]
    np.testing.assert_allclose(place, [1 - 9, 2 + 8, 3 + 7], atol=1e-12)


PARAMETRIC = (
    """*PARAMETER
# a comment
n = 4
length = 3.*sin(pi/6)*2.0   # of the box
last = 1 + n
E = 2.1*10**5
mat = 'M'
*NODE
1, 0., 0., 0.
"""
    + BOX.split("1, 0., 0., 0.\n", 1)[1]
    .replace("5, 3., 0., 0.\n21", "<last>, <length>, 0., 0.\n21")
    .replace("1, 4, 1, 1, 2", "1, <n>, 1, 1, 2")
    .replace("2.1e5, .3", "< E >, .3")
    .replace("MATERIAL, NAME=M", "MATERIAL, NAME=<mat>")
).replace("NSET=ENDS", "NSET=E")


def test_parameters_are_put_in(tmp_path):
    mesh = read_inp(written(tmp_path, PARAMETRIC))
    same_matrices(mesh, box("C3D8", (4, 2, 3), materials={"S": STEEL}))
    assert list(mesh.materials) == ["M"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("n = 4", "n = __import__('os').getpid()", r"line 3: n: .* is no function"),
        ("n = 4", "n = 9/2", "line 3: 9 / 2 divides integers, which versions of Abaqus"),
        ("n = 4", "n = 8/2", None),
        ("n = 4", "n = 2**2", None),
        ("n = 4", "n = 4.0", "line 10: expected a node number, found '5.0'"),
        ("n = 4", "n = m + 1", "line 3: n: there is no number 'm' yet"),
        ("n = 4", "e = 4", "a parameter cannot have the name e"),
        ("n = 4", "n 4", "line 3: expected name = value"),
        ("n = 4", "n = 10**400", r"line 3: n: .*too large"),
        (
            "<last>, <length>",
            "<last>, <width>",
            "there is no parameter <width> yet; there is n",
        ),
        ("*PARAMETER", "*PARAMETER, DEPENDENT", r"\*PARAMETER, DEPENDENT is not supported"),
    ],
)
def test_parameters_that_are_none(tmp_path, old, new, message):
    path = written(tmp_path, PARAMETRIC.replace(old, new, 1))
    if message is None:
        assert read_inp(path).n_elements == 24
        return
    with pytest.raises(ModelError, match=message):
        read_inp(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("NSET=LOW\n1, 5", "NSET=LOW\n1, 5, 3", "line 7: from 1 to 5 there are no steps of 3"),
        ("NSET=LOW\n1, 5", "NSET=LOW\n1, 6", "line 7: there is no node 6 yet"),
        ("301, 305\n", "301, 900000301\n", "expected at most 20000000 generated nodes"),
        ("*NGEN, NSET=LOW", "*NGEN, NSET=LOW, LINE=X", "LINE=X is not supported: expected C or P"),
        ("LOW, HIGH, 2, 10", "LOW, ENDS, 2, 10", "as many nodes, found 5 and 4"),
        ("LOW, HIGH, 2, 10", "LOW, HIGH, 99999999", "expected 1 to 4000000 intervals"),
        ("LOW, HIGH, 2, 10", "LOW, HI, 2", "there is no node set 'HI'"),
        ("*NFILL, NSET", "*NFILL, BIAS=.5, NSET", r"\*NFILL, BIAS is not supported"),
        ("1, 4, 1, 1, 2", "7, 4, 1, 1, 2", "there is no solid element 7 yet"),
        ("1, 4, 1, 1, 2", "1, 5, 1, 1, 2", "element 5 has node 6, which does not exist"),
        ("1, 4, 1, 1, 2", "1, 99999999, 1, 1, 2", "at most 20000000 elements"),
        ("1, 4, 1, 1, 2", "1, 4, 1, 0, 2", "element 1 is there twice"),
        ("*NODE, NSET=ENDS", "*SYSTEM\n0,0,0,1\n*NODE, NSET=ENDS", "expected an origin, a point"),
        ("*NODE, NSET=ENDS", "*SYSTEM\n0,0,0,0,0,1\n*NODE, NSET=ENDS", "lie on one line"),
    ],
)
def test_what_cannot_be_generated(tmp_path, old, new, message):
    assert old in BOX
    with pytest.raises(ModelError, match=message):
        read_inp(written(tmp_path, BOX.replace(old, new, 1)))
