"""Materials that a deck states in part, or not at all: the model file has the last word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import LINING, box
from own_blocks import write_blocks
from test_component_judge import apart
from test_component_nastran import deck
from test_model_file import built

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.file_materials import changed_material
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.materials import Anisotropic
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.nastran import read_bdf

PLATE = 'mesh = "plate.inp"'
CUBE = """*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=E
1,1,2,3,4,5,6,7,8
*MATERIAL, NAME=M
*SOLID SECTION, ELSET=E, MATERIAL=M
"""


def plate(folder, cut=("", ""), stated=""):
    """The plate's component where something of its deck is cut, and the model file states some."""
    lines = f"{PLATE}\n[components.plate.materials]\n{stated}" if stated else PLATE
    write_blocks(folder, (PLATE, lines))
    text = (folder / "plate.inp").read_text()
    assert cut[0] in text
    (folder / "plate.inp").write_text(text.replace(*cut))
    return built(folder / "blocks.toml").components[0]


DENSITY = "*DENSITY\n7.8e-09\n"
ELASTIC = "*ELASTIC, TYPE=ISO\n210000.0, 0.3\n"
NAME = "*MATERIAL, NAME=STEEL"


@pytest.mark.parametrize(
    ("cut", "stated"),
    [
        ((DENSITY, ""), "STEEL = {rho = 7.8e-9}"),
        ((DENSITY, ""), "STEEL = {E = 2.1e5, nu = 0.3, rho = 7.8e-9}"),
        ((ELASTIC, ""), "STEEL = {E = 2.1e5, nu = 0.3}"),
        ((ELASTIC, "*HYPERELASTIC, NEO HOOKE\n1., 2.\n"), "STEEL = {E = 2.1e5, nu = 0.3}"),
        ((ELASTIC, "*USER MATERIAL, CONSTANTS=2\n1., 2.\n"), "STEEL = {E = 2.1e5, nu = 0.3}"),
        ((ELASTIC, "*ELASTIC\n1e5, 0.3\n"), "STEEL = {E = 2.1e5}"),
        ((NAME, "*MATERIAL, NAME=OTHER"), "STEEL = {E = 2.1e5, nu = 0.3, rho = 7.8e-9}"),
    ],
)  # fmt: skip
def test_the_model_file_states_what_the_deck_does_not(tmp_path, cut, stated):
    expected = plate(tmp_path / "whole")
    found = plate(tmp_path / "cut", cut, stated)
    assert apart(found.K, expected.K) < 1e-13
    assert apart(found.M, expected.M) < 1e-13


@pytest.mark.parametrize(
    ("cut", "stated", "message"),
    [
        ((DENSITY, ""), "", r"material 'STEEL' has no \*DENSITY: state it in \[components.plate.m"),
        ((ELASTIC, ""), "", r"has no \*ELASTIC: state it in \[components\.plate\.materials\.STEEL"),
        ((ELASTIC, "*HYPERELASTIC\n1.\n"), "", r"'STEEL' is \*HYPERELASTIC, which is not read: st"),
        ((DENSITY, ""), "STEEL = {E = 1e5, nu = 0.3}", r"rho is missing; .*no \*DENSITY"),
        ((ELASTIC, ""), "STEEL = {nu = 0.3}", r"E is missing; .*no \*ELASTIC"),
        (("", ""), "STEEL = {E = [1, 2, 3]}", r"material STEEL has one, not E\[1\]"),
    ],
)  # fmt: skip
def test_what_nobody_states_is_told_with_the_table(tmp_path, cut, stated, message):
    with pytest.raises((ModelError, StudyFileError), match=message):
        plate(tmp_path, cut, stated)


def test_one_that_no_element_has_may_lack_anything(tmp_path):
    found = plate(tmp_path / "more", ("*MATERIAL, NAME=STEEL", "*MATERIAL, NAME=STEEL"))
    extra = plate(
        tmp_path, ("*MATERIAL, NAME=STEEL", "*MATERIAL, NAME=NOTHING\n*MATERIAL, NAME=STEEL")
    )
    assert apart(extra.M, found.M) == 0.0


