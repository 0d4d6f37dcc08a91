"""Growth rates of signals whose rate is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from squealstudy.motion.outcome.growth import bend_time, fit_growth, median_of

TIME = np.arange(10000) * 1e-5
W = 2e4  # rad/s


def stuart_landau(a, r0, time=TIME, w=W):
    """xi' = (a + i w) xi - a |xi|^2 xi: limit cycle of amplitude 1, from r0."""
    share = 1 / (1 + (1 / r0**2 - 1) * np.exp(-2 * a * time))
    return np.sqrt(share) * np.exp(1j * w * time)


def noise(rng, rows, memory=0.0):
    """Complex Gaussian noise of unit power, correlated over `memory` rows."""
    x = rng.normal(size=(rows + 500, 2)) @ np.array([1, 1j]) / np.sqrt(2)
    if not memory:
        return x[500:]
    keep = np.exp(-1 / memory)
    kernel = np.sqrt(1 - keep**2) * keep ** np.arange(min(500, int(20 * memory)))
    return np.convolve(x, kernel)[500 : 500 + rows]


@pytest.mark.parametrize("rate", [20.0, 60.0, 200.0, 800.0])
@pytest.mark.parametrize("start", [1e-2, 2e-3, 1e-5])
def test_stuart_landau_to_three_thousandths_within_bounds(rate, start):
    fit = fit_growth(TIME, stuart_landau(rate, start))
    assert fit.status == "ok"
    assert fit.growth_rate == pytest.approx(rate, rel=3e-3)
    assert fit.high - fit.low < 0.01 * rate
    assert np.interp(fit.stop, TIME, np.abs(stuart_landau(rate, start))) < 0.1  # of saturation


def test_the_rate_of_a_saturated_run_lies_within_its_bounds():
    for rate in (60.0, 200.0, 800.0):
        fit = fit_growth(TIME, stuart_landau(rate, 2e-3))
        assert fit.low < rate < fit.high


def test_onset_is_where_the_exponential_meets_a_tenth_of_the_limit_cycle():
    fit = fit_growth(TIME, stuart_landau(200.0, 1e-3))
    assert fit.onset_time == pytest.approx(np.log(100) / 200, rel=2e-3)
    assert np.isnan(fit_growth(TIME, np.exp((-50 + 1j * W) * TIME)).onset_time)
    early = fit_growth(TIME, stuart_landau(200.0, 1e-3), until=0.01)
    assert early.stop < 0.01
    assert early.onset_time == pytest.approx(
        np.log(100) / 200, rel=2e-3
    )  # the whole record's level


def test_van_der_pol_integrated_independently():
    """x'' - (2 a - x^2) x' + w^2 x = 0 grows at a, seen through its velocity and displacement."""
    a, w = 30.0, 2 * np.pi * 500
    time = np.arange(30000) * 1e-5

    def motion(_, x):
        return [x[1], (2 * a - x[0] ** 2) * x[1] - w**2 * x[0]]

    x = solve_ivp(motion, (0, time[-1]), [0.02, 0.0], "DOP853", time, rtol=1e-9, atol=1e-9).y
    lam = a + 1j * np.sqrt(w**2 - a**2)
    fit = fit_growth(time, x[1] - lam.conjugate() * x[0])  # left vector of the linear part
    assert fit.growth_rate == pytest.approx(a, rel=3e-3)
    energy = 0.5 * (x[1] ** 2 + (w * x[0]) ** 2)
    assert fit_growth(time, np.sqrt(energy)).growth_rate == pytest.approx(a, rel=1e-2)
    rippled = fit_growth(time, np.abs(x[0]))  # touches zero twice a period
    assert rippled.growth_rate == pytest.approx(a, rel=3e-2)


@pytest.mark.parametrize("seed", range(3))
def test_irregular_limit_cycle_residual_motion_and_noise(seed):
    rng = np.random.default_rng(seed)
    xi = stuart_landau(150.0, 3e-3)
    other = 3e-4 * np.exp((-80 + 3.1e4j) * TIME)
    wander = np.exp(0.4 * np.abs(xi) ** 2 * noise(rng, len(TIME), 100.0).real)
    fit = fit_growth(TIME, xi * wander + other + 1e-5 * noise(rng, len(TIME)))
    assert fit.growth_rate == pytest.approx(150.0, rel=1e-2)
    assert fit.low <= 150.0 <= fit.high


def test_growth_out_of_a_noise_floor_is_read_above_it():
    floor = 1e-6 * noise(np.random.default_rng(4), len(TIME))
    fit = fit_growth(TIME, stuart_landau(250.0, 1e-8) + floor)
    assert fit.growth_rate == pytest.approx(250.0, rel=0.02)
    assert fit.start > np.log(50) / 250


