"""Damping of components by mass, stiffness and material: matrices, modes, sources, time."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from own_blocks import STUDY, write_blocks
from study_runs import solved
from test_model_file import built

from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.modes.point import state_working_point
from squealstudy.motion.point import friction_law, motion_point, tangent
from squealstudy.motion.shared_modes import shared_modes, truncated
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.hybrid import HybridSettings, hybrid_model
from squealstudy.reduction.prepared import prepare_with_basis
from squealstudy.study.components import inspected, read_model
from squealstudy.study.definition import load_study
from squealstudy.system.linearise import linearise

ALPHA, BETA, LINING = 50.0, 2e-8, 5e-8
TABLES = (
    ('mesh = "plate.inp"', f'mesh = "plate.inp"\nmass_damping = {ALPHA}'),
    (
        'mesh = "slider.inp"',
        f'mesh = "slider.inp"\nstiffness_damping = {BETA}\n'
        f"material_damping = {{LINING = {LINING}}}",
    ),
)
PARAMETERS = (
    "[parameters]\n",
    '[parameters]\n"plate.alpha" = {path = "plate.mass_damping"}\n'
    '"slider.beta" = {path = "slider.stiffness_damping"}\n'
    '"lining.beta" = {path = "slider.material_damping.LINING"}\n',
)


@pytest.fixture(scope="module")
def damped(tmp_path_factory):
    """The folder of the two blocks with damping of every kind."""
    folder = tmp_path_factory.mktemp("damped")
    write_blocks(folder, *TABLES, PARAMETERS)
    return folder


def test_matrices_of_components(damped, tmp_path):
    write_blocks(tmp_path)
    bare = built(tmp_path / "blocks.toml")
    assert bare.C_el is None
    plate, slider = built(damped / "blocks.toml").components
    assert abs(plate.C - ALPHA * plate.M).max() < 1e-12 * ALPHA * abs(plate.M).max()
    expected = (BETA + LINING) * slider.K
    assert abs(slider.C - expected).max() < 1e-12 * abs(expected).max()
    for A, B in zip(bare.components, (plate, slider), strict=True):
        assert abs(A.K - B.K).max() == 0
        assert abs(A.M - B.M).max() == 0


def test_they_are_parameters(damped):
    found = {p.name: p for p in read_model(damped / "blocks.toml").parameters}
    for name, unit, default in (
        ("plate.alpha", "1/s", ALPHA),
        ("slider.beta", "s", BETA),
        ("lining.beta", "s", LINING),
    ):
        assert (found[name].unit, found[name].minimum) == (unit, 0.0)
        assert found[name].default == pytest.approx(default)
    none = {"plate.alpha": 0.0, "slider.beta": 0.0, "lining.beta": 0.0}
    assert built(damped / "blocks.toml", **none).C_el is None
    _, slider = built(damped / "blocks.toml", **none | {"lining.beta": 3e-8}).components
    assert abs(slider.C - 3e-8 * slider.K).max() < 1e-12 * 3e-8 * abs(slider.K).max()


def test_an_inspection_tells_it(damped):
    found, _ = inspected(read_model(damped / "blocks.toml"))
    told = [text for _, text in found.facts if text.startswith("damping")]
    assert told == [
        "damping: mass_damping 50 1/s",
        "damping: stiffness_damping 2e-08 s, of LINING 5e-08 s",
    ]


def test_times_have_the_units_of_the_file(tmp_path):
    """Of millimetres, kilograms and milliseconds: 1/ms and ms."""
    write_blocks(tmp_path, *TABLES, ('units = "t-mm-s"', 'units = "mm-kg-ms"'))
    plate, slider = built(tmp_path / "blocks.toml").components
    assert abs(plate.C - 1e3 * ALPHA * plate.M).max() < 1e-9 * abs(plate.C).max()
    expected = 1e-3 * (BETA + LINING) * slider.K
    assert abs(slider.C - expected).max() < 1e-9 * abs(expected).max()


@pytest.fixture(scope="module")
def results(damped, tmp_path_factory):
    return solved(Plan(load_study(damped / "study.toml")), tmp_path_factory.mktemp("r"))


def test_reduced_modes_are_those_of_full_order(results):
    check = results.manifest["reference"][0]
    assert check["status"] == "ok"
    assert check["frequency_error"] < 1e-3
    assert results.points["reference_frequency_error"].min() < 1e-2
    assert (results.modes["residual"] < 1e-12).all()


def test_parts_of_the_growth_add_up(results):
    seen = set()
    for point in results.points["point_id"]:
        for mode in results.modes[results.modes["point_id"] == point]["mode"]:
            shape = results.shape(str(point), int(mode))
            parts = np.array([s.growth_rate for s in shape.sources])
            largest = np.abs(parts).max()
            assert parts.sum() == pytest.approx(shape.growth_rate, rel=1e-6, abs=1e-9 * largest)
            seen |= {(s.kind, s.where) for s in shape.sources}
    assert {("component", "plate"), ("component", "slider")} <= seen


@pytest.fixture(scope="module")
def prepared(damped):
    """The prepared structure with its basis, the state of the defaults, and its working point."""
    assembly, state = built(damped / "blocks.toml"), design_state(damped)
    settings = ReductionSettings(60e3, 60e3, 60e3)
    made, _, basis = prepare_with_basis(assembly, state.operating, settings)
    return assembly, made, basis, state, state_working_point(made, state)


def design_state(folder):
    plan = Plan(load_study(folder / "study.toml"))
    (row, *_) = plan.tasks
    return row.state()


def test_the_reduced_damping_is_the_projection(prepared):
    assembly, made, basis, state, point = prepared
    bare = linearise(replace(made.model, C_el=None), point, state)
    found = linearise(made.model, point, state)
    T = la.block_diag(*basis.blocks)
    expected = T.T @ assembly.C_el.toarray() @ T
    np.testing.assert_allclose(found.C - bare.C, expected, atol=1e-9 * abs(expected).max())
    np.testing.assert_array_equal(found.K, bare.K)
    # mass damping of free-free modes is alpha, stiffness damping beta omega^2
    d = np.diag(expected)
    n = made.model.offsets[1]
    np.testing.assert_allclose(d[:n], ALPHA, rtol=1e-9)
    np.testing.assert_allclose(
        d[n:], (BETA + LINING) * made.model.k_el[n:], rtol=1e-7, atol=1e-9 * d.max()
    )


@pytest.mark.parametrize("below", [None, 50e3])
def test_runs_in_time_have_it(prepared, below):
    _, made, _, state, point = prepared
    reference = shared_modes(made.model, point, state)
    if below:
        reference = truncated(reference, below)
    friction = friction_law(reference.system, state, point, 0.0, 1e-3, "regularised")
    design = motion_point(reference, point, state, friction, (500.0, 6e4), 1e-7)
    C, K = tangent(reference.system, design, point, state)
    np.testing.assert_allclose(C, reference.C, atol=1e-9 * abs(reference.C).max())
    np.testing.assert_allclose(K, reference.K, atol=1e-9 * abs(reference.K).max())
    assert reference.damping.own is not None


def test_the_hybrid_representation_refuses_it(prepared):
    assembly, _, _, state, point = prepared
    with pytest.raises(ModelError, match="no damping of components of their own"):
        hybrid_model(assembly, point, state.operating, HybridSettings(6e4, 6e4))


def test_sensitivities_to_it(damped, tmp_path):
    names = ["plate.alpha", "slider.beta", "lining.beta"]
    text = STUDY.replace('kind = "complex_modes"', 'kind = "sensitivity"')
    text = text.replace("[modes]\n", f"[sensitivity]\nmodes = 3\nparameters = {names}\n\n[modes]\n")
    text = text.replace("reference_points = 1\n", "")
    (damped / "slopes.toml").write_text(text.replace("'", '"'))
    rows = solved(Plan(load_study(damped / "slopes.toml")), tmp_path).sensitivities
    assert set(rows["parameter"]) == set(names)
    assert (rows["disagreement"] < 1e-3).all()
    assert (rows["d_growth_rate"] < 0).all()
    alpha = rows[rows["parameter"] == "plate.alpha"]
    assert alpha["d_growth_rate"].between(-0.5, 0).all()  # -alpha / 2 times the plate's share


def test_sensitivities_to_a_modulus(damped, tmp_path):
    """Of a meshed material, through a reduction of its own: beside a change by one per cent."""
    text = STUDY.replace('kind = "complex_modes"', 'kind = "sensitivity"')
    asked = '[sensitivity]\nmodes = 3\nparameters = ["lining.E3"]\n\n[modes]\n'
    text = text.replace("[modes]\n", asked).replace("reference_points = 1\n", "")
    (damped / "modulus.toml").write_text(text)
    rows = solved(Plan(load_study(damped / "modulus.toml")), tmp_path).sensitivities
    assert len(rows) >= 3
    seen = rows[~rows["near_coalescence"] & (rows["predicted_frequency_change"].abs() > 1.0)]
    assert len(seen)
    ratio = seen["finite_frequency_change"] / seen["predicted_frequency_change"]
    assert ratio.between(0.9, 1.1).all()


@pytest.mark.parametrize(
    ("key", "value", "at", "message"),
    [
        ("mass_damping", "-1.0", "components.plate.mass_damping", "expected at least 0"),
        ("stiffness_damping", '"x"', "components.plate.stiffness_damping", "expected"),
        (
            "material_damping",
            "{LINING = 1e-7}",
            "components.plate.material_damping.LINING",
            "it has STEEL",
        ),
        (
            "material_damping",
            "{STEEL = -1e-7}",
            "components.plate.material_damping.STEEL",
            "at least 0",
        ),
        ("damping_ratio", "0.01", "components.plate.damping_ratio", "unknown"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(tmp_path, key, value, at, message):
    write_blocks(tmp_path, (TABLES[0][0], f"{TABLES[0][0]}\n{key} = {value}"))
    with pytest.raises(StudyFileError, match=re.escape(message)) as caught:
        built(tmp_path / "blocks.toml")
    assert str(caught.value.key).startswith(at)


def test_paths_that_there_are_not(tmp_path):
    for path, message in (
        ("plate.damping", "stiffness_damping, temperature, heat.scale or material_damping.NAME"),
        ("slider.material_damping.LININGS", "is no number in the file"),
    ):
        parameter = f'[parameters]\n"x" = {{path = "{path}"}}\n'
        write_blocks(tmp_path, *TABLES, ("[parameters]\n", parameter))
        with pytest.raises(StudyFileError, match=message):
            read_model(tmp_path / "blocks.toml")