@pytest.mark.parametrize(("at", "E", "rho"), [(0, 2e5, 8e-9), (150, 1.5e5, 7e-9), (999, 1e5, 6e-9)])
def test_materials_over_temperature(tmp_path, at, E, rho):
    table = "*ELASTIC\n2e5,.3,100.\n1e5,.3,200.\n*DENSITY\n8e-9,100\n6e-9,200.\n"
    plain = f"*ELASTIC\n{E},.3\n*DENSITY\n{rho}\n"
    (tmp_path / "t.inp").write_text(CUBE.replace("*SOLID", f"{table}*SOLID"))
    (tmp_path / "p.inp").write_text(CUBE.replace("*SOLID", f"{plain}*SOLID"))
    found, expected = read_inp(tmp_path / "t.inp", temperature=at), read_inp(tmp_path / "p.inp")
    assert apart(stiffness_matrix(found), stiffness_matrix(expected)) < 1e-14
    assert apart(mass_matrix(found), mass_matrix(expected)) < 1e-14
    np.testing.assert_allclose(mass_matrix(found).sum(), 3 * rho)
    with pytest.raises(ModelError, match=r"has values at 2 temperatures: expected temperature"):
        mass_matrix(read_inp(tmp_path / "t.inp"))


def uneven():
    """21 moduli that no symmetry has, in the order of keyword files."""
    A = np.random.default_rng(1).uniform(-1, 1, (6, 6))
    return Anisotropic.of_stiffness(1e4 * (A @ A.T + np.eye(6)), 2.5e-9)


def test_21_moduli_are_written_and_read(tmp_path):
    mesh = box("C3D8", (2, 1, 1), uneven=0.1, materials={"S": uneven()})
    write_inp(mesh, tmp_path / "a.inp")
    found = read_inp(tmp_path / "a.inp")
    assert found.materials["S"] == uneven()
    assert apart(stiffness_matrix(found), stiffness_matrix(mesh)) == 0.0


def test_21_moduli_of_an_orthotropic_material(tmp_path):
    mesh = box("C3D8", (2, 1, 1), uneven=0.1, materials={"S": LINING})
    full = Anisotropic.of_stiffness(LINING.stiffness(), LINING.density)
    assert apart(stiffness_matrix(mesh.with_material("S", full)), stiffness_matrix(mesh)) < 1e-14


def test_21_moduli_of_nastran(tmp_path):
    """Its order of shears is xy, yz, zx."""
    C = uneven().stiffness()
    order = [0, 1, 2, 5, 3, 4]
    words = [repr(float(C[order[i], order[j]])) for i in range(6) for j in range(i, 6)]
    words += ["2.5-9"]
    lines = [",".join(words[k : k + 8]) for k in range(7, len(words), 8)]
    card = "MAT9,7," + ",".join(words[:7]) + "".join(f"\n+,{line}" for line in lines)
    mesh = box("C3D8", (2, 1, 1), materials={"S": uneven()})
    text = deck(replace(mesh, blocks=(replace(mesh.blocks[0], formulation="C3D8I"),)))
    text = "\n".join(card if line.startswith("MAT1") else line for line in text.split("\n"))
    (tmp_path / "a.bdf").write_text(text)
    found = read_bdf(tmp_path / "a.bdf", treat_as={"CHEXA8": "C3D8"})
    assert apart(stiffness_matrix(found), stiffness_matrix(mesh)) < 1e-12
    assert apart(mass_matrix(found), mass_matrix(mesh)) < 1e-12


ORTHOTROPIC = ["9+3", "7+3", "2+3", ".2", ".1", ".15", "1.5+3", "1.2+3", "3+3", "2.5-9"]
STIFF = [str(1e3 * (i == j)) for i in range(6) for j in range(i, 6)]


@pytest.mark.parametrize(
    "fields",
    [
        ["MAT1", "7", "2.1+5", "", "0.3", "7.8-9", "", "", "0.02"],
        ["MAT11", "7", *ORTHOTROPIC, *[""] * 4, "0.02"],
        ["MAT9", "7", *STIFF, "2.5-9", *[""] * 7, "0.02"],
    ],
)
def test_damping_of_a_material_is_passed_over_and_told(fields, tmp_path):
    """GE is no number of the model: the model file states damping."""
    name, *rest = fields
    card = "\n+,".join(",".join(rest[k : k + 8]) for k in range(0, len(rest), 8))
    mesh = box("C3D8I", (2, 1, 1), materials={"S": uneven()})
    lines = [
        f"{name},{card}" if line.startswith("MAT1") else line for line in deck(mesh).split("\n")
    ]
    (tmp_path / "a.bdf").write_text("\n".join(lines))
    notes = read_bdf(tmp_path / "a.bdf", treat_as={"CHEXA8": "C3D8I"}).passed_over
    assert [n.keyword for n in notes if n.why.startswith("damping")] == [name]


def test_of_21_moduli_the_density_can_be_changed(tmp_path):
    name = ("components", "p", "materials", "S")
    found = changed_material(uneven(), {(*name, "rho"): 3e-9}, "S")
    assert (found.density, found.entries) == (3e-9, uneven().entries)
    with pytest.raises(ModelError, match="has 21 moduli: its rho alone can be changed"):
        changed_material(uneven(), {(*name, "E"): 1e5}, "S")
