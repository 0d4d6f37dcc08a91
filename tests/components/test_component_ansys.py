"""Components from archives of ANSYS: elements, degenerate bricks, sets, what is refused."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from component_meshes import LINING, STEEL, box
from own_blocks import block, write_blocks
from study_runs import solved
from test_model_file import built, frequencies

from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError
from squealstudy.models.components import ansys_archive
from squealstudy.models.components.ansys import read_cdb
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.study.definition import load_study

pytest.importorskip("mapdl_archive")
# formulation -> element, options, nodes of ours in the order of ANSYS
ELEMENTS = {
    "C3D8_BBAR": (185, {}, range(8)),
    "C3D8I": (185, {2: 2}, range(8)),
    "C3D8": (45, {1: 1}, range(8)),
    "C3D20R": (186, {}, range(20)),
    "C3D20": (186, {2: 1}, range(20)),
    "C3D10": (187, {}, range(10)),
    "C3D6": (185, {2: 3}, (0, 1, 2, 2, 3, 4, 5, 5)),
    "C3D4": (185, {}, (0, 1, 2, 2, 3, 3, 3, 3)),
    "C3D5": (185, {}, (0, 1, 2, 3, 4, 4, 4, 4)),
    "C3D13": (186, {}, (0, 1, 2, 3, 4, 4, 4, 4, 5, 6, 7, 8, 4, 4, 4, 4, 9, 10, 11, 12)),
    # K = L = S, O = P = W, A = B
    "C3D15": (186, {}, (0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 2, 8, 9, 10, 5, 11, 12, 13, 14, 14)),
}
TETRAHEDRON = (0, 1, 2, 2, 3, 3, 3, 3, 4, 5, 2, 6, 3, 3, 3, 3, 7, 8, 9, 9)  # of SOLID186
ISOTROPIC = {"EX": 2.1e5, "NUXY": 0.3, "DENS": 7.8e-9}


def archive(mesh, element, options, places, properties=ISOTROPIC, more=(), width=9):
    """What CDWRITE writes of a mesh of one element and material."""
    lines = ["/COM,ANSYS RELEASE 2019 R2", "/PREP7", "*SET,_RETURN ,  0.0", "DOF,DELETE"]
    lines += [f"ET,        3,{element}"]
    lines += [f"KEYOP,        3,{k:2},{v:9}" for k, v in options.items()]
    lines += [f"NBLOCK,6,SOLID,{max(mesh.numbers):10},{len(mesh.nodes):10}"]
    lines += [f"(3i{width},6e21.13e3)"]
    for n, x in zip(mesh.numbers, mesh.nodes, strict=True):
        lines.append(f"{n:{width}}{0:{width}}{0:{width}}" + "".join(f"{v:21.13E}" for v in x))
    (block,) = mesh.blocks
    lines += [
        "N,R5.3,LOC,       -1,",
        f"EBLOCK,19,SOLID,{max(block.labels):10},{len(block.labels):10}",
    ]
    lines += [f"(19i{width})"]
    for label, nodes in zip(block.labels, mesh.numbers[block.nodes], strict=True):
        own = nodes[list(places)]
        row = [7, 3, 1, 1, 0, 0, 0, 0, len(own), 0, label, *own[:8]]
        lines.append("".join(f"{v:{width}}" for v in row))
        if len(own) > 8:
            lines.append("".join(f"{v:{width}}" for v in own[8:]))
    lines += [f"{-1:{width}}", *more]
    for label, value in properties.items():
        lines += ["MPTEMP,R5.0, 1, 1,  0.00000000    ,"]
        lines += [f"MPDATA,R5.0, 1,{label:4},       7, 1, {value:.9E}    ,"]
    return "\n".join([*lines, "ALPHAD,  0.00000000", "/GO", "FINISH"]) + "\n"


def read(folder, text, **options):
    (folder / "a.cdb").write_text(text)
    mesh = read_cdb(folder / "a.cdb", **options)
    check_mesh(mesh)
    return mesh


@pytest.mark.parametrize(
    ("formulation", "width"),
    [*((name, 9) for name in ELEMENTS), ("C3D8I", 8), ("C3D20R", 8), ("C3D8I", 10), ("C3D20R", 10)],
)
def test_every_element(tmp_path, formulation, width):
    mesh = box(formulation, (2, 1, 2), uneven=0.1)
    element, options, places = ELEMENTS[formulation]
    same(read(tmp_path, archive(mesh, element, options, places, width=width)), mesh, formulation)


def same(found, mesh, formulation):
    np.testing.assert_array_equal(found.numbers, mesh.numbers)
    np.testing.assert_allclose(found.nodes, mesh.nodes, atol=1e-12)
    (one,), (two,) = found.blocks, mesh.blocks
    assert one.formulation == formulation
    np.testing.assert_array_equal(one.nodes, two.nodes)
    np.testing.assert_array_equal(one.labels, two.labels)
    for of in (stiffness_matrix, mass_matrix):
        A, B = of(found), of(mesh)
        assert abs(A - B).max() < 1e-11 * abs(B).max()
    assert list(found.element_sets) == ["TYPE3", "MAT7"]
    assert set(found.material) == {"MAT7"}


def test_quadratic_bricks_that_are_tetrahedra(tmp_path):
    mesh = box("C3D10", (1, 1, 1))
    same(read(tmp_path, archive(mesh, 186, {}, TETRAHEDRON)), mesh, "C3D10")


def test_types_in_a_block(tmp_path):
    """ETBLOCK of later releases has the options in it."""
    mesh = box("C3D20")
    text = archive(mesh, 186, {}, range(20))
    block = f"ETBLOCK,        1,        1\n(2i9,19a9)\n{3:9}{186:9}{0:9}{1:9}" + f"{0:9}" * 17
    same(read(tmp_path, text.replace("ET,        3,186", block + f"\n{-1:9}")), mesh, "C3D20")


def test_components_of_nodes_and_elements(tmp_path):
    mesh = box("C3D8I")
    n, e = mesh.numbers, mesh.blocks[0].labels
    more = [
        f"CMBLOCK,FRICTION,NODE,{4:8}  ! users node component definition",
        "(8i10)",
        "".join(f"{v:10}" for v in (n[0], n[3], -n[6], n[8])),  # a range
        f"CMBLOCK,HALF    ,ELEM,{2:8}",
        "(8i10)",
        "".join(f"{v:10}" for v in (e[1], e[4])),
        "CM,ALL,NODE",
    ]
    found = read(tmp_path, archive(mesh, 185, {2: 2}, range(8), more=more))
    np.testing.assert_array_equal(found.node_sets["FRICTION"], [0, 3, 4, 5, 6, 8])
    np.testing.assert_array_equal(found.element_sets["HALF"], [1, 4])
    part = read(tmp_path, archive(mesh, 185, {2: 2}, range(8), more=more), part="HALF")
    assert part.n_elements == 2
    wrong = [more[0].replace(f"{4:8}", f"{5:8}"), *more[1:]]
    with pytest.raises(ModelError, match="expected 5 numbers of component FRICTION, found 4"):
        read(tmp_path, archive(mesh, 185, {2: 2}, range(8), more=wrong))


ORTHOTROPIC = {
    **{"EX": 9e3, "EY": 7e3, "EZ": 2e3, "PRXY": 0.2, "PRXZ": 0.1, "PRYZ": 0.15},
    **{"GXY": 1.5e3, "GXZ": 1.2e3, "GYZ": 3e3, "DENS": 2.5e-9},
}


def test_orthotropic_materials(tmp_path):
    """PR is the major ratio, NU the minor one: PRXY / EX = NUXY / EY."""
    mesh = box("C3D20R")
    minor = {k: v for k, v in ORTHOTROPIC.items() if not k.startswith("PR")}
    minor |= {"NUXY": 0.2 * 7 / 9, "NUXZ": 0.1 * 2 / 9, "NUYZ": 0.15 * 2 / 7}
    for properties in (ORTHOTROPIC, minor):
        found = read(tmp_path, archive(mesh, 186, {}, range(20), properties))
        given = found.materials["MAT7"]
        np.testing.assert_allclose(given.entries, LINING.entries, rtol=1e-8)
        assert given.density == LINING.density
    text = archive(mesh, 186, {}, range(20), ORTHOTROPIC)
    first = f"{7:9}{3:9}{1:9}{1:9}"
    with pytest.raises(ModelError, match="MAT7 is orthotropic in the axes of an element coord"):
        read(tmp_path, text.replace(first + f"{0:9}", first + f"{11:9}"))


def test_single_properties_and_none(tmp_path):
    """MP alone; the shear modulus in place of Poisson's ratio; materials of the model file."""
    mesh = box("C3D20R")
    text = archive(
        mesh, 186, {}, range(20), {}, ["MP,EX,7,2.1e5", "MP,DENS,7,7.8e-9", "MP,GXY,7,8e4"]
    )
    given = read(tmp_path, text).materials["MAT7"]
    assert (given.young_modulus, given.density) == (2.1e5, 7.8e-9)
    assert given.poisson_ratio == pytest.approx(2.1e5 / 1.6e5 - 1)
    bare = read(tmp_path, archive(mesh, 186, {}, range(20), {"DENS": 7.8e-9, "MU": 0.3}))
    assert not bare.materials
    assert set(bare.with_material("S", STEEL, "MAT7").material) == {"S"}
    assert any(note.keyword == "MU" for note in bare.passed_over)


