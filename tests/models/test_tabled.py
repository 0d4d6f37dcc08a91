"""Parameters that follow a table over others: friction and materials over temperature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scipy.interpolate import RegularGridInterpolator
from study_runs import command, plan_of, solved
from test_report import quickly

import squealstudy
from squealstudy.cli.before_after import before_after
from squealstudy.engine.validity import parameter_reasons
from squealstudy.errors import StudyFileError
from squealstudy.models.parameter import ParameterTable
from squealstudy.screen import as_text

HEAD = """
[study]
name = "warm"
kind = "complex_modes"
[model]
name = "hulten"
[parameters]
temperature = "50 degC"
"""
FRICTION = """
[parameters.friction.table]
temperature = ["20 degC", "120 degC", "320 degC"]
friction = [0.1, 0.5, 0.2]
"""
OVER = """
[[sweep]]
parameter = "temperature"
values = ["20 degC", "45 degC", "120 degC", "270 degC", "300 degC"]
"""
SWEPT = '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.2]\n'
AT = {20: 0.1, 45: 0.2, 120: 0.5, 270: 0.275, 300: 0.23}
BRAKE = """
[study]
name = "hot_brake"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
[parameters]
temperature = 300.0
[parameters.friction.table]
temperature = [300.0, 500.0]
pressure = ["2 bar", "12 bar", "30 bar"]
value = [[0.4, 0.5, 0.45], [0.3, 0.35, 0.4]]
[parameters."pad.lining_young_modulus".table]
temperature = [300.0, 500.0]
value = ["6 GPa", "4 GPa"]
[[sweep]]
parameter = "temperature"
values = [300.0, 400.0, 500.0]
[[sweep]]
parameter = "pressure"
values = ["7 bar", "12 bar"]
"""


def test_it_is_linear_between_knots_and_exact_at_them():
    table = ParameterTable("y", ("x",), ((1.0, 2.0, 4.0),), (0.3, 0.7, -0.1))
    assert [table.value({"x": x}) for x in (1.0, 2.0, 4.0)] == [0.3, 0.7, -0.1]
    np.testing.assert_allclose(table.value({"x": np.array([1.5, 3.0])}), [0.5, 0.3], rtol=1e-15)


def test_two_dimensions_against_scipy():
    rng = np.random.default_rng(2)
    at = (np.sort(rng.random(4)), np.sort(rng.random(3)))
    values = rng.random((4, 3))
    table = ParameterTable("y", ("a", "b"), tuple(map(tuple, at)), tuple(values.ravel()))
    x = [low + (high - low) * rng.random(50) for low, high in ((k[0], k[-1]) for k in at)]
    expected = RegularGridInterpolator(at, values)(np.column_stack(x))
    np.testing.assert_allclose(table.value({"a": x[0], "b": x[1]}), expected, rtol=1e-13)
    alone = table.value({"a": x[0][7], "b": x[1][7]})
    assert isinstance(alone, float)
    assert alone == pytest.approx(expected[7], rel=1e-13)


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    return solved(HEAD + FRICTION + OVER, tmp_path_factory.mktemp("warm") / "r")


def test_modes_are_those_of_the_friction_of_each_temperature(warm, tmp_path):
    """Beside the same study over friction itself."""
    points = warm.points
    assert points["temperature"].tolist() == list(AT)  # degC
    np.testing.assert_allclose(points["friction"], list(AT.values()), rtol=1e-12)
    values = points["friction"].tolist()
    plain = HEAD.replace('temperature = "50 degC"\n', "")
    plain += f'[design]\ntype = "zip"\n[[sweep]]\nparameter = "friction"\nvalues = {values}\n'
    other = solved(plain, tmp_path / "r")
    for name in ("frequency_hz", "growth_rate"):
        mine, its = (
            [sorted(own) for _, own in r.modes.groupby("point_id", sort=False)[name]]
            for r in (warm, other)
        )
        np.testing.assert_allclose(mine, its, rtol=1e-12, atol=1e-9)


def test_onsets_over_temperature_are_where_the_table_has_the_onset_of_friction(warm):
    """Hulten's model locks in at a friction of 7/24: points between follow the table too."""
    found = warm.onsets[warm.onsets["status"].isin(["refined", "cubic"])]
    onsets = np.sort(found["onset"].to_numpy())
    rising = 20 + 100 * (7 / 24 - 0.1) / 0.4
    falling = 120 + 200 * (0.5 - 7 / 24) / 0.3
    np.testing.assert_allclose(onsets, [rising, falling], atol=0.1)


