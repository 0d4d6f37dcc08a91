"""The friction curve that falls, with an exponent, and rises with speed: judged in every domain."""

from __future__ import annotations

import numpy as np
import pytest
from spring_reference import Block
from test_lumped_springs import BAND, BLOCK

import squealstudy as sq
from squealstudy.errors import ParameterError
from squealstudy.laws import FRICTION_CURVES

SLOW = (1.0, 100.0)  # without the contact's own mode
NAMES = ("static_ratio", "decay_speed", "exponent", "viscous_rise")
VALUES = [(1.5, 0.4, 2.0, 0.1), (2.0, 0.3, 1.0, 0.0), (2.0, 0.3, 1.3, 0.2), (1.0, 0.5, 2.0, 0.3)]


def curve_of(values):
    return {f"friction_law.{name}": value for name, value in zip(NAMES, values, strict=True)}


def block(folder, **values):
    (folder / "block.toml").write_text(BLOCK)
    return sq.model(str(folder / "block.toml"), friction_law="stribeck", **values)


@pytest.mark.parametrize("values", VALUES)
@pytest.mark.parametrize("speed", [0.03, 0.2, 0.7, 3.0])
def test_slopes_are_those_of_differences(values, speed):
    FRICTION_CURVES["stribeck"].expect_consistent_at(speed, 1e6, 0.43, values)


def test_an_exponent_of_one_without_a_rise_is_the_exponential_fall():
    """Roots, and a run that sticks and slips."""
    values = curve_of((2.0, 0.5, 1.0, 0.0))
    ours, theirs = sq.model("belt", friction_law="stribeck", **values), sq.model("belt")
    theirs = theirs.at(**{name: values[name] for name in list(values)[:2]}, sliding_speed=0.6)
    ours = ours.at(sliding_speed=0.6)
    assert ours.modes(BAND).lam == pytest.approx(theirs.modes(BAND).lam, rel=1e-13)
    levels = [
        s.simulate(duration=0.2, step=2e-5, perturbation=0.1, band=BAND).summary()
        for s in (ours, theirs)
    ]
    for column in ("torque_mean", "torque_rms", "stick_share"):
        assert levels[0][column][0] == pytest.approx(levels[1][column][0], rel=1e-9)


@pytest.mark.parametrize("values", VALUES)
def test_growth_by_hand(values, tmp_path):
    """-(d + N mu') / 2 m, of one point and in a batch."""
    judge = Block(0.3, static=values[0], decay=values[1], exponent=values[2], rise=values[3])
    slope = (judge.drag(0.3 + 1e-6) - judge.drag(0.3 - 1e-6)) / 2e-6
    model = block(tmp_path, gap=1.0, **curve_of(values))
    many = model.at(sliding_speed=np.array([0.3, 0.5])).modes(BAND)
    for lam in (model.at(sliding_speed=0.3).modes(BAND).lam, many.lam[0]):
        slow = lam[np.argmin(np.abs(lam.imag - 200.0))]
        assert slow.real == pytest.approx(-(4.0 + slope) / 2, rel=1e-7)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("values", [VALUES[2], (1.0, 0.5, 2.0, 0.0)])
def test_derivatives_are_those_of_finite_changes(name, values, tmp_path):
    """Where friction is constant too: a rise or a static ratio would change that."""
    name = f"friction_law.{name}"
    model, value = block(tmp_path, gap=1.0, **curve_of(values)), curve_of(values)[name]
    h = 1e-6
    ends = (value, value + h) if value in (0.0, 1.0) else (value - h, value + h)
    low, high = (model.at(**{name: x}).modes(SLOW).lam[0] for x in ends)
    finite = (high - low) / (ends[1] - ends[0])
    one = model.at().sensitivities(name, modes=1, band=SLOW).derivative[0, 0]
    many = model.at(sliding_speed=np.array([0.3, 0.4])).sensitivities(name, modes=1, band=SLOW)
    assert one == pytest.approx(finite, rel=1e-4, abs=1e-5)
    assert many[0].derivative[0, 0] == pytest.approx(finite, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize(
    "case",
    [
        Block(0.15, exponent=2.0, rise=0.5),
        pytest.param(Block(0.15, exponent=1.5, rise=0.2), marks=pytest.mark.full_size),
    ],
)
def test_stick_and_slip_against_event_located_integration(case, tmp_path):
    """Mean and RMS of the friction force, and frequency."""
    judge = case.levels(0.8, 0.4, 0.05)
    values = curve_of((case.static, case.decay, case.exponent, case.rise))
    model = block(tmp_path, gap=1.0, **values, **{"contact.regularisation_speed": 2e-4})
    runs = model.at(sliding_speed=case.speed)
    found = runs.simulate(duration=0.8, step=2e-5, perturbation=0.05, band=BAND).summary().iloc[0]
    assert found["class"] == "limit_cycle"
    assert found["torque_mean"] == pytest.approx(judge["mean"], rel=3e-3)
    assert found["torque_rms"] == pytest.approx(judge["rms"], rel=6e-3)
    assert found["frequency_hz"] == pytest.approx(judge["frequency_hz"], rel=1e-3)


@pytest.mark.parametrize(("name", "value"), [("exponent", 0.5), ("viscous_rise", -0.1)])
def test_bad_values_are_one_sentence(name, value, tmp_path):
    with pytest.raises(ParameterError, match=f"friction_law.{name}.*at least"):
        block(tmp_path, **{f"friction_law.{name}": value}).at()
