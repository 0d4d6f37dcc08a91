"""Gaps that heat opens: free expansion of components as they are held, under the steady contact."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from own_blocks import block, write_blocks
from study_runs import command, solved
from test_report import quickly

import squealstudy as sq
from squealstudy.errors import StudyFileError
from squealstudy.models.components.heat import thermal_forces
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.study.components import read_model

ALPHA, NU = 1.1e-5, 0.3  # 1/K, of steel
LAYER = """[[layer]]
name = "bed"
between = ["plate.BOTTOM", "ground"]
normal = 2000.0
tangential = 1000.0
"""
BED = '"bed.normal" = {path = "layer.bed.normal"}\n'
HOT = '[components.plate]\nmesh = "plate.inp"\nmaterials.STEEL.thermal_expansion = 1.1e-5\n'


def blocks(folder, heat, *changes, parameters=""):
    """The two blocks with a hot plate."""
    hot = f"{HOT}heat = {{ {heat} }}\n"
    path = write_blocks(folder, ('[components.plate]\nmesh = "plate.inp"\n', hot), *changes)
    model = folder / "blocks.toml"
    model.write_text(model.read_text() + parameters)
    return path, model


def fixed(*sets):
    """The plate held by these sets alone, (name, directions)."""
    held = "".join(f'[[fixed]]\nset = "plate.{name}"\ndofs = {dofs}\n' for name, dofs in sets)
    return (LAYER, held), (BED, "")


def contact_of(model, **values):
    return sq.model(str(model), **values).at().assembly.contact


CUPS = [  # facets of four nodes are chords between corners
    ("C3D20", (4, 2, 1), 1e-9),
    ("C3D20R", (4, 2, 1), 1e-9),
    ("C3D10", (4, 2, 1), 1e-9),
    ("C3D8I", (16, 6, 1), 0.01),
]


@pytest.mark.parametrize(("formulation", "cells", "error"), CUPS)
def test_a_temperature_linear_through_the_thickness_cups_a_free_plate(
    tmp_path, formulation, cells, error
):
    """By the curvature alpha dT / h, in all directions, with no stress; motions count for none."""
    _, model = blocks(tmp_path, "gradient = [0.0, 0.0, 50.0]", *fixed())
    plate = block("plate", cells, (8.0, 3.0, 2.0), "STEEL", formulation)
    write_inp(plate, tmp_path / "plate.inp")
    contact = contact_of(model)
    x, y = contact.points[:, 0], contact.points[:, 1]
    opened = ALPHA * 50e3 * (x**2 + y**2) / 2  # the master's middle stands out
    rigid = np.column_stack([np.ones_like(x), x, y])
    off = contact.gap0 - opened
    off -= rigid @ np.linalg.lstsq(rigid, off)[0]
    bent = opened - rigid @ np.linalg.lstsq(rigid, opened)[0]
    assert np.abs(off).max() < error * np.abs(bent).max()


def test_a_plate_that_stands_on_the_ground_grows_by_its_height(tmp_path):
    """And by 1 + nu of that where its ends are held: it expands as it is held."""
    stands = ("BOTTOM", [3])
    _, model = blocks(tmp_path / "free", "rise = 100.0", *fixed(stands))
    grown = ALPHA * 100.0 * 2e-3
    assert contact_of(model).gap0 == pytest.approx(-grown, rel=1e-7)
    _, model = blocks(tmp_path / "held", "rise = 100.0", *fixed(stands, ("ENDS", [1])))
    assert contact_of(model).gap0 == pytest.approx(-(1 + NU) * grown, rel=1e-7)


def hot_file(folder, name="hot.csv", places=None, names="node, x, y, z, temperature"):
    """20 + 3 x - 2 y + 50 z degrees over mm, at the nodes of the plate or at places."""
    if places is None:
        places = block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL").nodes
    warm = 20.0 + places @ [3.0, -2.0, 50.0]
    rows = [
        f"{i},{x:.12g},{y:.12g},{z:.12g},{t:.12g}"
        for i, ((x, y, z), t) in enumerate(zip(places, warm, strict=True))
    ]
    (folder / name).write_text("\n".join([names, *rows]) + "\n")


def test_temperatures_of_a_file_are_those_of_its_places(tmp_path):
    """At nodes, and linear between other places, in the coordinates of the component's file."""
    moved = (
        "heat = {",
        "translate = [0.0, 0.0, -1.0]\nrotate = {axis = [0.0, 0.0, 1.0], "
        "angle = 180.0, point = [4.0, 1.5, 0.0]}\nheat = {",
    )
    lower = ("translate = [1.5, 0.5, 2.0]", "translate = [1.5, 0.5, 1.0]")
    gaps = []
    grid = np.stack(np.meshgrid(*(np.linspace(0, n, 5) for n in (8.0, 3.0, 2.0))), -1)
    for name, heat in (
        ("linear", "gradient = [3.0, -2.0, 50.0]"),
        ("nodes", 'file = "hot.csv", reference = 20.0'),
        ("grid", 'file = "hot.csv", reference = 20.0'),
    ):
        _, model = blocks(tmp_path / name, heat, lower)
        model.write_text(model.read_text().replace(*moved, 1))
        hot_file(tmp_path / name, places=grid.reshape(-1, 3) if name == "grid" else None)
        gaps.append(contact_of(model).gap0)
    assert np.ptp(gaps[0]) > 1e-7
    assert gaps[1] == pytest.approx(gaps[0], abs=1e-9 * np.abs(gaps[0]).max())
    assert gaps[2] == pytest.approx(gaps[0], abs=1e-9 * np.abs(gaps[0]).max())