def test_a_shear_modulus_of_its_own_is_no_isotropic_material(tmp_path):
    """ANSYS takes such a material as orthotropic; without the other moduli it is not known here."""
    mesh = box("C3D20R")
    text = archive(mesh, 186, {}, range(20), {**ISOTROPIC, "GXY": 5e4})
    with pytest.raises(ModelError, match="GXY is not that of an isotropic material of EX and PRXY"):
        read(tmp_path, text)
    rounded = read(tmp_path, archive(mesh, 186, {}, range(20), {**ISOTROPIC, "GXY": 8.08e4}))
    assert rounded.materials["MAT7"].poisson_ratio == 0.3


def test_what_is_passed_over_is_told(tmp_path):
    mesh = box("C3D8I")
    more = ["D,      12,UX  ,  0.0", "F,      12,FX  ,  1.0", "BETAD, 1e-7", "CE,R5.0,DEFN,1"]
    found = read(tmp_path, archive(mesh, 185, {2: 2}, range(8), more=more), pass_over=["ce"])
    told = {note.keyword: (note.line, note.why) for note in found.passed_over}
    lines = (tmp_path / "a.cdb").read_text().split("\n")
    for name, line in zip(("D", "F", "BETAD", "CE"), more, strict=True):
        assert lines[told[name][0] - 1] == line
    assert told["BETAD"][1] == "damping is stated in the model file"
    assert told["CE"][1] == "as asked for"


