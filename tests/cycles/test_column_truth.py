"""A reduced hunt for false columns (studies/benchmarks/column_truth.py), and that it finds some."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies" / "benchmarks"))

from column_cases import case_of_kind
from column_compare import Told, relative
from column_truth import compared, report, table_of

EXACT = {
    "predicted_growth_rate",
    "predicted_frequency_hz",
    "n_unstable",
    "torque_static",
    "max_growth_rate",
    "torque",
    "normal_force",
    "verdict",
    "torque_rms (loudest)",
}
LEVELS = ("torque_mean", "torque_rms", "torque_peak_to_peak", "frequency_hz")


@pytest.fixture(scope="module")
def found():
    """What some cases tell beside the judge: runs of each model, and limit cycles."""
    cases = [case_of_kind("transient", k, 1) for k in (0, 3)]
    cases += [case_of_kind("transient", k, 4) for k in (7, 14)]
    return [(case, compared(case)) for case in cases]


@pytest.fixture(scope="module")
def cycles():
    """The same of limit cycles, of the belt."""
    case = case_of_kind("limit_cycles", 8, 1)
    return [(case, compared(case))]


@pytest.mark.full_size  # all cases are drawn
def test_cases_are_of_several_models_and_the_same_each_time(found):
    assert {case.design.model for case, _ in found} == {"hoffmann", "hulten"}
    for case, _ in found:
        assert case.text in [case_of_kind(case.kind, case.number, seed).text for seed in (1, 4)]


@pytest.mark.parametrize("of", ["found", pytest.param("cycles", marks=pytest.mark.full_size)])
def test_what_the_judge_knows_exactly_is_told(of, request):
    found = request.getfixturevalue(of)
    for case, told in found:
        own = [t for t in told if t.column in EXACT]
        assert len(own) >= 4
        for t in own:
            assert t.inside, (case.kind, case.number, t)
        for t in told:  # with bounds of their own, which the whole hunt judges
            if t.column in ("torque_mean", "torque_rms"):
                assert t.told == pytest.approx(t.truth, rel=0.02), (case.kind, case.number, t)


def test_a_motion_that_repeats_beside_stable_sliding_is_no_undecided_one(found):
    (told,) = (told for case, told in found if case.design.contact_law == "exponential")
    assert [(t.told, t.truth) for t in told if t.column == "class"] == [("cycle", "cycle")]


def test_levels_of_friction_that_sticks(found):
    """Two corners a period at each point: RMS, mean, peaks and frequency within their bounds."""
    told = found[3][1]
    levels = [t for t in told if t.bounded and t.column in LEVELS]
    assert len(levels) == len(LEVELS)
    assert all(t.inside for t in levels), levels
    assert (
        abs(levels[1].told / levels[1].truth - 1) < 6e-5
    )  # 1.7e-4 with sub-steps that grow faster


def test_the_report_counts_what_is_outside(found):
    case = found[0][0]
    false = Told("points", "torque_rms", 1.0, 0.9, 1.1, 2.0)
    table = table_of(iter([*found, (case, [false])]))
    assert (~table["inside"]).sum() >= 1
    text = report(table)
    assert f"{len(table)} numbers" in text
    assert "torque_rms" in text


def test_bounds_of_a_number():
    assert relative("points", "torque_rms", 100.0, 0.01, 100.9).inside
    assert not relative("points", "torque_rms", 100.0, 0.01, 101.2).inside
    assert relative("points", "torque_rms", 100.0, 0.01, 100.5).width == pytest.approx(2.0)
    assert not Told("points", "class", "stable", np.nan, np.nan, "cycle").inside
