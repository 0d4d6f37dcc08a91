"""The working point beside its closed form: found, refused, or flagged."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.laboratory.method_stability.contract import CONVERGED, FAILED, SLOW, WRONG
from squealstudy.laboratory.method_stability.equilibrium import (
    AREA_M2,
    CONDENSED_STIFFNESS,
    CRITICAL,
    P_0,
    WORKING_POINT,
    equilibrium_gap,
    one_point,
)
from squealstudy.laws import contact_law
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction import working_point as solver
from squealstudy.reduction.gap_equations import GapJacobian
from squealstudy.reduction.working_point import working_point


@pytest.mark.parametrize(("lam", "pressure"), [(1e5, 1e4), (5e5, 1e3), (1e5, 1e5), (5e5, 1e6)])
def test_there_is_an_equilibrium_up_to_the_predicted_friction(lam, pressure):
    def found(friction):
        values = {"friction": friction, "lambda": lam, "pressure": pressure}
        return WORKING_POINT.evaluate(values)

    low, high = 0.0, 5.0
    for _ in range(16):
        middle = (low + high) / 2
        low, high = (middle, high) if found(middle).outcome in (CONVERGED, SLOW) else (low, middle)
    assert found(low).predicted == pytest.approx(1.0, rel=1e-3)
    beyond = found(1.01 * low)
    assert (beyond.outcome, beyond.flagged) == (FAILED, True)


@pytest.mark.parametrize("friction", [0.0, 0.5, CRITICAL, 1.3])
@pytest.mark.parametrize("load", [-500.0, 0.0, 2000.0])
def test_closed_form_balances(friction, load):
    y = equilibrium_gap(5e5, load, friction)
    share = 1 - friction / CRITICAL
    if np.isnan(y):
        assert share < 0
        return
    balance = load + share * AREA_M2 * P_0 * np.exp(-5e5 * y)
    assert CONDENSED_STIFFNESS * y == pytest.approx(balance, abs=1e-8 * (abs(load) + 1))


def test_any_pressure_law_tension_and_start_converges():
    grid = itertools.product(
        np.geomspace(1e2, 1e8, 5), np.geomspace(1e4, 1e8, 5), [0.0, 1e4], [-500.0, 0.0, 500.0]
    )
    cells = [
        WORKING_POINT.evaluate({"pressure": p, "lambda": lam, "tension": f, "start": s})
        for p, lam, f, s in grid
    ]
    assert {x.outcome for x in cells} <= {CONVERGED, SLOW}
    assert all(x.error < 1e-6 for x in cells)


def test_the_pressed_branch_is_flagged_by_its_root():
    cells = [
        WORKING_POINT.evaluate({"friction": mu, "tension": f})
        for mu, f in itertools.product([1.3, 1.4, 1.8], [1500.0, 2000.0, 3000.0])
    ]
    wrong = [x for x in cells if x.outcome == WRONG]
    assert wrong
    assert all(x.flagged and x.by == "real positive root" for x in wrong)


def test_a_singular_jacobian_is_a_failure_with_a_name(monkeypatch):
    """A point whose contact is all that holds it, and is open: dF/dg = 1 - 1."""
    one, zero = np.ones(1), np.zeros(1)
    free = replace(one_point(0.0), k_c=1.0, area=one, C_NN=np.eye(1), C_TN=np.zeros((1, 1)))
    point = OperatingPoint(0.5, 1e6, 1.0, contact_law())
    with pytest.raises(la.LinAlgError):
        GapJacobian(free, point, zero, zero)
    singular = lambda *given: GapJacobian(free, point, zero, zero)  # noqa: E731
    monkeypatch.setattr(solver, "GapJacobian", singular)
    with pytest.raises(ConvergenceError) as caught:
        working_point(one_point(0.0), point)
    assert caught.value.status == "working_point"
