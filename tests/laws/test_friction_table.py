"""Friction by points over speed: judged by scipy's monotone curve, by hand, and in time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from spring_reference import Block
from test_lumped_springs import BAND, BLOCK

import squealstudy as sq
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.laws import FRICTION_CURVES, FrictionCurve
from squealstudy.models.operating import FRICTION_RANGE
from squealstudy.study.definition import parse_study

SPEEDS = (0.02, 0.1, 0.25, 0.4, 0.9, 2.0)
RATIOS = (2.0, 1.9, 1.3, 1.35, 1.1, 1.1)  # falls, rises, falls, is level
SLOW = (1.0, 100.0)  # without the contact's own mode


def points(speeds=SPEEDS, ratios=RATIOS):
    speed = {f"friction_law.speed_{k}": v for k, v in enumerate(speeds, 1)}
    return speed | {f"friction_law.ratio_{k}": v for k, v in enumerate(ratios, 1)}


def judge(speeds=SPEEDS, ratios=RATIOS):
    slopes = PchipInterpolator(speeds, ratios).derivative()(speeds)
    slopes[[0, -1]] = 0.0  # constant beyond the ends
    curve = CubicHermiteSpline(speeds, ratios, slopes)
    return lambda s, n=0: curve(np.clip(s, speeds[0], speeds[-1]), n)


def block(folder, **values):
    (folder / "block.toml").write_text(BLOCK)
    given = points() | {"gap": 1.0} | values
    return sq.model(str(folder / "block.toml"), friction_law="table", **given)


class Tabled(Block):
    """The block with this table."""

    ratio = staticmethod(judge())

    def drag(self, slip):
        return self.force * self.friction * float(self.ratio(abs(slip)))


def test_the_curve_is_scipys_between_the_ends_and_constant_beyond():
    curve = FrictionCurve.from_values("table", points())
    s = np.linspace(0.0, 2.5, 501)
    ours, expected = curve.at(0.4, s, np.ones(501)), judge()
    assert ours.mu == pytest.approx(0.4 * expected(s), rel=1e-13)
    inside = (s > SPEEDS[0]) & (s < SPEEDS[-1])
    assert ours.by_speed[inside] == pytest.approx(0.4 * expected(s[inside], 1), abs=1e-13)
    assert not ours.by_speed[~inside].any()


@pytest.mark.parametrize("count", [1, 2, 8])
def test_slopes_are_those_of_differences(count):
    speeds, ratios = np.linspace(0.1, 3.0, 8)[:count], (1.5, 1.2, 1.3, 1.0, 0.9, 1.4, 1.6, 1.0)
    curve = FrictionCurve.from_values("table", points(speeds, ratios[:count]))
    curve.expect_consistent(0.43, 0.05, [1e6])
    for speed in (0.33, 0.77, 1.9, 2.9, 4.0):
        curve.expect_consistent(0.43, speed, [1e6])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_growth_by_hand(sign, tmp_path):
    """-(d + N mu') / 2 m, of one point and in a batch, forwards and in reverse."""
    model = block(tmp_path)
    many = model.at(sliding_speed=sign * np.array([0.3, 0.5])).modes(BAND)
    for speed, modes in ((0.3, many.lam[0]), (0.5, many.lam[1])):
        one = model.at(sliding_speed=sign * speed).modes(BAND).lam
        growth = -(4.0 + 100.0 * 0.4 * float(judge()(speed, 1))) / 2.0
        for lam in (one, modes):
            slow = lam[np.argmin(np.abs(lam.imag - 200.0))]
            assert slow.real == pytest.approx(growth, rel=1e-7)


@pytest.mark.parametrize("name", ["ratio_3", "speed_4", "ratio_7"])
def test_derivatives_are_those_of_finite_changes(name, tmp_path):
    model, h = block(tmp_path, **{"friction_law.speed_7": 3.0}), 1e-6
    name = f"friction_law.{name}"
    at = ({**points(), "friction_law.ratio_7": 1.0})[name]
    low, high = (
        model.at(sliding_speed=0.3, **{name: x}).modes(SLOW).lam[0] for x in (at - h, at + h)
    )
    one = model.at(sliding_speed=0.3).sensitivities(name, modes=1, band=SLOW).derivative[0, 0]
    many = model.at(sliding_speed=np.array([0.3, 0.6])).sensitivities(name, modes=1, band=SLOW)
    alone = model.at(sliding_speed=0.6).sensitivities(name, modes=1, band=SLOW)
    assert one == pytest.approx((high - low) / (2 * h), rel=1e-4, abs=1e-5)
    assert abs(one) > 0 or name.endswith("7")
    for ours, expected in ((many[0], one), (many[1], alone.derivative[0, 0])):
        assert ours.derivative[0, 0] == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_a_finite_change_beyond_the_next_point_is_missing_and_the_derivative_is_there(tmp_path):
    """One hundredth of the fourth speed is beyond the fifth."""
    speeds, name = (0.02, 0.1, 0.25, 0.4, 0.402, 2.0), "friction_law.speed_4"
    model, h = block(tmp_path, **points(speeds)), 1e-6
    found = model.at(sliding_speed=0.3).sensitivities(name, modes=1, band=SLOW)
    lam = [model.at(sliding_speed=0.3, **{name: 0.4 + x}).modes(SLOW).lam[0] for x in (h, -h)]
    assert found.derivative[0, 0] == pytest.approx((lam[0] - lam[1]) / (2 * h), rel=1e-5)
    assert np.isnan(found.finite[0, 0])


@pytest.mark.full_size  # by default of a Stribeck curve: test_stribeck.py
def test_stick_and_slip_against_event_located_integration(tmp_path):
    """Mean and RMS of the friction force, and frequency."""
    case = Tabled(0.15)
    expected = case.levels(0.8, 0.4, 0.05)
    runs = block(tmp_path, **{"contact.regularisation_speed": 2e-4}).at(sliding_speed=case.speed)
    row = runs.simulate(duration=0.8, step=2e-5, perturbation=0.05, band=BAND).summary().iloc[0]
    assert row["class"] == "limit_cycle"
    assert row["torque_mean"] == pytest.approx(expected["mean"], rel=3e-3)
    assert row["torque_rms"] == pytest.approx(expected["rms"], rel=6e-3)
    assert row["frequency_hz"] == pytest.approx(expected["frequency_hz"], rel=1e-3)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"speed_3": 0.1}, "speed_3 is 0.1 m/s: expected more than friction_law.speed_2, 0.1 m/s"),
        ({"speed_8": 3.0}, "speed_8 is 3 m/s: .*speed_7, which is not given"),
        ({"ratio_7": 0.5}, "ratio_7 needs a friction_law.speed_7 above 2 m/s"),
    ],
)
def test_tables_that_do_not_ascend_are_refused(values, text, tmp_path):
    given = {f"friction_law.{name}": value for name, value in values.items()}
    with pytest.raises((ModelError, ParameterError), match=text):
        block(tmp_path, **given).at().modes(BAND)
    many = block(tmp_path, **given).at(sliding_speed=np.array([0.3, 0.5])).modes(BAND)
    assert set(many.status) == {"failed"}
    assert all(re.search(text, message) for message in many.message)
    mu = FRICTION_CURVES["table"].mu
    assert np.isnan(mu(0.3, 0.0, 0.4, 0.1, 1.0, 0.05, 1.2, *(0.0, 1.0) * 6)[0])


