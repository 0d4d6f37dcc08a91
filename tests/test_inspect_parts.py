"""`squealstudy inspect` of a mesh alone, and of a model file that is not finished."""

from __future__ import annotations

import pytest
from test_component_nastran import deck
from test_inspect import mesh, model, said

from squealstudy.errors import StudyFileError
from squealstudy.models.components.inp_writer import write_inp
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
    assert "not read: *BOUNDARY (line" in facts
    assert "not yet contact, load, rotation" in facts
    assert picture.is_file()
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
    assert "TOP (8 facets, 2400 mm2)" in facts
    assert "has no *DENSITY: state it in [components.plate.materials.STEEL]" in messages


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
