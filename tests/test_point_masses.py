"""Masses on components: what they weigh, how they follow a set, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from own_blocks import write_blocks
from test_model_file import built

from squealstudy.errors import StudyFileError
from squealstudy.models.components.component_facts import rigid_shapes
from squealstudy.study.components import read_model

TONNE, MM = 1e3, 1e-3
GRAMS = 2e-6  # t
PARAMETER = '"weight" = {path = "point_mass.weight.mass"}\n'


def model(folder, on, more="", mass=GRAMS):
    """The blocks with a mass on a set of the slider; their assembly."""
    table = f'[[point_mass]]\nname = "weight"\non = "{on}"\nmass = {mass}\n{more}\n'
    write_blocks(folder, ("[parameters]\n", f"{table}[parameters]\n{PARAMETER}"))
    return folder / "blocks.toml"


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bare")
    write_blocks(folder)
    return built(folder / "blocks.toml")


def added(assembly, bare):
    """What the mass adds to M of the slider."""
    plate, slider = assembly.components
    assert abs(plate.M - bare.components[0].M).max() == 0
    assert abs(slider.K - bare.components[1].K).max() == 0
    return (slider.M - bare.components[1].M).tocsr()


def inertia_of(m, at, origin):
    """6 x 6 of a point mass by translations and turns about an origin."""
    r = at - origin
    G = np.hstack([np.eye(3), np.cross(np.eye(3), r).T])
    return m * G.T @ G


@pytest.mark.parametrize("on", ["slider.TOP", "slider.ENDS"])
@pytest.mark.parametrize("at", [None, (4.0, 1.0, 9.0)])
def test_rigid_motions_feel_the_whole_mass(bare, tmp_path, on, at):
    more = "" if at is None else f"at = {list(at)}"
    assembly = built(model(tmp_path, on, more))
    dM, x = added(assembly, bare), assembly.components[1].coordinates
    R = rigid_shapes(x)
    m = GRAMS * TONNE
    felt = R.T @ (dM @ R)
    np.testing.assert_allclose(felt[:3, :3], m * np.eye(3), atol=1e-12 * m)
    assert assembly.components[1].mass == pytest.approx(bare.components[1].mass + m)
    if at is not None:  # as a point at that place, by Steiner's rule
        expected = inertia_of(m, MM * np.array(at), x.mean(axis=0))
        np.testing.assert_allclose(felt, expected, atol=1e-12 * abs(expected).max())
        assert np.linalg.matrix_rank(dM.toarray(), tol=1e-9 * m) == 3
    assert np.linalg.eigvalsh(dM.toarray()).min() > -1e-15 * m
    used = np.unique(np.flatnonzero(dM.diagonal()) // 3)
    face = (x[:, 2] > 3.999e-3) if on == "slider.TOP" else abs(x[:, 0] - 4e-3) > 2.499e-3
    assert set(used) <= set(np.flatnonzero(face))


def test_a_face_shares_it_by_area(bare, tmp_path):
    """The kinetic energy of a turn about the middle of a 5 x 2 mm face under a uniform layer."""
    assembly = built(model(tmp_path, "slider.TOP"))
    dM, x = added(assembly, bare), assembly.components[1].coordinates
    about_z = np.cross([0.0, 0.0, 1.0], x - np.array([4.0, 1.5, 4.0]) * MM).ravel()
    expected = GRAMS * TONNE * (5.0**2 + 2.0**2) / 12 * MM**2
    assert about_z @ dM @ about_z == pytest.approx(expected, rel=1e-12)


def test_a_node_has_it_all(bare, tmp_path):
    dM = added(built(model(tmp_path, "slider.CORNER")), bare)
    assert dM.nnz == 3
    assert dM.data == pytest.approx(GRAMS * TONNE)


def test_it_is_a_parameter(bare, tmp_path):
    path = model(tmp_path, "slider.TOP")
    (parameter,) = (p for p in read_model(path).parameters if p.name == "weight")
    assert (parameter.unit, parameter.minimum, parameter.structural) == ("kg", 0.0, True)
    assert parameter.default == pytest.approx(GRAMS * TONNE)
    one, none = added(built(path), bare), added(built(path, weight=0.0), bare)
    assert abs(none).max() == 0
    twice = added(built(path, weight=2 * GRAMS * TONNE), bare)
    assert abs(twice - 2 * one).max() < 1e-14 * abs(twice).max()


@pytest.mark.parametrize(
    ("on", "more", "key", "message"),
    [
        ("slider.CORNER", "at = [0, 0, 0]", "point_mass[1].on", "the points of the set lie on a"),
        ("slider.TOPP", "", "point_mass[1].on", "did you mean 'TOP'?"),
        ("ground", "", "point_mass[1].on", "expected COMPONENT.SET, got 'ground'"),
        ("slider.TOP", "at = [0, 0]", "point_mass[1].at", ""),
        ("slider.TOP", "kg = 3", "point_mass[1].kg", ""),
    ],
)
def test_what_is_wrong_is_said_with_its_key(tmp_path, on, more, key, message):
    path = model(tmp_path, on, more)
    with pytest.raises(StudyFileError) as caught:
        built(path)
    assert message in str(caught.value)
    assert str(caught.value.key).startswith(key)


def test_it_does_not_pull(tmp_path):
    with pytest.raises(StudyFileError, match="expected at least 0"):
        built(model(tmp_path, "slider.TOP", mass=-GRAMS))


def test_a_large_set_does_not_couple_all_its_nodes(tmp_path, monkeypatch):
    monkeypatch.setattr("squealstudy.models.components.point_masses.MOST_NODES", 8)
    path = model(tmp_path, "slider.TOP", "at = [0, 0, 20]")
    with pytest.raises(StudyFileError, match="at most 8; name a smaller set"):
        built(path)
