"""Left-handed elements, lumped masses, and the bricks that a deck of Nastran means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import STEEL, box
from test_component_judge import apart
from test_component_nastran import deck, read

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import read_mesh
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.faces import boundary, facet_groups
from squealstudy.models.components.file_tables import ComponentTable
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.handed import righted
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
    more = ("CBAR,900,3,1,2,0.,0.,1.", "PBAR,3,7", "TLOAD1,1,1", "RBAR,901,1,2,123456")
    with pytest.raises(ModelError, match=r'pass_over = \["CBAR", "RBAR"\]$'):
        nastran(tmp_path, *more)
    mesh = nastran(tmp_path, *more, pass_over=["CBAR", "RBAR"])
    assert {"CBAR", "PBAR", "TLOAD1", "RBAR"} <= {note.keyword for note in mesh.passed_over}


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
    with pytest.raises(ModelError, match=r"not connected there; merge the nodes$"):
        two(tmp_path, third + "*CONTACT PAIR, INTERACTION=I\nLOW, UP\n")
