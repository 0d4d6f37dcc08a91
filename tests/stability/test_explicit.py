"""Central differences: the limit of the step, free, damped and in stick."""

from __future__ import annotations

import numpy as np
import pytest
from shared_kernels import OF_COMPARED_INTEGRATORS

from squealstudy.laboratory.method_stability.contract import CONVERGED, FAILED, WRONG
from squealstudy.laboratory.method_stability.explicit import EXPLICIT

pytestmark = OF_COMPARED_INTEGRATORS

OMEGA = 2 * np.pi * 1e3


def crossing(values, low, high):
    """The longest step that is bounded."""
    for _ in range(20):
        middle = np.sqrt(low * high)
        bounded = EXPLICIT.evaluate({**values, "step": middle}).outcome == CONVERGED
        low, high = (middle, high) if bounded else (low, middle)
    return low


@pytest.mark.parametrize("damping", [0.0, 0.2])
def test_a_free_mode_is_bounded_up_to_two(damping):
    step = crossing({"damping_ratio": damping}, 1e-5, 1e-3)
    assert step * OMEGA == pytest.approx(2.0, rel=1e-3)
    beyond = EXPLICIT.evaluate({"damping_ratio": damping, "step": 1.002 * step})
    assert (beyond.outcome, beyond.flagged) == (FAILED, True)


@pytest.mark.parametrize(("lagged", "weight"), [(1.0, 2.0), (0.0, 4.0)])
@pytest.mark.parametrize("rate", [3e3, 1e5])
def test_a_stuck_point_shortens_the_step(lagged, weight, rate):
    step = crossing({"lagged": lagged, "stick_rate": rate}, 1e-6, 1e-3)
    exact = (np.sqrt((weight * rate) ** 2 + 16 * OMEGA**2) - weight * rate) / (2 * OMEGA**2)
    assert step == pytest.approx(exact, rel=1e-3)
    values = {"lagged": lagged, "stick_rate": rate, "step": step}
    assert EXPLICIT.evaluate(values).predicted == pytest.approx(1.0, rel=1e-3)


@pytest.mark.as_python
def test_growth_in_stick_is_flagged_and_its_factor_that_of_the_recurrence():
    h, c = 3e-5, 1e5
    cell = EXPLICIT.evaluate({"step": h, "stick_rate": c, "lagged": 1.0})
    assert (cell.outcome, cell.flagged) == (WRONG, True)
    roots = np.roots([1.0, -(2.0 - h * c - (h * OMEGA) ** 2), 1.0 - h * c])
    assert cell.measured == pytest.approx(np.abs(roots).max(), rel=0.1)


@pytest.mark.as_python
def test_a_warning_at_a_bounded_run_is_told_too():
    """The energy of the mode beats here, as it is not what the scheme conserves."""
    cell = EXPLICIT.evaluate({"step": 3e-5, "stick_rate": 1e3})
    assert (cell.outcome, cell.flagged) == (CONVERGED, True)
    assert cell.by.startswith("energy drift")


@pytest.mark.as_python
def test_a_run_that_is_gone_within_a_step_has_grown():
    cell = EXPLICIT.evaluate({"step": 1e-3, "stick_rate": 1e6})
    assert cell.outcome in ("failed", "wrong")
    assert cell.flagged
    assert cell.measured > 1e3
    assert EXPLICIT.evaluate({"step": 3e-4, "stick_rate": 1e6}).outcome != "converged"
