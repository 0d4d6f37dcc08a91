"""Left-handed elements, lumped masses, and the bricks that a deck of Nastran means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import STEEL, box
from test_component_judge import apart
from test_component_nastran import deck, read

from squealstudy.errors import ModelError
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.faces import boundary, facet_groups, facets
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.handed import righted
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

OTHER_WAY = {  # corners, then middles of edges, of an element read from below
    "C3D4": (0, 2, 1, 3),
    "C3D8": (4, 5, 6, 7, 0, 1, 2, 3),
    "C3D8I": (4, 5, 6, 7, 0, 1, 2, 3),
    "C3D20": (4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19),
    "C3D6": (3, 4, 5, 0, 1, 2),
    "C3D15": (3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14),
    "C3D10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
}


@pytest.mark.parametrize("name", OTHER_WAY)
def test_left_handed_elements_are_the_same(name):
    """Every other element; faces of surfaces keep their nodes."""
    mesh = box(name, (2, 1, 1), uneven=0.2, materials={"S": STEEL})
    mesh = replace(mesh, surfaces={"SKIN": boundary(mesh)})
    block = mesh.blocks[0]
    nodes = block.nodes.copy()
    nodes[::2] = nodes[::2][:, list(OTHER_WAY[name])]
    left = replace(mesh, blocks=(replace(block, nodes=nodes),))
    left = replace(left, surfaces={"SKIN": boundary(left)})
    with pytest.raises(ModelError, match="negative Jacobian"):
        check_mesh(left)
    found = righted(left)
    check_mesh(found)
    assert apart(stiffness_matrix(found), stiffness_matrix(mesh)) < 1e-12
    assert apart(mass_matrix(found), mass_matrix(mesh)) < 1e-12
    assert _corners(found) == _corners(mesh)
    assert f"{len(nodes[::2])} of {len(nodes)} elements" in found.passed_over[0].why
    assert righted(mesh) is mesh


def _corners(mesh):
    groups = facet_groups(mesh, mesh.surfaces["SKIN"])
    return sorted(tuple(sorted(row)) for g in groups for row in g.nodes.tolist())


def test_an_element_that_is_folded_is_refused(tmp_path):
    mesh = box("C3D8", (1, 1, 1), materials={"S": STEEL})
    nodes = mesh.nodes.copy()
    nodes[0] = nodes[-1] * 1.5
    with pytest.raises(ModelError, match="negative Jacobian"):
        check_mesh(righted(replace(mesh, nodes=nodes)))


@pytest.mark.parametrize("name", FORMULATIONS)
def test_lumped_masses(name):
    """At the nodes, above zero, with the mass and its centre."""
    mesh = box(name, (2, 2, 1), materials={"S": STEEL})
    M, full = mass_matrix(mesh, "lumped"), mass_matrix(mesh)
    assert M.nnz == M.shape[0]
    assert M.diagonal().min() > 0
    move = np.tile(np.eye(3), (len(mesh.nodes), 1))
    np.testing.assert_allclose(move.T @ (M @ move), move.T @ (full @ move), atol=1e-20)
    at = mesh.nodes - mesh.nodes.mean(axis=0)
    np.testing.assert_allclose(at.ravel() @ (M @ move), at.ravel() @ (full @ move), atol=1e-20)
    if mesh.blocks[0].nodes.shape[1] <= 8:
        np.testing.assert_allclose(M.diagonal(), full.sum(axis=1).A1, rtol=1e-12)


def nastran(folder, *more, cut=("", ""), **table):
    text = deck(box("C3D8I", (2, 1, 1), uneven=0.1), more=more).replace(*cut)
    (folder / "a.bdf").write_text(text)
    return read_mesh(folder / "a.bdf", ComponentTable(mesh="a.bdf", **table))


@pytest.mark.parametrize(
    ("psolid", "name"),
    [
        ("", "C3D8I"),
        (",0,,,1", "C3D8I"),  # with bubble functions
        (",0,THREE,GRID,FULL,SMECH", "C3D8"),
        (",,TWO,,1", "C3D8"),
        (",,3", "C3D8I"),
    ],
)
def test_the_brick_that_a_property_means(tmp_path, psolid, name):
    mesh = nastran(tmp_path, cut=("PSOLID,3,7", f"PSOLID,3,7{psolid}"))
    assert [b.formulation for b in mesh.blocks] == [name]
    told = [note for note in mesh.passed_over if note.keyword == "PSOLID"]
    assert len(told) == (psolid == ",,3")
    mesh = nastran(
        tmp_path, cut=("PSOLID,3,7", f"PSOLID,3,7{psolid}"), treat_as={"CHEXA8": "C3D8I"}
    )
    assert [b.formulation for b in mesh.blocks] == ["C3D8I"]


def test_nastran_lumps_masses_unless_a_parameter_says_otherwise(tmp_path):
    assert nastran(tmp_path).lumped
    assert nastran(tmp_path, "PARAM,COUPMASS,-1").lumped
    assert nastran(tmp_path, "PARAM,COUPMASS,0").lumped
    assert not nastran(tmp_path, "PARAM,COUPMASS,1").lumped
    assert not nastran(tmp_path, cut=("BEGIN BULK", "PARAM,COUPMASS,1\nBEGIN BULK")).lumped
    quadratic = read(tmp_path, deck(box("C3D10", (1, 1, 1))))
    assert not quadratic.lumped
    assert "that of C3D10 is consistent here" in quadratic.passed_over[0].why


def test_decks_with_default_systems_and_formulas(tmp_path):
    """GRDSET gives the system of nodes; DEQATN has commas of its own."""
    mesh = nastran(
        tmp_path,
        "GRDSET,,9",
        "CORD2R,9,,1.,2.,3.,1.,2.,4.\n+,2.,2.,3.",
        "DEQATN  1       F(A,B,C,D,E,F,G,H,I,J)=A+B\n+       +MAX(A,B,C,D,E,F,G,H,I,J)",
    )
    plain = nastran(tmp_path)
    np.testing.assert_allclose(mesh.nodes, plain.nodes + np.array([1.0, 2.0, 3.0]), atol=1e-12)


def test_cards_that_may_matter_are_a_line_to_paste(tmp_path):
    more = ("CBAR,900,3,1,2,0.,0.,1.", "PBAR,3,7", "TLOAD1,1,1", "CGAP,901,1,1,2")
    with pytest.raises(ModelError, match=r'pass_over = \["CBAR", "CGAP"\]$'):
        nastran(tmp_path, *more)
    mesh = nastran(tmp_path, *more, pass_over=["CBAR", "CGAP"])
    assert {"CBAR", "PBAR", "TLOAD1", "CGAP"} <= {note.keyword for note in mesh.passed_over}


TWO = """*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
11,0,0,1
12,1,0,1
13,1,1,1
14,0,1,1
15,0,0,2
16,1,0,2
17,1,1,2
18,0,1,2
*ELEMENT, TYPE=C3D8, ELSET=E
7,11,12,13,14,15,16,17,18
3,1,2,3,4,5,6,7,8
*MATERIAL, NAME=M
*DENSITY
1.
*ELASTIC
1e3, .3
*SOLID SECTION, ELSET=E, MATERIAL=M
*SURFACE, NAME=LOW
3, S2
*SURFACE, NAME=UP
7, S1
"""


def two(folder, more="", **table):
    (folder / "two.inp").write_text(TWO + more)
    return read_mesh(folder / "two.inp", ComponentTable(mesh="two.inp", **table))


def test_bodies_that_touch_are_apart_where_the_deck_has_contact(tmp_path):
    with pytest.raises(ModelError, match="not connected there; merge the nodes, or read each of"):
        two(tmp_path)
    assert two(tmp_path, pass_over=["doubled nodes"]).n_elements == 2
    mesh = two(tmp_path, "*CONTACT PAIR, INTERACTION=I\nLOW, UP\n")
    assert mesh.element_sets["BODY1"].tolist() == [0]
    one = two(tmp_path, "*CONTACT PAIR, INTERACTION=I\nLOW, UP\n", part="body2")
    assert one.labels.tolist() == [3]
    assert list(one.surfaces) == ["LOW"]
    assert two(tmp_path, part="BODY2").n_elements == 1
    with pytest.raises(ModelError, match=r"no element set 'BODY3'; it has BODY1, BODY2, E"):
        two(tmp_path, part="BODY3")


def test_bodies_that_are_tied_are_one(tmp_path):
    mesh = two(tmp_path, "*TIE, NAME=T\nUP, LOW\n")
    assert list(mesh.element_sets) == ["E"]
    assert mesh.body_of.tolist() == [0, 0]


def test_doubled_nodes_within_a_body_are_refused_beside_contact(tmp_path):
    third = "*NODE\n21,1,0,0\n22,2,0,0\n23,2,1,0\n24,1,1,0\n25,2,0,1\n*ELEMENT, TYPE=C3D8, "
    third += "ELSET=E\n9,21,22,23,24,6,25,26,7\n*NODE\n26,2,1,1\n"
    with pytest.raises(ModelError, match="not connected there; merge the nodes; where"):
        two(tmp_path, third + "*CONTACT PAIR, INTERACTION=I\nLOW, UP\n")


@pytest.mark.parametrize("name", ["C3D10", "C3D15", "C3D20"])
@pytest.mark.parametrize("left", [(1, 5), (0, 2, 3, 5)])
def test_middle_nodes_that_are_not_there_follow_their_corners(tmp_path, name, left):
    """Of elements that have only some of them."""
    mesh = box(name, (1, 1, 1), uneven=0.2, materials={"S": STEEL})
    shape, of = mesh.blocks[0].kind.shape, mesh.blocks[0].nodes
    corners = sum(shape.is_corner(k) for k in range(shape.nodes))
    ends = {}
    for row in of:
        for k in range(corners, shape.nodes):
            a, b = (int(row[c]) for c in shape.ends[k])
            ends[int(row[k])] = (a, b)
    gone = [m for i, m in enumerate(sorted(ends)) if i % 6 not in left]
    nodes = mesh.nodes.copy()
    for m in gone:
        nodes[m] = nodes[list(ends[m])].mean(axis=0)
    whole = replace(mesh, nodes=nodes)
    numbers = {int(mesh.numbers[m]) for m in gone}
    lines = []
    for line in deck(whole).split("\n"):
        words = line.split(",")
        if words[0] in ("CTETRA", "CPENTA", "CHEXA", "+"):
            line = ",".join("" if w.isdigit() and int(w) in numbers and i else w for i, w in
                            enumerate(words))  # fmt: skip
        if words[0] != "GRID" or int(words[1]) not in numbers:
            lines.append(line)
    found = read(tmp_path, "\n".join(lines), treat_as={})
    assert len(found.nodes) == len(nodes)
    told = {note.keyword: note.why for note in found.passed_over}
    assert f"{len(gone)} middle nodes" in told["middle nodes"]
    found, e = expanded(found)
    free = np.setdiff1d(np.arange(len(nodes)), gone)
    E = np.zeros((3 * len(nodes), 3 * len(free)))
    for axis in range(3):
        E[3 * free + axis, 3 * np.arange(len(free)) + axis] = 1.0
        for m in gone:
            for end in ends[m]:
                E[3 * m + axis, 3 * int(np.searchsorted(free, end)) + axis] = 0.5
    expected = E.T @ stiffness_matrix(whole) @ E
    assert apart(e.restricted(stiffness_matrix(found)), expected) < 1e-5  # digits of the deck


def test_sets_of_corners_are_faces_without_their_middle_nodes(tmp_path):
    mesh = box("C3D20", (1, 1, 1))
    row = mesh.numbers[mesh.blocks[0].nodes[0]]
    text = deck(mesh, more=["SET1,4," + ",".join(map(str, row[4:8]))])
    lines = [line for line in text.split("\n") if line[:1] != "+" and line[:5] != "CHEXA"]
    first, second = ",".join(map(str, row[:6])), ",".join(map(str, row[6:9]))
    lines.insert(lines.index("PSOLID,3,7"), f"CHEXA,101,3,{first}\n+,{second}")
    found = read(tmp_path, "\n".join(lines))
    assert found.blocks[0].formulation == "C3D20"
    (facet,) = facets(found, "SET4")
    assert facet.nodes.shape == (1, 8)
