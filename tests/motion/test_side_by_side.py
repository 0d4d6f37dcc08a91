"""Lines and levels of several runs side by side: those of each alone, and of readable twins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

import squealstudy as sq
from squealstudy.motion.outcome.intervals import mean_interval, periods_interval, periods_mean
from squealstudy.motion.outcome.levels import (
    TorqueSums,
    levels_side_by_side,
    plain_levels_side_by_side,
    torque_levels,
)
from squealstudy.motion.outcome.spectrum import spectrum, unfolded_line
from squealstudy.motion.outcome.summary import look_ahead, summarise
from squealstudy.motion.outcome.torque import LEVELS, LINE

STEP = 1e-3


def signals(rows: int) -> np.ndarray:
    """Periodic, beating, drifting, growing, noisy, still and straight ones (m, rows)."""
    t, rng = STEP * np.arange(rows), np.random.default_rng(rows)
    noise = rng.normal(size=(3, rows))
    sine = np.sin(2 * np.pi * 61.3 * t)
    return np.array(
        [
            360.0 + sine + 0.3 * np.cos(2 * np.pi * 122.6 * t),
            sine + np.sin(2 * np.pi * 57.0 * t),
            5.0 + (1.0 - np.exp(-3.0 * t)) * sine,
            np.exp(2.0 * t) * sine,
            sine + 0.3 * noise[0],
            noise[1],
            np.cumsum(noise[2]),
            np.full(rows, 360.0),
            np.zeros(rows),
            1.0 + t,
            100.0 - np.exp(-3.0 * np.arange(rows) / rows),
        ]
    )


# -- readable twins: one signal, a loop over its blocks


def peak(power: np.ndarray, resolution: float) -> float:
    """The highest line from the third bin on, between two bins of the Hann window."""
    if len(power) < 5 or not power[3:-1].any():
        return np.nan
    k = 3 + int(np.argmax(power[3:-1]))
    side = 1 if power[k + 1] >= power[k - 1] else -1
    ratio = np.sqrt(power[k + side] / power[k])
    return (
        np.nan if ratio >= 1 else (k + side * max(0.0, (2 * ratio - 1) / (ratio + 1))) * resolution
    )


def approach(periods: np.ndarray, mean: float) -> float:
    """What is left of an exponential through smooth means of periods; 0 where they are no line."""
    weight = np.hanning(len(periods) // 3 + 2)[1:-1]
    starts = np.round(np.linspace(0, len(periods) - len(weight), 5)).astype(int)
    smooth = [np.average(periods[k : k + len(weight)], weights=weight) for k in starts]
    if not np.ptp(smooth) > 0 or not np.corrcoef(range(5), smooth)[0, 1] ** 2 >= 0.9:
        return 0.0
    slope = float(np.polyfit(range(5), smooth, 1)[0])
    parabola, covariance = np.polyfit(np.arange(5) - 2, smooth, 2, cov=True)
    bend = parabola[0] + 1.9 * np.sqrt(covariance[0, 0]) * np.sign(slope)
    ratio = (slope + 2 * bend) / (slope - 2 * bend)
    ratio = np.clip(ratio, 0.3, 0.85) if ratio > 0 else 0.85
    return 0.0 if abs(4 * slope) > 0.2 * abs(mean) else 1.6 * abs(slope) * 2 / -np.log(ratio)


def interval(values: np.ndarray, width: float) -> tuple[float, float, float]:
    """Mean and bounds over whole periods of `width` rows, from the end back."""
    count = int(len(values) / width * (1 + 1e-12)) if width >= 1 else 0
    if count < 5:
        return tuple(float(x) for x in mean_interval(values))
    count -= count % 6 if count >= 12 else 0
    summed = np.concatenate([[0.0], np.cumsum(values)])

    def means(edges: np.ndarray) -> np.ndarray:
        at = np.interp(len(values) - width * edges, np.arange(len(summed)), summed)
        return np.diff(at) / (width * -np.diff(edges))

    def blocks(number: int) -> np.ndarray:
        return means(np.round(np.linspace(count, 0, number + 1)))

    mean, half = float(means(np.array([count, 0.0]))[0]), 0.0
    numbers = [number for number in (20, 10, 5) if count >= number]
    for number in numbers:
        rest = blocks(number) - blocks(number).mean()
        size = float(rest @ rest)
        rho = float(rest[1:] @ rest[:-1]) / size + 1 / number if size > 0 else 0.0
        wider = (1 + min(max(rho, 0.0), 0.9)) / (1 - min(max(rho, 0.0), 0.9))
        error = np.sqrt(size / (number * (number - 1)) * wider)
        half = special.stdtrit(number - 1, 0.975) * error
        if rho <= 0.1:
            break
    x = blocks(numbers[-2:][0])
    place = np.arange(len(x)) - 0.5 * (len(x) - 1)
    rest, thirds = x - x.mean(), blocks(3)
    first, second = np.diff(thirds)
    on_a_line = (place @ rest) ** 2 >= 0.7 * (rest @ rest) * (place @ place) > 0
    if on_a_line and first * second > 0 and abs(thirds[2] - thirds[0]) <= 0.05 * abs(mean):
        ratio = min(second / first, 0.9)
        half = max(half, abs(thirds[2] + 1.5 * second * ratio / (1 - ratio) - mean))
    if count >= 20:
        half = max(half, approach(blocks(count), mean))
    return mean, mean - half, mean + half


@pytest.mark.parametrize("rows", [3, 6, 21, 400, 1251])
def test_lines_are_those_of_each_signal(rows: int) -> None:
    x = signals(rows)
    means = 0.5 * x  # a line of half its size in the means has folded
    means[::2] = x[::2]
    together = spectrum(STEP, x)
    lines, unfolded = together.peak(), unfolded_line(STEP, x, means)
    levels = together.level(lines)
    for k, signal in enumerate(x):
        alone = spectrum(STEP, signal)
        np.testing.assert_allclose(together.power[k], alone.power, rtol=1e-9, atol=1e-13)
        assert lines[k] == pytest.approx(peak(alone.power, alone.resolution), rel=1e-9, nan_ok=True)
        at = lines[k] / alone.resolution
        level = 0.0
        if np.isfinite(at) and at < len(alone.power) - 1:
            half = max(3.0, 0.015 * at)
            level = np.sqrt(alone.power[max(1, round(at - half)) : round(at + half) + 1].sum())
        assert levels[k] == pytest.approx(level, rel=1e-9)
        assert np.isnan(unfolded[k]) == (np.isnan(lines[k]) or k % 2 == 1)


@pytest.mark.parametrize("rows", [4, 30, 400, 1251])
def test_intervals_are_those_of_each_record(rows: int) -> None:
    """Periods of any width, and rows where there is none."""
    x = signals(rows)
    for shift in range(7):
        widths = np.array([np.nan, 0.4, 1.7, 3.0, 16.313, rows / 13.5, rows / 5.0])
        widths = np.resize(np.roll(widths, shift), len(x))
        together = np.array(periods_interval(x, widths))
        twins = np.array([interval(*pair) for pair in zip(x, widths, strict=True)]).T
        scale = np.abs(x).max(axis=1)
        np.testing.assert_allclose(
            together / (scale + 1), twins / (scale + 1), rtol=1e-9, atol=1e-12
        )
        np.testing.assert_array_equal(periods_mean(x, widths), together[0])


@pytest.mark.parametrize("rows", [2, 7, 400])
@pytest.mark.parametrize("exact", [True, False])
def test_levels_are_those_of_each_alone(rows: int, exact: bool) -> None:
    x, time = signals(rows), STEP * np.arange(rows)
    mean = np.where(np.arange(len(x))[:, None] % 3 == 1, 0.3 * x, x)  # every third line has folded
    every = TorqueSums(mean, 0.01 * x**2, x - 0.1, x + 0.2)
    together = levels_side_by_side(STEP, x, every if exact else None)
    plain = plain_levels_side_by_side(STEP, x, every if exact else None)
    for k, signal in enumerate(x):
        own = TorqueSums(*(column[0] for column in vars(every.at(np.array([k]))).values()))
        alone = torque_levels(time, signal, own if exact else None)
        if exact and rows == 400 and k in (1, 4):
            assert np.isnan([alone.frequency_hz, alone.line]).all()
        for name, value in vars(together[k]).items():
            expected = pytest.approx(getattr(alone, name), rel=1e-9, abs=1e-12, nan_ok=True)
            assert value == expected, name
        told = [alone.rms, alone.mean, alone.peak_to_peak]
        np.testing.assert_allclose(plain[k], told, rtol=1e-9, atol=1e-12)


def test_summaries_of_a_batch_are_those_of_each_run() -> None:
    """Growing, settled and dying runs of a batch, one of them without a row, look up the same."""
    model = sq.model("belt", damping_ratio=0.01)
    found = model.at(friction=[0.05, 0.3, 0.5, 0.8]).simulate(0.08, step=4e-5, perturbation=0.2)
    runs = [run for run in found.motions if run is not None]
    short = replace(runs[0], history={name: x[:1] for name, x in runs[0].history.items()})
    alone = [summarise(replace(run)) for run in runs]
    look_ahead([*runs, short])
    assert all(any(LEVELS in np.ravel(key) for key in run.windows) for run in runs)
    assert all(LINE in run.windows for run in runs)
    assert not short.windows
    for run, one in zip(runs, alone, strict=True):
        for name, value in summarise(run).point.items():
            expected = one.point[name]
            if isinstance(expected, float):
                expected = pytest.approx(expected, rel=1e-9, abs=1e-12, nan_ok=True)
            assert value == expected, name
