"""Keywords that do not matter are passed over, those that may are refused together."""

from __future__ import annotations

import pytest
from test_component_inp import written
from test_component_judge import apart
from test_deck_materials import CUBE

from squealstudy.errors import ModelError
from squealstudy.models.components.inp import read_inp
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
        "*FOO\n1\n*CYCLIC SYMMETRY MODEL\n1\n"
    )
    with pytest.raises(ModelError) as caught:
        read(tmp_path, DECK + more)
    text = str(caught.value)
    assert "*FOO is not known here" in text
    assert "*CYCLIC SYMMETRY MODEL is not supported: write the whole body" in text
    assert "element S4 is not supported: only solids are" in text
    line = text[text.index("pass_over = ") :].removeprefix("pass_over = ")
    mesh = read(tmp_path, DECK + more, pass_over=eval(line))
    assert apart(stiffness_matrix(mesh), plain[0]) == 0.0
    assert [len(e) for e in mesh.element_sets.values()] == [1]
    assert {"*FOO", "*CYCLIC SYMMETRY MODEL", "*ELEMENT"} <= {n.keyword for n in mesh.passed_over}