def test_other_elements(tmp_path):
    """Contact is passed over and told, masses are refused; an element may be another."""
    mesh = box("C3D8")
    text = archive(mesh, 45, {1: 1}, range(8))
    first = f"{7:9}{3:9}{1:9}{1:9}"
    more = "ET,        5,174\nET,        6,21\nET,        3"
    text = text.replace("ET,        3", more, 1)
    contact = text.replace(first, first.replace(f"{3:9}", f"{5:9}"), 1)
    found = read(tmp_path, contact)
    assert found.n_elements == mesh.n_elements - 1
    assert [n.why for n in found.passed_over if n.keyword == "ELEMENT174"] == [
        "contact is stated in the model file"
    ]
    mass = text.replace(first, first.replace(f"{3:9}", f"{6:9}"), 1)
    with pytest.raises(ModelError, match=r"not supported: ELEMENT21 \(1\): state masses"):
        read(tmp_path, mass)
    assert read(tmp_path, mass, pass_over=["ELEMENT21"]).n_elements == mesh.n_elements - 1
    other = read(tmp_path, text, treat_as={"SOLID45": "C3D8I"})
    assert other.blocks[0].formulation == "C3D8I"
    with pytest.raises(ModelError, match=r"C3D20 has 20 nodes"):
        read(tmp_path, text, treat_as={"SOLID45": "C3D20"})
    with pytest.raises(ModelError, match="treat_as SOLID46 = 'C3D8': expected one of SOLID185"):
        read(tmp_path, text, treat_as={"SOLID46": "C3D8"})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "KEYOP,        3, 2,        2",
            "KEYOP,        3, 2,        1",
            r"KEYOPT\(2\) = 1, is not",
        ),
        (
            "KEYOP,        3, 2,        2",
            "KEYOP,        3, 3,        1",
            r"KEYOPT\(3\) = 1, is not",
        ),
        (
            "KEYOP,        3, 2,        2",
            "KEYOP,        4, 2,        2",
            "expected the type of an ET",
        ),
        ("ET,        3,185", "ET,        4,185", "line 6: expected the type of an ET"),
        ("ET,        3,185", "ET,        3", "line 5: expected a type and an element"),
        ("ET,        3,185", "ETBLOCK", "line 5: expected the number of types, found ''"),
        (
            "N,R5.3,LOC,       -1,",
            "N,R5.3,UNBL,LOC, 1, 0.",
            r"line \d+: expected the end of a block",
        ),
        ("EBLOCK,19,SOLID", "EBLOCK,10,", "expected EBLOCK, number of fields, SOLID"),
        ("MPDATA,R5.0, 1,EX", "MPDATA,R5.0, 1,EQ", "a property 'EQ' of materials is not supported"),
        (
            "2.100000000E+05    ,",
            "2.1E+05, 2.0E+05",
            "expected EX at one temperature, found 2 values",
        ),
        ("MPDATA,R5.0, 1,NUXY", "MPDATA,R5.0, 1,NUXZ", "MAT7 has no EY"),
        ("3.000000000E-01", "5.000000000E-01", "MAT7: expected EX > 0 and -1 < PRXY < 0.5"),
        ("7.800000000E-09", "0.0", "MAT7 has no density DENS above zero"),
        ("/GO", "TB,ANEL,1", r"commands that are not supported: TB \(1, first in line \d+\)"),
        ("NBLOCK,6,SOLID", "NBLOCK,6,SOLID,9,9\nNBLOCK,6,SOLID", "line 8: expected one NBLOCK"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, old, new, message):
    text = archive(box("C3D8I"), 185, {2: 2}, range(8))
    assert old in text
    with pytest.raises(ModelError, match=message) as caught:
        mass_matrix(read(tmp_path, text.replace(old, new, 1)))
    assert str(caught.value).startswith(str(tmp_path / "a.cdb"))