def test_exact_alone_serves_tables(warm):
    assert set(warm.modes["method"]) == {"dense"}
    assert "bend at their knots" in warm.manifest["method"]["reason"]


def test_the_report_says_through_what_temperature_acts(warm):
    assert "temperature acts through tables of friction alone" in quickly(warm)


def test_a_changed_table_is_another_study():
    one, other = (
        plan_of(HEAD + text + OVER)
        for text in (FRICTION, FRICTION.replace('"20 degC", "120', '"10 degC", "120'))
    )
    same = plan_of(HEAD + FRICTION + OVER)
    assert one.study_hash == same.study_hash != other.study_hash


def moved(design, **changes):
    """Values of a design point with some changed."""
    point = design.with_values(dict(design.values) | changes)
    return dict(point.values)


def test_points_of_a_brake_follow_two_tables():
    """A structure a temperature, friction of temperature and pressure."""
    plan = plan_of(BRAKE)
    assert len(plan.structures) == 3
    friction = plan.tasks.column("friction").reshape(2, 3)
    np.testing.assert_allclose(friction[0], [0.45, 0.3875, 0.325], rtol=1e-12)
    np.testing.assert_allclose(friction[1], [0.5, 0.425, 0.35], rtol=1e-12)
    young = plan.tasks.column("pad.lining_young_modulus").reshape(2, 3)
    np.testing.assert_allclose(young, [[6e9, 5e9, 4e9]] * 2, rtol=1e-12)
    assert plan.nominal.friction == 0.5
    first = plan.tasks[0]
    assert moved(first, pressure=12e5)["friction"] == 0.5
    assert moved(first, friction=0.46)["friction"] == 0.46  # the finite change of a sensitivity
    assert moved(first, temperature=126.85)["pad.lining_young_modulus"] == 5e9
    assert first.with_values(moved(first, temperature=126.85)).structure == ""
    assert first.with_values(moved(first, pressure=12e5)).structure == first.structure


def test_bare_temperatures_are_kelvins_as_all_of_si():
    """In [parameters], in tables, in sweeps, and in scatter; results have them in degC."""
    sweep = 'parameter = "temperature"\nstart = 300\nstop = "126.85 degC"\nnum = 3\n'
    plan = plan_of(
        BRAKE.replace('parameter = "temperature"\nvalues = [300.0, 400.0, 500.0]', sweep)
    )
    assert plan.study.values["temperature"] == 26.85  # noqa: PD011 - no frame
    assert {table.at[0] for table in plan.study.model.tables} == {(26.85, 226.85)}  # noqa: PD008
    np.testing.assert_allclose(
        np.unique(plan.tasks.column("temperature")), [26.85, 76.85, 126.85], rtol=1e-15
    )
    scatter = (
        'distribution = "normal"\nmean = 350.0\nstd = 5.0\n[design]\ntype = "sobol"\nsamples = 8'
    )
    drawn = plan_of(HEAD + FRICTION + f'[[sweep]]\nparameter = "temperature"\n{scatter}')
    assert abs(drawn.tasks.column("temperature").mean() - 76.85) < 2.0


@pytest.mark.parametrize("ends", [(293.15, 573.15), ("20 degC", "300 degC"), (253.15, 573.15)])
def test_logarithms_of_temperatures_are_of_kelvins(ends):
    """Whatever unit the file has: from 293.15 K to 573.15 K the middle is 409.9 K."""
    start, stop = ends
    table = FRICTION.replace('"20 degC"', '"-30 degC"')
    low = 253.15 if start == 253.15 else 293.15
    key = f"start = {start!r}\nstop = {stop!r}\n".replace("'", '"')
    sweep = f'[[sweep]]\nparameter = "temperature"\n{key}scale = "log"\n'
    grid = plan_of(HEAD + table + sweep + "num = 3\n").tasks.column("temperature")
    assert grid[1] + 273.15 == pytest.approx(np.sqrt(low * 573.15), rel=1e-12)
    halved = plan_of(HEAD + table + sweep + 'num = 2\n[design]\ntype = "boundary"\nlevels = 1\n')
    (at,) = halved.study.sweeps
    assert at.halved(1)[1] == grid[1]
    design = '[design]\ntype = "sobol"\nsamples = 1024\n'
    drawn = plan_of(HEAD + table + sweep + design).tasks.column("temperature") + 273.15
    assert np.median(drawn) == pytest.approx(np.sqrt(low * 573.15), rel=2e-3)
    scatter = 'distribution = "lognormal"\nmedian = 350.0\nsigma = 0.02\n'
    text = f'[[sweep]]\nparameter = "temperature"\n{scatter}{design}'
    drawn = plan_of(HEAD + table + text).tasks.column("temperature") + 273.15
    assert np.std(np.log(drawn)) == pytest.approx(0.02, rel=0.02)
    assert np.median(drawn) == pytest.approx(350.0, rel=1e-3)


