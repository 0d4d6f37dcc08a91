"""`squealstudy inspect` of a mesh alone, and of a model file that is not finished."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from component_meshes import STEEL, box
from test_component_nastran import deck
from test_inspect import mesh, model, said
from test_turning_superelements import write_frame

from squealstudy.errors import StudyFileError
from squealstudy.models.components.free_modes import FIRST_CUTOFF, first_cutoff, first_elastic
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.study.components import read_model


def test_a_part_alone(tmp_path, capsys):
    write_inp(mesh("plate"), tmp_path / "plate.inp", ["*BOUNDARY", "101, 1", "*CLOAD", "1,1,1."])
    picture = tmp_path / "plate.png"
    path = tmp_path / "plate.inp"
    code, facts, messages = said(capsys, path, "--picture", str(picture))
    assert (code, messages) == (0, "")
    assert "units t-mm-s" in facts
    assert "plate.inp: 89 nodes, 8 C3D20; materials STEEL" in facts
    assert "80 x 30 x 20 mm, 0.0003744 t (0.3744 kg), inertia 0.0406, 0.212, 0.228 t mm2" in facts
    assert "6 rigid modes, first free modes" in facts
    assert "TOP (8 facets, 2400 mm2)" in facts
    assert "node sets: CORNER (1)" in facts
    assert "of the file: *BOUNDARY (line" in facts
    assert "from [0, 0, 0] to [80, 30, 20] mm" in facts
    assert "not yet contact, load, rotation" in facts
    assert picture.is_file()
    assert f"free modes: {tmp_path / 'plate_modes.png'}" in " ".join(facts.split())
    assert (tmp_path / "plate_modes.png").stat().st_size > 10_000
    code, facts, messages = said(capsys, path, "--units", "SI")
    assert code == 1
    assert "which no part of a brake is: are its numbers in SI?" in messages
    assert "waves would run in STEEL at 6e+06 m/s: are moduli and densities in SI?" in messages


def test_a_part_without_density_is_told_as_far_as_it_goes(tmp_path, capsys):
    write_inp(mesh("plate"), tmp_path / "plate.inp")
    text = (tmp_path / "plate.inp").read_text()
    assert "*DENSITY\n7.8e-09\n" in text
    (tmp_path / "plate.inp").write_text(text.replace("*DENSITY\n7.8e-09\n", ""))
    code, facts, messages = said(capsys, tmp_path / "plate.inp")
    assert code == 1
    assert "89 nodes, 8 C3D20" in facts
    assert "from [0, 0, 0] to [80, 30, 20] mm" in facts
    assert "TOP (8 facets, 2400 mm2)" in facts
    assert "has no *DENSITY: state it in [components.plate.materials.STEEL]" in messages


def test_a_density_in_other_units_is_told_at_once(tmp_path, capsys):
    """All modes lie below 2 kHz then; rigid ones are still six, and few others are looked for."""
    write_inp(mesh("plate"), tmp_path / "plate.inp")
    text = (tmp_path / "plate.inp").read_text()
    (tmp_path / "plate.inp").write_text(text.replace("7.8e-09", "7.8e+03"))
    code, facts, messages = said(capsys, tmp_path / "plate.inp")
    assert code == 1
    assert "6 rigid modes, first free modes 0.0" in facts
    assert "waves would run in STEEL at" in messages


def test_free_modes_of_nothing_are_looked_for_from_somewhere():
    """From zero the search for elastic modes would never end."""
    nothing = sp.csr_matrix((9, 9))
    assert first_cutoff(nothing, sp.eye(9, format="csr")) == FIRST_CUTOFF
    assert first_cutoff(sp.eye(9, format="csr"), nothing) == FIRST_CUTOFF


def test_a_part_of_nastran_with_cards_that_may_matter(tmp_path, capsys):
    (tmp_path / "2 plate.bdf").write_text(deck(mesh("plate"), more=["CBAR,900,3,11,12"]))
    code, _, messages = said(capsys, tmp_path / "2 plate.bdf")
    assert code == 1
    assert 'where neither mass nor stiffness depend on them: pass_over = ["CBAR"]' in messages
    code, facts, _ = said(capsys, tmp_path / "2 plate.bdf", "--pass-over", "CBAR")
    assert code == 0
    assert "first free modes" in facts


def test_one_body_of_a_file(tmp_path, capsys):
    write_inp(mesh("plate"), tmp_path / "plate.inp")
    code, _, messages = said(capsys, tmp_path / "plate.inp", "--part", "LEFT")
    assert (code, "no element set 'LEFT'" in messages) == (1, True)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("absent.inp", (), "there is no file"),
        ("part.step", (), "expected a model file (.toml) or a mesh: one of .inp, .msh"),
        ("absent.inp", ("--units", "cgs"), "units 'cgs': expected one of SI, t-mm-s, mm-kg-ms"),
    ],
)
def test_what_is_no_part(tmp_path, capsys, name, options, message):
    code, _, messages = said(capsys, tmp_path / name, *options)
    assert code != 0
    assert message in messages


CONTACT = (
    '[[contact]]\nkind = "sliding"\nslave = "slider.BOTTOM"\nmaster = "plate.TOP"\nsearch = 0.1\n'
)
LOAD = '[[load]]\npressure_on = "slider.TOP"\narea = 10.0\n'


def test_a_model_file_is_built_up_by_looking(tmp_path, capsys):
    path = model(tmp_path, (LOAD, ""))
    code, facts, messages = said(capsys, path)
    assert (code, messages) == (0, "")
    assert facts.count("6 rigid modes") == 2
    assert "contact_1 sliding: slider.BOTTOM on plate.TOP, 27 points, 100.0 % of the" in facts
    assert "not yet load" in facts
    path = model(tmp_path, (LOAD, ""), (CONTACT, ""))
    code, facts, messages = said(capsys, path)
    assert (code, messages) == (0, "")
    assert "not yet contact, load" in facts
    with pytest.raises(StudyFileError, match=r"there is no \[\[contact\]\]: no faces in contact"):
        read_model(path)
    (tmp_path / "plate.inp").write_text("nothing")
    code, facts, messages = said(capsys, path)
    assert code == 1
    assert "slider.inp" in facts
    assert "plate: " in messages


def test_free_modes_that_are_drawn_are_those_of_the_part():
    """Of a slender bar: pairs of bending, up to the count asked for."""
    bar = box("C3D20", (10, 1, 1), (100.0, 10.0, 10.0), materials={"S": STEEL})
    K, M = stiffness_matrix(bar), mass_matrix(bar)
    hz, shapes = first_elastic(K * 1e3, M * 1e3, 4)
    beam = 4.73**2 / (2 * np.pi) * np.sqrt(2.1e11 * 10**2 / 12 / 7800) / 100**2 / 1e-3
    assert hz[0] == pytest.approx(hz[1], rel=1e-6)
    assert 0.9 < hz[0] / beam < 1.0
    assert shapes.shape == (K.shape[0], 4)


def test_nodes_alone_cannot_be_drawn(tmp_path, capsys):
    table = write_frame(tmp_path, 6)
    (tmp_path / "m.toml").write_text(f'units = "t-mm-s"\n{table}')
    picture = tmp_path / "m.png"
    code, _, messages = said(capsys, tmp_path / "m.toml", "--picture", str(picture))
    assert code == 2
    assert "there is nothing to draw: no component has solids" in messages
