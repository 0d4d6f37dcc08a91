"""Temperature of a component as a parameter of a study: moduli of its deck follow."""

from __future__ import annotations

import pytest
from own_blocks import write_blocks
from study_runs import solved
from test_component_judge import apart
from test_component_nastran import deck
from test_deck_bulk import BOX, TABLE, written
from test_model_file import built

from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.bodies import body_matrices
from squealstudy.models.components.model_file import TEMPERATURE
from squealstudy.study.components import build_of, read_model
from squealstudy.study.definition import load_study

COLD = "*ELASTIC, TYPE=ISO\n210000.0, 0.3\n"
WARM = "*ELASTIC, TYPE=ISO\n210000.0, 0.3, 20.\n150000.0, 0.3, 220.\n"
PLATE = 'mesh = "plate.inp"'
KEY = '"plate.temperature" = {path = "plate.temperature"}\n'


def write(folder, parameter=KEY, key="temperature = 20.0"):
    write_blocks(
        folder,
        (PLATE, f"{PLATE}\n{key}"),
        ("[parameters]", f"[parameters]\n{parameter}"),
    )
    text = (folder / "plate.inp").read_text()
    assert COLD in text
    (folder / "plate.inp").write_text(text.replace(COLD, WARM))
    return folder / "blocks.toml"


def test_moduli_follow_the_temperature(tmp_path):
    path = write(tmp_path)
    cold, warm, hot = (
        built(path, **values).components[0].K
        for values in ({}, {"plate.temperature": 120.0}, {"plate.temperature": 400.0})
    )
    assert apart(warm, cold * (18 / 21)) < 1e-12
    assert apart(hot, cold * (15 / 21)) < 1e-12  # constant beyond


def test_a_sweep_over_temperature(tmp_path):
    write(tmp_path)
    text = (tmp_path / "study.toml").read_text()
    sweep = '[[sweep]]\nparameter = "plate.temperature"\nvalues = [20.0, 220.0]\n\n[modes]'
    (tmp_path / "study.toml").write_text(text.replace("[modes]", sweep))
    results = solved(Plan(load_study(tmp_path / "study.toml")), tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    first = results.modes.groupby("point_id", sort=False)["frequency_hz"].max()
    assert len(set(first.round(1))) > 1


def test_materials_of_the_model_file_stay(tmp_path):
    path = write(tmp_path)
    text = path.read_text()
    stated = "[components.plate.materials]\nSTEEL = {E = 1e5, nu = 0.3}\n\n[components.slider]"
    path.write_text(text.replace("[components.slider]", stated))
    cold, warm = (built(path, **v).components[0].K for v in ({}, {"plate.temperature": 120.0}))
    assert apart(warm, cold) == 0.0


@pytest.mark.parametrize(
    ("parameter", "key", "message"),
    [
        (KEY, "", "'plate.temperature' is no number in the file"),
        (KEY.replace('ture"}', 'tur"}'), "temperature = 1.0", "with mass_damping, "),
        (KEY.replace("}", ', unit = "bar"}'), "temperature = 1.0", "expected no unit"),
    ],
)
def test_paths_that_are_none(tmp_path, parameter, key, message):
    with pytest.raises(StudyFileError, match=message):
        built(write(tmp_path, parameter, key))


def test_temperatures_that_the_deck_does_not_reach(tmp_path):
    more = ["PARAM,COUPMASS,1", "MATT1,7,4", TABLE["TABLEM1"]]
    (tmp_path / "a.bdf").write_text(deck(written(BOX), more=more))
    (tmp_path / "m.toml").write_text(
        'units = "t-mm-s"\n[components.plate]\nmesh = "a.bdf"\ntemperature = 0.0\n'
        f"[parameters]\n{KEY}"
    )
    brake = build_of(read_model(tmp_path / "m.toml", unfinished=True)).brake

    def at(temperature):
        return body_matrices(brake, "plate", {("components", "plate", TEMPERATURE): temperature})[0]

    assert apart(at(100.0), at(0.0) * (19 / 21)) < 1e-6
    with pytest.raises(
        ModelError, match=r"temperature = 300 is outside of the table, .* from 0 to 200"
    ):
        at(300.0)
