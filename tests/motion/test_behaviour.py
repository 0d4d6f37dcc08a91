"""Classes of runs, when they settle, and transfers between modes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.motion.outcome.behaviour import classify
from squealstudy.motion.outcome.energies import transfer
from squealstudy.motion.outcome.envelope import windows
from squealstudy.motion.outcome.settling import settled

TIME = np.arange(10000) * 1e-5
LINE = 3000.0  # Hz


def ripple(depth=0.5):
    """Energy of a vibration goes up and down twice a period."""
    return 1 + depth * np.cos(4 * np.pi * LINE * TIME)


def stuart_landau(a, start=1e-6):
    """Energy on its way from `start` to 1."""
    return 1 / (1 + (1 / start - 1) * np.exp(-2 * a * TIME))


def torque_of(time, energy):
    """About 300 N m, with the vibration in it."""
    return 300 + np.sqrt(energy) * np.cos(2 * np.pi * LINE * time)


def named(energy, initial=0.0, noise=0.0):
    """Class of an energy over TIME, and whether it has settled."""
    name = classify(TIME, energy, initial, noise).name
    return name, settled(TIME, energy, torque_of(TIME, energy), name)


@pytest.mark.parametrize("rate", [-5.0, -50.0, -500.0])
@pytest.mark.parametrize("floor", [0.0, 1e-18])
def test_decay_is_stable(rate, floor):
    energy = 1e-7 * np.exp(2 * rate * TIME) + floor
    assert named(energy * ripple())[0] == "stable"
    assert named(energy * ripple(), 1e-7)[0] == "stable"


@pytest.mark.parametrize("damping", [1e-5, 1e-4, 1e-3])
def test_a_light_decay_is_undecided_until_it_has_fallen(damping):
    """A hundred periods at a damping ratio of 1e-5 fall by 0.6 %, as towards a cycle."""
    time = np.arange(10000) / 10000 / 3.0 * 0.1  # 100 periods
    rate = damping * 2 * np.pi * LINE

    def decay(t):
        return np.exp(-2 * rate * t) * (1 + 0.5 * np.cos(4 * np.pi * LINE * t))

    found = classify(time, decay(time), 1.0)
    if damping > 5e-5:
        assert found.name == "stable"
        assert np.isnan(found.until)
        return
    assert found.name == "undecided"
    assert 2 * time[-1] < found.until < 20 * time[-1]
    longer = np.linspace(0, found.until, 100000)
    assert classify(longer, decay(longer), 1.0).name == "stable"
    assert not settled(time, decay(time), torque_of(time, decay(time)), found.name)[0]


@settings(max_examples=60, deadline=None)
@given(
    fall=st.floats(4e-3, 100.0),
    depth=st.floats(0.0, 1.0),
    kicked=st.booleans(),
    noise=st.floats(0.0, 0.02),
    seed=st.integers(0, 100),
)
def test_a_decay_is_never_a_limit_cycle(fall, depth, kicked, noise, seed):
    """Falls of the logarithm over the record, down to what a damping ratio of 2e-6 does."""
    uneven = np.repeat(np.random.default_rng(seed).normal(size=100), 100)
    energy = np.exp(-2 * fall * TIME / TIME[-1]) * ripple(depth) * (1 + noise * uneven)
    if not kicked:  # what goes on from an earlier run is judged less strictly
        energy *= np.exp(-2 * 0.02 * TIME / TIME[-1])
    assert named(energy, float(kicked))[0] in ("stable", "undecided")


@settings(max_examples=60, deadline=None)
@given(
    excess=st.floats(0.0, 9.0),
    pace=st.floats(0.1, 1e3),
    power=st.sampled_from([1.0, 2.0]),
    noise=st.floats(0.0, 0.1),
    seed=st.integers(0, 100),
)
def test_a_cycle_reached_from_above_is_never_stable(excess, pace, power, noise, seed):
    """a^m - c^m decays exponentially: da/dt = -s a (1 - (c/a)^m), from up to ten times c."""
    start = (1 + excess) ** power - 1
    level = (1 + start * np.exp(-pace * TIME / TIME[-1])) ** (1 / power)
    uneven = np.repeat(np.random.default_rng(seed).normal(size=100), 100)
    energy = level**2 * ripple() * np.exp(noise * uneven)
    assert named(energy, (1 + excess) ** 2)[0] != "stable"


@settings(max_examples=60, deadline=None)
@given(start=st.floats(1e-12, 0.9), pace=st.floats(0.1, 1e3), noise=st.floats(0.0, 0.1))
def test_a_cycle_reached_from_below_is_never_stable(start, pace, noise):
    uneven = np.repeat(np.random.default_rng(1).normal(size=100), 100)
    energy = stuart_landau(pace / TIME[-1], start) * ripple() * np.exp(noise * uneven)
    assert named(energy, start)[0] != "stable"


def test_a_fast_mode_that_leaves_a_light_one_behind_is_no_cycle():
    """One mode has gone, the other falls by 0.5 % to 2 % over the record."""
    for fall in (5e-3, 1e-2, 2e-2):
        energy = 0.3 * np.exp(-2 * fall * TIME / TIME[-1]) + 0.7 * np.exp(-200 * TIME)
        assert named(energy * ripple(), 1.0)[0] in ("stable", "undecided")


def test_beyond_a_fold_the_level_lingers_and_is_undecided():
    """dx/dt = -(e + x^2): it slows down where the cycle would be, and goes on."""
    for left in (0.02, 0.1, 0.3):  # share of the way that the record holds
        e = (left * np.pi / TIME[-1]) ** 2 / 0.8**2 * 0.64
        x = np.sqrt(e) / np.tan(np.sqrt(e) * (TIME + 0.02 * TIME[-1]))
        energy = np.exp(2 * x / (10 / TIME[-1])) * ripple()
        assert named(energy, float(energy[0]))[0] in ("undecided", "stable")


def test_the_top_of_a_beat_is_no_limit_cycle():
    """Coupled modes hand their energy to each other: it rises by 100 times and will fall."""
    for end in (60, 75, 85, 90, 95, 110):  # degrees of the beat at the end
        energy = 1e-4 + np.sin(np.deg2rad(end) * TIME / TIME[-1]) ** 2
        assert named(energy * ripple(), 1e-4)[0] != "limit_cycle", end


def test_dry_friction_stops_a_vibration():
    """The amplitude falls linearly, and faster and faster in its logarithm, to rest."""
    for until in (0.3, 0.6, 1.5, 5.0):  # of the record
        energy = np.maximum(1 - TIME / (until * TIME[-1]), 0.0) ** 2
        found = named(energy * ripple(), 1.0)[0]
        assert found == ("stable" if until < 1 else "undecided")


def test_undamped_motion_is_undecided_at_any_length():
    found = classify(TIME, ripple(), 1.0)
    assert found.name == "undecided"
    assert found.until == np.inf


def test_slow_growth_is_undecided_until_it_shows():
    for rise, name in ((2e-3, "undecided"), (0.1, "growing")):
        energy = np.exp(2 * rise * TIME / TIME[-1])
        assert named(energy * ripple(), 1.0)[0] == name


def test_transient_growth_of_a_stable_point_is_stable_below_what_was_put_in():
    energy = 1e-7 * np.exp(-60 * TIME) * (1 + 4 * (1 - np.exp(-400 * TIME)))
    assert energy.max() > 2e-7
    assert named(energy * ripple(), initial=1e-7)[0] == "stable"


def test_beating_of_two_stable_modes_that_die_away():
    beat = 1 + 0.9 * np.cos(200 * TIME)
    assert named(1e-7 * np.exp(-60 * TIME) * beat)[0] in ("stable", "undecided")
    assert named(1e-7 * np.exp(-200 * TIME) * beat)[0] == "stable"


def test_numerical_noise_and_silence_are_stable():
    rng = np.random.default_rng(0)
    assert named(1e-27 * rng.random(len(TIME)), noise=1e-18)[0] == "stable"
    drift = np.cumsum(1e-29 * rng.random(len(TIME)) - 5e-30) ** 2
    assert named(drift, noise=1e-18)[0] == "stable"
    assert named(np.zeros(len(TIME))) == ("stable", (True, 0.0))
    assert named(1e-27 * np.exp(200 * TIME), noise=1e-18)[0] == "growing"  # out of round-off


@pytest.mark.parametrize("rate", [1.0, 5.0, 40.0, 70.0])
def test_growth_to_the_end(rate):
    energy = stuart_landau(rate)
    nothing = (False, pytest.approx(np.nan, nan_ok=True))
    assert named(energy * ripple(0.1), 1e-6) == ("growing", nothing)


@pytest.mark.parametrize("rate", [150.0, 200.0, 500.0])
def test_limit_cycle_and_when_it_settled(rate):
    energy = stuart_landau(rate)
    name, (is_settled, time) = named(energy * ripple(), 1e-6)
    assert name == "limit_cycle"
    assert is_settled
    reached = np.log((1e6 - 1) / (1 / 0.95**2 - 1)) / (2 * rate)  # RMS of 0.95
    width = windows(TIME, energy * ripple()).start[1]
    assert time == pytest.approx(reached, abs=width)


def test_a_plateau_reached_late_is_a_limit_cycle_that_has_not_settled():
    assert named(stuart_landau(115.0) * ripple()) == (
        "limit_cycle",
        (False, pytest.approx(np.nan, nan_ok=True)),
    )


def test_a_limit_cycle_continued_or_reached_from_above():
    assert named(ripple()) == ("limit_cycle", (True, 0.0))
    energy = (0.3 + 0.7 * np.exp(-200 * TIME)) * ripple()
    for initial in (0.0, 1.0):
        name, (is_settled, time) = named(energy, initial)
        assert name == "limit_cycle"
        assert is_settled
        assert 0.008 < time < 0.025


@pytest.mark.parametrize("spread", [0.6, 1.0])
def test_bursts_are_irregular(spread):
    found: Counter[str] = Counter()
    for seed in range(60):
        levels = np.random.default_rng(seed).normal(size=50)
        energy = stuart_landau(1e3) * ripple() * np.exp(spread * np.repeat(levels, 200))
        found[named(energy, 1e-6)[0]] += 1
    assert found["irregular"] >= 50
    assert found["irregular"] + found["undecided"] == 60


def test_a_modulation_that_dies_away_is_not_irregular():
    """A light beat about a cycle that growth has reached: at ten times the length it is gone."""
    for fall in (1.0, 1.5, 2.5):  # of the logarithm of the modulation, over the record
        beat = np.exp(1.5 * np.exp(-fall * TIME / TIME[-1]) * np.sin(2 * np.pi * 310 * TIME / 6))
        assert named(stuart_landau(1e3) * ripple() * beat, 1e-6)[0] in ("undecided", "limit_cycle")
    beat = np.exp(0.9 * np.sin(2 * np.pi * 310 * TIME / 6))  # lasts
    assert named(stuart_landau(1e3) * ripple() * beat, 1e-6)[0] == "irregular"


def test_a_second_growth_in_the_judged_part_is_not_irregular():
    """A level that is reached, wavers, and is left for one three times as high."""
    step = np.sqrt(stuart_landau(1e3)) * (1 + 2 / (1 + np.exp(-(TIME / TIME[-1] - 0.85) / 0.03)))
    wavers = 1 + 0.2 * np.sin(2 * np.pi * TIME / TIME[-1] * 7)
    assert named((step * wavers) ** 2 * ripple(), 1e-6)[0] in ("undecided", "growing")


def test_predicted_growth_tells_a_cycle_from_a_beat():
    """Three times what was put in, and still on its way down to a cycle, by 1 % of the level."""
    energy = (1 - 8 / 9 * np.exp(-300 * TIME) + 0.1 * np.exp(-20 * TIME)) * ripple()
    little = 0.1 / TIME[-1]
    assert classify(TIME, energy, 1 / 9, growth=little).name == "limit_cycle"
    assert classify(TIME, energy, 1 / 9).name == "undecided"
    slow = 0.02 / TIME[-1]  # where its pace stays, a cycle may lie anywhere below
    energy = (1 - 8 / 9 * np.exp(-300 * TIME)) * np.exp(-2 * slow * TIME) * ripple()
    assert classify(TIME, energy, 1 / 9, growth=little).name != "limit_cycle"


def test_a_level_that_stays_where_growth_is_predicted_is_a_cycle():
    """A kick straight onto it has no transient; that the level does not grow shows it."""
    energy = ripple() * np.ones_like(TIME)
    assert classify(TIME, energy, energy[0]).name == "undecided"
    assert classify(TIME, energy, energy[0], growth=2.0 / TIME[-1]).name == "limit_cycle"
    assert classify(TIME, energy, energy[0], growth=0.2 / TIME[-1]).name == "undecided"
    decay = -2e-2 / TIME[-1]  # over the record, far more than this level drifts
    assert classify(TIME, energy, energy[0], growth=decay).name == "limit_cycle"
    falls = energy * np.exp(2 * 0.3 * decay * TIME)  # at a third of its pace
    assert classify(TIME, falls, energy[0], growth=decay).name == "undecided"
    # one that grows bends the level
    rising = np.exp(np.maximum(TIME / TIME[-1] - 0.7, 0.0) ** 2) * ripple()
    assert classify(TIME, rising, rising[0], growth=2.0 / TIME[-1]).name != "limit_cycle"


def test_weak_wandering_is_a_limit_cycle():
    found = 0
    for seed in range(60):
        levels = np.random.default_rng(seed).normal(size=50)
        energy = stuart_landau(1e3) * ripple() * np.exp(0.1 * np.repeat(levels, 200))
        found += named(energy, 1e-6)[0] == "limit_cycle"
    assert found >= 55


def test_records_that_cannot_be_judged():
    short = classify(TIME[:5], np.ones(5))
    assert short.name == "undecided"
    assert short.until > TIME[4]
    assert classify(TIME, np.full(len(TIME), np.nan)).name == "undecided"
    assert settled(TIME[:5], np.ones(5), np.ones(5), "limit_cycle")[0] is False
    assert classify(TIME[:15], np.exp(np.arange(15.0))).name == "growing"


def test_windows_hold_five_periods():
    for periods, count in ((3, 7), (100, 20), (300, 25)):
        line = np.cos(2 * np.pi * periods * TIME / TIME[-1])
        found = windows(TIME, 1 + 0.5 * line)
        assert len(found.level) == pytest.approx(count, abs=1)
        if periods > 50:
            np.testing.assert_allclose(found.level, 1.0, rtol=1e-3)
            assert found.periods == pytest.approx(periods / 2, rel=0.02)


@settings(max_examples=40)
@given(
    scale=st.floats(1e-6, 1e6),
    shift=st.floats(-5, 5),
    rate=st.floats(-300, 300),
)
def test_scale_and_time_do_not_matter(scale, shift, rate):
    energy = (1e-7 * np.exp(2 * rate * TIME) if rate < 0 else stuart_landau(rate)) * ripple()
    name = classify(TIME, energy).name
    assert classify(TIME + shift, scale * energy).name == name
    torque = torque_of(TIME, energy)
    one = settled(TIME, energy, torque, name)
    two = settled(TIME + shift, scale * energy, np.sqrt(scale) * torque, name)
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
