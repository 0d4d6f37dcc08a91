"""Models of files: two blocks through units, placement, matrices, parameters, and their errors."""

from __future__ import annotations

import pickle
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from component_meshes import LINING, STEEL, rigid_shapes
from own_blocks import MODEL, STUDY, block, write_blocks
from study_runs import solved

import squealstudy as sq
from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.bodies import Brake, body_matrices
from squealstudy.models.components.gmsh import read_gmsh
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.materials import Orthotropic
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.model_file import ModelFile
from squealstudy.models.fem.solid import Isotropic
from squealstudy.study.components import read_model
from squealstudy.study.definition import load_study
from squealstudy.study.source import SourceText, validate
from squealstudy.study.toml_text import toml_text

MM, MPA, TONNE = 1e-3, 1e6, 1e3


def assembled(folder: Path, *changes, **values):
    """The assembly of the two blocks with changes of the file and values of parameters."""
    write_blocks(folder, *changes)
    return built(folder / "blocks.toml", **values)


def built(path: Path, **values):
    model = read_model(path)
    options = {option.name: option.choices[0] for option in model.options}
    return model.build(options, {**model.defaults(), **values})


def stiffness(assembly):
    """K without friction of an assembly with a contact stiffness of 1e12 Pa/m, and M (n, n)."""
    c = assembly.contact
    K = assembly.K_el + assembly.K_springs() + 1e12 * c.N.T @ sp.diags(c.area) @ c.N
    return K.toarray(), assembly.M.toarray()


def frequencies(assembly, count=20):
    return np.sqrt(la.eigh(*stiffness(assembly), eigvals_only=True, subset_by_index=(0, count)))


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """Folder with the files of the two blocks, and their assembly."""
    folder = tmp_path_factory.mktemp("blocks")
    return folder, assembled(folder)


def test_components_are_those_of_the_meshes_in_si(blocks):
    _, assembly = blocks
    mesh = block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL")
    plate = assembly.components[0]
    K, M = MPA * MM * stiffness_matrix(mesh), TONNE * mass_matrix(mesh)
    assert abs(plate.K - K).max() < 1e-13 * abs(K).max()
    assert abs(plate.M - M).max() < 1e-13 * abs(M).max()
    assert plate.mass == pytest.approx(8e-3 * 3e-3 * 2e-3 * 7800, rel=1e-12)
    assert assembly.components[1].coordinates.min(axis=0) == pytest.approx([1.5e-3, 0.5e-3, 2e-3])


def test_contact_slides_about_the_axis(blocks):
    """The axis is at (4, -100) mm: the plate moves along -x there, faster farther out."""
    _, assembly = blocks
    contact, n = assembly.contact, assembly.n_dof
    assert contact.area.sum() == pytest.approx(5e-3 * 2e-3, rel=1e-12)
    assert (contact.gap0 == 0).all()
    moved = np.zeros((n, 2))
    moved[assembly.slices["plate"].start : assembly.slices["plate"].stop : 3, 0] = 1.0
    moved[assembly.slices["slider"].start + 2 : assembly.slices["slider"].stop : 3, 1] = 1.0
    assert contact.N @ moved[:, 1] == pytest.approx(1.0)  # the slider lifts off
    along, lifted = (contact.T @ moved).T
    assert along == pytest.approx(-1.0, abs=1e-3)
    assert lifted == pytest.approx(0.0, abs=1e-12)
    assert 0.1005 < contact.radius.min() < contact.radius.max() < 0.1026
    assert set(contact.pairs) == {"contact_1"}
    assert contact.points[:, 2] == pytest.approx(2e-3)
    middle = np.average(contact.radius, weights=contact.area)
    assert contact.speed_factor == pytest.approx(contact.radius / middle, rel=1e-14)


def test_all_points_may_slide_at_one_speed(blocks, tmp_path):
    folder, _ = blocks
    uniform = assembled(tmp_path, ("axis = [0, 0, 1]", "axis = [0, 0, 1]\nuniform = true"))
    assert (uniform.contact.speed_factor == 1).all()
    study = load_study(folder / "study.toml")
    radius = study.model.effective_radius(study.options, study.values)
    assert radius == pytest.approx(0.1015, rel=1e-3)
    of_file = assembled(tmp_path, ("axis = [0, 0, 1]", "axis = [0, 0, 1]\neffective_radius = 50"))
    assert of_file.contact.speed_factor == pytest.approx(of_file.contact.radius / 0.05)


