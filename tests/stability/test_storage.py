"""Observation matrices in single precision: where contact forces change, and who says so."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from shared_kernels import IN_SINGLE_PRECISION
from study_texts import study_text

import squealstudy
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.laboratory.method_stability.contract import CONVERGED, WRONG
from squealstudy.laboratory.method_stability.storage import (
    FLOAT32_ROUND_OFF,
    OMEGA,
    ROWS,
    STORAGE,
    light_touch,
)
from squealstudy.motion import level_errors as doubts
from squealstudy.motion.level_errors import storage_number
from squealstudy.motion.warmup import warm_kernels
from squealstudy.study.definition import parse_study


@pytest.fixture(scope="module")
def cells():
    warm_kernels(single_storage=True)  # in one process of the session: both would take as long
    amplitudes, exponents = np.geomspace(1e-7, 1e-1, 7), np.geomspace(1e4, 1e9, 6)
    return [
        STORAGE.evaluate({"amplitude": a, "lambda": e})
        for a, e in itertools.product(amplitudes, exponents)
    ]


@IN_SINGLE_PRECISION
def test_the_boundary_is_where_it_is_predicted(cells):
    assert all((x.predicted < 1) == (x.outcome == CONVERGED) for x in cells)
    assert 5 < sum(x.outcome == WRONG for x in cells) < 25


@IN_SINGLE_PRECISION
def test_nothing_is_wrong_without_a_word_and_nothing_right_is_flagged(cells):
    assert all(x.flagged == (x.outcome == WRONG) for x in cells)


@IN_SINGLE_PRECISION
def test_the_error_is_round_off_times_the_exponent(cells):
    small = [x for x in cells if 1e-4 < x.predicted < 1]
    for x in small:  # rounded by 0.9 u each
        assert x.error == pytest.approx(0.9e-3 * x.predicted, rel=0.01)
        assert x.error <= 1.01 * x.measured


def test_double_precision_has_no_such_boundary():
    cell = STORAGE.evaluate({"amplitude": 0.1, "lambda": 1e9, "single": 0.0})
    assert (cell.outcome, cell.flagged, cell.error) == (CONVERGED, False, 0.0)


def test_the_bound_in_closed_form():
    system, design = light_touch(1e6)
    a = 1e-3
    energy = 0.5 * OMEGA**2 * a**2 * float(ROWS @ ROWS)
    assert storage_number(system, design, energy) == pytest.approx(
        np.expm1(1e6 * 1.8 * FLOAT32_ROUND_OFF * a), rel=1e-5
    )
    assert storage_number(system, design, 0.0) == 0.0


STUDY = (
    study_text("belt", "transient", "belt")
    + """\
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.05
step = 2e-5
save_every = 0
storage = "single"
"""
)


@IN_SINGLE_PRECISION
def test_a_run_says_so(tmp_path, monkeypatch):
    """A calm run says nothing; with another limit the same run names the key."""
    plan = Plan(parse_study(STUDY, tmp_path / "belt.toml"))
    run_study(plan, tmp_path / "calm", 1)
    assert squealstudy.open_results(tmp_path / "calm").points["message"][0] == ""
    monkeypatch.setattr(doubts, "MAX_STORAGE_CHANGE", -1.0)
    run_study(plan, tmp_path / "loud", 1)
    assert 'storage = "double"' in squealstudy.open_results(tmp_path / "loud").points["message"][0]
