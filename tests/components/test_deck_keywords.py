"""Keywords that do not matter are passed over, those that may are refused together."""

from __future__ import annotations

import numpy as np
import pytest
from component_meshes import box
from test_component_inp import written
from test_component_judge import apart
from test_component_nastran import deck
from test_deck_materials import CUBE

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

DECK = CUBE.replace("*SOLID", "*DENSITY\n1.\n*ELASTIC\n1e3, .3\n*SOLID")


def read(folder, text, **given):
    return read_inp(written(folder, text), **given)


@pytest.fixture
def plain(tmp_path):
    mesh = read(tmp_path, DECK)
    return stiffness_matrix(mesh), mass_matrix(mesh)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("*SOLID", "*PLASTIC\n1.,0.\n*CREEP, LAW=NORTON\n1.,2.,3.\n*DEPVAR\n3\n*SOLID", "*CREEP"),
        ("*SOLID", "*DAMAGE INITIATION, CRITERION=DUCTILE\n1.\n*SOLID", "*DAMAGE INITIATION"),
        ("*NODE\n", "*DESIGN VARIABLES, TYPE=COORDINATE\nE\n*NODE\n", "*DESIGN VARIABLES"),
        ("*NODE\n", "*GAP CONDUCTANCE\n1.,2.,3.\n*\n*NODE\n", "*GAP CONDUCTANCE"),
        ("*NODE\n", "*SUBMODEL, TYPE=NODE, INPUT=absent.frd\nE\n*NODE\n", "*SUBMODEL"),
        ("*NODE\n", ">a title\n*NODE\n", None),
        ("ELSET=E\n1", "ELSET=E, DLOAD=3\n1", "*ELEMENT"),
        ("*ELEMENT", "*NSET, NSET=N, FREQUENCY=3\n1\n*ELEMENT", "*NSET"),
    ],
)
def test_what_does_not_matter_is_passed_over_and_told(tmp_path, plain, old, new, told):
    mesh = read(tmp_path, DECK.replace(old, new, 1))
    assert apart(stiffness_matrix(mesh), plain[0]) == 0.0
    assert apart(mass_matrix(mesh), plain[1]) == 0.0
    assert told is None or told in [note.keyword for note in mesh.passed_over]


def test_what_may_matter_is_refused_all_at_once_with_a_line_to_paste(tmp_path, plain):
    more = (
        "*ELEMENT, TYPE=S4, ELSET=E\n9,1,2,3,4\n*SHELL SECTION, ELSET=E, MATERIAL=M\n1.\n"
        "*FOO\n1\n*EMBEDDED ELEMENT\n1\n"
    )
    with pytest.raises(ModelError) as caught:
        read(tmp_path, DECK + more)
    text = str(caught.value)
    assert "*FOO is not known here" in text
    assert "*EMBEDDED ELEMENT is not supported: merge the nodes" in text
    assert "element S4 is not supported: only solids are" in text
    line = text[text.index("pass_over = ") :].removeprefix("pass_over = ")
    mesh = read(tmp_path, DECK + more, pass_over=eval(line))
    assert apart(stiffness_matrix(mesh), plain[0]) == 0.0
    assert [len(e) for e in mesh.element_sets.values()] == [1]
    assert {"*FOO", "*EMBEDDED ELEMENT", "*ELEMENT"} <= {n.keyword for n in mesh.passed_over}


@pytest.mark.parametrize(
    ("kind", "why"), [("D", "of a flow network"), ("GAPUNI", "contact is stated in the model file")]
)
def test_elements_that_join_no_solids_are_told(tmp_path, plain, kind, why):
    mesh = read(tmp_path, f"{DECK}*ELEMENT, TYPE={kind}, ELSET=EG\n9,1,2\n")
    assert apart(stiffness_matrix(mesh), plain[0]) == 0.0
    assert ("*ELEMENT", why) in [(note.keyword, note.why) for note in mesh.passed_over]