def test_settings_of_cdwrite_and_lumped_masses(tmp_path):
    text = archive(box("C3D8I"), 185, {2: 2}, range(8))
    more = "LUMPM,OFF\nSTEF,5.67E-08\nDMPOPT,ESAV,NO\nTIMINT,ON,STRU\nCSCIR,0,0\nEMUNIT,MKS\n"
    more += "SOLVE\n/GO"
    assert not read(tmp_path, text.replace("/GO", more, 1)).lumped
    assert read(tmp_path, text.replace("/GO", more.replace("OFF", "ON"), 1)).lumped
    with pytest.raises(ModelError, match=r'depend on them: pass_over = \["TB", "CP"\]$'):
        read(tmp_path, text.replace("/GO", "TB,ANEL,1\nCP,1,UX\n/GO", 1))


def test_damaged_blocks(tmp_path):
    """Missing middle nodes, nodes and elements that are not there, bricks without sense."""
    mesh = box("C3D20R", (1, 1, 1))
    text = archive(mesh, 186, {}, range(20))
    n = mesh.numbers[mesh.blocks[0].nodes[0]]
    for old, new, message in [
        (f"{n[19]:9}\n", f"{999:9}\n", r"there is no node 999"),
        (f"{n[19]:9}\n", f"{n[18]:9}\n", "a node is there twice"),
        (f"{n[7]:9}\n", f"{n[4]:9}\n", "bricks with corners in one place may be wedges"),
        (f"{101:10},{1:10}", f"{101:10},{2:10}", "expected 2 lines of the block, could read 1"),
    ]:
        assert old in text
        with pytest.raises(ModelError, match=message):
            read(tmp_path, text.replace(old, new, 1))
    lacking = read(tmp_path, text.replace(f"{n[19]:9}\n", f"{0:9}\n", 1))
    assert len(lacking.constraints) == 3  # the middle of an edge follows its ends
    with pytest.raises(ModelError, match=r"a.cdb has no NBLOCK"):
        read(tmp_path, "/PREP7\n")