def test_another_mode_that_saturates_early_ends_the_fit():
    """Noise that sets in and stays, far below the amplitude's own limit cycle."""
    rng = np.random.default_rng(5)
    xi = stuart_landau(200.0, 2e-3)
    xi = xi * np.exp(np.cumsum(np.where(TIME > 5e-3, -0.6 * 200 * 1e-5, 0.0)) * (np.abs(xi) < 0.3))
    xi = xi + 5e-4 * noise(rng, len(TIME), 20.0) * (TIME > 5e-3)
    fit = fit_growth(TIME, xi)
    assert fit.growth_rate == pytest.approx(200.0, rel=5e-3)
    assert fit.stop < 6e-3


@pytest.mark.parametrize("rate", [-5.0, -60.0, -400.0])
@pytest.mark.parametrize("floor", [0.0, 1e-6, 1e-3])
def test_decay_ends_before_the_floor(rate, floor):
    xi = np.exp((rate + 1j * W) * TIME) + floor * noise(np.random.default_rng(1), len(TIME))
    fit = fit_growth(TIME, xi)
    assert fit.growth_rate == pytest.approx(rate, rel=3e-3)
    envelope = np.sqrt(np.exp(2 * rate * TIME) + floor**2)
    assert fit_growth(TIME, envelope).growth_rate == pytest.approx(rate, rel=3e-3)


def test_decay_of_an_envelope_that_touches_zero():
    envelope = np.exp(-60 * TIME) * np.abs(np.cos(W * TIME))
    assert fit_growth(TIME, envelope).growth_rate == pytest.approx(-60.0, rel=0.01)


def test_growth_that_has_not_saturated_is_read_to_the_end():
    fit = fit_growth(TIME, stuart_landau(20.0, 1e-3))
    assert fit.stop > 0.098
    assert fit.growth_rate == pytest.approx(20.0, rel=1e-3)
    bent = fit_growth(TIME, stuart_landau(50.0, 1e-2))  # at the end half-way to saturation
    assert bent.growth_rate == pytest.approx(50.0, rel=3e-3)


@pytest.mark.parametrize(("memory", "level"), [(0.0, 1e-3), (10.0, 5e-4), (30.0, 5e-4)])
def test_bounds_cover_the_rate_at_least_as_often_as_they_say(memory, level):
    time, hits, widths, errors = TIME[:4000], [], [], []
    xi = stuart_landau(120.0, 5e-3, time)
    for seed in range(200):
        fit = fit_growth(time, xi + level * noise(np.random.default_rng(seed), len(time), memory))
        assert fit.status == "ok"
        hits.append(fit.low <= 120.0 <= fit.high)
        widths.append(fit.high - fit.growth_rate)
        errors.append(abs(fit.growth_rate - 120.0))
    assert np.mean(hits) >= 0.95
    assert np.quantile(widths, 0.5) < 4 * np.quantile(errors, 0.9)


@pytest.mark.parametrize("apart", [55.0j, 20.0 + 50.0j, 30.0 + 40.0j])
def test_a_share_of_another_mode_is_within_the_bounds(apart):
    """Along left vectors of the equations the modes of a step are not quite alone."""
    lam, time = 150.0 + 2700.0j, TIME[:5000]
    one, two = np.exp((lam + apart) * time), np.exp(lam * time)
    told = fit_growth(time, two * (1 + 2e-5j) + 2e-3 * one, others=[one])
    assert told.low <= 150.0 <= told.high
    assert told.high - told.low < 3.0


@pytest.mark.parametrize("rise", [0.05, 0.2, -0.4])
def test_a_small_change_of_large_motion_tells_bounds_that_reach_small_motion(rise):
    """Growth a (1 + b r^2) with ripple: of a quarter of an e-folding the bend is hardly seen."""
    a, time = rise / TIME[-1], TIME
    r2 = 0.01 * np.exp(2 * a * time)
    log = a * time + 0.5 * (r2 - r2[0]) + 1e-5 * np.cos(60.3 * time / TIME[-1])
    fit = fit_growth(time, np.exp(log + 1j * W * time))
    assert fit.low <= a <= fit.high
    assert fit.high - fit.low < 0.5 * abs(a)


def test_beside_a_mode_that_is_large_from_its_start_no_growth_is_small():
    """When a mode stops to rise, others do not grow as they did; at a limit cycle never."""
    lam = W * 1j + 200.0
    assert bend_time(TIME, stuart_landau(200.0, 1e-4)) == pytest.approx(np.log(750) / 200, rel=0.02)
    assert bend_time(TIME, stuart_landau(200.0, 0.8)) == 0.0
    assert bend_time(TIME, np.exp(lam * TIME)) == np.inf
    assert bend_time(TIME, np.exp((lam - 400.0) * TIME)) == np.inf


