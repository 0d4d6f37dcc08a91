"""Components from Nastran's bulk data: every element and field format, systems, what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from component_meshes import STEEL, box
from own_blocks import block, write_blocks
from study_runs import solved
from test_model_file import built, frequencies

from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import read_files
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.nastran import SOLIDS, read_bdf
from squealstudy.study.components import read_model
from squealstudy.study.definition import load_study

CARDS = {formulation: (card, order) for (card, _), (_, formulation, order) in SOLIDS.items()}


def small(number):
    """Eight characters, exponents without E where they are needed."""
    for digits in range(7, 0, -1):
        text = f"{number:.{digits}g}"
        text = re.sub(r"e([+-])0*(\d+)", r"\1\2", text)
        if "." not in text:  # before the exponent
            text = re.sub(r"^(-?\d+)", r"\1.", text)
        if len(text) <= 8:
            return text
    raise AssertionError(number)


def card(form, name, *fields):
    """A card in a format, continued where it is long."""
    if form == "free":
        words = [repr(float(f)) if isinstance(f, float) else str(f) for f in fields]
        lines = [words[k : k + 8] for k in range(0, len(words), 8)]
        return "\n".join(",".join([name if k == 0 else "+", *w]) for k, w in enumerate(lines))
    width, count = (16, 4) if form == "large" else (8, 8)
    shown = [
        (f"{f:.9e}" if form == "large" else small(f)) if isinstance(f, float) else str(f)
        for f in fields
    ]
    lines = []
    for k in range(0, len(shown), count):
        first = (name if k == 0 else "") + ("*" if form == "large" else "")
        lines.append(f"{first:8}" + "".join(f"{w:>{width}}" for w in shown[k : k + count]))
    return "\n".join(lines)


def deck(mesh, form="free", more=(), elastic=(2.1e5, "", 0.3, 7.8e-9)):
    """Bulk data of a mesh of one material, property 3."""
    lines = ["SOL 103", "CEND", "  TITLE = box", "BEGIN BULK", "$ nodes"]
    for n, x in zip(mesh.numbers, mesh.nodes, strict=True):
        lines.append(card(form, "GRID", n, "", *map(float, x)))
    for b in mesh.blocks:
        name, order = CARDS[b.formulation]
        back = np.argsort(order)
        for label, nodes in zip(b.labels, mesh.numbers[b.nodes], strict=True):
            lines.append(card(form, name, label, 3, *nodes[back]))
    lines += [card(form, "PSOLID", 3, 7), card(form, "MAT1", 7, *elastic), *more]
    return "\n".join([*lines, "ENDDATA", "what follows is not read"]) + "\n"


def read(folder, text, **options):
    (folder / "a.bdf").write_text(text)
    mesh = read_bdf(folder / "a.bdf", **options)
    check_mesh(mesh)
    return mesh


@pytest.mark.parametrize("form", ["free", "small", "large"])
@pytest.mark.parametrize("formulation", list(CARDS))
def test_every_element_in_every_format(tmp_path, formulation, form):
    mesh = box(formulation, (2, 1, 2), uneven=0.1)
    found = read(tmp_path, deck(mesh, form))
    digits = {"free": 1e-14, "large": 1e-8, "small": 1e-3}[form]
    np.testing.assert_array_equal(found.numbers, mesh.numbers)
    np.testing.assert_allclose(found.nodes, mesh.nodes, atol=digits * 3)
    (one,), (two,) = found.blocks, mesh.blocks
    assert one.formulation == formulation
    np.testing.assert_array_equal(one.nodes, two.nodes)
    np.testing.assert_array_equal(one.labels, two.labels)
    for of in (stiffness_matrix, mass_matrix):
        A, B = of(found), of(mesh)
        assert abs(A - B).max() < 30 * digits * abs(B).max()
    assert list(found.element_sets) == ["PID3"]
    assert set(found.material) == {"MAT7"}


def test_systems_sets_and_couplings(tmp_path):
    """Nodes of a cylinder system that refers to another one; sets with THRU; RBE2 and RBE3."""
    mesh = box("C3D8I", (2, 1, 1))
    text = deck(mesh)
    n = int(mesh.numbers[-1])
    x = mesh.nodes[-1]
    plain = card("free", "GRID", n, "", *map(float, x))
    assert plain in text
    # system 5: shifted by (1, 2, 3), turned a quarter about z; 6 a cylinder system in it
    local = np.array([x[1] - 2, -(x[0] - 1), x[2] - 3])
    r, angle = np.hypot(*local[:2]), np.rad2deg(np.arctan2(local[1], local[0]))
    systems = [
        "CORD2R,5,,1.,2.,3.,1.,2.,4.\n+,1.,3.,3.",
        "CORD2C,6,5,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.",
        "CORD2S,8,5,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.",
        "GRID,900,8,5.,90.,0.",
        "GRID,901,,1.,1.,5.",
        f"SET1,4,{mesh.numbers[0]},THRU,{mesh.numbers[2]},{n}",
        f"RBE2,50,901,123456,{mesh.numbers[1]},{mesh.numbers[3]},{mesh.numbers[5]}",
        f"RBE3,51,,900,123,1.,123,{mesh.numbers[0]},{mesh.numbers[2]}\n+,{mesh.numbers[4]}",
        "SPC1,1,123,11",
        "FORCE,1,11,0,1.,0.,0.,1.",
    ]
    turned = card("free", "GRID", n, 6, float(r), float(angle), float(local[2]))
    found = read(tmp_path, deck(mesh, more=systems).replace(plain, turned))
    at = {int(k): i for i, k in enumerate(found.numbers)}
    np.testing.assert_allclose(found.nodes[at[n]], x, atol=1e-12)
    np.testing.assert_allclose(found.nodes[at[900]], [1, 7, 3], atol=1e-12)
    wanted = [at[int(k)] for k in (*mesh.numbers[:3], n)]
    np.testing.assert_array_equal(found.node_sets["SET4"], np.sort(wanted))
    rigid, mean = found.constraints
    assert (rigid.kind, rigid.reference, len(rigid.nodes)) == ("rigid", at[901], 3)
    assert (mean.kind, mean.reference, len(mean.nodes)) == ("distributing", at[900], 3)
    told = {note.keyword: note.why for note in found.passed_over}
    assert "model file" in told["SPC1"]
    assert "study" in told["FORCE"]


@pytest.mark.parametrize("place", ["free", "small", "case"])
def test_densities_of_weight(tmp_path, place):
    """PARAM WTMASS multiplies the mass of elements, in bulk data or in case control."""
    mesh = box("C3D8I", (2, 1, 1))
    more = {"free": ["PARAM,WTMASS,2.5-1"], "small": ["PARAM   WTMASS  .25"], "case": []}[place]
    text = deck(mesh, more=[*more, "PARAM,POST,-1"])
    if place == "case":
        text = text.replace("BEGIN BULK", "PARAM,WTMASS,0.25\nBEGIN BULK")
    found = read(tmp_path, text)
    assert found.materials["MAT7"].density == pytest.approx(0.25 * 7.8e-9, rel=1e-14)
    assert abs(mass_matrix(found) - 0.25 * mass_matrix(mesh)).max() < 1e-14 * 7.8e-9
    assert [note.keyword for note in found.passed_over] == ["COUPMASS", "PARAM"]


@pytest.mark.parametrize(
    ("values", "message"),
    [(["0."], "expected WTMASS above zero"), (["1.", "2."], "WTMASS has the values 1, 2")],
)
def test_no_factor_of_masses(tmp_path, values, message):
    more = [f"PARAM,WTMASS,{value}" for value in values]
    with pytest.raises(ModelError, match=rf"line \d+: PARAM: {message}"):
        read(tmp_path, deck(box("C3D8I", (2, 1, 1)), more=more))


def test_matrices_that_case_control_adds(tmp_path):
    """They are refused: mass and stiffness of the component are more than its elements'."""
    mesh = box("C3D8I", (2, 1, 1))
    dmig = "DMIG,KAAX,0,6,1,0\nDMIG,KAAX,1,1,,1,1,3.0"
    text = deck(mesh, more=[dmig])
    told = [note.keyword for note in read(tmp_path, text).passed_over]
    assert told == ["COUPMASS", "DMIG (2)"]
    text = text.replace("BEGIN BULK", "  k2gg = KAAX\nBEGIN BULK")
    with pytest.raises(ModelError, match=r"a.bdf, line 4: K2GG adds a matrix of DMIG"):
        read(tmp_path, text)
    assert read(tmp_path, text, pass_over=["K2GG"]).n_elements == 2