def test_without_its_reader(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mapdl_archive", None)
    with pytest.raises(ModelError, match=r"need mapdl-archive: pip install 'squealstudy\[ansys\]'"):
        read(tmp_path, archive(box("C3D8I"), 185, {2: 2}, range(8)))


def test_archives_that_ansys_wrote():
    """Those that come with the reader: what is known of them by other means."""
    from importlib.resources import files

    folder = files("mapdl_archive") / "examples"
    mesh = read_cdb(folder / "HexBeam.cdb")
    check_mesh(mesh)
    assert [b.formulation for b in mesh.blocks] == ["C3D20R"]
    x = np.zeros((len(mesh.nodes), 3))
    x[:, 0] = 1
    mass = x.ravel() @ (mass_matrix(mesh) @ x.ravel())
    assert mass == pytest.approx(2700 * np.prod(np.ptp(mesh.nodes, axis=0)))  # a box
    assert list(mesh.element_sets["ECOMP1"]) == [16, 17, *range(20, 40)]
    assert list(mesh.element_sets["ECOMP2"]) == [*range(20), 22, 23]
    assert list(mesh.node_sets["NCOMP2"])[:24] == [*range(21), 42, 43, 44]
    straight = read_cdb(folder / "TetBeam.cdb")  # SOLID187 without middle nodes
    check_mesh(straight)
    assert [b.formulation for b in straight.blocks] == ["C3D10"]
    assert "middle nodes" in [note.keyword for note in straight.passed_over]
    straight = straight.with_material("S", STEEL)
    E = expanded(straight)[1].E
    ones = np.ones((E.shape[1] // 3, 1)) * [[1.0, 0, 0]]
    moved = E @ ones.ravel()
    mass = STEEL.density * np.prod(np.ptp(straight.nodes, axis=0))
    assert moved @ (mass_matrix(straight) @ moved) == pytest.approx(mass)


def test_a_study_of_an_archive(tmp_path):
    """Faces are components of nodes; frequencies are those of the .inp."""
    write_blocks(tmp_path)
    expected = frequencies(built(tmp_path / "blocks.toml"))
    plate = block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL")
    sets = []
    for name in ("TOP", "BOTTOM"):
        own = plate.numbers[plate.node_set(name)]
        rows = [own[k : k + 8] for k in range(0, len(own), 8)]
        sets += [f"CMBLOCK,{name},NODE,{len(own)}", "(8i10)"]
        sets += ["".join(f"{n:10}" for n in row) for row in rows]
    (tmp_path / "plate.cdb").write_text(archive(plate, 186, {2: 1}, range(20), more=sets))
    toml = (tmp_path / "blocks.toml").read_text()
    (tmp_path / "blocks.toml").write_text(toml.replace("plate.inp", "plate.cdb"))
    np.testing.assert_allclose(frequencies(built(tmp_path / "blocks.toml")), expected, rtol=1e-9)
    results = solved(Plan(load_study(tmp_path / "study.toml")), tmp_path / "r")
    assert (results.points["status"] == "ok").all()


# -- damaged files ---------------------------------------------------------------------------------
def _sound() -> str:
    return archive(box("C3D8_BBAR", (1, 1, 1)), 185, {}, range(8))


@pytest.mark.parametrize("place", [2, 9, 14])  # lines of EBLOCK, of NBLOCK
@pytest.mark.parametrize("more", ["7" * 4000, " 7" * 200, "\x00" * 5000])
def test_a_line_longer_than_its_format_never_reaches_the_reader(tmp_path, place, more):
    """The reader of others corrupts memory there."""
    lines = _sound().split("\n")
    start = next(k for k, line in enumerate(lines) if line.startswith("NBLOCK"))
    lines[start + place] += more
    with pytest.raises(ModelError, match=r"a\.cdb, line \d+: expected"):
        read(tmp_path, "\n".join(lines))


@pytest.mark.parametrize("format_", ["(99i9)", "(19i9999)", "(19i)", "19i9", "(19s9)", ""])
def test_a_format_that_is_none_is_refused(tmp_path, format_):
    with pytest.raises(ModelError, match="expected the format of a block"):
        read(tmp_path, _sound().replace("(19i9)", format_))


def test_a_reader_that_crashes_is_one_sentence(tmp_path, monkeypatch):
    program = tmp_path / "crash.py"
    program.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(ansys_archive, "PROGRAM", program)
    with pytest.raises(ModelError, match="its reader crashed"):
        read(tmp_path, _sound())