def test_nothing_to_fit():
    zero, rng = np.zeros(1000), np.random.default_rng(0)
    time = TIME[:1000]
    assert fit_growth(time, zero).status == "no_signal"
    assert fit_growth(time, zero + np.nan).status == "no_signal"
    assert fit_growth(TIME[:0], zero[:0]).status == "no_signal"
    assert fit_growth(TIME[:20], np.exp((1e3 + 1j * W) * TIME[:20])).status == "too_short"
    slow = np.exp((100 + 200j) * time)  # a third of a period
    assert fit_growth(time, slow).status == "too_short"
    steady = stuart_landau(200.0, 0.999999, time)
    for signal in (steady, np.abs(steady), noise(rng, 1000), np.abs(noise(rng, 1000))):
        fit = fit_growth(time, signal)
        assert fit.status == "too_short"
        assert np.isnan(
            [fit.growth_rate, fit.low, fit.high, fit.start, fit.stop, fit.onset_time]
        ).all()


def test_a_bend_without_a_straight_stretch_is_no_exponential():
    steepening = np.exp(8 * np.expm1(8 * TIME / TIME[-1]) / np.expm1(8.0))
    for bent in (steepening * np.exp(1j * W * TIME), steepening):
        fit = fit_growth(TIME, bent)
        assert fit.status == "not_exponential"
        assert np.isnan(fit.growth_rate)
    assert fit_growth(TIME, np.exp(50 * TIME) + 0j).status == "too_short"  # never turns: no period


@settings(max_examples=30)
@given(
    scale=st.floats(1e-9, 1e9),
    shift=st.floats(-10, 10),
    rate=st.floats(60, 400),
    real=st.booleans(),
)
def test_scale_and_time_do_not_matter(scale, shift, rate, real):
    xi = stuart_landau(rate, 1e-3)
    xi = np.abs(xi) if real else xi
    one, two = fit_growth(TIME, xi), fit_growth(TIME + shift, scale * xi)
    assert two.growth_rate == pytest.approx(one.growth_rate, rel=1e-6)
    assert two.start - shift == pytest.approx(one.start, abs=1e-9)
    assert two.onset_time - shift == pytest.approx(one.onset_time, abs=1e-6)
    assert one.low <= one.growth_rate <= one.high


def test_a_flank_of_a_ripple_is_no_growth():
    """sqrt of the energy of one mode, over four of its periods, and over many."""
    w, a = 2 * np.pi * 80, 15.0
    for periods, told in ((4.0, False), (20.0, True)):
        time = np.linspace(0.0, periods * 2 * np.pi / w, 2000)
        rippled = np.exp(a * time) * np.sqrt(1.0 + 0.8 * np.cos(2 * w * time))
        fit = fit_growth(time, rippled, period=2 * np.pi / w)
        assert fit.status == ("ok" if told else "too_short")
        if told:
            assert fit.low <= a <= fit.high
            assert (fit.stop - fit.start) * w / (2 * np.pi) == pytest.approx(
                round((fit.stop - fit.start) * w / (2 * np.pi)), abs=0.05
            )


@pytest.mark.parametrize("r", [0.05, 0.15, 0.3])
def test_growth_that_bends_tells_bounds_that_reach_the_small_amplitude(r):
    """A record that ends before the cycle: slopes are a (1 - r^2), from r on."""
    time, a = TIME[:1500], 20.0
    fit = fit_growth(time, stuart_landau(a, r, time))
    assert fit.status != "ok" or fit.low <= a <= fit.high


@pytest.mark.parametrize("values", [[], [3.0], [1.0, 4.0], [2.0, np.nan], [5.0, -1.0, 2.0]])
def test_medians_are_those_of_numpy(values):
    expected = np.median(values) if values else np.nan
    np.testing.assert_equal(median_of(np.array(values)), expected)


@pytest.mark.parametrize("cubic", [-0.6, -0.3, 0.5, 3.0])
@pytest.mark.parametrize("floor", [0.0, 1e-4])
def test_a_fall_from_large_motion_is_fitted_where_motion_is_small(cubic, floor):
    """x' = (-a + i w) x - a cubic |x|^2 x from 1 on: in closed form, to a floor of noise."""
    a = 60.0
    # of 1/|x|^2 = u: u' = 2 a (u + cubic), from 1
    u = (1.0 + cubic) * np.exp(2.0 * a * TIME) - cubic
    xi = np.exp(1j * W * TIME) / np.sqrt(u)
    fit = fit_growth(TIME, xi + floor * noise(np.random.default_rng(3), len(TIME)))
    assert fit.status == "ok"
    assert fit.low <= -a <= fit.high
    assert fit.growth_rate == pytest.approx(-a, rel=0.01)
