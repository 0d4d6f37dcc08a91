"""The answer of a study of methods: what costs least within its tolerance, and how sure that is."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from squealstudy.kinds.work_precision.screen import MOST_ROWS, SCREEN, WORDS
from squealstudy.kinds.work_precision.section import FREQUENCY_QUANTITIES, TIME_QUANTITIES
from squealstudy.screen import as_text


def results_of(*rows, tolerance=1e-2, quantity="torque_rms"):
    """Rows of (method, label, default, cost, error, upper bound of the error)."""
    names = ["method", "label", "default", "cost", f"error_{quantity}", f"high_{quantity}"]
    table = pd.DataFrame([("exact", "exact", False, 9.0, 0.0, 0.0), *rows], columns=names)
    table = table.assign(
        reference=table["method"] == "exact",
        status="ok",
        n_failed=0,
        missed=0,
        spurious=0,
        seconds_median=table["cost"],
        setup_seconds=0.0,
        seconds_min=0.9 * table["cost"],
        seconds_max=1.1 * table["cost"],
        memory_mb=1.0,
        iterations=1.0,
        n_coordinates=10,
    )
    table[f"within_{quantity}"] = False
    errors = pd.DataFrame({"label": table["label"], "point": 0, "quantity": quantity})
    errors = errors.assign(value=1.0, truth=1.0)
    facts = {"quantities": [quantity], "tolerance": tolerance, "over": 2, "reference": "exact"}
    return SimpleNamespace(
        measurements=table, fact=facts.__getitem__, table={"errors": errors}.__getitem__
    )


ROUGH = ("newmark", "newmark, step 4", False, 1.0, 5e-2, 6e-2)
FINE = ("newmark", "newmark, step 1", False, 4.0, 1e-3, 2e-3)
USUAL = ("usual", "usual, step 1", True, 6.0, 2e-3, 7e-2)


def test_the_cheapest_within_the_tolerance_of_the_study_is_told():
    told = SCREEN.verdict(results_of(ROUGH, FINE, USUAL))
    assert told == (
        "Of 3 measurements against 'exact' the cheapest within 0.01 in RMS is 'newmark, step 1': "
        "4 s a design point; the default method takes 1.50 times that ('usual, step 1'). "
        "The largest error of the cheapest is 1.0e-03."
    )
    of_onset = results_of(FINE, quantity="onset")
    of_onset.measurements["cost_onset"] = 7.0  # of a whole line of points
    assert "within 0.01 in onset is 'newmark, step 1': 7 s an onset" in SCREEN.verdict(of_onset)
    rough = SCREEN.verdict(results_of(ROUGH, FINE, USUAL, tolerance=0.1))
    assert "the cheapest within 0.1 in RMS is 'newmark, step 4'" in rough


def test_methods_whose_times_overlap_are_as_cheap():
    """Of 5.2 and 5.5 ms, each with a scatter of 10 %, one was the cheapest and that was all."""
    near, far = (("other", f"other, step {c}", False, c, 1e-3, 2e-3) for c in (4.5, 5.0))
    told = SCREEN.verdict(results_of(FINE, USUAL, near))
    assert told.endswith(". As cheap within the scatter of times: 'other, step 4.5'.")
    assert "As cheap" not in SCREEN.verdict(results_of(FINE, USUAL, far))
    rough = ("other", "other, step 4.1", False, 4.1, 5e-2, 5e-2)
    assert "As cheap" not in SCREEN.verdict(results_of(FINE, USUAL, rough))


def test_an_error_that_chance_may_hide_is_told_with_its_bound():
    told = SCREEN.verdict(results_of(USUAL))
    error = "The largest error of the cheapest is 2.0e-03, but"
    assert f": 6 s a design point, by the default method. {error}" in told
    assert told.endswith("the bounds (95 %) of both results allow up to 7.0e-02.")


def test_where_none_is_within_it_the_most_exact_is_told():
    told = SCREEN.verdict(results_of(ROUGH, USUAL, tolerance=1e-4))
    assert told == (
        "None of 2 measurements against 'exact' is within 0.0001 in RMS; the most exact is "
        "'usual, step 1', with 2.0e-03."
    )
    other = (*USUAL[:2], False, *USUAL[3:])
    told = SCREEN.verdict(results_of((*ROUGH[:2], True, *ROUGH[3:]), other))
    assert (
        "; no setting of the default method is within it. The largest error of the cheapest" in told
    )


def test_where_no_error_is_known_none_is_told_as_0():
    """As of an onset that neither the reference nor the methods have."""
    unknown = results_of((*ROUGH[:4], np.nan, np.nan), (*USUAL[:4], np.nan, np.nan))
    told = SCREEN.verdict(unknown)
    assert told == "No error in RMS is known of 2 measurements against 'exact'."
    failed = results_of(ROUGH)
    failed.measurements.loc[1, "n_failed"] = 1
    told = SCREEN.verdict(failed)
    assert told.startswith("No measurement counts: in each a point failed")


def test_of_many_measurements_one_of_each_method_is_listed():
    many = [("newmark", f"newmark, step {k}", False, 1.0 + k, 9e-3, 9e-3) for k in range(MOST_ROWS)]
    text = as_text(SCREEN.findings(results_of(*many, USUAL, ROUGH)))
    shown = text.split("passes")[1]
    assert "newmark, step 0" in shown
    assert "newmark, step 1" not in shown
    assert "exact (reference)" in shown
    assert "usual, step 1" in shown
    assert f"or the most exact; {MOST_ROWS} more in the measurements table" in text
    assert "more in the measurements" not in as_text(SCREEN.findings(results_of(ROUGH, USUAL)))


def test_an_exact_method_errs_by_0_and_modes_have_no_passes():
    results = results_of(("windows", "windows", True, 1.0, 0.0, 0.0))
    results.measurements["iterations"] = np.nan
    text = as_text(SCREEN.findings(results))
    assert " by the default method. The largest error of the cheapest is 0." in SCREEN.verdict(
        results
    )
    assert "0.0e+00" not in text
    assert "passes" not in text


@pytest.mark.parametrize("quantity", [*FREQUENCY_QUANTITIES, *TIME_QUANTITIES])
def test_every_quantity_has_words(quantity):
    assert WORDS[quantity]


def test_what_a_cost_consists_of_is_told_with_the_reduction_where_it_has_one():
    """An onset of 0.55 s cost 1.6 s, and the legend told neither of the line nor of reductions."""
    plain = results_of(FINE, USUAL)
    assert "cost:" not in as_text(SCREEN.findings(plain))  # the time of a point alone
    plain.measurements["setup_seconds"], plain.measurements["cost"] = 2.0, [10.0, 5.0, 7.0]
    assert "cost: seconds a point and 1/2 of the set-up" in as_text(SCREEN.findings(plain))
    plain.measurements["cost"] += 1.0
    told = as_text(SCREEN.findings(plain), 200)
    assert "cost: seconds a point and 1/2 of the set-up and the reduction" in told
    onsets = results_of(FINE, USUAL, quantity="onset")
    onsets.measurements[["cost_onset", "onset_seconds"]] = 8.25, 7.5
    onsets.measurements["setup_seconds"] = 2.0
    told = as_text(SCREEN.findings(onsets), 200)
    assert "cost: seconds an onset, and for each point of its line 1/2 of the set-up" in told
    assert re.search(r"newmark, step 1 +4 +7.5 +2 +8.25 ", told)  # not the cost of a point, 4 s


def test_a_dearer_setting_of_the_method_that_fails_is_told():
    """50 vectors of a run of 5 ms were within it, and 50 of a run of 10 ms were not."""
    more = ("newmark", "newmark, step 0.5", False, 5.0, 0.2, 0.3)
    told = SCREEN.verdict(results_of(ROUGH, FINE, more))
    assert told.endswith(" Of the same method 'newmark, step 0.5' costs more and is not within it.")
    assert "not within" not in SCREEN.verdict(results_of(ROUGH, FINE, USUAL))


def test_sizes_lacking_values_and_points_without_truth_are_told():
    results = results_of(ROUGH, FINE, USUAL)
    plain = as_text(SCREEN.findings(results))
    for word in ("coordinates", "none:", "status", " of them"):
        assert word not in plain
    assert "... step 1 " in plain
    assert "...: the method of the line above" in plain
    errors, table = results.table("errors"), results.measurements
    errors.loc[errors["label"] == "newmark, step 4", "value"] = np.nan
    errors.loc[len(errors)] = ["exact", 1, "torque_mean", 1.0, 1.0]
    table.loc[table["label"] == "exact", "n_coordinates"] = 2000
    table.loc[table["label"] == "usual, step 1", "missed"] = 1
    told = as_text(SCREEN.findings(results))
    assert "4 s a design point, 10 coordinates; " in " ".join(told.split())
    assert re.search(r"newmark, step 4 +10 +1 +1.00 +none +ok", told)
    assert "none: at some point the reference has such a value" in told
    assert "the largest of 2 measured points (RMS at 1 of them)" in " ".join(told.split())
    assert "ok, 1 missed" in told
    results.measurements["seconds_median"] = 0.5 * table["cost"]  # and as much of the set-up
    told = as_text(SCREEN.findings(results))
    assert re.search(r"usual, step 1 +10 +3 +6 +1.00 ", told)