STUDY = """\
[study]
name = "table"
kind = "complex_modes"
[model]
name = "belt"
friction_law = "table"
[parameters]
friction_law.ratio_1 = 2.0
friction_law.speed_2 = SPEED
[modes]
band = [1.0, 100.0]
[[sweep]]
parameter = "friction_law.speed_3"
start = 1.0
stop = 3.0
num = 3
"""


def test_a_study_says_where_its_table_does_not_ascend():
    assert parse_study(STUDY.replace("SPEED", "0.5"), Path("a.toml")).sweeps
    for speed, keys in (("1.0", "sweep"), ("0.0", "parameters")):
        text = STUDY.replace("SPEED", speed)
        if keys == "parameters":
            text = text.replace('"friction_law.speed_3"', '"sliding_speed"')
            text = text.replace("friction_law.speed_2 = 0.0", "friction_law.ratio_4 = 0.5")
        with pytest.raises(StudyFileError, match=f"{keys}.*friction law table"):
            parse_study(text, Path("a.toml"))


@pytest.mark.parametrize(("ratio", "doubted"), [(4.0, False), (12.0, True)])
def test_friction_beyond_dry_contacts_is_doubted(ratio, doubted):
    values = points(ratios=(*RATIOS[:2], ratio)) | {"friction": 0.3}
    many = {name: np.full(2, value) for name, value in values.items()}
    for given in (values, many):
        assert np.all((FRICTION_RANGE.values(given, 2) > FRICTION_RANGE.most) == doubted)
