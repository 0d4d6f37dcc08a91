"""Initial gaps of a contact that were measured: a file of places on its face."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import write_blocks

import squealstudy as sq
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.face_map import FaceMap

CONTACT = "search = 0.1\n"


def plane(x, y):
    """A tilted face, um over mm: gaps in mm."""
    return 1e-3 * (2.0 + 0.5 * x - 0.3 * y)


def write_map(folder, names="x, y, gap", place=lambda x, y: (x, y), gap=plane):
    rows = [names]
    for x in np.linspace(0.0, 5.0, 7):
        values = ((*place(x, y), gap(x, y)) for y in np.linspace(0.0, 4.0, 7))
        rows += [", ".join(f"{v:.9g}" for v in row) for row in values]
    (folder / "film.csv").write_text("\n".join(rows) + "\n")


def blocks(folder, initial='{ file = "film.csv" }', more="", parameters=""):
    path = write_blocks(folder)
    model = folder / "blocks.toml"
    text = model.read_text().replace(
        CONTACT, f'name = "pads"\n{CONTACT}initial_gap = {initial}\n{more}', 1
    )
    model.write_text(text + parameters)
    return path, model


def gaps_and_points(model):
    contact = sq.model(str(model)).at().assembly.contact
    return contact.gap0, contact.points


def test_contact_points_have_the_gaps_of_the_file(tmp_path):
    """Of a plane exactly; places are those of the slave's own file, before it was moved."""
    _, model = blocks(tmp_path)
    write_map(tmp_path)
    gap, points = gaps_and_points(model)
    own = 1e3 * points - [1.5, 0.5, 2.0]  # mm; the slider's translation
    assert np.ptp(gap) > 1e-7
    assert gap == pytest.approx(1e-3 * plane(own[:, 0], own[:, 1]), rel=1e-9)


def test_axes_in_any_order_and_three_of_them(tmp_path):
    _, model = blocks(tmp_path)
    write_map(tmp_path)
    expected, _ = gaps_and_points(model)
    other = tmp_path / "other"
    other.mkdir()
    _, model = blocks(other)
    write_map(other, names="Y; Z; X; gap", place=lambda x, y: (y, 0.0, x))
    (other / "film.csv").write_text((other / "film.csv").read_text().replace(", ", "; "))
    assert gaps_and_points(model)[0] == pytest.approx(expected, rel=1e-9)


def test_a_scale_of_the_gaps_is_a_parameter(tmp_path):
    """0 is a flat face, 2 twice as uneven; the study sweeps it."""
    parameters = '"film.scale" = {path = "contact.pads.gap_scale", unit = ""}\n'
    _, model = blocks(tmp_path, more="gap_scale = 1.0\n", parameters=parameters)
    write_map(tmp_path)
    brake = sq.model(str(model))
    once, none, twice = (
        brake.at(**{"film.scale": s}).assembly.contact.gap0 for s in (1.0, 0.0, 2.0)
    )
    assert (none == 0).all()
    assert twice == pytest.approx(2 * once, rel=1e-12)


def test_the_outermost_places_may_miss_the_edge(tmp_path):
    """Within two distances of neighbours the nearest place counts, beyond it is an error."""
    points = np.array([[0.0, 0.0, 0.0], [-0.1, 0.5, 3.0], [-0.21, 0.5, 3.0]])
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 1, 11)))
    lines = [f"{a:g} {b:g} {a + 10 * b:.12g}" for a, b in zip(x, y, strict=True)]
    (tmp_path / "film.csv").write_text("x y gap\n" + "\n".join(lines))
    found = FaceMap(tmp_path / "film.csv", 1e-3)
    assert found.at(1e-3 * points[:2]) == pytest.approx([0.0, 5e-3])
    with pytest.raises(ModelError, match=r"33.3 % of the contact points lie off its places"):
        found.at(1e-3 * points)


BAD = [
    ("x, y\n1, 2\n", "line 1: expected names x, y, gap, got x, y"),
    ("x, y, gap, p\n1, 2, 3, 4\n", "line 1: expected names x, y, gap, got x, y, gap, p"),
    ("x, y, gap\n1, 2\n", "line 2: expected 3 numbers, got 2"),
    ("x, y, gap\n\n1, 2, open\n", "line 3: expected numbers"),
    ("x, y, gap\n1, 2, nan\n", "line 2: expected finite numbers"),
    ("x, y, gap\n1_0, 2, 3\n", "line 2: expected numbers"),
    ("x, y, gap\n" + 200_000 * "x" + ", 2, 3\n", "line 2: expected numbers"),
    ("x, y, z, gap\n0, 0, 0, 1\n1, 0, 0, 2\n1, 1, 0, 1\n1, 1, 0.01, 5\n", "one above the other"),
    ("x, y, gap\n", "no places below"),
    ("", "is empty"),
    ("x, y, gap\n0, 0, 1\n1, 1, 1\n2, 2, 1\n", "places along one line"),
    ("x, y, gap\n0, 0, 1\n1, 1, 1\n", "three places or more that span a face, got 2"),
    ("x, y, gap\n0, 0, 1\n0, 0, 2\n1, 0, 1\n0, 1, 1\n", "the place 0, 0 has 2 gaps"),
    ("x, y, gap\n100, 0, 1\n101, 0, 2\n100, 1, 1\n", "100 % of the contact points lie off"),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_a_bad_map_is_one_sentence_with_its_key(tmp_path, text, words):
    study, _ = blocks(tmp_path)
    (tmp_path / "film.csv").write_text(text)
    with pytest.raises(StudyFileError) as told:
        sq.model(str(tmp_path / "blocks.toml")).at().assembly  # noqa: B018
    assert words in str(told.value)
    assert "contact[1].initial_gap.file" in str(told.value)
    assert study.exists()


def test_a_file_that_is_not_there_and_a_scale_of_nothing(tmp_path):
    study, model = blocks(tmp_path)
    with pytest.raises(StudyFileError, match=r"initial_gap\.file.*there is no file film\.csv"):
        sq.read_study(study)
    _, model = blocks(tmp_path, initial="0.1", more="gap_scale = 2.0\n")
    with pytest.raises(StudyFileError, match="gap_scale: expected only with a measured"):
        sq.read_study(study)
    parameters = '"film" = {path = "contact.pads.initial_gap"}\n'
    _, model = blocks(tmp_path, parameters=parameters)
    write_map(tmp_path)
    with pytest.raises(StudyFileError, match="is no number in the file"):
        sq.model(str(model))


def test_another_map_is_another_model(tmp_path):
    """Results name the model by the content of its files."""
    _, model = blocks(tmp_path)
    write_map(tmp_path)
    before, _ = gaps_and_points(model)
    write_map(tmp_path, gap=lambda x, y: 2 * plane(x, y))
    assert gaps_and_points(model)[0] == pytest.approx(2 * before, rel=1e-9)
