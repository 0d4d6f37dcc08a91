"""Masses on components: what they weigh, how they follow a set, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from own_blocks import block, write_blocks
from test_model_file import SLIDER_OF_MATRICES, built, write_slider_matrices

from squealstudy.errors import StudyFileError
from squealstudy.models.components.component_facts import rigid_shapes
from squealstudy.models.components.inp_writer import write_inp
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


def with_sets(folder):
    """The slider with the nodes of its top, and with these and one corner of its bottom."""
    mesh = block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
    top = mesh.node_set("TOP")
    edge = np.flatnonzero(abs(mesh.nodes - [0.0, 0.0, 1.0]).max(axis=1) < 1e-9)
    sets = {"UPPER": top, "MIX": np.append(top, mesh.node_sets["CORNER"]), "EDGE": edge}
    write_inp(replace(mesh, node_sets={**mesh.node_sets, **sets}), folder / "slider.inp")
    return mesh, sets


def test_no_node_of_a_set_is_dropped(bare, tmp_path):
    """Nodes of whole facets are that face; with one more all of them have the same share."""
    assembly = built(model(tmp_path, "slider.TOP"))
    by_area = added(assembly, bare)
    _, sets = with_sets(tmp_path)
    path = tmp_path / "blocks.toml"
    text = path.read_text()
    path.write_text(text.replace('\non = "slider.TOP"', '\non = "slider.UPPER"'))
    assert abs(added(built(path), bare) - by_area).max() < 1e-15 * abs(by_area).max()
    path.write_text(text.replace('\non = "slider.TOP"', '\non = "slider.MIX"'))
    alike = added(built(path), bare)
    count = len(sets["MIX"])
    expected = np.zeros((len(assembly.components[1].coordinates), 3))
    expected[sets["MIX"]] = GRAMS * TONNE / count
    np.testing.assert_allclose(alike.diagonal(), expected.ravel(), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('pressure_on = "slider.TOP"', 'pressure_on = "slider.MIX"', "load[1].pressure_on"),
        ('between = ["plate.BOTTOM", "ground"]', 'between = ["slider.MIX", "ground"]',
         "layer[1].between"),
    ],
)  # fmt: skip
def test_what_is_no_face_is_refused_where_one_is_needed(tmp_path, old, new, key):
    write_blocks(tmp_path, (old, new))
    mesh, _ = with_sets(tmp_path)
    with pytest.raises(StudyFileError, match="is no face") as caught:
        built(tmp_path / "blocks.toml")
    assert caught.value.key == key
    number = mesh.numbers[mesh.node_sets["CORNER"][0]]
    assert f"node set 'MIX' is no face: of its 19 nodes node {number}" in str(caught.value)


def test_springs_on_nodes_without_rows_are_refused(tmp_path):
    """Of matrices that leave out a node: a spring there would hold nothing."""
    there = ('["slider.ENDS", "ground"]', '["slider.EDGE", "ground"]')
    write_blocks(tmp_path, ('mesh = "slider.inp"', SLIDER_OF_MATRICES), there)
    mesh, sets = with_sets(tmp_path)
    number = mesh.numbers[sets["EDGE"][0]]
    lines = write_slider_matrices(tmp_path)
    kept = [i for i, line in enumerate(lines) if not line.startswith(f"{number}.")]
    for name in ("K", "M"):
        A = sp.load_npz(tmp_path / f"{name}.npz")
        sp.save_npz(tmp_path / f"{name}.npz", A[kept][:, kept].tocsr())
    (tmp_path / "slider.dof").write_text("\n".join(lines[i] for i in kept))
    with pytest.raises(StudyFileError, match="no rows for node") as caught:
        built(tmp_path / "blocks.toml")
    assert caught.value.key == "spring[1].between"


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
    monkeypatch.setattr("squealstudy.models.components.attached.MOST_NODES", 8)
    path = model(tmp_path, "slider.TOP", "at = [0, 0, 20]")
    with pytest.raises(StudyFileError, match="at most 8; name a smaller set"):
        built(path)