def test_samples_beyond_the_end_of_a_table_are_not_valid():
    """A normal scatter has no end, and the last pieces go on: the rare points say so."""
    scatter = (
        '[[sweep]]\nparameter = "temperature"\ndistribution = "normal"\nmean = "41 degC"\n'
        'std = 5.6\n[design]\ntype = "sobol"\nsamples = 32768\n'
    )
    plan = plan_of(HEAD + FRICTION + scatter)
    temperature = plan.tasks.column("temperature")
    (broken,) = parameter_reasons(plan)
    assert broken.rule == "the table of friction is over temperature from 20 to 320, temperature"
    assert 0 < len(broken.rows) < 10
    np.testing.assert_array_equal(broken.rows, np.flatnonzero(temperature < 20.0))
    np.testing.assert_array_equal(broken.values, temperature[broken.rows])


@pytest.mark.parametrize(("beyond", "broken"), [(1e-10, 0), (1e-5, 1)])
def test_round_off_at_the_end_of_a_table_is_in_it(beyond, broken):
    """As of a logarithmic scatter over the whole table."""
    plan = plan_of(HEAD + FRICTION + OVER.replace("300 degC", "320 degC"))
    values = plan.tasks.column("temperature")
    values.flags.writeable = True
    values[-1] += beyond
    assert len(parameter_reasons(plan)) == broken


def test_fields_of_results_and_what_can_be_read_again(warm):
    again = squealstudy.open_results(warm.directory)
    assert again.units["temperature"] == "degC"
    field = pq.read_schema(warm.directory / "points.parquet").field("temperature")
    assert field.metadata[b"unit"] == b"degC"
    pd.testing.assert_frame_equal(again.points, warm.points)


def test_check_calls_constant_what_is_constant(tmp_path, capsys):
    """What is given, too; not what follows a table over what is swept."""
    path = tmp_path / "study.toml"
    for swept, friction in (("", "friction = 0.22, "), (OVER, "")):
        path.write_text(HEAD + "normal_force = 200.0\n" + FRICTION + swept)
        assert command("check", str(path)) == 0
        screen = " ".join(capsys.readouterr().out.split())
        given = "normal_force = 200 N, contact_law"
        assert f"constant {friction}sliding_speed = 0.5 m/s, damping_ratio = 0, " in screen
        assert given in screen


def test_check_does_not_call_friction_the_same_that_follows_the_speed(tmp_path, capsys):
    """Nor does a point have its slope, as it has of a law."""
    path, said = tmp_path / "study.toml", "friction is the same at all speeds"
    table = "[parameters.friction.table]\nsliding_speed = [0.1, 1.0]\nfriction = [0.5, 0.2]\n"
    text = HEAD.replace('temperature = "50 degC"', "sliding_speed = 0.9")
    for added, is_same in (("", True), (table, False)):
        path.write_text(text + added)
        assert command("check", str(path)) == 0
        screen = " ".join(capsys.readouterr().out.split())
        assert (said in screen) == is_same
        follows = (
            "follows friction follows sliding_speed by a table: no slope of it acts at a point"
        )
        assert (follows in screen) != is_same


BAD = {
    "temperature = [300.0]\nvalue = [0.4]": "2 or more values",
    "temperature = [400.0, 300.0]\nvalue = [0.4, 0.5]": "ascend",
    "temperature = [300.0, 400.0]\nvalue = [0.4, 0.5, 0.6]": "expected 2 values of friction, got 3",
    "temperature = [300.0, 400.0]": "expected a list 'value'",
    "value = [0.3, 0.4]": "of what friction follows",
    "temperature = [300.0, 400.0]\nvalue = [0.4, -0.5]": "at least 0",
    'temperature = [300.0, 400.0]\nvalue = [0.4, "2 bar"]': "is a pure number",
    "temperature = [300.0, 310.0]\nvalue = [0.4, 0.5]": "from 26.85 to 36.85, got 50",
    "temperatur = [300.0, 400.0]\nvalue = [0.4, 0.5]": "no parameter 'temperatur'",
    "temperature = [300.0, 400.0]\nvalue = [0.4, 0.5]\nfriction = [0.4, 0.5]": "give one",
    "temperature = [300.0, 400.0]\nvalue = [[0.4], [0.5]]": "expected a finite number",
    "temperature = [300.0, 400.0]\nvalue = 0.4": "expected 2 values of friction, got 0.4",
}