def test_the_steady_contact_is_the_equilibrium_of_hot_parts(tmp_path):
    """Pressures are those of all forces at once, K u + contact = load + thermal forces."""
    _, model = blocks(tmp_path, "rise = 5.0, gradient = [0.0, 0.0, 4.0]")
    brake = sq.model(str(model), contact_law="bilateral")
    steady = brake.at(friction=0.0, pressure=2e6).steady
    definition = read_model(model)
    options = {o.name: o.choices[0] for o in definition.options} | {"contact_law": "bilateral"}
    assembly = definition.build(options, definition.defaults())
    contact = assembly.contact
    mesh = block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL")
    strains = {"STEEL": ALPHA}
    rise = 5.0 + 4.0 * mesh.nodes[:, 2]
    forces = thermal_forces(mesh, rise, strains)  # MPa mm2 = N
    load = 2e6 * assembly.load
    load[assembly.slices["plate"]] += forces
    stiffness = float(contact.law.evaluate(np.array([1e-7]))[1][0])
    pressed = contact.N.T @ sp.diags(stiffness * contact.area) @ contact.N
    K = assembly.K_el + assembly.K_springs(static=True) + pressed
    u = sp.linalg.spsolve(K.tocsc(), load)
    pressure = -stiffness * (contact.N @ u)
    assert np.ptp(pressure) > 0.1 * np.abs(pressure).max()
    assert steady.pressure == pytest.approx(pressure, abs=1e-7 * np.abs(pressure).max())


def test_the_scale_is_swept(tmp_path):
    """Gaps follow it, and so do pressures; 0 is the cold brake."""
    scale = '"disc.heat" = {path = "plate.heat.scale", unit = ""}\n'
    path, model = blocks(tmp_path, "gradient = [0.0, 0.0, 30.0]", parameters=scale)
    none, once, twice = (contact_of(model, **{"disc.heat": s}).gap0 for s in (0.0, 1.0, 2.0))
    assert (none == 0.0).all()
    assert twice == pytest.approx(2 * once, rel=1e-12)
    text = path.read_text().replace(
        '"friction"\nvalues = [0.3, 0.6]', '"disc.heat"\nvalues = [0.0, 0.5]'
    )
    path.write_text(text.replace("reference_points = 1", "reference_points = 0"))
    found = solved(sq.read_study(path).plan(), tmp_path / "out")
    assert (found.points["status"] == "ok").all()
    highest = found.points["contact_pressure_max"]
    assert highest[1] > 1.05 * highest[0]


def test_expansion_is_a_parameter(tmp_path):
    more = '"steel.alpha" = {path = "plate.materials.STEEL.thermal_expansion", unit = "1/K"}\n'
    _, model = blocks(tmp_path, "rise = 40.0", parameters=more)
    once = contact_of(model).gap0
    assert contact_of(model, **{"steel.alpha": 2.2e-5}).gap0 == pytest.approx(2 * once, rel=1e-9)


