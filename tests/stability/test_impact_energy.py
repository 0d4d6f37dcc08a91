"""Energy that average acceleration makes in impacts: where, and who says so."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from shared_kernels import OF_COMPARED_INTEGRATORS

from squealstudy.laboratory.method_stability.contract import CONVERGED, FAILED, WRONG, checked
from squealstudy.laboratory.method_stability.impact_energy import (
    IMPACT_ENERGY,
    STEP_LIMIT,
    fly,
    peak_number,
)
from squealstudy.motion.integrator import DRIFT_LIMIT
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.level_errors import N_BALANCE_BLOCKS, _drifting, energy_drift


def at(number, shift=1.0):
    """Values whose h omega_peak is `number`, at different phases of the impacts."""
    of_one = peak_number(checked(IMPACT_ENERGY.knobs, {"step": 1e-6, "velocity": shift}))
    return {"step": 1e-6 * number / of_one, "velocity": shift}


PHASES = np.linspace(0.97, 1.03, 7)


def test_peak_stiffness_is_that_of_the_forecast():
    knobs = checked(IMPACT_ENERGY.knobs, at(0.05))
    highest = knobs["lambda"] * fly(knobs).history["normal_force"].max()
    expected = (peak_number(knobs) / knobs["step"]) ** 2
    assert highest == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("number", [0.6, 1.0, STEP_LIMIT / 1.01])
def test_nothing_is_gained_below_the_limit(number):
    cells = [IMPACT_ENERGY.evaluate(at(number, s)) for s in PHASES]
    assert all(x.predicted < 1 for x in cells)
    assert all(x.outcome == CONVERGED for x in cells)
    assert max(x.error for x in cells) < 5e-3


def test_energy_is_gained_at_twice_the_limit():
    cells = [IMPACT_ENERGY.evaluate(at(2.5, s)) for s in PHASES]
    assert all(x.outcome == WRONG for x in cells)
    assert max(x.measured for x in cells) > 1.05
    errors = [np.mean([IMPACT_ENERGY.evaluate(at(x, s)).error for s in PHASES]) for x in (1, 2)]
    assert errors[1] > 30 * errors[0]


def test_no_gain_goes_without_a_word():
    cells = [
        IMPACT_ENERGY.evaluate(at(number, s))
        for number, s in itertools.product([1.5, 1.8, 2.1, 2.5, 3.0, 5.0], PHASES)
    ]
    outcomes = [x.outcome for x in cells]
    assert {WRONG, FAILED} <= set(outcomes)
    assert all(x.flagged for x in cells if x.outcome != CONVERGED)


@pytest.fixture(scope="module")
def flight():
    return fly(checked(IMPACT_ENERGY.knobs, at(0.6)))


def with_imbalance(flight, imbalance):
    """The run with energy that came from nowhere."""
    history = {**flight.history, "stored": flight.history["stored"] + imbalance}
    return replace(flight, history=history)


def test_drift_is_what_stays(flight):
    n = len(flight.history["time"])
    scale = flight.history["modal_energy"].max()
    assert energy_drift(flight) < 1e-6
    bump = np.zeros(n)
    bump[n // 2 : n // 2 + n // 50] = 0.1 * scale
    assert energy_drift(with_imbalance(flight, bump)) < 1e-6
    gained = np.where(np.arange(n) > n // 2, 0.02 * scale, 0.0)
    assert energy_drift(with_imbalance(flight, gained)) == pytest.approx(0.02, rel=1e-3)
    lost_again = np.where(np.abs(np.arange(n) / n - 0.5) < 0.2, 0.02 * scale, 0.0)
    assert energy_drift(with_imbalance(flight, lost_again)) == pytest.approx(0.02, rel=1e-3)


def test_a_run_that_explodes_in_its_last_rows_is_caught(flight):
    """The medians of its tenth parts do not see it yet; an impact that goes on is none."""
    n, scale = len(flight.history["time"]), float(flight.history["modal_energy"].max())
    end = np.where(np.arange(n) >= n - 3, scale, 0.0)
    assert energy_drift(with_imbalance(flight, 0.1 * end)) < 1e-6
    assert energy_drift(with_imbalance(flight, 10 * end)) > 0.5


def test_drift_of_short_and_resting_runs(flight):
    short = {name: rows[: N_BALANCE_BLOCKS - 1] for name, rows in flight.history.items()}
    assert np.isnan(energy_drift(replace(flight, history=short)))
    rest = {name: 0.0 * rows for name, rows in flight.history.items()}
    assert energy_drift(replace(flight, history=rest)) == 0.0


def test_the_row_of_a_run_says_so():
    for limit in (DRIFT_LIMIT, ExactFreeMotion.drift_limit):
        assert _drifting(0.9 * limit, 1e-6, limit) == ""
        assert "levels may be wrong" in _drifting(1.1 * limit, 1e-6, limit)
    assert _drifting(float("nan"), 1e-6, DRIFT_LIMIT) == ""
    text = _drifting(0.024, 1e-6, DRIFT_LIMIT)
    assert "2.4 % of the energy of the vibration" in text
    assert "a step of 5e-07 s" in text


def test_exact_free_motion_gains_where_newmark_does_and_says_so():
    cells = [
        IMPACT_ENERGY.evaluate({**at(number, s), "exact": 1.0})
        for number in (0.3, 0.6, 2.5, 5.0)
        for s in PHASES
    ]
    below, beyond = cells[: 2 * len(PHASES)], cells[2 * len(PHASES) :]
    assert {x.outcome for x in below} == {CONVERGED}
    assert {WRONG, FAILED} & {x.outcome for x in beyond}
    assert all(x.flagged for x in beyond if x.outcome in (WRONG, FAILED))


@OF_COMPARED_INTEGRATORS
@pytest.mark.parametrize("number", [1.0, 2.5, 5.0])
def test_the_discrete_gradient_gains_nothing(number):
    cells = [IMPACT_ENERGY.evaluate({**at(number, s), "gradient": 1.0}) for s in PHASES]
    assert all(x.outcome == CONVERGED for x in cells)
    assert max(x.error for x in cells) < 1e-6
