"""Keyword files of Abaqus and CalculiX: what is read, passed over, refused, and where."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
from component_meshes import LINING, STEEL, box

from squealstudy.errors import ModelError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.faces import boundary, facets
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import number, write_inp
from squealstudy.models.components.materials import Orientation, Orthotropic
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.fem.solid import FULL_INTEGRATION_ORDER, Isotropic

# a flat file in the manner of CalculiX: two cubes, odd blanks and capitals, Fortran's exponents
FLAT = """** a comment
*Heading
two cubes
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1.0D0, 0., 0.
3, 1., 1.000000000000000000, 0.
4, 0, 1, 0
 5 , , , 1e0
*node, nset=Nall
6, 1., 0., 1.,
7, 1., 1., 1.
8, 0., 1., 1.

11, 2., 0., 0.
12, 2., 1., 0.
13, 2., 0., 1.
14, 2., 1., 1.
99, 9., 9., 9.
*ELEMENT, TYPE=C3D8, ELSET=LEFT
1, 1, 2, 3, 4, 5,
6, 7, 8
** between two records
*ELEMENT, TYPE=C3D8I,
 ELSET=RIGHT
2, 2, 11, 12, 3, 6, 13, 14, 7
*ELSET, ELSET=BOTH
LEFT, RIGHT
*NSET, NSET=BOTTOM, GENERATE
1, 4
11, 12, 1
*NSET, NSET=SOME, GENERATE
2, 8, 2
*NSET, NSET=MORE
SOME, 14,
1
*NSET, NSET=OF_LEFT, ELSET=LEFT
*SURFACE, NAME=Down, TYPE=ELEMENT
LEFT, S1
2, S1
*SURFACE, NAME=OUTSIDE
RIGHT
*SURFACE, NAME=NODES, TYPE=NODE
BOTTOM, 1.
5
*MATERIAL, NAME=Iron
*DENSITY
7.2E-09
*ELASTIC
1.1D+05, 0.28, 20.
*MATERIAL, NAME=pad material
*DENSITY
2.5e-9,
*ELASTIC, TYPE=ENGINEERING CONSTANTS
9e3, 7e3, 2e3, .2, .1, .15, 1.5e3, 1.2e3,
3e3
*EXPANSION
1.2e-5
*ORIENTATION, NAME=AXES, SYSTEM=RECTANGULAR
0., 1., 0., -1., 0., 0.
3, 0.
*SOLID SECTION, ELSET=LEFT, MATERIAL=IRON
*Solid Section, elset=Right, material="PAD MATERIAL", orientation=axes
1.,
*BOUNDARY
BOTTOM, 1, 3
*STEP, PERTURBATION
*FREQUENCY
10
*END STEP
"""


def written(folder, text, name="a.inp"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_flat_file(tmp_path):
    mesh = read_inp(written(tmp_path, FLAT))
    check_mesh(mesh)
    np.testing.assert_array_equal(mesh.numbers, [1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13, 14])
    np.testing.assert_array_equal(
        mesh.nodes[[1, 2, 4, 5]], [[1, 0, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1]]
    )
    assert [(b.formulation, list(b.labels)) for b in mesh.blocks] == [("C3D8", [1]), ("C3D8I", [2])]
    assert mesh.numbers[mesh.blocks[0].nodes].tolist() == [[1, 2, 3, 4, 5, 6, 7, 8]]
    sets = {name: mesh.numbers[nodes].tolist() for name, nodes in mesh.node_sets.items()}
    assert sets == {
        "Nall": [1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13, 14],
        "BOTTOM": [1, 2, 3, 4, 11, 12],
        "SOME": [2, 4, 6, 8],
        "MORE": [1, 2, 4, 6, 8, 14],
        "OF_LEFT": [1, 2, 3, 4, 5, 6, 7, 8],
        "NODES": [1, 2, 3, 4, 5, 11, 12],
    }
    assert {k: v.tolist() for k, v in mesh.element_sets.items()} == {
        "LEFT": [0],
        "RIGHT": [1],
        "BOTH": [0, 1],
    }
    assert mesh.surfaces["Down"].tolist() == [[0, 1], [1, 1]]
    assert mesh.surfaces["OUTSIDE"].tolist() == [[1, k] for k in (1, 2, 3, 4, 5)]
    assert mesh.material.tolist() == ["Iron", "pad material"]
    assert mesh.orientation.tolist() == ["", "AXES"]
    assert mesh.materials["Iron"] == Isotropic(1.1e5, 0.28, 7.2e-9)
    np.testing.assert_allclose(mesh.materials["pad material"].entries, LINING.entries, rtol=1e-14)
    (down,) = facets(mesh, "down")
    assert (mesh.nodes[down.nodes][..., 2] == 0).all()


def test_what_is_passed_over_is_listed(tmp_path):
    mesh = read_inp(written(tmp_path, FLAT))
    lines = FLAT.split("\n")
    found = {(p.keyword, p.line) for p in mesh.passed_over}
    assert {k for k, _ in found} == {"*HEADING", "*EXPANSION", "*BOUNDARY", "*STEP", "*NODE"}
    for keyword, line in found:
        assert lines[line - 1].upper().startswith(keyword)
    assert "node 99: no element has it" in [p.why for p in mesh.passed_over]


def test_numbers_of_generate_that_are_not_there_are_listed(tmp_path):
    mesh = read_inp(written(tmp_path, FLAT.replace("2, 8, 2", "2, 10, 2")))
    (note,) = [p for p in mesh.passed_over if p.keyword == "*NSET"]
    assert note.why == "1 of its numbers belong to no node"


# an assembly in the manner of Abaqus; the second instance is turned by 90 degrees about z
ASSEMBLY = """*HEADING
*PART, NAME=Cube
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*ELEMENT, TYPE=C3D8
1, 1, 2, 3, 4, 5, 6, 7, 8
*NSET, NSET=Set-1
1, 2
*ELSET, ELSET=all, GENERATE
1, 1, 1
*ORIENTATION, NAME=Ori
1., 0., 0., 0., 1., 0.
*SOLID SECTION, ELSET=all, MATERIAL=M, ORIENTATION=Ori
,
*END PART
*PART, NAME=Shell
*NODE
1, 0., 0., 0.
*ELEMENT, TYPE=S4
1, 1, 1, 1, 1
*END PART
*ASSEMBLY, NAME=Assembly
*INSTANCE, NAME=Cube-1, PART=Cube
*END INSTANCE
*INSTANCE, NAME=Cube-2, PART=Cube
10., 0., 0.
10., 0., 0., 10., 0., 5., 90.
*END INSTANCE
*INSTANCE, NAME=Shell-1, PART=Shell
*END INSTANCE
*NODE
1, 5., 5., 5.
*NSET, NSET=Set-1, INSTANCE=Cube-2
3, 4
*NSET, NSET=BOTH, INSTANCE=Cube-1
5
*NSET, NSET=BOTH, INSTANCE=Cube-2
Set-1, 6
*NSET, NSET=DOTTED
Cube-2.7, Cube-1.8, Cube-2.Set-1
*ELSET, ELSET=_Face_S2, INTERNAL, INSTANCE=Cube-2
1,
*SURFACE, TYPE=ELEMENT, NAME=Face
_Face_S2, S2
*SURFACE, TYPE=ELEMENT, NAME=Side
Cube-2.all, S1
Cube-1.1, S3
*END ASSEMBLY
*MATERIAL, NAME=M
*DENSITY
1.,
*ELASTIC, TYPE=ORTHOTROPIC
10., 1., 20., 1., 1., 30., 1., 2., 3.
"""


def test_an_instance_of_an_assembly(tmp_path):
    path = written(tmp_path, ASSEMBLY)
    mesh = read_inp(path, "cube-2")
    check_mesh(mesh)
    expected = np.array([[10, 0, 0], [10, 1, 0], [9, 1, 0], [9, 0, 0]])
    np.testing.assert_allclose(mesh.nodes[:4], expected, atol=1e-14)
    assert mesh.blocks[0].formulation == "C3D8_BBAR"  # Abaqus's C3D8
    sets = {name: mesh.numbers[nodes].tolist() for name, nodes in mesh.node_sets.items()}
    assert sets == {
        "Set-1": [1, 2],
        "ASSEMBLY.Set-1": [3, 4],
        "BOTH": [1, 2, 6],
        "DOTTED": [1, 2, 7],
    }
    assert mesh.surfaces["Face"].tolist() == [[0, 2]]
    assert mesh.surfaces["Side"].tolist() == [[0, 1]]
    (face,) = facets(mesh, "Face")
    x = mesh.nodes[face.nodes[0]]
    np.testing.assert_allclose(np.cross(x[1] - x[0], x[2] - x[1]), [0, 0, 1], atol=1e-14)
    axes = mesh.orientations["Ori"].axes(mesh.nodes[:1])[0]
    np.testing.assert_allclose(axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-14)
    one = read_inp(path, "CUBE-1", dialect="calculix")
    np.testing.assert_array_equal(one.nodes[2], [1, 1, 0])
    assert one.blocks[0].formulation == "C3D8"
    assert one.surfaces["Side"].tolist() == [[0, 3]]


def test_which_instance_must_be_said(tmp_path):
    path = written(tmp_path, ASSEMBLY)
    with pytest.raises(ModelError, match=r"3 instances \(CUBE-1, CUBE-2, SHELL-1\): expected the"):
        read_inp(path)
    with pytest.raises(ModelError, match="no instance 'DISC'; it has CUBE-1, CUBE-2, SHELL-1"):
        read_inp(path, "DISC")
    with pytest.raises(ModelError, match=r"a.inp, line 26: element S4 is not supported"):
        read_inp(path, "Shell-1")


def test_a_turned_instance_has_the_turned_matrices(tmp_path):
    path = written(tmp_path, ASSEMBLY)
    here, there = (stiffness_matrix(read_inp(path, name)) for name in ("Cube-1", "Cube-2"))
    turn = np.kron(np.eye(8), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    np.testing.assert_allclose(turn @ here.toarray() @ turn.T, there.toarray(), atol=1e-13)


def test_an_element_set_of_a_flat_file_is_a_component(tmp_path):
    mesh = read_inp(written(tmp_path, FLAT), "right")
    assert mesh.labels.tolist() == [2]
    assert mesh.numbers.tolist() == [2, 3, 6, 7, 11, 12, 13, 14]
    assert mesh.surfaces["Down"].tolist() == [[0, 1]]
    assert mesh.numbers[mesh.node_sets["BOTTOM"]].tolist() == [2, 3, 11, 12]
    with pytest.raises(ModelError, match="no element set 'X'; it has BOTH, LEFT, RIGHT"):
        read_inp(tmp_path / "a.inp", "X")


def test_included_files(tmp_path):
    lines = FLAT.split("\n")
    at = lines.index("*NODE, NSET=Nall")
    written(tmp_path, "\n".join(lines[at + 1 : at + 6]), "nodes.txt")
    written(tmp_path, "\n".join(lines[at + 6 :]), "rest.inp")
    head = [*lines[:at], "*NODE, NSET=Nall", "*INCLUDE, INPUT=nodes.txt", "*include,input=rest.inp"]
    mesh = read_inp(written(tmp_path, "\n".join(head), "main.inp"))
    whole = read_inp(written(tmp_path, FLAT))
    np.testing.assert_array_equal(mesh.nodes, whole.nodes)
    head[-2:] = ["*INCLUDE, INPUT=rest.inp"]
    head[-2] += ", INPUT=nodes.txt"
    mesh = read_inp(written(tmp_path, "\n".join(head), "other.inp"))
    np.testing.assert_array_equal(mesh.nodes, whole.nodes)
    broken = written(tmp_path, "1, 2, x\n", "nodes.txt")
    with pytest.raises(ModelError, match=re.escape(f"{broken}, line 1: expected a coordinate")):
        read_inp(tmp_path / "main.inp")
    loop = written(tmp_path, "*INCLUDE, INPUT=loop.inp\n", "loop.inp")
    with pytest.raises(ModelError, match="include each other"):
        read_inp(loop)


# -- what is written is read ---------------------------------------------------------------------
@pytest.mark.parametrize("name", [n for n in FORMULATIONS if n != "C3D8_BBAR"])
def test_a_written_mesh_is_read(tmp_path, name):
    mesh = box(name, (2, 2, 1), uneven=0.2)
    of = np.array(["S", "S", "L"] * mesh.n_elements, dtype=object)[: mesh.n_elements]
    axes = np.where(of == "L", "O", "").astype(object)
    mesh = replace(
        mesh,
        node_sets={"FEW": np.array([0, 3, 4]), "MANY": np.arange(len(mesh.nodes))},
        element_sets={"SECTION_1": np.array([1])},
        surfaces={"SKIN": boundary(mesh)},
        materials={"S": STEEL, "L": LINING},
        material=of,
        orientations={
            "O": Orientation("rectangular", (1, 2, 0.3), (-1, 1, 0.2), (1, 1, 1), (2, 30.0))
        },
        orientation=axes,
    )
    path = tmp_path / "a.inp"
    write_inp(mesh, path)
    words = re.findall(r"[^\s,]+", path.read_text())
    assert max(len(word) for word in words if re.search(r"\d\.|\.\d", word)) <= 20
    assert all(len(line.split(", ")) <= 16 for line in path.read_text().split("\n"))
    back = read_inp(path)
    check_mesh(back)
    assert not back.passed_over
    for what in ("node_sets", "element_sets", "surfaces"):
        for key, members in getattr(mesh, what).items():
            np.testing.assert_array_equal(getattr(back, what)[key], members)
    for matrix in (stiffness_matrix, mass_matrix):
        ours, theirs = matrix(mesh), matrix(back)
        assert abs(ours - theirs).max() < 1e-12 * abs(ours).max()


def test_mean_dilatation_is_written_as_the_c3d8_of_abaqus(tmp_path):
    mesh = box("C3D8_BBAR", (2, 1, 1))
    write_inp(mesh, tmp_path / "a.inp")
    back = read_inp(tmp_path / "a.inp", dialect="abaqus")
    assert [b.formulation for b in back.blocks] == ["C3D8_BBAR"]
    block = mesh.blocks[0]
    two = tuple(
        replace(
            block, formulation=name, nodes=block.nodes[k : k + 1], labels=block.labels[k : k + 1]
        )
        for k, name in enumerate(("C3D8", "C3D8_BBAR"))
    )
    with pytest.raises(ModelError, match="cannot be in one file"):
        write_inp(replace(mesh, blocks=two), tmp_path / "b.inp")


@pytest.mark.parametrize("component", ["disc", "outer_pad", "caliper"])
def test_generated_components_are_written_and_read(tmp_path, component):
    """Metres, thin cells, two materials: the same matrices as those of the generated brake."""
    mesher = BrakeMesher(MODELS["disc_brake"].defaults(), COARSE, FULL_INTEGRATION_ORDER)
    solid = mesher.component(component)
    write_inp(mesh_of_grid(component, solid.grid, mesher.materials(component)), tmp_path / "a.inp")
    mesh = read_inp(tmp_path / "a.inp")
    for ours, theirs in ((stiffness_matrix(mesh), solid.K), (mass_matrix(mesh), solid.M)):
        assert abs(ours - theirs).max() < 1e-12 * abs(theirs).max()


@pytest.mark.parametrize("power", [-30, -4, -2, 0, 3, 9, 12])
def test_numbers_keep_what_twenty_characters_can_hold(power):
    values = np.random.default_rng(power + 30).uniform(-10, 10, 500) * 10.0**power
    words = [number(x) for x in values]
    assert max(map(len, words)) <= 20
    assert np.abs(np.array(words, dtype=float) / values - 1).max() < (
        1e-15 if -2 <= power <= 3 else 1e-13
    )


def test_names_that_a_file_cannot_hold_are_refused(tmp_path):
    mesh = box("C3D4", (1, 1, 1))
    for bad in ("a,b", "a=b", "Bremsträger", "", "*x"):
        with pytest.raises(ModelError, match="cannot be written as a name"):
            write_inp(replace(mesh, node_sets={bad: np.array([0])}), tmp_path / "a.inp")


# -- what is wrong: one message each, with file and line -----------------------------------------
def changed(old, new, message, where=None):
    """A fault, and the beginning of the line that its message names: else it is the changed one."""
    assert FLAT.count(old) == 1, old
    return old, new, message, where


WRONG = [
    changed("NAME=OUTSIDE", "NAME=DOWN", r"there is a 'DOWN' already"),
    changed("NAME=NODES, TYPE", "NAME=SOME, TYPE", r"there is a 'SOME' already"),
    changed("8, 0., 1., 1.", "8, 0., 1., 1., 0.", r"expected a node and three coord.*found 5"),
    changed("8, 0., 1., 1.", "8, 0., nan, 1.", r"expected a coordinate, found 'nan'"),
    changed("8, 0., 1., 1.", "8, 0., 1_0, 1.", r"expected a coordinate, found '1_0'"),
    changed("8, 0., 1., 1.", "8, 0., 1.e999, 1.", r"expected a coordinate, found '1.e999'"),
    changed("8, 0., 1., 1.", "8.5, 0., 1., 1.", r"expected a node number, found '8.5'"),
    changed("8, 0., 1., 1.", "7, 0., 1., 1.", r"node 7 is there twice, at different places"),
    changed(
        "14, 2., 1., 1.",
        "15, 2., 1., 1.",
        r"element 2 has node 14, which does not exist",
        "2, 2, 11",
    ),
    changed(
        "6, 7, 8", "6, 7", r"expected an element and its 8 nodes, found 8 numbers", "1, 1, 2, 3"
    ),
    changed(
        "6, 7, 8", "6, 7, 8, 9", r"expected an element and its 8 nodes, found 10", "1, 1, 2, 3"
    ),
    changed("2, 2, 11, 12, 3,", "1, 2, 11, 12, 3,", r"element 1 is there twice, first in line 21"),
    changed("TYPE=C3D8, ", "TYPE=C3D8R, ", r"element C3D8R is not supported: hourglass.*treat_as"),
    changed("TYPE=C3D8, ", "TYPE=C3D8H, ", r"element C3D8H is not supported: .*treat_as"),
    changed("TYPE=C3D8, ", "TYPE=C3D10M, ", r"element C3D10M is not supported: .*treat_as"),
    changed("TYPE=C3D8, ", "TYPE=B31, ", r"element B31 is not supported: supported: C3D4, C3D10"),
    changed("TYPE=C3D8, ", "", r"\*ELEMENT needs TYPE="),
    changed("TYPE=C3D8, ", "TYPE=C3D8, TYPE=C3D8, ", r"the parameter TYPE is there twice"),
    changed("TYPE=C3D8, ", "TYPE=C3D8, OFFSET=3, ", r"\*ELEMENT: the parameter OFFSET is not"),
    changed("SOME, 14,", "SOME, 15,", r"there is no node 15"),
    changed("SOME, 14,", "SUM, 14,", r"there is no node set 'SUM'; there is Nall, BOTTOM"),
    changed("SOME, 14,", "MORE, 14,", r"the node set 'MORE' contains itself"),
    changed("2, 8, 2", "8, 2, 2", r"from 8 to 2 in steps of 2 there is nothing"),
    changed("2, 8, 2", "2", r"expected first, last and step"),
    changed("2, S1", "2, S7", r"C3D8I element 2: there is no face S7, only S1 to S6"),
    changed("2, S1", "2, SPOS", r"expected a face S1 to S6, found 'SPOS'"),
    changed("2, S1", "3, S1", r"there is no element 3"),
    changed("NAME=OUTSIDE", "NAME=OUTSIDE, COMBINE=UNION", r"\*SURFACE: the parameter COMBINE"),
    changed("NAME=OUTSIDE", "NAME=OUTSIDE, TYPE=CUTTING SURFACE", r".*TYPE=CUTTING SURFACE is not"),
    changed("7.2E-09\n", "7.2E-09, 3, 4\n", r".*expected 1 numbers .* and a temperature"),
    changed("7.2E-09\n", "seven\n", r"expected a density, found 'seven'"),
    changed("1.1D+05, 0.28, 20.", "1.1D+05", r"\*ELASTIC: expected 2 numbers"),
    changed("1.1D+05, 0.28, 20.", "1.1D+05, 0.5", r"material 'Iron'", "*ELASTIC"),
    changed(
        "1.1D+05, 0.28, 20.",
        "1., .3, 20.\n2., .3, 30.",
        r".*values at 2 temperatures: expected temperature = NUMBER; the table goes from 20 to 30",
        "*ELASTIC",
    ),
    changed(
        "1.1D+05, 0.28, 20.",
        "1., .3, 20.\n2., .3, 20.",
        r".*expected temperatures that rise",
        "2., .3, 20.",
    ),
    changed("TYPE=ENGINEERING CONSTANTS", "TYPE=LAMINA", r".*TYPE=LAMINA is not supported"),
    changed(
        "TYPE=ENGINEERING CONSTANTS",
        "TYPE=ANISOTROPIC",
        r"\*ELASTIC: expected 21 numbers .*, found 9",
        "3e3",
    ),
    changed(
        "2.5e-9,\n*ELASTIC",
        "2.5e-9,\n*ELASTIC, MODULI=X, DEPENDENCIES=1",
        r"DEPENDENCIES is not supp",
        "*ELASTIC, MODULI",
    ),
    changed("*DENSITY\n7.2E-09\n", "", r"material 'Iron' has no \*DENSITY", "*MATERIAL, NAME=Iron"),
    changed(
        "0., 1., 0., -1., 0., 0.",
        "0., 1., 0., 0., 2., 0.",
        r"the points of an orientation",
        "*ORIENTATION",
    ),
    changed("SYSTEM=RECTANGULAR", "SYSTEM=SPHERICAL", r"SYSTEM=SPHERICAL is not supported"),
    changed("SYSTEM=RECTANGULAR", "DEFINITION=NODES", r"only DEFINITION=COORDINATES"),
    changed("3, 0.\n", "4, 0.\n", r"expected an axis 1, 2 or 3 and an angle"),
    changed("MATERIAL=IRON", "MATERIAL=STEEL", r"there is no material 'STEEL'; there is Iron, pad"),
    changed(
        "ELSET=LEFT, MATERIAL",
        "ELSET=BOTH, MATERIAL",
        r"C3D8I element 2: a section is given",
        "*Solid Section",
    ),
    changed(
        "ELSET=LEFT, MATERIAL", "ELSET=LIFT, MATERIAL", r"there is no element set 'LIFT'; there"
    ),
    changed("orientation=axes", "orientation=axis", r"there is no orientation 'axis'"),
    changed("*BOUNDARY\n", "*FASTENER\n", r"\*FASTENER is not supported: couple .*pass_over"),
    changed(
        "*BOUNDARY\n", "*Boundry\n*Ncopy\n*Ncopy\n", r'\*BOUNDRY is .* \(2 times\); .*"NCOPY"\]'
    ),
    changed("*BOUNDARY\n", "*BOUNDRY\n", r"\*BOUNDRY is not known here"),
    changed(
        "*BOUNDARY\n",
        "*DENSITY\n1.\n*DENSITY\n",
        r"material 'pad material' has a \*DENSITY al",
        "*DENSITY\n1.",
    ),
    changed("*END STEP\n", "", r"\*STEP has no end", "*STEP"),
    changed(
        "10\n*END STEP", "10\n*END STEP\n*END STEP", r"\*END STEP: there is no open", "*END STEP"
    ),
    changed(
        "*FREQUENCY\n10\n", "*END STEP\n*PART, NAME=P\n", r"there is no open \*STEP", "*END STEP"
    ),
    changed("** a comment\n", "1, 2\n", r"expected a keyword, found '1, 2'"),
]


@pytest.mark.parametrize(
    ("old", "new", "message", "where"), WRONG, ids=[f"{w[1][:30] or w[0]!r}" for w in WRONG]
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, old, new, message, where):
    path = written(tmp_path, FLAT.replace(old, new))
    with pytest.raises(ModelError) as raised:
        stiffness_matrix(read_inp(path))
    text = str(raised.value)
    found = re.fullmatch(r"(.*), line (\d+): (.*)", text)
    assert found, text
    assert found[1] == str(path)
    assert re.search(message, found[3]), text
    line = path.read_text().split("\n")[int(found[2]) - 1]
    if where is None:
        before = FLAT[: FLAT.index(old)]
        assert int(found[2]) == before.count("\n") + 1, text
    else:
        assert line.startswith(where.split("\n")[0]), text


def test_no_cut_of_a_file_fails_otherwise(tmp_path):
    """Ended anywhere, or with any line left out, a file is read or refused with a ModelError."""
    lines = FLAT.split("\n")
    cuts = [lines[:k] for k in range(len(lines))]
    for text in [*cuts, *(lines[:k] + lines[k + 1 :] for k in range(len(lines)))]:
        path = written(tmp_path, "\n".join(text))
        with contextlib.suppress(ModelError):
            read_inp(path)


def test_elements_can_be_treated_as_others(tmp_path):
    path = written(tmp_path, FLAT.replace("TYPE=C3D8, ", "TYPE=C3D8R, "))
    mesh = read_inp(path, treat_as={"C3D8R": "C3D8I"})
    assert [b.formulation for b in mesh.blocks] == ["C3D8I"]
    assert mesh.labels.tolist() == [1, 2]
    with pytest.raises(ModelError, match="expected one of C3D4"):
        read_inp(path, treat_as={"C3D8R": "C3D9"})
    with pytest.raises(ModelError, match="not a known solid element"):
        read_inp(path, treat_as={"S4": "C3D8"})


def test_keywords_can_be_passed_over_by_name(tmp_path):
    path = written(tmp_path, FLAT.replace("*BOUNDARY\n", "*M P C\n"))
    mesh = read_inp(path, pass_over=["*Mpc"])
    assert ("*M P C", "as asked for") in [(p.keyword, p.why) for p in mesh.passed_over]


def test_an_absent_file(tmp_path):
    with pytest.raises(ModelError, match="there is no such file"):
        read_inp(tmp_path / "a.inp")


def test_orthotropic_entries_are_read_in_their_order(tmp_path):
    mesh = read_inp(written(tmp_path, ASSEMBLY), "Cube-1")
    assert mesh.materials["M"] == Orthotropic((10, 1, 20, 1, 1, 30, 1, 2, 3), 1.0)