@pytest.mark.parametrize(
    ("line", "members"),
    [
        ("8, 5, -1", [5, 6, 7, 8]),
        ("7, 2, -2", [3, 5, 7]),
        ("3, 3, -1", [3]),
        ("2, 6, 2", [2, 4, 6]),
    ],
)
def test_generated_sets_run_both_ways(tmp_path, line, members):
    mesh = read(tmp_path, DECK + f"*NSET, NSET=SOME, GENERATE\n{line}\n")
    assert mesh.numbers[mesh.node_set("SOME")].tolist() == members


def test_an_instance_may_name_sets(tmp_path):
    nodes, rest = DECK.split("*MATERIAL")
    parts = (
        f"*PART, NAME=P\n{nodes}*SOLID SECTION, ELSET=E, MATERIAL=M\n*END PART\n*ASSEMBLY, NAME=A\n"
    )
    instance = "*INSTANCE, NAME=I, PART=P, NSET=N, ELSET=F\n*END INSTANCE\n*END ASSEMBLY\n*MATERIAL"
    mesh = read(tmp_path, parts + instance + rest.split("*SOLID")[0])
    assert mesh.n_elements == 1
    assert "the parameters NSET, ELSET, not used here" in [note.why for note in mesh.passed_over]


@pytest.mark.parametrize(
    ("system", "node", "place"),
    [
        ("C", "2., 90., 3.", [0, 2, 3]),
        ("S", "2., 90., 30.", [0, 3**0.5, 1]),
        ("R", "1,2,3", [1, 2, 3]),
    ],
)
def test_nodes_in_other_coordinates(tmp_path, system, node, place):
    more = f"*NODE, SYSTEM={system}, NSET=ONE\n9, {node}\n*EQUATION\n2\n9,1,1.,1,1,-1.\n"
    mesh = read(tmp_path, DECK + more)
    np.testing.assert_allclose(mesh.nodes[mesh.node_set("ONE")[0]], place, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "a.inp",
            "version https://git-lfs.github.com/spec/v1\noid",
            "a pointer of Git LFS: 'git lfs",
        ),
        ("a.stp", "", "unknown format '.stp', .*it is a shape: mesh it first"),
        ("a.vtu", "", "unknown format '.vtu', .*meshio or gmsh converts it"),
        ("a.odb", "", "unknown format '.odb', .*let its program write the mesh as text"),
        (
            "a.xyz",
            "",
            "unknown format '.xyz', expected one of .inp, .msh, .unv, .med, .cdb, .bdf, .*fem$",
        ),
    ],
)
def test_files_that_are_no_deck(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(ModelError, match=message):
        read_mesh(tmp_path / name, ComponentTable(mesh=name))


def test_decks_of_optistruct_and_listed_faces(tmp_path):
    mesh = box("C3D8I", (2, 1, 1))
    n, labels = mesh.numbers[mesh.blocks[0].nodes], mesh.labels
    upper, lower = ",".join(map(str, n[1][4:7])), ",".join(map(str, n[0][[3, 0, 2]]))
    own = f"BSURFS,4,,,,{labels[1]},{upper}\n+,{labels[0]},{lower}"
    (tmp_path / "a.fem").write_text(deck(mesh, more=[own]))
    found = read_mesh(tmp_path / "a.fem", ComponentTable(mesh="a.fem"))
    assert found.surfaces["BSURFS4"].tolist() == [[0, 1], [1, 2]]
    (tmp_path / "a.fem").write_text(deck(mesh, more=[own.replace(f"{n[1][4]},", f"{n[0][0]},")]))
    with pytest.raises(ModelError, match=rf"BSURFS: element {labels[1]} has no face with"):
        read_mesh(tmp_path / "a.fem", ComponentTable(mesh="a.fem"))


def test_temperatures_are_of_inp_and_bulk_data_alone(tmp_path):
    (tmp_path / "a.bdf").write_text(deck(box("C3D8I", (2, 1, 1)), more=["CDAMP2,9,1.,1,1"]))
    assert read_mesh(tmp_path / "a.bdf", ComponentTable(mesh="a.bdf")).n_elements == 2
    (tmp_path / "a.msh").write_text("")
    with pytest.raises(ModelError, match=r"over temperature are read of \.inp and bulk data alone"):
        read_mesh(tmp_path / "a.msh", ComponentTable(mesh="a.msh", temperature=20.0))