def test_layer_spring_and_load_have_the_sums_of_the_file(blocks):
    _, assembly = blocks
    bed, guides = assembly.springs
    rigid = {c.name: rigid_shapes(c.coordinates) for c in assembly.components}
    of_plate = bed.matrix()[assembly.slices["plate"], assembly.slices["plate"]]
    of_slider = guides.matrix()[assembly.slices["slider"], assembly.slices["slider"]]
    R = rigid["plate"][:, :3]
    face = 8e-3 * 3e-3
    assert np.diag(R.T @ of_plate @ R) == pytest.approx(face * np.array([1e12, 1e12, 2e12]))
    R = rigid["slider"][:, :3]
    assert R.T @ of_slider @ R == pytest.approx(np.diag([2e7, 1.5e7, 1e6]), abs=1.0)
    assert assembly.load.reshape(-1, 3).sum(axis=0) == pytest.approx([0, 0, -1e-5], abs=1e-15)


def test_the_same_blocks_in_other_units_are_the_same(blocks, tmp_path):
    """A file in SI of numbers that are 1e-3 of a mm, 1e6 of an MPa, ...: equal to round-off."""
    _, assembly = blocks
    write_blocks(tmp_path)
    for name, args in (
        ("plate", ((4, 2, 1), (8.0, 3.0, 2.0), "STEEL")),
        ("slider", ((3, 1, 2), (5.0, 2.0, 2.0), "LINING")),
    ):
        mesh = block(name, *args)
        material = (
            Isotropic(MPA * STEEL.young_modulus, 0.3, 7800.0)
            if name == "plate"
            else Orthotropic(tuple(MPA * e for e in LINING.entries), 2500.0)
        )
        write_inp(
            replace(mesh, nodes=MM * mesh.nodes, materials={args[2]: material}),
            tmp_path / f"{name}.inp",
        )
    text = MODEL
    for old, new in (
        ('"t-mm-s"', '"SI"'),
        ("[4.0, -100.0, 0.0]", "[0.004, -0.1, 0]"),
        ("[1.5, 0.5, 2.0]", "[1.5e-3, 0.5e-3, 2.0e-3]"),
        ("search = 0.1", "search = 1e-4"),
        ("normal = 2000.0", "normal = 2e12"),
        ("tangential = 1000.0", "tangential = 1e12"),
        ("[2e4, 1.5e4, 1e3]", "[2e7, 1.5e7, 1e6]"),
        ("area = 10.0", "area = 1e-5"),
    ):
        text = text.replace(old, new)
    (tmp_path / "blocks.toml").write_text(text)
    other = built(tmp_path / "blocks.toml")
    for A, B in zip(stiffness(assembly), stiffness(other), strict=True):
        assert np.abs(A - B).max() < 1e-11 * np.abs(A).max()
    assert np.abs(assembly.load - other.load).max() < 1e-12 * np.abs(assembly.load).max()
    assert other.contact.radius == pytest.approx(assembly.contact.radius, rel=1e-12)


def test_matrices_in_place_of_a_mesh(blocks, tmp_path):
    """The slider as K and M with rows in another order: the same brake."""
    _, assembly = blocks
    write_blocks(tmp_path, ('mesh = "slider.inp"', SLIDER_OF_MATRICES))
    write_slider_matrices(tmp_path)
    other = built(tmp_path / "blocks.toml")
    assert frequencies(other) == pytest.approx(frequencies(assembly), rel=1e-9)


SLIDER_OF_MATRICES = 'K = "K.npz"\nM = "M.npz"\ndof = "slider.dof"\nnodes = "slider.inp"'