def test_plates_that_mark_faces(tmp_path):
    mesh = box("C3D8I", (1, 1, 1))
    top = mesh.numbers[np.flatnonzero(mesh.nodes[:, 2] > 2.4)][[0, 2, 3, 1]]
    plate = ["CQUAD4,500,9," + ",".join(map(str, top)), "PSHELL,9,7,1."]
    found = read(tmp_path, deck(mesh, more=plate), treat_as={"CQUAD4": "faces"})
    assert found.surfaces["PID9"].tolist() == [[0, 2]]
    with pytest.raises(ModelError, match=r'CQUAD4 \(1, first .*treat_as.*= \["CQUAD4"\]'):
        read(tmp_path, deck(mesh, more=plate))


def test_other_formulations_and_moduli(tmp_path):
    mesh = box("C3D8I", (1, 1, 1))
    found = read(tmp_path, deck(mesh), treat_as={"CHEXA8": "C3D8"})
    assert found.blocks[0].formulation == "C3D8"
    for elastic in ((2.1e5, 2.1e5 / 2.6, "", 7.8e-9), ("", 2.1e5 / 2.6, 0.3, 7.8e-9)):
        material = read(tmp_path, deck(mesh, elastic=elastic)).materials["MAT7"]
        assert material.young_modulus == pytest.approx(STEEL.young_modulus)
        assert material.poisson_ratio == pytest.approx(STEEL.poisson_ratio)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PSOLID,3,7", "PSOLID,3,8", "PSOLID: there is no MAT1 8"),
        (
            "PSOLID,3,7",
            "CBAR,1,2\nCONM1,4,5\nCBAR,2",
            r"CBAR \(2, first in line 16\), CONM1 \(1",
        ),
        ("MAT1,7,210000.0", "MAT1,7,", "MAT1: expected E > 0 and -1 < NU < 0.5"),
        ("7.8e-09", "", "MAT1: expected a density RHO above zero"),
        ("MAT1,7,210000.0,,0.3", "MAT1,7,210000.0,9e4,0.3", "contradict each other"),
        ("GRID,11,,", "GRID,11,4,", "GRID: there is no coordinate system 4"),
        ("GRID,11,,0.0", "GRID,11,,0.0.1", "expected a coordinate, found '0.0.1'"),
        ("GRID,12,", "GRID,11,", "node 11 is there twice"),
        ("CHEXA,101,3,11", "CHEXA,101,3,999", "CHEXA: there is no node 999"),
        ("CHEXA,101,3,11", "CHEXA,101,3,", "expected 8 or 20 nodes, found 7"),
        ("PSOLID,3,7", "CHEXA,101,3,11", "element 101 is there twice"),
        ("PSOLID,3,7", "PSOLID,3,7\nSET1,1,11,THRU", "expected a node after THRU"),
        ("PSOLID,3,7", "PSOLID,3,7\nRBE2,1,11,12,12", "expected the components 123"),
        ("PSOLID,3,7", "PSOLID,3,7\nRBE3,1,,11,123,1.,123,12,1.\n+,123,13", "expected one weight"),
        (
            "PSOLID,3,7",
            "CORD2R,1,,0.,0.,0.,0.,0.,1.\n+,0.,0.,2.\nGRID,999,1",
            "one line",
        ),
        ("PSOLID,3,7", "INCLUDE 'absent.bdf'", "absent.bdf cannot be read: there is no such file"),
        ("PSOLID,3,7", "PSOLID,3,7,,,,,,,,9", "more than eight fields"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, old, new, message):
    text = deck(box("C3D8I", (1, 1, 1)))
    assert old in text
    with pytest.raises(ModelError, match=message) as caught:
        mass_matrix(read(tmp_path, text.replace(old, new, 1)))
    assert re.search(r"a\.bdf, line \d+: ", str(caught.value))


