"""Classes of runs, when they settle, and transfers between modes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.analysis.runs.behaviour import classify, settled, windows
from squealstudy.analysis.runs.transfer import transfer

TIME = np.arange(10000) * 1e-5
LINE = 3000.0  # Hz


def ripple(depth=0.5):
    """Energy of a vibration goes up and down twice a period."""
    return 1 + depth * np.cos(4 * np.pi * LINE * TIME)


def stuart_landau(a, start=1e-6):
    """Energy on its way from `start` to 1."""
    return 1 / (1 + (1 / start - 1) * np.exp(-2 * a * TIME))


@pytest.mark.parametrize("rate", [-5.0, -50.0, -500.0])
@pytest.mark.parametrize("floor", [0.0, 1e-13])
def test_decay_is_stable(rate, floor):
    energy = 1e-7 * np.exp(2 * rate * TIME) + floor
    assert classify(TIME, energy * ripple()) == "stable"
    assert classify(TIME, energy * ripple(), 1e-7, LINE) == "stable"


def test_transient_growth_of_a_stable_point_is_stable_below_what_was_put_in():
    energy = 1e-7 * np.exp(-60 * TIME) * (1 + 4 * (1 - np.exp(-400 * TIME)))
    assert energy.max() > 2e-7
    assert classify(TIME, energy * ripple(), initial=1e-7) == "stable"


def test_beating_of_two_stable_modes_that_die_away():
    beat = 1 + 0.9 * np.cos(200 * TIME)
    assert classify(TIME, 1e-7 * np.exp(-60 * TIME) * beat) == "stable"


def test_numerical_noise_and_silence_are_stable():
    rng = np.random.default_rng(0)
    assert classify(TIME, 1e-27 * rng.random(len(TIME))) == "stable"
    assert classify(TIME, np.cumsum(1e-29 * rng.random(len(TIME)) - 5e-30) ** 2) == "stable"
    assert classify(TIME, np.zeros(len(TIME))) == "stable"
    assert settled(TIME, np.zeros(len(TIME))) == (True, 0.0)
    assert classify(TIME, 1e-27 * np.exp(200 * TIME)) == "growing"  # out of round-off


@pytest.mark.parametrize("rate", [1.0, 5.0, 40.0, 70.0])
def test_growth_to_the_end(rate):
    energy = stuart_landau(rate)
    assert classify(TIME, energy * ripple(0.1), 1e-6) == "growing"
    assert settled(TIME, energy * ripple(0.1)) == (False, pytest.approx(np.nan, nan_ok=True))


@pytest.mark.parametrize("rate", [150.0, 200.0, 500.0])
@pytest.mark.parametrize("frequency", [np.nan, LINE])
def test_limit_cycle_and_when_it_settled(rate, frequency):
    energy = stuart_landau(rate)
    assert classify(TIME, energy * ripple(), 1e-6, frequency) == "limit_cycle"
    is_settled, time = settled(TIME, energy * ripple(), frequency)
    assert is_settled
    reached = np.log((1e6 - 1) / (1 / 0.95**2 - 1)) / (2 * rate)  # RMS of 0.95
    width = windows(TIME, energy, frequency).start[1]
    assert time == pytest.approx(reached, abs=width)


def test_a_plateau_reached_late_is_a_limit_cycle_that_has_not_settled():
    energy = stuart_landau(115.0) * ripple()
    assert classify(TIME, energy) == "limit_cycle"
    assert not settled(TIME, energy)[0]


def test_a_limit_cycle_continued_or_reached_from_above():
    assert classify(TIME, ripple()) == "limit_cycle"
    assert settled(TIME, ripple()) == (True, 0.0)
    energy = (0.3 + 0.7 * np.exp(-200 * TIME)) * ripple()
    assert classify(TIME, energy) == "limit_cycle"
    is_settled, time = settled(TIME, energy)
    assert is_settled
    assert 0.008 < time < 0.025
    rng = np.random.default_rng(2)
    wandering = 1 + 0.1 * np.repeat(rng.normal(size=100), 100)
    for uneven in (1.0, wandering):  # put in by a strong start
        assert classify(TIME, energy * uneven, initial=1.0) == "limit_cycle"
        assert classify(TIME, energy * uneven, initial=1.0, driven=False) == "stable"
    slow = 0.3 * np.exp(-4 * TIME) + 0.7 * np.exp(-200 * TIME)  # one mode outlives another
    assert classify(TIME, slow * ripple(), initial=1.0) == "stable"


@pytest.mark.parametrize("spread", [0.6, 1.0])
def test_bursts_are_irregular(spread):
    found: Counter[str] = Counter()
    for seed in range(60):
        levels = np.random.default_rng(seed).normal(size=50)
        energy = stuart_landau(1e3) * np.exp(spread * np.repeat(levels, 200))
        found[classify(TIME, energy, 1e-6)] += 1
        if classify(TIME, energy, 1e-6) == "irregular":
            assert not settled(TIME, energy)[0]
    assert found["irregular"] >= 55


def test_weak_wandering_is_a_limit_cycle():
    found = 0
    for seed in range(60):
        levels = np.random.default_rng(seed).normal(size=50)
        energy = stuart_landau(1e3) * np.exp(0.1 * np.repeat(levels, 200))
        found += classify(TIME, energy, 1e-6) == "limit_cycle"
    assert found >= 57


def test_records_that_cannot_be_judged():
    assert classify(TIME[:5], np.ones(5)) == "irregular"
    assert classify(TIME, np.full(len(TIME), np.nan)) == "irregular"
    assert settled(TIME[:5], np.ones(5))[0] is False
    assert classify(TIME[:10], np.exp(np.arange(10.0))) == "growing"


def test_windows_hold_three_periods():
    for periods, count in ((3, 10), (45, 15), (300, 25)):
        found = windows(TIME, np.ones(len(TIME)), periods / TIME[-1])
        assert len(found.level) == count
        np.testing.assert_allclose(found.level, 1.0)


@settings(max_examples=40)
@given(
    scale=st.floats(1e-6, 1e6),
    shift=st.floats(-5, 5),
    rate=st.floats(-300, 300),
)
def test_scale_and_time_do_not_matter(scale, shift, rate):
    energy = (1e-7 * np.exp(2 * rate * TIME) if rate < 0 else stuart_landau(rate)) * ripple()
    assert classify(TIME + shift, scale * energy, noise=0.0) == classify(TIME, energy, noise=0.0)
    one, two = settled(TIME, energy), settled(TIME + shift, scale * energy)
    assert two[0] == one[0]
    np.testing.assert_allclose(two[1] - shift, one[1], atol=1e-9)


MODES = np.array([37, 44, 51])


def test_transfer_from_the_mode_that_grew_first():
    energies = np.stack(
        [
            0.3 * stuart_landau(150.0, 1e-5) / (1 + np.exp((TIME - 0.05) / 2e-3)),
            stuart_landau(150.0, 1e-7),
            np.full_like(TIME, 1e-9),
        ],
        axis=1,
    )
    first, last, time = transfer(TIME, energies, MODES)
    assert (first, last) == (37, 44)
    true = TIME[np.argmax(energies[:, 1] > energies[:, 0])]
    assert time == pytest.approx(true, abs=2 * 2e-3)
    ripples = 1 + 0.9 * np.cos(2e4 * TIME[:, None] + np.arange(3))
    assert transfer(TIME, energies * ripples, MODES)[:2] == (37, 44)


def test_no_transfer():
    lead = np.stack([stuart_landau(150.0), 0.2 * stuart_landau(150.0), 0 * TIME], axis=1)
    assert transfer(TIME, lead, MODES) == (0, 0, pytest.approx(np.nan, nan_ok=True))
    for nothing in (np.zeros((100, 3)), np.zeros((0, 3)), np.zeros((100, 0))):
        first, last, time = transfer(TIME[: len(nothing)], nothing, MODES[: nothing.shape[1]])
        assert (first, last) == (0, 0)
        assert np.isnan(time)


def test_a_lead_lost_for_a_while_counts_from_when_it_came_back():
    second = np.select([TIME < 0.03, TIME < 0.05, TIME < 0.06], [0.1, 2.0, 0.5], 2.0)
    first, last, time = transfer(TIME, np.stack([np.ones_like(TIME), second], axis=1), MODES[:2])
    assert (first, last) == (37, 44)
    assert time == pytest.approx(0.06, abs=1e-9)


@settings(max_examples=30)
@given(scale=st.floats(1e-9, 1e9), shift=st.floats(-5, 5), seed=st.integers(0, 1000))
def test_transfer_keeps_under_scale_time_and_order(scale, shift, seed):
    rng = np.random.default_rng(seed)
    energies = np.repeat(rng.gamma(1.0, size=(20, 3)), 100, axis=0)
    time, order = TIME[:2000], rng.permutation(3)
    one = transfer(time, energies, MODES)
    two = transfer(time + shift, scale * energies[:, order], MODES[order])
    assert one[:2] == two[:2]
    assert (one[0] == one[1]) == (one[0] == 0)
    np.testing.assert_allclose(two[2] - shift, one[2], atol=1e-9)
