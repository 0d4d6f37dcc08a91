"""Faces that sliding has worn: Archard's law, up to where pressure times speed is uniform."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import write_blocks
from study_runs import command, solved
from test_report import quickly

import squealstudy as sq
from squealstudy.errors import StudyFileError

RATE = 1e-14  # 1/Pa
WEAR = """
[wear]
pressure = 2.0
friction = 0.3
distance = {distance}
rate = {rate}
"""


def blocks(folder, distance=0.0, rate=1e6 * RATE, parameters="", point="[4.0, -3.0, 0.0]"):
    """A slider near the axis: its outermost points slide half as fast again as the innermost."""
    folder.mkdir(exist_ok=True)
    path = write_blocks(folder)
    model = folder / "blocks.toml"
    text = model.read_text().replace("point = [4.0, -100.0, 0.0]", f"point = {point}")
    head, tail = text.split("[parameters]\n")
    wear = WEAR.format(distance=distance, rate=rate)  # of t-mm-s: mm, 1/MPa
    model.write_text(f"{head}{wear}\n[parameters]\n{parameters}{tail}")
    return path, model


def steady(model, **values):
    system = sq.model(str(model), **values).at(friction=0.3, pressure=2e6)
    return system.assembly.contact, system.steady


def test_pressure_times_speed_becomes_uniform(tmp_path):
    """p v is one number: the pressing force over the integral of 1 / v. Guides hold the tilt."""
    _, model = blocks(tmp_path, distance=1e7)
    soft = model.read_text().replace("[2e4, 1.5e4, 1e3]", "[2e4, 1.5e4, 1e-3]")
    model.write_text(soft.replace("friction = 0.3\ndist", "friction = 0.0\ndist"))
    system = sq.model(str(model)).at(friction=0.0, pressure=2e6)
    contact, pressure = system.assembly.contact, system.steady.pressure
    even = 20.0 / (contact.area @ (1.0 / contact.speed_factor))  # 2 MPa on 10 mm2 press with 20 N
    assert contact.speed_factor.max() > 1.5 * contact.speed_factor.min()
    assert pressure * contact.speed_factor == pytest.approx(even, rel=1e-4)
    new, before = steady(blocks(tmp_path / "new")[1])
    assert np.abs(before.pressure * new.speed_factor / even - 1).max() > 0.3  # it was not so


def test_a_short_way_wears_by_the_first_pressures(tmp_path):
    """rate p v s, of the pressures of new faces; gaps differ by nothing else."""
    _, model = blocks(tmp_path, distance=1.0)
    contact, _ = steady(model)
    new, before = steady(blocks(tmp_path / "new")[1])
    depth = contact.gap0 - new.gap0
    expected = RATE * 1e-3 * before.pressure * new.speed_factor
    assert depth == pytest.approx(expected, rel=1e-3)
    assert (depth > 0).all()


def test_the_way_there_is_one(tmp_path):
    """Where wear is fast, twice the rate over half the distance is the same."""
    once, _ = steady(blocks(tmp_path / "a", distance=1e7)[1])
    other, _ = steady(blocks(tmp_path / "b", distance=5e6, rate=2e6 * RATE)[1])
    assert other.gap0 == pytest.approx(once.gap0, rel=2e-3)


def test_the_distance_is_swept(tmp_path):
    """A worn contact has other modes; a study says at which distance."""
    path, _ = blocks(tmp_path, parameters='"worn" = {path = "wear.distance", unit = "m"}\n')
    text = path.read_text().replace(
        '"friction"\nvalues = [0.3, 0.6]', '"worn"\nvalues = [0.0, 1e6]'
    )
    assert '"worn"' in text
    path.write_text(text.replace("reference_points = 1", "reference_points = 0"))
    found = solved(sq.read_study(path).plan(), tmp_path / "out")
    assert (found.points["status"] == "ok").all()
    highest = found.points["contact_pressure_max"]
    assert highest[1] < 0.9 * highest[0]


BAD = [
    ("distance = 1.0", "distance = -1.0", "wear.distance", "at least 0"),
    ("rate = ", "rate = -", "wear.rate", "more than 0"),
    ("pressure = 2.0\n", "", "wear", "'pressure' is missing"),
    ("friction = 0.3", "friction = 900.0", "wear", "no steady sliding that wears the faces"),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), BAD)
def test_bad_wear_is_one_sentence(tmp_path, old, new, key, words):
    _, model = blocks(tmp_path, distance=1.0)
    text = model.read_text()
    assert text.count(old) >= 1
    model.write_text(text.replace(old, new))
    with pytest.raises(StudyFileError) as told:
        sq.model(str(model)).at().assembly  # noqa: B018
    assert key in str(told.value)
    assert words in str(told.value)


def test_a_distance_that_cannot_be_is_a_failed_point_alone(tmp_path):
    """The new brake beside it is solved, and the screen says what the other lacks."""
    path, model = blocks(tmp_path, parameters='"worn" = {path = "wear.distance", unit = "m"}\n')
    model.write_text(model.read_text().replace("friction = 0.3\ndist", "friction = 900.0\ndist"))
    swept = path.read_text().replace("values = [0.3, 0.6]", "values = [0.3]")
    swept += 'reference_points = 0\n[[sweep]]\nparameter = "worn"\nvalues = [0.0, 1.0]\n'
    path.write_text(swept.replace("reference_points = 1\n", ""))
    found = solved(sq.read_study(path).plan(), tmp_path / "out")
    points = found.points.sort_values("worn")
    assert points["status"].tolist()[0] == "ok"
    assert points["status"].tolist()[1] != "ok"
    assert "worn = 1 (SI): there is no steady sliding that wears" in points["message"].iloc[1]


def test_check_tells_the_distance_of_the_study(tmp_path, capsys):
    """By its name where it is swept; new faces are no worn ones."""
    path, _ = blocks(tmp_path, parameters='"worn" = {path = "wear.distance", unit = "m"}\n')
    study = path.read_text()
    at = "of sliding at 2 MPa and a friction of 0.3 have worn the faces, at a rate of 1e-14 1/Pa"
    told = {
        "": "the faces are new: the distance of [wear] is 0",
        "[parameters]\nworn = 300.0\n": f"300 m {at}",
        '[[sweep]]\nparameter = "worn"\nvalues = [0.0, 1.0]\n': f"'worn' {at}",
    }
    for more, text in told.items():
        path.write_text(study + more)
        assert command("check", str(path)) == 0
        screen = " ".join(capsys.readouterr().out.split())
        assert text in screen
        assert ("are new" in screen) == (not more)


def test_a_parameter_of_wear_that_is_none(tmp_path):
    _, model = blocks(tmp_path, parameters='"x" = {path = "wear.depth"}\n')
    with pytest.raises(StudyFileError, match=r"expected wear\.distance or wear\.rate"):
        sq.model(str(model))


def test_parts_without_a_mode_below_the_cut_off_have_a_steady_state(tmp_path):
    """Small stiff blocks under the default settings: static shapes alone."""
    _, model = blocks(tmp_path)
    system = sq.model(str(model)).at(friction=0.3, pressure=2e6)
    assert system.steady.status == "ok"
    assert 0 < system.steady.force[:, 0].sum() < 20.0  # N: the guides bear the rest


def test_inspect_check_and_report_say_that_faces_are_worn(tmp_path, monkeypatch, capsys):
    """Depths are the gaps that have opened; a distance of 0 leaves new faces, and says so."""
    monkeypatch.chdir(tmp_path)
    path, model = blocks(tmp_path / "worn", distance=1e6)
    contact, _ = steady(model)
    new, _ = steady(blocks(tmp_path / "new")[1])
    depth = 1e3 * (contact.gap0 - new.gap0)  # mm
    assert command("inspect", str(model)) == 1  # parts so small are doubted
    screen = " ".join(capsys.readouterr().out.split())
    assert "1e+06 mm of sliding at 2 MPa and a friction of 0.3 wore off contact_1" in screen
    assert f"{depth.min():.3g} to {depth.max():.3g} mm" in screen
    assert command("inspect", str(tmp_path / "new" / "blocks.toml")) == 1
    assert "the faces are new: the distance of [wear] is 0" in capsys.readouterr().out
    said = "1000 m of sliding at 2 MPa and a friction of 0.3 have worn the faces"
    assert command("check", str(path)) == 0
    assert said in " ".join(capsys.readouterr().out.split())
    results = solved(sq.read_study(path).plan(), tmp_path / "out")
    assert said in quickly(results)
