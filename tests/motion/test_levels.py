"""Levels and lines of signals known in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import bursts
from study_runs import solved

import squealstudy as sq
from squealstudy.motion.outcome import settling
from squealstudy.motion.outcome.intervals import mean_interval, periods_interval
from squealstudy.motion.outcome.levels import (
    TorqueSums,
    last_window,
    period_swings,
    plain_levels,
    swing_spread,
    torque_levels,
)
from squealstudy.motion.outcome.spectrum import spectrum
from squealstudy.motion.outcome.summary import told_frequency

STEP = 1e-5


def tone(periods, rows=4000, phases=(0.3, 1.0, 2.0)):
    """360 + 3 sin + 1 sin(2) + 0.2 sin(3); its frequency."""
    time = np.arange(rows) * STEP
    f = periods / (rows * STEP)
    parts = zip((1, 2, 3), (3.0, 1.0, 0.2), phases, strict=True)
    return time, 360 + sum(a * np.sin(2 * np.pi * k * f * time + p) for k, a, p in parts), f


@pytest.mark.parametrize("periods", [50.0, 50.3, 50.5, 123.77, 400.0])
def test_lines_of_a_periodic_torque(periods):
    time, torque, f = tone(periods)
    found = torque_levels(time, torque)
    assert found.frequency_hz == pytest.approx(f, rel=1e-5)
    assert found.line == pytest.approx(3 / np.sqrt(2), rel=1e-3)
    assert found.harmonic_2 == pytest.approx(1 / np.sqrt(2), rel=1e-3)
    assert found.harmonic_3 == pytest.approx(0.2 / np.sqrt(2), rel=1e-3)
    rms = np.sqrt((9 + 1 + 0.04) / 2)
    assert found.mean == pytest.approx(360, abs=0.03)
    assert found.rms == pytest.approx(rms, rel=5e-3)
    assert found.rms_low <= found.rms <= found.rms_high
    assert found.rms_high - found.rms_low < 0.1 * rms
    fine = np.linspace(0, 2 * np.pi, 4001)
    shape = 3 * np.sin(fine + 0.3) + np.sin(2 * fine + 1) + 0.2 * np.sin(3 * fine + 2)
    assert found.peak_to_peak == pytest.approx(np.ptp(shape), rel=1e-4 * periods)  # few rows each


@pytest.mark.parametrize(("periods", "error"), [(4.4, 0.01), (7.3, 2e-3), (20.6, 1e-4)])
def test_few_periods(periods, error):
    time, torque, f = tone(periods)
    found = torque_levels(time, torque)
    assert found.frequency_hz == pytest.approx(f, rel=error)
    assert found.line == pytest.approx(3 / np.sqrt(2), rel=0.03)


def test_a_line_beyond_the_nyquist_frequency_has_no_level():
    time = np.arange(4000) * STEP
    found = torque_levels(time, np.sin(2 * np.pi * 30e3 * time))
    assert found.frequency_hz == pytest.approx(30e3, rel=1e-6)
    assert found.line == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert np.isnan([found.harmonic_2, found.harmonic_3]).all()  # not seen, which is not none


@pytest.mark.parametrize("hz", [440.0, 451.0, 740.0, 990.0, 1350.0, 2300.0])
def test_a_line_that_rows_are_too_far_apart_to_show_is_not_told(hz):
    every, fine = 100, 1e-5 * np.arange(100 * 600 + 1)  # rows at 1 kHz
    torque = 3 * np.sin(2 * np.pi * hz * fine) + 0.2 * np.sin(2 * np.pi * 2 * hz * fine)
    means = torque[1:].reshape(-1, every).mean(axis=1)
    squares = (torque[1:].reshape(-1, every) ** 2).mean(axis=1)
    ends = torque[1:].reshape(-1, every)
    sums = TorqueSums(means, squares - means**2, ends.min(axis=1), ends.max(axis=1))
    time, rows = fine[every::every], torque[every::every]
    seen = torque_levels(time, rows, sums)
    assert seen.rms == pytest.approx(np.sqrt((9 + 0.04) / 2), rel=0.02)  # rows or not
    if hz < 500.0:
        assert seen.frequency_hz == pytest.approx(hz, rel=1e-4)
        return
    assert np.isfinite(torque_levels(time, rows).frequency_hz)  # a line that is not there
    assert np.isnan([seen.frequency_hz, seen.line, seen.harmonic_2]).all()
    assert last_window(time, rows, means) == slice(360, 600)


def test_power_is_that_of_the_signal():
    _, torque, _ = tone(77.7)
    power = spectrum(STEP, torque).power
    assert power.sum() == pytest.approx((9 + 1 + 0.04) / 2, rel=1e-3)


@pytest.mark.parametrize(
    "torque", [np.zeros(500), np.full(500, 360.0), 360 * (1 + 1e-14 * np.arange(500.0) % 3)]
)
def test_flat_torque(torque):
    found = torque_levels(np.arange(500) * STEP, torque)
    assert found.mean == pytest.approx(torque.mean())
    assert (found.rms, found.rms_low, found.rms_high, found.peak_to_peak) == (0, 0, 0, 0)
    assert (found.line, found.harmonic_2, found.harmonic_3) == (0, 0, 0)
    assert np.isnan(found.frequency_hz)


@pytest.mark.parametrize("rows", [1, 2, 3, 4, 5, 7, 12])
def test_very_short_records(rows):
    time = np.arange(rows) * STEP
    torque = np.random.default_rng(0).normal(size=rows)
    found = torque_levels(time, torque)
    assert found.mean == pytest.approx(torque.mean())
    assert found.rms_low <= found.rms <= found.rms_high
    part = last_window(time, torque)
    assert 0 <= part.start < part.stop == rows


def test_drift_is_no_line():
    time = np.arange(4000) * STEP
    assert np.isnan(torque_levels(time, 360 + 40 * time).frequency_hz)
    swing = torque_levels(time, 360 + 40 * np.cos(np.pi * time / time[-1]))  # half a period
    assert swing.line < 0.1 * swing.rms


def test_the_last_window_has_twenty_periods_where_there_are_so_many():
    time = np.arange(10000) * STEP
    assert last_window(time, np.sin(2 * np.pi * 2000 * time)) == slice(6000, 10000)
    slow = last_window(time, np.sin(2 * np.pi * 300 * time))
    assert slow.start == pytest.approx(10000 - 20 / (300 * STEP), abs=5)
    assert last_window(time, np.sin(2 * np.pi * 120 * time)) == slice(0, 10000)
    assert last_window(time, np.zeros(10000)) == slice(6000, 10000)


@pytest.mark.parametrize(("memory", "least"), [(0, 0.93), (20, 0.92), (60, 0.89)])
def test_bounds_of_a_mean_square_cover_it(memory, least):
    """Gaussian noise of unit variance, correlated over `memory` of 6000 rows."""
    _, low, high = mean_interval(bursts(memory, 6000, 400))
    assert least <= np.mean((low <= 1) & (high >= 1)) <= 0.99


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10**6),
    rows=st.integers(20, 2000),
    scale=st.floats(1e-6, 1e6),
    offset=st.floats(-1e3, 1e3),
)
def test_levels_scale_and_bounds_contain_them(seed, rows, scale, offset):
    time = np.arange(rows) * STEP
    rng = np.random.default_rng(seed)
    wave = np.sin(2 * np.pi * rng.uniform(200, 2e4) * time) + 0.3 * rng.normal(size=rows)
    one, two = torque_levels(time, wave), torque_levels(time, scale * (wave + offset))
    assert one.rms_low <= one.rms <= one.rms_high
    assert one.rms == pytest.approx(wave.std(), rel=1e-12)
    assert two.mean == pytest.approx(scale * (one.mean + offset), rel=1e-9, abs=1e-9 * scale)
    for name in ("rms", "rms_low", "rms_high", "peak_to_peak", "line", "harmonic_2"):
        expected = scale * getattr(one, name)
        assert getattr(two, name) == pytest.approx(
            expected, rel=1e-6, abs=1e-6 * scale, nan_ok=True
        )
    np.testing.assert_allclose(two.frequency_hz, one.frequency_hz, rtol=1e-6)


@pytest.mark.parametrize("rate", [0.5, 2.0, 4.0])
def test_bounds_reach_a_level_that_is_still_approached(rate):
    """The swing goes to 10 as 10 (1 + .02 exp(-rate t / T)); RMS there is 10 over the root of 2."""
    time = np.arange(40000) * STEP
    swing = 10.0 * (1.0 + 0.02 * np.exp(-rate * time / time[-1]))
    torque = 100.0 + swing * np.sin(2 * np.pi * 43 * time / time[-1])
    found = torque_levels(time, torque, TorqueSums.of_rows(torque))
    assert found.rms_low <= 10.0 / np.sqrt(2.0) <= found.rms_high
    settled = torque_levels(time, 100.0 + torque / swing, TorqueSums.of_rows(torque / swing))
    assert settled.rms_high - settled.rms_low < 0.1 * (found.rms_high - found.rms_low)


def test_spread_of_the_swings_of_single_periods():
    """Two tones, 20 and 21 periods: peaks of a period are from 2 to 4 apart."""
    phase = 2 * np.pi * np.arange(40000) / 40000
    torque = 50.0 + np.sin(20 * phase) + 0.5 * np.sin(21 * phase)
    width = 40000 / 20
    spread = swing_spread(TorqueSums.of_rows(torque), width)
    assert spread == pytest.approx(2.0 / 2.0, rel=0.1)
    assert swing_spread(TorqueSums.of_rows(50.0 + np.sin(20 * phase)), width) < 1e-6
    assert np.isnan(swing_spread(TorqueSums.of_rows(torque), 4.0))


def test_bounds_hold_all_periods_of_a_window():
    """Eighteen periods, quiet in the first eight: ten blocks of a period each left these out."""
    values = np.repeat([0.5] * 8 + [1.0] * 10, 20)
    mean, low, high = periods_interval(values, 20.0)
    assert mean == pytest.approx(14 / 18)
    assert low < 0.7
    assert high > 0.9


def test_peaks_of_single_periods():
    phase = 2 * np.pi * np.arange(1, 1201) / 40
    torque = (1.0 + 0.25 * np.sin(phase / 5)) * np.sin(phase)
    swings = period_swings(TorqueSums.of_rows(torque), 40.0)
    assert len(swings) == 30
    assert swings.min() == pytest.approx(1.53, abs=0.05)
    assert np.ptp(swings) / swings.mean() == pytest.approx(0.45, abs=0.06)


@pytest.mark.parametrize("rows", [2, 5, 30, 400])
@pytest.mark.parametrize("cycles", [0.01, 0.033, 0.2])
def test_plain_levels_are_those_with_bounds(rows, cycles):
    time = np.arange(float(rows))
    torque = 3.0 + np.sin(2 * np.pi * cycles * time) + 0.01 * np.cos(time**2)
    for sums in (None, TorqueSums(torque + 0.01, 0.1 + 0.0 * torque, torque - 0.2, torque + 0.3)):
        told = torque_levels(time, torque, sums)
        plain = plain_levels(time, torque, sums)
        assert plain == pytest.approx([told.rms, told.mean, told.peak_to_peak], rel=1e-12)
    assert plain_levels(time, np.ones(rows), None).tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize(("error", "told"), [(1e-4, True), (0.099, True), (0.49, False)])
def test_a_period_that_another_step_doubles_is_untold(error, told):
    found = told_frequency(0.856, error)
    assert found == (0.856, error) if told else np.isnan(found).all()


BURSTS = """
[study]
name = "bursts"
kind = "limit_cycles"
[model]
name = "hulten"
contact_law = "cubic"
[parameters]
"contact.cubic_stiffness" = 5e17
damping_ratio = 0.01
friction = 0.32
[modes]
band = [10.0, 1000.0]
"""


@pytest.mark.full_size
def test_bursts_have_the_period_of_one_burst_or_none(tmp_path):
    """The judge (event_reference.py, 9 s) repeats after .5789 s to .3 %; twice that was told."""
    point = solved(BURSTS, tmp_path).points.iloc[0]
    assert point["torque_rms"] == pytest.approx(74.39, rel=point["level_error"])
    assert np.isnan(point["frequency_hz"]) or point["frequency_hz"] == pytest.approx(
        1.727, rel=point["frequency_error"]
    )


def test_bounds_reach_a_level_that_is_approached_under_beats():
    """Means of 120 periods go to 1 exponentially, and beat by more than they drift.

    Of the 40 bounds that are drawn 4 ended before the level.
    """
    rng, t = np.random.default_rng(0), np.arange(120) / 120
    for _ in range(40):
        rate, beats, phase = rng.uniform(1.0, 2.5), rng.uniform(8.0, 25.0), rng.uniform(0, 6.28)
        beat = np.cos(2 * np.pi * beats * t + phase)
        periods = 1.0 - 0.02 * np.exp(-rate * t) * (1.0 + 2.0 * beat)
        _, low, high = periods_interval(np.repeat(periods, 20), 20.0)
        assert low <= 1.0 <= high
        steady = np.repeat(1.0 + 0.02 * np.cos(2 * np.pi * np.round(beats) * t), 20)
        _, low, high = periods_interval(steady, 20.0)
        assert high - low < 0.02


DRIFTING = """
[study]
name = "drifting"
kind = "transient"
[model]
name = "hoffmann"
contact_law = "unilateral"
[parameters]
damping_ratio = 0.001
sliding_speed = 0.1
[[sweep]]
parameter = "friction"
values = [0.76, 0.80, 0.85]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 1.5
step = 1e-5
perturbation = 1e-4
save_every = 20
"""


def test_bounds_of_short_runs_hold_the_levels_of_long_ones(tmp_path):
    """Levels beat and drift in runs of 1.5 s; those of 5 s, known to 0.01 %, are written here.

    At friction 0.85 the bounds were [49.93, 50.27] N.
    """
    points = solved(DRIFTING, tmp_path).points
    assert points["settled"].all()
    long_runs = np.array([39.957, 45.039, 50.361])
    assert (points["torque_rms_low"] <= long_runs).all()
    assert (points["torque_rms_high"] >= long_runs).all()
    assert (points["torque_rms_high"] - points["torque_rms_low"] < 0.1 * long_runs).all()


@pytest.mark.parametrize("duration", [0.5, 0.55, 0.6, 0.7, 0.8, 0.85, 0.9, 1.0])
def test_a_bend_that_beats_may_have_made_is_not_trusted(duration):
    """It goes to 88.2 N; after .6 s it was told as 82.5 +- 2.1 N, after 1 s as 85.2 +- 1.5 N."""
    values = {"friction": 0.3713792, "sliding_speed": 1.0895084, "damping_ratio": 0.007439353}
    values |= {"friction_law.static_ratio": 1.3, "friction_law.decay_speed": 0.3}
    system = sq.model("hulten", **values, **{"contact.regularisation_speed": 1e-3}).at()
    run = {"step": 2e-5, "save_every": 10, "perturbation": 1e-2}
    row = system.simulate(duration=duration, **run).summary().iloc[0]
    late = system.simulate(duration=5.0, **run).summary().iloc[0]
    assert row["torque_rms_low"] <= late["torque_rms"] <= row["torque_rms_high"]
    assert late["torque_rms_high"] - late["torque_rms_low"] < 0.005 * late["torque_rms"]


@pytest.mark.parametrize(("half", "to_come"), [(1.0, 0.0), (3.0, 7 / 3 * 10.0)])
def test_an_overshoot_that_is_over_does_not_widen_bounds(half, to_come):
    """239.6 +- .4 N after an overshoot of 18 N was told as 239.6 +- 42 N: as if that went on."""
    time = np.linspace(0.0, 1.0, 2001)
    level = np.where(time < 0.6, 110.0, 100.0)
    torque = np.sqrt(2) * level * np.sin(2 * np.pi * 100.0 * time)
    run = SimpleNamespace(times=time, history={"torque": torque}, windows={})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settling, "longer_window", lambda *_: slice(401, 2001))
        told = settling.level_to_come(run, slice(1201, 2001), half)
    assert told == pytest.approx(to_come, rel=0.01)


def test_no_level_is_steady_that_is_not_known():
    """It was told as 111 +- 42 N, steady from 800 ms on; a second later it is at 143 N."""
    values = {"friction": 0.35032471, "sliding_speed": 0.98700674, "damping_ratio": 0.00089132956}
    values |= {"friction_law.static_ratio": 1.3, "friction_law.decay_speed": 0.3}
    system = sq.model("hulten", **values, **{"contact.regularisation_speed": 1e-3}).at()
    row = system.simulate(duration=2.0, step=2e-5, save_every=10, perturbation=1e-2).summary()
    told = row.iloc[0]
    assert told["class"] == "limit_cycle"
    assert told["torque_rms_high"] - told["torque_rms_low"] > 0.1 * told["torque_rms"]
    assert (told["settled"], np.isnan(told["settled_time"])) == (False, True)
