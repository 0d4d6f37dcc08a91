"""Near-dependent traces: kept above the tolerance, dropped below it, orthonormal always."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from squealstudy.laboratory.method_stability import orthonormalisation
from squealstudy.laboratory.method_stability.contract import CONVERGED, FAILED, RECOVERED, WRONG
from squealstudy.laboratory.method_stability.orthonormalisation import ORTHONORMALISATION
from squealstudy.reduction.orthonormal import MODE_TOLERANCE


@pytest.mark.parametrize("held", [1e-3, 1.0, 100.0])
@pytest.mark.parametrize("tolerance", [MODE_TOLERANCE, 1e-4])
def test_rank_is_lost_at_the_tolerance(held, tolerance):
    def kept(dependence):
        values = {"dependence": dependence, "held": held, "tolerance": tolerance}
        return ORTHONORMALISATION.evaluate(values)

    low, high = tolerance * 1e-2, 1.0
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if kept(middle).outcome == CONVERGED else (middle, high)
    assert kept(high).predicted == pytest.approx(1.0, rel=1e-2)
    below = kept(0.9 * high)
    assert (below.outcome, below.by) == (RECOVERED, "truncation")
    assert below.flagged
    assert below.measured == 1.0


def test_what_is_dropped_is_no_more_than_the_tolerance():
    grid = itertools.product(np.geomspace(1e-12, 0.9, 10), np.geomspace(1e-7, 0.1, 7))
    cells = [ORTHONORMALISATION.evaluate({"dependence": d, "tolerance": t}) for d, t in grid]
    assert {x.outcome for x in cells} == {CONVERGED, RECOVERED}
    assert all(x.outcome == CONVERGED for x in cells if x.predicted < 0.99)


def test_tolerances_below_what_squares_show_are_wrong_and_flagged():
    grid = itertools.product(np.geomspace(1e-12, 0.9, 10), np.geomspace(1e-14, 1e-9, 6))
    cells = [ORTHONORMALISATION.evaluate({"dependence": d, "tolerance": t}) for d, t in grid]
    wrong = [x for x in cells if x.outcome == WRONG]
    assert wrong
    assert all(x.flagged and x.predicted > 1 for x in wrong)


def test_projecting_once_is_not_enough(monkeypatch):
    def once(M, K, phi, blocks):
        ((X, _),) = blocks
        X = X - phi @ (phi.T @ (M @ X))
        L = np.linalg.cholesky(X.T @ (M @ X))
        return np.hstack([phi, np.linalg.solve(L, X.T).T]), np.zeros(0)

    values = {"dependence": 1e-3, "held": 1e6}
    assert ORTHONORMALISATION.evaluate(values).outcome == RECOVERED
    monkeypatch.setattr(orthonormalisation, "complete_basis", once)
    assert ORTHONORMALISATION.evaluate(values).outcome == WRONG
    worse = ORTHONORMALISATION.evaluate({**values, "dependence": 1e-12})
    assert worse.outcome == FAILED
    assert worse.flagged