def test_files_without_what_is_needed(tmp_path):
    for text, message in (("GRID,1\n", "no solid element"), ("PSOLID,3,7\n", "has no GRID")):
        with pytest.raises(ModelError, match=message):
            read(tmp_path, text)
    with pytest.raises(ModelError, match="treat_as CBAR = 'C3D8': expected one of CTETRA4"):
        read(tmp_path, "GRID,1\n", treat_as={"CBAR": "C3D8"})


def test_a_study_of_a_deck_that_includes_another(tmp_path):
    """The frequencies are those of the .inp, and ids follow the included file too."""
    write_blocks(tmp_path)
    expected = frequencies(built(tmp_path / "blocks.toml"))
    plate = block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL")
    sets = [
        f"SET1,{k}," + ",".join(map(str, plate.numbers[plate.node_set(name)]))
        for k, name in ((1, "TOP"), (2, "BOTTOM"))
    ]
    wrapped = [",\n+,".join(_by_eight(s)) for s in sets]
    text = deck(plate, more=wrapped)
    head, _, body = text.partition("$ nodes\n")
    (tmp_path / "plate.bdf").write_text(head + "INCLUDE 'nodes.bdf'\n")
    (tmp_path / "nodes.bdf").write_text(body)
    toml = (tmp_path / "blocks.toml").read_text()
    for old, new in (("inp", "bdf"), ("TOP", "SET1"), ("BOTTOM", "SET2")):
        toml = toml.replace(f"plate.{old}", f"plate.{new}")
    (tmp_path / "blocks.toml").write_text(toml)
    np.testing.assert_allclose(frequencies(built(tmp_path / "blocks.toml")), expected, rtol=1e-9)
    model = read_model(tmp_path / "blocks.toml")
    read_too = [p.name for _, p in read_files(model.build.brake.file, tmp_path / "blocks.toml")]
    assert "nodes.bdf" in read_too
    results = solved(Plan(load_study(tmp_path / "study.toml")), tmp_path / "r")
    assert (results.points["status"] == "ok").all()


def _by_eight(text):
    """Words between commas, eight a line behind the first."""
    first, *words = text.split(",")
    lines = [words[k : k + 8] for k in range(0, len(words), 8)]
    return [",".join([first, *lines[0]]), *(",".join(line) for line in lines[1:])]
