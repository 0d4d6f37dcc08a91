"""Material axes element by element: *DISTRIBUTION of a deck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import box

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.materials import Orientation, Orthotropic
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import stiffness_matrix

WOOD = Orthotropic((9.0, 3.0, 8.0, 2.0, 2.5, 7.0, 1.5, 1.2, 1.1), 1.0)
FIRST = Orientation("rectangular", (1, 2, 0.3), (-1, 1, 0.2))
SECOND = Orientation("rectangular", (0, 1, 1), (-1, 0, 0.2))
ROW = {FIRST: "1., 2., .3, -1., 1., .2", SECOND: "0., 1., 1., -1., 0., .2"}


def deck(folder, *rows, orientation=("*ORIENTATION, NAME=O", "D"), section=", ORIENTATION=O"):
    """A box of three elements, labels 1 to 3 or so, with a distribution of these rows."""
    mesh = box("C3D8", (3, 1, 1), materials={"S": WOOD})
    labels = mesh.labels
    rows = [row.format(*labels) for row in rows]
    lines = [*orientation, *rows]
    write_inp(mesh, folder / "plain.inp")
    text = (folder / "plain.inp").read_text()
    at = text.upper().index("*SOLID SECTION")
    end = text.index("\n", at)
    more = f"*ELSET, ELSET=TWO\n{labels[0]}, {labels[2]}\n" + "\n".join(lines) + "\n"
    text = text[:at] + more + text[at:end] + section + text[end:]
    (folder / "a.inp").write_text(text)
    return mesh, read_mesh(folder / "a.inp", ComponentTable(mesh="a.inp"))


def of(mesh, *axes):
    names = {a: f"A{k}" for k, a in enumerate(axes)}
    which = np.array([names[a] for a in axes], dtype=object)
    return replace(mesh, orientations={name: a for a, name in names.items()}, orientation=which)


@pytest.mark.parametrize(
    "rows",
    [
        (f", {ROW[FIRST]}", f"{{1}}, {ROW[SECOND]}"),
        (f", {ROW[SECOND]}", f"TWO, {ROW[FIRST]}"),
        (f"TWO, {ROW[FIRST]}", f"{{1}}, {ROW[SECOND]}"),
        (f", {ROW[FIRST]}", f"TWO, {ROW[SECOND]}", f"{{0}}, {ROW[FIRST]}", f"{{2}}, {ROW[FIRST]}",
         f"{{1}}, {ROW[SECOND]}"),
    ],
)  # fmt: skip
def test_axes_element_by_element(tmp_path, rows):
    mesh, found = deck(tmp_path, "*DISTRIBUTION, NAME=D, LOCATION=ELEMENT", *rows)
    expected = stiffness_matrix(of(mesh, FIRST, SECOND, FIRST))
    assert abs(stiffness_matrix(found) - expected).max() < 1e-12 * abs(expected).max()
    assert abs(stiffness_matrix(of(mesh, FIRST, FIRST, FIRST)) - expected).max() > 1e-3
    assert len(found.orientations) == 2  # of equal rows one


def test_axes_beside_an_orientation_of_the_name_they_would_get(tmp_path):
    axes = ("*ORIENTATION, NAME=O@3", "0, 0, 1, 1, 0, 0", "*ORIENTATION, NAME=O", "D")
    rows = (f", {ROW[FIRST]}", f"{{2}}, {ROW[SECOND]}", "*ELSET, ELSET=ONE", "{1}")
    deck(tmp_path, "*DISTRIBUTION, NAME=D", *rows, orientation=axes)
    lines = (tmp_path / "a.inp").read_text().splitlines()
    (at,) = (i for i, line in enumerate(lines) if line.upper().startswith("*SOLID SECTION"))
    sections = [f"*SOLID SECTION, MATERIAL=S, ELSET={e}" for e in ("ONE", "TWO")]
    lines[at] = f"{sections[0]}, ORIENTATION=O@3\n{sections[1]}, ORIENTATION=O"
    (tmp_path / "a.inp").write_text("\n".join(lines))
    mesh = read_mesh(tmp_path / "a.inp", ComponentTable(mesh="a.inp"))
    assert [mesh.orientations[name] for name in mesh.orientation[[0, 2]]] == [FIRST, SECOND]
    assert mesh.orientation[1] == "O@3"
    assert len(mesh.orientations) == 3


def test_system_and_turn_are_those_of_the_orientation(tmp_path):
    axes = ("*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL", "D", "1, 30.")
    rows = ("*DISTRIBUTION, NAME=D", ", -9., 0., 0., -9., 0., 1.", "{1}, 0., -9., 0., 1., -9., 0.")
    mesh, found = deck(tmp_path, *rows, orientation=axes)
    one = Orientation("cylindrical", (-9, 0, 0), (-9, 0, 1), turn=(1, 30.0))
    other = Orientation("cylindrical", (0, -9, 0), (1, -9, 0), turn=(1, 30.0))
    expected = stiffness_matrix(of(mesh, one, other, one))
    assert abs(stiffness_matrix(found) - expected).max() < 1e-12 * abs(expected).max()


def test_a_distribution_that_nothing_names_is_told(tmp_path):
    rows = ("*DISTRIBUTION TABLE, NAME=T", "LENGTH", "*DISTRIBUTION, NAME=D, TABLE=T", ", 1.2")
    _, found = deck(tmp_path, *rows, orientation=(), section="")
    told = {note.keyword: note.why for note in found.passed_over}
    assert told["*DISTRIBUTION"] == "no orientation names it"
    assert "*DISTRIBUTION TABLE" in told


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (("*DISTRIBUTION, NAME=E", ", 1., 0., 0., 0., 1., 0."), "there are 0 distributions 'D'"),
        (("*DISTRIBUTION, NAME=D", "{0}, 1., 0., 0., 0., 1., 0."), "has no axes for 2 elements"),
        (("*DISTRIBUTION, NAME=D", ", 1., 0., 0."), "expected an element or a set and two points"),
        (("*DISTRIBUTION, NAME=D", ", 1., 0., 0., 2., 0., 0."), "lie on one line"),
        (("*DISTRIBUTION, NAME=D", ", 1., 0., 0., x, 0., 0."), "expected a coordinate, found 'x'"),
        (("*DISTRIBUTION, NAME=D", "NO, 1., 0., 0., 0., 1., 0."), "there is no element set 'NO'"),
        (("*DISTRIBUTION, NAME=D", "99, 1., 0., 0., 0., 1., 0."), "there is no element 99"),
        (
            ("*DISTRIBUTION, NAME=D, LOCATION=NODE", ", 1., 0., 0., 0., 1., 0."),
            "expected LOCATION=ELEMENT",
        ),
    ],
)
def test_distributions_that_are_none(tmp_path, rows, message):
    with pytest.raises(ModelError, match=rf"line \d+: .*{message}"):
        deck(tmp_path, *rows)


def test_densities_by_a_distribution_are_refused(tmp_path):
    """Which would be another material for each element."""
    rows = ("*DISTRIBUTION, NAME=R", ", 2.", "{0}, 3.")
    deck(tmp_path, *rows, orientation=(), section="")
    text = (tmp_path / "a.inp").read_text()
    at = text.upper().index("*DENSITY")
    after = text.index("\n", at) + 1
    end = text.index("\n", after)
    (tmp_path / "a.inp").write_text(text[:after] + "R" + text[end:])
    with pytest.raises(ModelError, match=r"line \d+: .*expected a density, found 'R'"):
        read_mesh(tmp_path / "a.inp", ComponentTable(mesh="a.inp"))
