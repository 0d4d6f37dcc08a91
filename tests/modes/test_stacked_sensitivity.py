"""Sensitivities of small models in batches: equal to the way point by point, status by status."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from study_runs import Plan, plan_of, solved
from test_stacked import CASES, ELASTIC, WHOLE, columns, point_of

import squealstudy as sq
from squealstudy.errors import ParameterError
from squealstudy.laws import FRICTION_CURVES
from squealstudy.mechanics.reduction import reduced
from squealstudy.mechanics.sensitivity_batch import Request, batch_sensitivities
from squealstudy.mechanics.sensitivity_parameters import (
    design_structure,
    requested,
    state_parameters,
    structural_names,
)
from squealstudy.models.catalogue import MODELS
from squealstudy.modes.sensitivity.mode_sensitivities import with_more
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import structural_sensitivities
from squealstudy.system.linearise import component_frequencies

BAND = (1.0, 1000.0)
HERE = Path(__file__).parents[1]
OF_MODES = ("modes[1].damping_ratio", "mass.modes[2].damping_ratio")
CHANGE = 0.01


def every_parameter(model, point):
    """Names of all parameters that have derivatives."""
    names = []
    for parameter in model.parameters:
        try:
            requested(parameter.name, point)
        except ParameterError:  # of another law, or acting in time only
            continue
        names.append(parameter.name)
    return names


def one_by_one(point, asked, choice, band=BAND):
    """The readable twin."""
    found = reduced(point.assembly(), point.operating_point(), WHOLE)
    design = solve_families(found.prepared, point.state(), band, choice)
    parameters = state_parameters(asked, component_frequencies(found.prepared.model))
    modes = point_sensitivities(design, parameters, CHANGE, band[1])
    names = structural_names(asked)
    more = structural_sensitivities(design, design_structure(point, WHOLE), names, CHANGE)
    return [with_more(m, s) for m, s in zip(modes, more, strict=True)]


def expect_same(found, row, modes, rtol):
    """A design point of a batch beside itself alone: `rtol` of roots, of changes and slopes."""
    own = np.flatnonzero(found.owner == row)
    assert len(own) == len(modes)
    for k, mode in zip(own, modes, strict=True):
        size = abs(mode.lam)
        assert abs(found.lam[k] - mode.lam) < rtol * size
        assert found.condition[k] == pytest.approx(mode.family.condition, rel=1e3 * rtol)
        assert found.residual[k] < 1e-11 or found.residual[k] < 100 * mode.family.residual
        np.testing.assert_allclose(found.biorthogonality[k], mode.biorthogonality, atol=1e3 * rtol)
        np.testing.assert_allclose(found.energies[k], mode.energies, atol=1e3 * rtol)
        assert found.names == tuple(s.step.name for s in mode.sensitivities)
        for j, s in enumerate(mode.sensitivities):
            place, step = (k, j), s.step
            at = (found.value[place], found.reference[place], found.change[place])
            assert at == (step.value, step.reference, step.size), step.name
            np.testing.assert_allclose(found.component_hz[place], step.component_hz, rtol=1e-9)
            predicted = abs(found.derivative[place] - s.derivative) * abs(step.size)
            allowed = rtol * size * max(1.0, mode.family.condition)
            assert predicted < allowed, step.name
            assert found.reason[place] == s.reason
            if s.finite is None:
                assert np.isnan(found.finite[place])
                continue
            assert abs(found.finite[place] - s.finite.change) < allowed, step.name
            assert found.match[place] == pytest.approx(s.finite.match, rel=1e3 * rtol)
            moves = abs(s.predicted) > 1e4 * allowed  # the curvature is seen, too
            if moves and np.isfinite(s.validity) and s.validity < 1e3 * abs(step.size):
                assert found.validity[place] == pytest.approx(s.validity, rel=1e-5), step.name
                assert found.near_coalescence[place] == mode.near_coalescence(s)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(
    "built",
    [False, pytest.param(True, marks=pytest.mark.full_size)],
    ids=["stacked", "built one by one"],
)
def test_a_batch_has_the_sensitivities_of_its_points(case, built):
    name, chosen, ranges = CASES[case]
    model = replace(MODELS[name], stack=None) if built else MODELS[name]
    options = {o.name: o.choices[0] for o in model.options} | chosen
    count = 3
    # damped: modes of one growth have no order
    values = {"damping_ratio": 0.013} | columns(name, ranges, count, seed=len(case))
    values["damping_ratio"] = np.maximum(values["damping_ratio"], 1e-3)
    first = point_of(model, options, values, 0)
    asked = [requested(n, first) for n in (*every_parameter(model, first), *OF_MODES)]
    wanted = Request(asked, ModeChoice(count=2), CHANGE, BAND)
    ((rows, found),) = batch_sensitivities(model, options, values, count, wanted)
    assert rows.tolist() == list(range(count))
    assert not found.left.any()
    assert not found.system.failures
    assert len(found.lam) >= count
    for row in range(count):
        modes = one_by_one(point_of(model, options, values, row), asked, wanted.choice)
        expect_same(found, row, modes, 1e-11)


FAMILIES = ("disc.modes[*].frequency_scale", "pad.modes[*].damping_ratio")


@pytest.mark.parametrize("choice", [ModeChoice(count=3), ModeChoice(frequencies_hz=(400.0, 900.0))])
def test_elastic_bodies_with_all_terms(choice):
    """Friction across, gaps, own damping, component modes that are changed or damped already."""
    count, rng = 3, np.random.default_rng(3)
    options = {"contact_law": "exponential", "friction_law": "exponential_fall"}
    values = ELASTIC.defaults() | {
        "friction": rng.uniform(0.1, 0.6, count),
        "pressure": rng.uniform(3e5, 2e6, count),
        "sliding_speed": rng.choice([-1.0, 1.0], count) * rng.uniform(0.02, 0.1, count),
        "friction_law.static_ratio": 1.4,
        "damping_ratio": rng.uniform(0.0, 0.02, count),
        "stiffness_damping": rng.uniform(0.0, 1e-6, count),
        "mass": rng.choice([0.5, 1.0], count),
        "pad.modes[3].frequency_scale": rng.uniform(0.8, 1.2, count),
        "disc.modes[2].damping_ratio": rng.uniform(0.0, 0.05, count),
        "modes[4].damping_ratio": rng.uniform(0.0, 0.05, count),
    }
    first = point_of(ELASTIC, options, values, 0)
    names = (*every_parameter(ELASTIC, first), *FAMILIES, "pad.modes[3].frequency_scale")
    asked = [requested(n, first) for n in (*names, "modes[4].damping_ratio")]
    wanted = Request(asked, choice, CHANGE, (1.0, 1e5))
    ((_, found),) = batch_sensitivities(ELASTIC, options, values, count, wanted)
    assert not found.left.any()
    assert len(found.names) == 19
    for row in range(count):
        point = point_of(ELASTIC, options, values, row)
        expect_same(found, row, one_by_one(point, asked, choice, (1.0, 1e5)), 1e-9)


@pytest.mark.parametrize("away", [1e-10, 1e-7, 1e-4])
def test_beside_a_coalescence(away):
    """Where two modes are about to be one a derivative means nothing: both ways say so."""
    model, options = MODELS["hulten"], {"contact_law": "bilateral"}
    options["friction_law"] = "exponential_fall"
    limit = (100.0**2 - 75.0**2) / (2 * 100.0 * 75.0)
    values = model.defaults() | {"friction": limit * (1.0 + away * np.array([-1.0, 1.0]))}
    asked = [requested("friction", point_of(model, options, values, 0))]
    wanted = Request(asked, ModeChoice(frequencies_hz=(88.0, 89.0)), CHANGE, BAND)
    ((_, found),) = batch_sensitivities(model, options, values, 2, wanted)
    for row in range(2):
        modes = one_by_one(point_of(model, options, values, row), asked, wanted.choice)
        own = np.flatnonzero(found.owner == row)
        assert not found.left[row]
        assert found.near_coalescence[own].all()
        round_off = 1e-14 / away  # of a root, of its condition squared
        for k, mode in zip(own, modes, strict=True):
            (s,) = mode.sensitivities
            assert mode.near_coalescence(s)
            assert found.condition[k] == pytest.approx(mode.family.condition, rel=100 * round_off)
            assert abs(found.lam[k] - mode.lam) < 1e-7 * abs(mode.lam)
            change = s.finite.change
            # which of two roots that are all but one moves which way is round-off
            apart = abs(found.finite[k, 0] - np.array([change, -change.conjugate()]))
            assert apart.min() < 1e-6 * abs(change)
            assert away == 1e-10 or apart[0] < 1e-6 * abs(change)


STUDY = """[study]
name = "slopes"
kind = "sensitivity"
{extensions}
[model]
name = "{model}"
{options}
[parameters]
damping_ratio = 0.01
{parameters}
[modes]
band = [1.0, 1000.0]
[[sweep]]
parameter = "friction"
start = {start}
stop = {stop}
num = 5
[sensitivity]
modes = 2
parameters = [{asked}]
"""


def study(model, asked, options="", parameters="", friction=(0.1, 0.6), extension=""):
    return STUDY.format(
        model=model,
        options=options,
        parameters=parameters,
        start=friction[0],
        stop=friction[1],
        asked=", ".join(f'"{name}"' for name in asked),
        extensions=f'extensions = ["{HERE / "extension" / extension}"]' if extension else "",
    )


def both_ways(text, tmp_path):
    """Tables of points and sensitivities: in a batch, and point by point."""
    plan = plan_of(text)
    assert plan.stacked
    alone = Plan(plan.study, point_by_point=True)
    return [solved(p, tmp_path / str(i)) for i, p in enumerate((plan, alone))]


def expect_same_tables(found, twin, rtol=1e-7):
    """Texts and flags equal, numbers to round-off, or to the errors of differences of a law."""
    assert found.points["status"].tolist() == twin.points["status"].tolist()
    assert found.points["message"].tolist() == twin.points["message"].tolist()
    for name in ("n_modes", "open_share", "valid", "invalid_reason"):
        pd.testing.assert_series_equal(found.points[name], twin.points[name])
    one, other = found.sensitivities, twin.sensitivities
    assert len(one) == len(other)
    assert one.dtypes.equals(other.dtypes)
    number = dict(zip(twin.points["point_id"], found.points["point_id"], strict=True))
    assert one["point_id"].tolist() == [number[i] for i in other["point_id"]]
    round_off = {"residual", "biorthogonality", "point_id", "disagreement", "validity_range"}
    for name in one.columns.difference(list(round_off)):
        if one[name].dtype.kind == "f":
            size = other[name].abs().max()
            np.testing.assert_allclose(one[name], other[name], rtol=rtol, atol=1e-9 * size)
        else:
            assert one[name].tolist() == other[name].tolist(), name
    seen = other["disagreement"] > 1e-6
    np.testing.assert_allclose(one["disagreement"][seen], other["disagreement"][seen], 1e-4, 1e-7)


CURVE = {"options": 'friction_law = "fading"', "extension": "my_friction_curve.py"}
CUBE = {"options": 'contact_law = "cube"', "extension": "my_contact_law.py"}


def test_a_curve_of_the_pressure_from_outside(tmp_path):
    """No slopes are given: central differences, of the pressure that moves with friction, too."""
    asked = ("friction", "friction_law.fade_pressure", "normal_force", "k1", "sliding_speed")
    expect_same_tables(*both_ways(study("hoffmann", asked, **CURVE), tmp_path), rtol=1e-5)


def test_a_contact_law_from_outside(tmp_path):
    asked = ("friction", "contact.cube", "normal_force", "k1", "damping_ratio")
    expect_same_tables(*both_ways(study("hoffmann", asked, **CUBE), tmp_path), rtol=1e-5)


def test_without_slopes_of_its_own_a_law_has_differences(tmp_path, monkeypatch):
    curve = FRICTION_CURVES["exponential_fall"]
    monkeypatch.setitem(FRICTION_CURVES._known, curve.name, replace(curve, slopes=None))
    asked = ("friction", "friction_law.static_ratio", "sliding_speed")
    text = study("hulten", asked, parameters='"friction_law.static_ratio" = 1.3')
    expect_same_tables(*both_ways(text, tmp_path), rtol=1e-5)


def test_points_that_fail_are_their_own_rows(tmp_path):
    """From a friction of 1 / tan 60 deg on the mass jams; just before the changed design does."""
    jams, law = "alpha1 = 120.0\nalpha2 = 120.0", 'contact_law = "exponential"'
    text = study("hoffmann", ("friction", "k2"), law, jams, friction=(0.56, 0.59))
    found, twin = both_ways(text.replace("num = 5", "num = 13"), tmp_path)
    expect_same_tables(found, twin)
    status = found.points["status"].tolist()
    assert status == ["ok"] * status.index("working_point") + ["working_point"] * 6
    lost = found.sensitivities[found.sensitivities["reason"] != ""]
    assert set(lost["parameter"]) == {"friction"}
    assert lost["reason"].str.startswith("no steady sliding equilibrium found").all()
    assert lost["finite_growth_change"].isna().all()


def test_what_arrays_cannot_serve_is_solved_alone(tmp_path):
    """Modes of one name that differ at some points: these rows say so, as they do alone."""
    text = study("hulten", ("modes[1-2].damping_ratio", "friction"))
    text = text.replace('parameter = "friction"', 'parameter = "modes[1].damping_ratio"')
    text = text.replace("start = 0.1", "start = 0.01").replace("stop = 0.6", "stop = 0.05")
    found, twin = both_ways(text, tmp_path)
    assert found.points["status"].tolist() == ["ok"] + 4 * ["failed"]
    expect_same_tables(found, twin)


def test_nothing_is_left_in_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    found = solved(study("hulten", ("friction", "mass", "modes[1].damping_ratio")), tmp_path / "r")
    assert (found.points["status"] == "ok").all()
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]


def test_the_library_has_the_same_in_a_batch():
    model = sq.model("hoffmann", damping_ratio=0.01, contact_law="exponential")
    friction, asked = np.array([0.2, 0.9, 1.1]), ("friction", "k1", "contact.lambda")
    batch = model.at(friction=friction).sensitivities(*asked, modes=1)
    for mu, one in zip(friction, batch, strict=True):
        alone = model.at(friction=mu).sensitivities(*asked, modes=1)
        assert one.names == alone.names
        np.testing.assert_allclose(one.lam, alone.lam, rtol=1e-12)
        size = np.abs(alone.finite).max()
        for name in ("derivative", "finite"):
            scale = one.change if name == "derivative" else 1.0
            difference = (getattr(one, name) - getattr(alone, name)) * scale
            assert np.abs(difference).max() < 1e-8 * size
        assert one.to_pandas()["near_coalescence"].equals(alone.to_pandas()["near_coalescence"])
    told = model.at(friction=0.9, mass=[1.0, 1e308]).sensitivities("friction")
    assert [one.status for one in told] == ["ok", "overflow"]
    with pytest.raises(ParameterError, match="did you mean 'friction'"):
        model.at(friction=friction).sensitivities("frction")
