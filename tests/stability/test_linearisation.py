"""The companion form beside closed-form roots."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.linalg as la

from squealstudy.laboratory.method_stability import linearisation
from squealstudy.laboratory.method_stability.contract import CONVERGED, WRONG
from squealstudy.laboratory.method_stability.linearisation import LINEARISATION, turned_modes

GRID = [
    {"stiffness_ratio": r, "damping_ratio": z}
    for r, z in itertools.product(np.geomspace(1.0, 1e18, 13), np.geomspace(1e-3, 1e6, 13))
]


@pytest.fixture(scope="module")
def cells():
    return [LINEARISATION.evaluate(values) for values in GRID]


def test_closed_form_roots_are_those_of_the_matrices():
    C, K, exact = turned_modes(100.0, 3.0)
    for root in exact:
        Q = root**2 * np.eye(len(K)) + root * C + K
        assert la.svdvals(Q)[-1] < 1e-12 * la.norm(K)
    assert (exact.imag == 0).sum() == 2


def test_nothing_is_wrong_within_the_boundary_or_without_a_word(cells):
    assert all(x.outcome == CONVERGED for x in cells if x.predicted < 1)
    wrong = [x for x in cells if x.outcome == WRONG]
    assert len(wrong) > 30
    assert all(x.flagged for x in wrong)
    assert not any(x.flagged for x in cells if x.predicted < 1e-3)


def test_the_prediction_is_a_bound_and_not_far_off_light_damping(cells):
    assert all(x.measured < 2 * x.predicted + 1e-9 for x in cells)
    light = [
        x
        for x, values in zip(cells, GRID, strict=True)
        if values["damping_ratio"] < 0.1 and values["stiffness_ratio"] > 1e6
    ]
    near = [x.measured > 1e-3 * x.predicted for x in light]  # round-off of one cell may be small
    assert len(near) > 5
    assert np.mean(near) > 0.8


def test_without_time_scaling_the_estimate_still_tells(monkeypatch):
    def unscaled(C, K, band):
        n = len(K)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
        lam, z = la.eig(A)
        lam, z = lam[lam.imag >= 0], z[:n, lam.imag >= 0]
        return lam, (z + 1e-5 * np.abs(z).max()) / np.linalg.norm(z, axis=0)

    monkeypatch.setattr(linearisation, "dense_roots", unscaled)
    assert LINEARISATION.evaluate({"stiffness_ratio": 1e3}).flagged