def write_slider_matrices(folder: Path, size: float = 1.0) -> list[str]:
    """K, M in t-mm-s and the map of their rows, whose lines are returned."""
    mesh = block("slider", (3, 1, 2), (5.0 * size, 2.0 * size, 2.0 * size), "LINING")
    order = np.random.default_rng(1).permutation(3 * len(mesh.nodes))
    for name, A in (("K", stiffness_matrix(mesh)), ("M", mass_matrix(mesh))):
        sp.save_npz(folder / f"{name}.npz", A[order][:, order].tocsr())
    lines = [f"{mesh.numbers[i // 3]}.{i % 3 + 1}" for i in order]
    (folder / "slider.dof").write_text("\n".join(lines) + "\n")
    return lines


def test_a_turned_block_takes_its_material_along(blocks, tmp_path):
    """Half a turn of the slider about its middle axis: the box and its faces look the same."""
    _, assembly = blocks
    turned = assembled(
        tmp_path,
        ("translate = [1.5, 0.5, 2.0]",
         "translate = [1.5, 0.5, 2.0]\n"
         "rotate = {axis = [0, 0, 1], angle = 90, point = [2.5, 1.0, 0.0]}"),
    )  # fmt: skip
    R = sp.kron(sp.eye(turned.components[1].n_dof // 3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    expected = R @ assembly.components[1].K @ R.T
    difference = abs(turned.components[1].K - expected).max()
    assert difference < 1e-12 * abs(expected).max()


def test_held_freedoms_leave_matrices_and_rows(blocks, tmp_path):
    _, assembly = blocks
    held = assembled(tmp_path, ("[parameters]", '[[fixed]]\nset = "plate.BOTTOM"\n\n[parameters]'))
    plate = held.components[0]
    low = assembly.components[0].coordinates[:, 2] < 1e-9
    kept = np.flatnonzero(np.repeat(~low, 3))
    np.testing.assert_array_equal(plate.dofs, kept)
    assert len(plate.coordinates) == len(low)
    assert abs(plate.K - assembly.components[0].K[kept][:, kept]).nnz == 0
    assert held.n_dof == assembly.n_dof - 3 * low.sum()
    assert held.springs[0].matrix().nnz == 0  # the bed is on what is held
    w2 = la.eigh(plate.K.toarray(), plate.M.toarray(), eigvals_only=True)
    assert w2[0] > 0  # nothing is free


def test_parameters_change_what_they_point_to(blocks, tmp_path):
    folder, assembly = blocks
    softer = built(folder / "blocks.toml", **{"lining.E3": 1e9, "bed.normal": 5e11})
    fresh = tmp_path / "fresh"
    write_blocks(fresh, ("default = 2e3", "default = 1e3"), ("normal = 2000.0", "normal = 500.0"))
    for A, B in zip(stiffness(softer), stiffness(built(fresh / "blocks.toml")), strict=True):
        np.testing.assert_allclose(A, B, rtol=1e-12, atol=1e-12 * np.abs(A).max())
    assert frequencies(softer, 3)[1] < frequencies(assembly, 3)[1]
    parameters = {p.name: p for p in read_model(folder / "blocks.toml").parameters}
    assert parameters["lining.E3"].default == 2e9
    assert parameters["lining.E3"].unit == "Pa"
    assert parameters["bed.normal"].default == 2e12
    assert parameters["guides.x"].default == 2e7
    assert parameters["friction"].default == 0.4
    assert all(parameters[n].structural for n in ("lining.E3", "bed.normal", "guides.x"))


def test_defaults_have_units(blocks, tmp_path):
    """A text with its unit, and a bare number with the unit beside it, of the file or not."""
    pressures = "friction = {default = 0.4}\npressure = "
    for lining, pressure in (
        ('default = "2 GPa"', '{default = "12 bar"}'),
        ('default = 2e9, unit = "Pa"', "{default = 12, unit = 'bar'}"),
        ('default = 20, unit = "kbar"'.replace("kbar", "hPa"), "{default = 12e5, unit = 'Pa'}"),
    ):
        path = write_blocks(
            tmp_path,
            ('default = 2e3, unit = "MPa"', lining),
            ("friction = {default = 0.4}", pressures + pressure),
        )
        found = {p.name: p.default for p in read_model(path.parent / "blocks.toml").parameters}
        assert found["pressure"] == 12e5
        assert found["lining.E3"] == (2000.0 if "hPa" in lining else 2e9)


def test_values_of_a_study_have_units(tmp_path):
    sweep = '[[sweep]]\nparameter = "lining.E3"\nvalues = ["1.5 GPa", "2200 MPa"]\n\n[modes]'
    text = STUDY.replace("[modes]", '[parameters]\npressure = "12 bar"\n\n' + sweep)
    study = load_study(write_blocks(tmp_path, study=text))
    assert list(study.sweeps[1].values) == [1.5e9, 2.2e9]
    assert study.values["pressure"] == 12e5
    (tmp_path / "study.toml").write_text(text.replace("2200 MPa", "2 mm"))
    with pytest.raises(StudyFileError, match="E3 is in Pa: got '2 mm'"):
        load_study(tmp_path / "study.toml")


def test_a_study_of_a_model_file(blocks, tmp_path):
    """It runs like any other, and agrees with the unreduced model."""
    folder, _ = blocks
    results = solved(Plan(load_study(folder / "study.toml")), tmp_path / "r")
    points = results.points
    assert (points["status"] == "ok").all()
    assert points["reference_frequency_error"].min() < 1e-2
    assert (results.modes["residual"] < 1e-12).all()
    assert {"energy_plate", "energy_slider"} <= set(results.modes.columns)


def test_ids_follow_every_file(tmp_path):
    """Another mesh, or another text that an .inp includes, are other results."""
    path = write_blocks(tmp_path)
    text = (tmp_path / "plate.inp").read_text()
    nodes, rest = text.split("*ELEMENT", 1)
    (tmp_path / "nodes.txt").write_text(nodes)
    (tmp_path / "plate.inp").write_text(f"*INCLUDE, INPUT=nodes.txt\n*ELEMENT{rest}")
    first = Plan(load_study(path))
    assert Plan(load_study(path)).tasks.structures == first.tasks.structures
    (tmp_path / "nodes.txt").write_text(nodes + "** a comment\n")
    second = Plan(load_study(path))
    assert second.tasks.structures != first.tasks.structures
    assert (second.tasks.ids != first.tasks.ids).all()
    with pytest.raises(ModelError, match="has changed meanwhile"):
        first.tasks[0].assembly()


def test_the_model_goes_to_workers(blocks):
    folder, assembly = blocks
    task = Plan(load_study(folder / "study.toml")).tasks[0]
    again = pickle.loads(pickle.dumps(task)).assembly()
    assert again.n_dof == assembly.n_dof


SECOND_CONTACT = """\
[[contact]]
kind = "sliding"
slave = "plate.TOP"
master = "slider.BOTTOM"
search = 0.1

[[layer]]"""


# -- messages ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("old", "new", "line", "key", "message"),
    [
        ('units = "t-mm-s"', 'units = "mm-t-s"', 2, "units", "expected one of 'SI', 't-mm-s'"),
        ('units = "t-mm-s"\n', "", None, "units",
         "the key 'units' is missing: SI, t-mm-s or mm-kg-ms"),
        ('"slider.BOTTOM"', '"slider.BOTTON"', 17, "contact[1].slave",
         "slider (slider.inp) has no surface or node set 'BOTTON'; it has BOTTOM, CORNER, ENDS, "
         "TOP; did you mean 'BOTTOM'?"),
        ('"plate.TOP"', '"plat.TOP"', 18, "contact[1].master",
         "there is no component 'plat'; there is plate, slider; did you mean 'plate'?"),
        ('"plate.TOP"', '"TOP"', 18, "contact[1].master", "expected COMPONENT.SET, got 'TOP'"),
        ("[1.5, 0.5, 2.0]", "[1.5, 0.5, 14.0]", 15, "contact[1]", "placed wrongly"),
        ("[1.5, 0.5, 2.0]", "[6.5, 0.5, 2.0]", 15, "contact[1]",
         "30 % of slider.BOTTOM lies within 0.1 mm of plate.TOP"),
        ('"plate.TOP"', '"plate.BOTTOM"', 15, "contact[1]", "point the same way"),
        ('kind = "sliding"', 'kind = "stuck"', 15, "contact[1]", "expected tangential"),
        ("[4.0, -100.0, 0.0]\naxis = [0, 0, 1]", "[4.0, 0.0, 0.0]\naxis = [0, 0, 0]", 4, "rotation",
         "the axis not zero"),
        ('mesh = "plate.inp"', 'mesh = "plat.inp"', 9, "components.plate.mesh", "no file plat.inp"),
        ('mesh = "plate.inp"', 'mesh = "plate.inp"\nK = "K.npz"', 8, "components.plate",
         "expected mesh, or K, M and nodes"),
        ("E[3]", "E[4]", 37, "parameters.lining.E3.path",
         "material LINING has three of each, such as E[3], not E[4]"),
        ("LINING.E[3]", "LINING.E", 37, "parameters.lining.E3.path", "not E"),
        ("LINING.E[3]", "LININ.E[3]", 37, "parameters.lining.E3.path",
         "slider has no material 'LININ'; it has LINING; did you mean 'LINING'?"),
        ("default = 2e3", "default = 1e9", 37, "parameters.lining.E3.default",
         "lining.E3 = 1e+15 (SI): material LINING: elastic constants E"),
        ('slave = "slider.BOTTOM"\nmaster = "plate.TOP"', 'slave = "plate.TOP"\nmaster = '
         '"slider.BOTTOM"', 15, "contact[1]", "plate.TOP is the larger face: exchange the two"),
        ('"spring.guides.stiffness[1]"', '"spring.guide.stiffness[1]"', 39,
         "parameters.guides.x.path", "NAME is one of guides"),
        ('"spring.guides.stiffness[1]"', '"spring.guides.stiffness"', 39,
         "parameters.guides.x.path", "it is a list of 3; lists count from 1"),
        ('mesh = "plate.inp"', 'mesh = "plate.inp"\nmes = 1', 10, "components.plate.mes",
         "unknown key; did you mean 'mesh'?"),
        ('mesh = "plate.inp"', 'mesh = "plate.inp"\nmaterials.X = {E = 1, nux = 1}', 10,
         "components.plate.materials.X.nux", "unknown key; did you mean 'nu'?"),
        ('mesh = "plate.inp"', 'mesh = "plate.inp"\nmaster = "x"', 10, "components.plate.master",
         "it belongs in [[contact]] or [[tie]]"),
        ("[[layer]]", "[model]\n[[layer]]", 21, "model", "unknown key"),
        ('units = "t-mm-s"', 'units = "t-mm-s"\ncontact_law = "linear"', 3, "contact_law",
         "it belongs in [model] of the study"),
        ('units = "t-mm-s"', 'units = "t-mm-s"\nrotor = "plate"', 3, "rotor",
         "it belongs in [rotation]"),
        ("search = 0.1", "search = inf", 19, "contact[1].search", "expected a finite number"),
        ('unit = "MPa"', 'unit = "mm"', 37, "parameters.lining.E3.unit", "a unit like 'Pa'"),
        (', default = 2e3, unit = "MPa"', "", 37, "parameters.lining.E3", "expected default"),
        ("default = 2e3", 'default = "2 GPa"', 37, "parameters.lining.E3.unit", "its own unit"),
        ('default = 2e3, unit = "MPa"', 'default = "2 mm"', 37, "parameters.lining.E3.default",
         "lining.E3 is in Pa: got '2 mm'"),
        ('default = 2e3, unit = "MPa"', 'default = "soft"', 37, "parameters.lining.E3.default",
         "expected a number and its unit"),
        ("friction = {default = 0.4}", "pressure = {default = 12, unit = 'mm'}", 40,
         "parameters.pressure.unit", "a unit like 'Pa'"),
        ("friction = {default = 0.4}", "pressure = {default = '-3 bar'}", 40,
         "parameters.pressure.default", "expected a value above 0 Pa"),
        ("friction = {default = 0.4}", "frequency_hz = {path = 'load.brake.area'}", 40,
         "parameters.frequency_hz", "another meaning"),
        ("axis = [0, 0, 1]", 'axis = [0, 0, 1]\nrotor = "plte"', 7, "rotation.rotor",
         "there is no component 'plte'; there is plate, slider; did you mean 'plate'?"),
        ('"plate.TOP"', '"slider.TOP"', 15, "contact[1]", "which cannot slide on itself"),
        ("[[layer]]", SECOND_CONTACT, 17, "contact[1].slave",
         "and turns, as the master of contact_2: say which component turns"),
        ('name = "guides"', 'name = "bed"', 28, "spring[1].name", "the name of layer[1] already"),
        ('name = "bed"', 'name = "contact_1"', 22, "layer[1].name", "of contact[1] already"),
        ('[[load]]\npressure_on = "slider.TOP"\narea = 10.0\n', "", None, "load",
         "there is no [[load]]"),
        ("friction = {default = 0.4}", "frictio = {default = 0.4}", 40, "parameters.frictio",
         "did you mean 'friction'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(tmp_path, old, new, line, key, message):
    write_blocks(tmp_path, (old, new))
    with pytest.raises((StudyFileError, ModelError)) as caught:
        built(tmp_path / "blocks.toml")
    if message:
        assert message in str(caught.value)
        assert caught.value.path == tmp_path / "blocks.toml"
        assert caught.value.key == key
        assert caught.value.line == line


def test_two_loads_need_no_names(tmp_path):
    """They are brake and load_2, whose parameters are told apart."""
    more = '[[load]]\npressure_on = "slider.TOP"\narea = 5.0\n\n[parameters]\n'
    paths = '"a" = {path = "load.brake.area"}\n"b" = {path = "load.load_2.area"}'
    write_blocks(tmp_path, ("[parameters]", more + paths))
    found = {p.name: p.default for p in read_model(tmp_path / "blocks.toml").parameters}
    assert found["a"] == pytest.approx(10e-6)
    assert found["b"] == pytest.approx(5e-6)


def test_values_of_a_design_that_cannot_be_name_their_parameters(blocks):
    """One design point fails, not the study: it is no error of the file."""
    folder, _ = blocks
    with pytest.raises(ModelError, match=r"blocks.toml: lining.E3 = 1e\+15 \(SI\): mat"):
        built(folder / "blocks.toml", **{"lining.E3": 1e15})


def broken_map(lines):
    yield lines[:-1], "row 144 of 144 of K.npz has no line in slider.dof"
    yield [*lines[:4], "7000.1", *lines[5:]], "slider.dof, line 5: slider.inp has no node 7000"
    yield [*lines[:4], "12.7", *lines[5:]], "direction 7: expected 1 to 6"
    yield [*lines[:4], lines[0], *lines[5:]], "is in line 1 already"
    yield (
        [*lines[:4], "x", *lines[5:]],
        "line 5: expected 'node.direction' or 'modal', got 'x'",
    )


@pytest.mark.parametrize("case", range(5))
def test_a_wrong_map_of_freedoms(tmp_path, case):
    write_blocks(tmp_path, ('mesh = "slider.inp"', SLIDER_OF_MATRICES))
    lines, message = list(broken_map(write_slider_matrices(tmp_path)))[case]
    (tmp_path / "slider.dof").write_text("\n".join(lines))
    with pytest.raises(StudyFileError) as caught:
        built(tmp_path / "blocks.toml")
    text = str(caught.value).replace(f"row {len(lines) + 1} of {len(lines) + 1}", "row 144 of 144")
    assert message in text
    assert caught.value.key == "components.slider.dof"


def test_what_a_study_says_of_its_model_file(tmp_path):
    path = write_blocks(tmp_path)
    for old, new, message in (
        ('file = "blocks.toml"', 'file = "block.toml"', "there is no file"),
        ('file = "blocks.toml"', 'file = "blocks.toml"\nname = "belt"', "not both"),
        ('file = "blocks.toml"', 'name = "components"', "is what a file describes"),
        ('parameter = "friction"', 'parameter = "linin.E3"', "did you mean 'lining.E3'?"),
    ):
        path.write_text(STUDY.replace(old, new))
        with pytest.raises(StudyFileError, match=re.escape(message)):
            load_study(path)


def test_a_mesh_of_gmsh(tmp_path):
    """Materials are given in the model file, to volumes by their names."""
    shutil.copy(Path(__file__).parents[1] / "meshes" / "pad_hex20.msh", tmp_path)
    mesh = read_gmsh(tmp_path / "pad_hex20.msh")
    table = {"components": {"pad": {"mesh": "pad_hex20.msh", "materials": {}}}}
    sets = sorted(set(mesh.element_sets))
    for name in sets:
        table["components"]["pad"]["materials"][name] = {"E": 2.1e5, "nu": 0.3, "rho": 7.8e-9}
    face = next(iter(mesh.surfaces))
    table |= {"units": "t-mm-s"}
    table["contact"] = [
        {"kind": "frictionless", "slave": f"pad.{face}", "master": f"pad.{face}", "search": 1.0}
    ]
    (tmp_path / "pad.toml").write_text(toml_text(table))
    source = SourceText.read(tmp_path / "pad.toml")
    file = validate(ModelFile, source, source.tables)
    K, M = body_matrices(Brake(source.path, file, "pad"), "pad", {})
    given = mesh.with_material("steel", STEEL)
    assert abs(K - MPA * MM * stiffness_matrix(given)).max() < 1e-13 * abs(K).max()
    assert abs(M - TONNE * mass_matrix(given)).max() < 1e-13 * abs(M).max()


def test_a_component_without_material_is_refused(tmp_path):
    path = write_blocks(tmp_path)
    text = (tmp_path / "plate.inp").read_text()
    head, tail = text.split("*SOLID SECTION")
    (tmp_path / "plate.inp").write_text(head + tail.split("\n", 1)[1])
    with pytest.raises(StudyFileError, match="no material; give") as caught:
        built(tmp_path / "blocks.toml")
    assert caught.value.key == "components.plate"
    given = (
        'mesh = "plate.inp"',
        'mesh = "plate.inp"\nmaterials.S = {E = 2.1e5, nu = 0.3, rho = 7.8e-9}',
    )
    (tmp_path / "blocks.toml").write_text(MODEL.replace(*given))
    assert path.is_file()
    assert built(tmp_path / "blocks.toml").components[0].mass == pytest.approx(3.744e-4)


def test_the_python_face_takes_a_model_file(blocks):
    folder, _ = blocks
    model = sq.model(str(folder / "blocks.toml"), **{"bed.normal": 5e11})
    assert model.parameters.loc["bed.normal", "value"] == 5e11
    table = model.component_modes(60_000.0)
    assert set(table["component"]) == {"plate", "slider"}
    assert (table.groupby("component")["rigid"].sum() == 6).all()
    study = model.study()
    assert study.resolved.values["bed.normal"] == 5e11


def test_cells_have_the_energy_of_the_component(blocks, tmp_path):
    """So that shapes are drawn; held nodes stand still in them."""
    _, assembly = blocks
    rng = np.random.default_rng(0)
    for component in assembly.components:
        u = rng.standard_normal(component.n_dof) + 1j * rng.standard_normal(component.n_dof)
        energies = component.cells.energies(u)
        assert energies.sum() == pytest.approx(np.vdot(u, component.K @ u).real, rel=1e-12)
        assert (energies > 0).all()
    assert assembly.components[0].cells.volumes.sum() == pytest.approx(48e-9, rel=1e-12)
    assert len(assembly.components[0].cells.facets) == 28
    held = assembled(tmp_path, ("[parameters]", '[[fixed]]\nset = "plate.BOTTOM"\n\n[parameters]'))
    moved = held.at_nodes(np.ones(held.n_dof))
    low = held.components[0].coordinates[:, 2] < 1e-9
    np.testing.assert_array_equal(moved[: len(low)].all(axis=1), ~low)
    np.testing.assert_array_equal(moved[len(low) :], 1.0)


def test_a_load_without_area_has_that_of_its_face(tmp_path):
    stated = assembled(tmp_path / "stated").load
    own = assembled(tmp_path / "own", ("area = 10.0\n", "")).load
    np.testing.assert_allclose(own, stated, atol=1e-15 * abs(stated).max())  # 5 x 2 mm2