NO_ALPHA = ("materials.STEEL.thermal_expansion = 1.1e-5\n", "")
BAD = [
    ("rise = 1.0", NO_ALPHA, "heat", "its material STEEL does not say how it expands"),
    ('file = "hot.csv"', None, "heat", "expected file and reference"),
    ("scale = 2.0", None, "heat", "expected file and reference, or rise and gradient"),
    ('file = "hot.csv", reference = 20.0, rise = 3.0', None, "heat", "or rise and gradient"),
    ('file = "cold.csv", reference = 20.0', None, "heat.file", "there is no file cold.csv"),
]


@pytest.mark.parametrize(("heat", "change", "key", "words"), BAD)
def test_bad_heat_is_one_sentence(tmp_path, heat, change, key, words):
    _, model = blocks(tmp_path, heat)
    hot_file(tmp_path)
    if change:
        model.write_text(model.read_text().replace(*change))
    with pytest.raises(StudyFileError) as told:
        sq.model(str(model)).at().assembly  # noqa: B018
    assert f"components.plate.{key}" in str(told.value)
    assert words in str(told.value)


PLACES = np.array([[x, y, z] for x in (0.0, 8.0) for y in (0.0, 3.0) for z in (0.0, 2.0)])
FILES = [
    (
        PLACES + np.array([40.0, 0.0, 0.0]),
        "node, x, y, z, temperature",
        "100 % of the component's nodes lie",
    ),
    (PLACES, "node, x, y, z, T", "there is no column 'temperature'"),
    (PLACES[:3], "node, x, y, z, temperature", "places all over the component, got 3"),
    (PLACES * [1.0, 1.0, 0.0], "node, x, y, z, temperature", "has two temperatures"),
    (PLACES[::2], "node, x, y, z, temperature", "not in one plane"),
]


@pytest.mark.parametrize(("places", "names", "words"), FILES)
def test_a_bad_file_of_temperatures_is_one_sentence(tmp_path, places, names, words):
    _, model = blocks(tmp_path, 'file = "hot.csv", reference = 20.0')
    hot_file(tmp_path, places=places, names=names)
    if words.startswith("has two"):
        rows = (tmp_path / "hot.csv").read_text()
        (tmp_path / "hot.csv").write_text(rows + "9, 0, 0, 0, 900\n")
    with pytest.raises(StudyFileError) as told:
        sq.model(str(model)).at().assembly  # noqa: B018
    assert "components.plate.heat.file" in str(told.value)
    assert words in str(told.value)


def test_check_tells_the_scale_of_the_study(tmp_path, capsys):
    scale = '"hot" = {path = "plate.heat.scale", unit = ""}\n'
    path, _ = blocks(tmp_path, "rise = 1.0", parameters=scale)
    study = path.read_text()
    for value, text in ((0.5, "heat has expanded plate: 0.5 times"), (0.0, "plate is cold")):
        path.write_text(f"{study}[parameters]\nhot = {value}\n")
        assert command("check", str(path)) == 0
        assert text in " ".join(capsys.readouterr().out.split())


def test_a_scale_of_no_heat_is_no_parameter(tmp_path):
    scale = '"hot" = {path = "slider.heat.scale"}\n'
    _, model = blocks(tmp_path, "rise = 1.0", parameters=scale)
    with pytest.raises(StudyFileError, match=r"slider with .*heat\.scale"):
        sq.model(str(model))


@pytest.mark.full_size  # by default of worn faces: test_wear.py
def test_inspect_check_and_report_say_that_the_plate_is_hot(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path, model = blocks(tmp_path / "hot", "rise = 30.0, gradient = [0.0, 0.0, 10.0]")
    gap = 1e3 * contact_of(model).gap0
    assert command("inspect", str(model)) == 1  # parts so small are doubted
    screen = " ".join(capsys.readouterr().out.split())
    assert "plate is 30 to 50 K above its mesh" in screen
    assert f"contact_1 opens by {gap.min():.3g} to {gap.max():.3g} mm" in screen
    said = "heat has expanded plate: 1 times the temperatures of a linear field"
    assert command("check", str(path)) == 0
    assert said in " ".join(capsys.readouterr().out.split())
    results = solved(sq.read_study(path).plan(), tmp_path / "out")
    assert said in quickly(results)
