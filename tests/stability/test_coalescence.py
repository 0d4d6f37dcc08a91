"""Perturbation beside a lock-in: where the expansion ends, and who says so."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from squealstudy.laboratory.method_stability.coalescence import (
    COALESCENCE,
    exact_roots,
    flutter_matrices,
)
from squealstudy.laboratory.method_stability.contract import CONVERGED, WRONG
from squealstudy.linalg.companion import all_pairs

CRITICAL = (100**2 - 75**2) / (2 * 100 * 75)


@pytest.mark.parametrize("mu", [0.0, 0.2, CRITICAL, 0.8])
def test_closed_form(mu):
    C, K, coupling = flutter_matrices(0.02)
    found = all_pairs(C, K + mu * coupling).lam
    found = found[found.imag > 0]
    for root in exact_roots(mu, 0.02):
        assert np.abs(found - root).min() < 1e-6 * abs(root)
    split = np.ptp(np.abs(exact_roots(mu, 0.0).imag))
    assert (split > 1.0) == (mu < CRITICAL)


@pytest.fixture(scope="module")
def cells():
    anchors, steps = np.linspace(0.0, 0.9, 13), np.geomspace(1e-4, 0.5, 12)
    return [
        COALESCENCE.evaluate({"anchor": a, "step": s, "tolerance": t})
        for a, s, t in itertools.product(anchors, steps, (1e-3, 1e-6))
    ]


def test_the_boundary_is_where_it_is_predicted(cells):
    far = [x for x in cells if not 0.6 < x.predicted < 1.5]
    agreed = [(x.predicted < 1) == (x.outcome == CONVERGED) for x in far]
    assert np.mean(agreed) >= 0.99
    assert sum(x.outcome == WRONG for x in far) > 30


def test_nothing_is_wrong_without_a_word(cells):
    assert all(x.flagged for x in cells if x.outcome == WRONG)
    calm = [x for x in cells if x.predicted < 0.5]
    assert not any(x.flagged for x in calm)


def test_third_term_is_the_error():
    cell = COALESCENCE.evaluate({"anchor": 0.35, "step": 0.002, "damping_ratio": 0.0})
    assert cell.measured == pytest.approx(cell.predicted**3, rel=0.15)


def test_beyond_the_radius_no_tolerance_helps():
    cell = COALESCENCE.evaluate({"anchor": 0.35, "step": 0.1, "tolerance": 0.1})
    assert cell.predicted > 1.0
    errors = [COALESCENCE.evaluate({"anchor": 0.35, "step": s}).error for s in (0.02, 0.2)]
    assert errors[1] > 50 * errors[0]
