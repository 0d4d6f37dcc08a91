"""The frequency of a motion itself, of motions integrated here or known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motions import made_up
from scipy.integrate import solve_ivp

from squealstudy.motion.outcome import periods
from squealstudy.motion.outcome.periods import fundamental
from squealstudy.wording import motion_frequency

PERIODS = {1.0: 6.66328686, 10.0: 19.07836957}  # of van der Pol's oscillator, by mu (published)


def tones(step, rows, *parts):
    """Displacement and velocity (rows, 1) of a sum of (amplitude, Hz, phase)."""
    time = step * np.arange(rows)
    turns = [(a, 2 * np.pi * hz, 2 * np.pi * hz * time + phase) for a, hz, phase in parts]
    q = sum(a * np.cos(angle) for a, _, angle in turns)
    v = sum(-a * w * np.sin(angle) for a, w, angle in turns)
    return step, q[:, None], v[:, None], np.ones(1)


@pytest.mark.parametrize(("mu", "rows"), [(1.0, 8), (1.0, 23), (10.0, 200), (10.0, 8)])
def test_relaxation_oscillations(mu, rows):
    period = PERIODS[mu]
    step = period / rows * 1.0123  # rows do not meet the period
    time = 20 * period + np.arange(0, 12 * period, step)
    flow = lambda _, y: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]  # noqa: E731
    y = solve_ivp(flow, (0, time[-1]), [2, 0], "LSODA", time, rtol=1e-9, atol=1e-9).y
    found = fundamental(step, y[0][:, None], y[1][:, None], np.ones(1)).hz
    if rows == 8 and mu == 10.0:  # eight rows do not show its jumps
        assert np.isnan(found) or found * period == pytest.approx(1.0, abs=2e-3)
    else:
        assert found * period == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("rows", np.linspace(3.1, 12.0, 90))
def test_few_rows_a_period_make_no_longer_period(rows):
    """Stick, then a way back with a continuous velocity: rows may lie alike after several."""
    stick, slip = 2.0, 1.0
    period = stick + slip
    time = period / rows * np.arange(int(40 * rows)) % period
    late, turn = np.maximum(time - stick, 0.0), 2 * np.pi / slip
    q = (time - period / slip * (late - np.sin(turn * late) / turn))[:, None]
    v = (1.0 - period / slip * (1.0 - np.cos(turn * late)))[:, None]
    told = fundamental(period / rows, q, v, np.ones(1)).hz * period
    assert np.isnan(told) or told == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ([(1, 37.3, 0.0), (5, 74.6, 1.0)], 37.3),  # loudest at the second harmonic
        ([(1, 80.0, 0.0), (0.03, 40.0, 1.0)], 40.0),  # a doubled period
        ([(1, 60.0, 0.0), (0.3, 90.0, 1.0)], 30.0),  # without a line at it
        ([(1, 313.0, 0.0), (0.2, 494.3, 1.0)], np.nan),  # two frequencies
        ([(1, 100.0, 0.0), (0.4, 161.8034, 1.0)], np.nan),
        ([(1, 207.0, 0.0), (0.036, 261.855, 1.0)], np.nan),  # 16 periods return no better than 4
    ],
)
def test_the_loudest_line_is_not_the_frequency(parts, told):
    assert fundamental(*tones(2.5e-4, 4000, *parts)).hz == pytest.approx(
        told, rel=1e-6, nan_ok=True
    )


def test_what_has_no_frequency():
    assert np.isnan(fundamental(*tones(1 / 950, 2000, (1, 1000.0, 0.0))).hz)  # rows in step with it
    time = np.arange(20, 60, 0.02)

    def lorenz(_, y):
        return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]

    x = solve_ivp(lorenz, (0, 60), [1, 1, 1], t_eval=time, rtol=1e-8).y.T
    v = np.array([lorenz(0, row) for row in x])
    assert np.isnan(fundamental(0.02, x, v, np.ones(3)).hz)
    assert np.isnan(fundamental(0.1, np.ones((50, 1)), np.zeros((50, 1)), np.ones(1)).hz)  # at rest
    assert np.isnan(fundamental(0.1, np.ones((50, 0)), np.ones((50, 0)), np.ones(0)).hz)
    decays = np.exp(-30 * time)[:, None] * np.cos(300 * time)[:, None]
    assert np.isnan(fundamental(0.02, decays, decays, np.ones(1)).hz)


def test_words():
    assert motion_frequency(95.2, 285.5) == "95, x3"
    assert motion_frequency(95.2, 95.3) == "95"
    assert motion_frequency(95.2, np.nan) == "95"
    assert motion_frequency(np.nan, 3131.0) == "~3131"
    assert motion_frequency(np.nan, np.nan) == "-"


@pytest.mark.parametrize("hz", [17.3, 41.7, 96.1])
@pytest.mark.parametrize("second", [0.0, 0.003, 0.01])
def test_the_error_holds_what_another_motion_does(hz, second):
    """Beside a second motion of an unlike frequency, which is no part of the period."""
    found = fundamental(*tones(1e-3, 900, (1, hz, 1.0), (second, hz * 2**0.5, 0.3)))
    assert abs(found.hz / hz - 1) <= found.error
    assert found.error < 0.02


def test_a_window_of_a_run_is_searched_once(monkeypatch):
    step, q, v, omega = tones(2.5e-4, 4000, (1.0, 100.0, 0.0))
    history = {"time": step * np.arange(len(q)), "torque": q[:, 0]}
    run = made_up(history, q, v, omega, None, (q[:, :0], q[:, :0]))
    asked = []
    search = lambda *record: asked.append(record) or fundamental(*record)  # noqa: E731
    monkeypatch.setattr(periods, "fundamental", search)
    window = periods.judged_window(run)
    assert (window.start, window.stop) == (2400, 4000)
    for rows in (window, slice(2400, None)):  # the same rows
        assert periods.own_frequency(run, rows).hz == pytest.approx(100.0, rel=1e-6)
    assert len(asked) == 1
    faster = replace(
        run, displacement=q[::2], velocity=v[::2], history={k: x[::2] for k, x in history.items()}
    )
    assert periods.judged_window(faster) == slice(1200, 2000)
    assert periods.own_frequency(faster, slice(1200, 2000)).hz == pytest.approx(100.0, rel=1e-6)
    periods.own_frequency(run, slice(0, 2400))
    assert len(asked) == 3
    assert np.isnan(periods.own_frequency(run, slice(5000, None)).hz)  # no rows