@pytest.mark.parametrize("table", BAD, ids=list(BAD.values()))
def test_what_a_table_cannot_say(table):
    with pytest.raises(StudyFileError, match=BAD[table]) as caught:
        plan_of(f"{HEAD}\n[parameters.friction.table]\n{table}\n")
    assert "friction" in str(caught.value) or "temperature" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + FRICTION + OVER.replace("300", "321"), "got 321"),
        (HEAD + FRICTION + SWEPT, "follows a table over temperature: sweep that"),
        (HEAD.replace("temperature", "#") + FRICTION, "expected a value of temperature"),
        (HEAD + FRICTION + OVER + '[modes]\nmethod = "windows"\n', "expected auto or dense"),
        (HEAD + "friction.table = 3\n", "expected a table of values"),
        (HEAD, "no parameter 'temperature'"),
    ],
)
def test_what_a_study_with_tables_cannot_ask(text, message):
    with pytest.raises(StudyFileError, match=message):
        plan_of(text).method  # noqa: B018


SLOWS = """
[transient]
duration = 0.1
step = 2e-5
sliding_speed = { points = [[0.0, 0.9], [0.1, 0.1]] }
"""


@pytest.mark.parametrize(
    ("kind", "asked", "message"),
    [
        ("transient", SLOWS, r"transient.sliding_speed': 'friction' follows 'sliding_speed'"),
        ("sensitivity", '[sensitivity]\nparameters = ["sliding_speed"]\n', "'friction' follows it"),
    ],
)
def test_what_does_not_follow_a_table_is_not_asked(kind, asked, message, tmp_path):
    """A run whose speed changes, and a derivative by it, would have the friction of one speed."""
    text = HEAD.replace("complex_modes", kind).replace('temperature = "50 degC"', "")
    table = "[parameters.friction.table]\nsliding_speed = [0.1, 1.0]\nfriction = [0.5, 0.2]\n"
    study = f"{text}sliding_speed = 0.9\n{table}"
    with pytest.raises(StudyFileError, match=message):
        solved(study + asked, tmp_path / "r")
    if kind == "sensitivity":  # by default such a parameter is left out
        solved(study + "[sensitivity]\nmodes = 2\n", tmp_path / "s")


def test_the_shipped_example_is_one(tmp_path: Path):
    path = Path(__file__).parents[2] / "studies" / "warm_brake.toml"
    study = squealstudy.read_study(path)
    assert {t.name for t in study.resolved.model.tables} >= {"friction", "pad.lining_young_modulus"}


def test_where_tables_bend_between_values_no_onset_is_not_told(tmp_path, capsys):
    """At 120 degC friction is .5, beyond the closed form's .29167; at 20 and 300 degC it is not."""
    designs = '[[sweep]]\nparameter = "damping_ratio"\nvalues = [0.001, 0.002]\n'
    ends = OVER.replace('"45 degC", "120 degC", "270 degC", ', "")
    text = f"{HEAD}{FRICTION}{ends}{designs}"
    results = solved(text, tmp_path / "ends")
    assert not results.points["n_unstable"].any()
    assert command("check", str(write_study(tmp_path, text))) == 0
    told = " ".join(capsys.readouterr().out.split())
    said = "tables have knots at temperature 120 degC, between values of the sweep"
    assert said in told
    screen = " ".join(as_text(results.screen.findings(results)).split())
    assert "none known" in screen
    assert "none up to" not in screen
    assert said in dict(results.screen.facts(results))["knots"]
    compared = results.compare(results)
    assert "after: none" not in " ".join(as_text(before_after(compared, results, results)).split())
    whole = solved(text.replace(ends, OVER), tmp_path / "whole")
    assert whole.points["n_unstable"].any()
    assert "knots" not in dict(whole.screen.facts(whole))


def write_study(folder, text):
    path = folder / "study.toml"
    path.write_text(text)
    return path
