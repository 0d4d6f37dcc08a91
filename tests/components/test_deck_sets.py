"""Surfaces of a model file by geometry: where the outer faces of a mesh are, and look."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import write_blocks

from squealstudy.errors import StudyFileError
from squealstudy.models.components.bodies import body_of
from squealstudy.study.components import build_of, read_model

SLIDER = "translate = [1.5, 0.5, 2.0]"


def surfaces(folder, text):
    """Surfaces of the slider, 5 x 2 x 2 mm, with sets of the model file."""
    write_blocks(folder, (SLIDER, f"{SLIDER}\n[components.slider.sets]\n{text}"))
    build = build_of(read_model(folder / "blocks.toml"))
    with build.told(build.defaults):
        return body_of(build.brake, "slider").mesh.surfaces


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("mine = {plane = {point = [0, 0, 2], normal = [0, 0, 1]}}", "TOP"),
        ("mine = {plane = {point = [9, 9, 2], normal = [0, 0, -3]}}", "TOP"),
        ("mine = {normal = [0, 0, -1]}", "BOTTOM"),
        ("mine = {box = [[0, 0, 2], [5, 2, 2]]}", "TOP"),
        ("mine = {box = [[5, 2, 2], [0, 0, 2]], normal = [0, 0.1, 1]}", "TOP"),
        ("mine = {plane = {point = [0, 0, 2.05], normal = [0, 0, 1]}, tolerance = 0.1}", "TOP"),
    ],
)
def test_faces_by_where_they_are(tmp_path, text, same):
    found = surfaces(tmp_path, text)
    np.testing.assert_array_equal(
        sorted(map(tuple, found["mine"])), sorted(map(tuple, found[same]))
    )


def test_faces_by_radius(tmp_path):
    """Of the top those between 0 and 2 mm of the axis through a corner; three cells along x."""
    text = """inner = {normal = [0, 0, 1], cylinder = {axis = [0, 0, 2], radius = [0, 2.7]}}
sides = {cylinder = {axis = [0, 1, 0], point = [2.5, 0, 1], radius = [2.4, 2.8]}}"""
    found = surfaces(tmp_path, text)
    assert len(found["inner"]) == 1
    assert set(map(tuple, found["inner"])) < set(map(tuple, found["TOP"]))
    np.testing.assert_array_equal(found["sides"], sorted(map(tuple, found["ENDS"])))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("TOP = {normal = [0, 0, 1]}", "slider.inp has a set 'TOP' already"),
        ("a = {normal = [0, 0, 0]}", "expected a direction, got zeros"),
        (
            "a = {plane = {point = [0, 0, 1], normal = [0, 0, 1]}}",
            "slider.inp is in the plane, the nearest is 1 mm off; .* from .* mm",
        ),
        (
            "a = {normal = [0, 0, 1], box = [[0, 0, 0], [9, 9, 0]]}",
            "none of 3 outer .* is turned there, the nearest is 180 deg off",
        ),
        ("a = {tolerance = 1.0}", "expected box, plane, cylinder, normal or elements"),
        ("a = {box = [[0, 0, 0]]}", "expected 2 values"),
        ("a = {plane = [[0, 0, 1], [0, 0, 1]]}", "expected a table {point = ..., normal = ...}"),
    ],
)
def test_what_selects_nothing_is_said_with_its_key(tmp_path, text, message):
    with pytest.raises(StudyFileError, match=message) as caught:
        surfaces(tmp_path, text)
    assert str(caught.value.key).startswith("components.slider.sets")
