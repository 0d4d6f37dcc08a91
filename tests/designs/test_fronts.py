"""Errors of findings against a reference, and fronts of error against cost."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.tables.method_quality import (
    at_tolerances,
    on_front,
    onset_errors,
    root_errors,
    run_errors,
)

TRUE = [-3.0 + 1000j, 20.0 + 2000j, -900.0 + 3000j]


def found(roots):
    return {"roots": [[r.real, r.imag] for r in roots]}


def largest(errors, quantity):
    return max((e.error for e in errors if e.quantity == quantity), default=None)


def test_errors_of_light_and_unstable_modes():
    errors, count = root_errors(found([-3.0 + 1010j, 22.0 + 2000j, -500.0 + 3100j]), found(TRUE))
    assert count == (0, 0)
    size = abs(-3.0 + 1010j) / abs(TRUE[0]) - 1
    assert largest(errors, "frequency") == pytest.approx(size)
    zeta = 22.0 / abs(22 + 2000j) - 20.0 / abs(20 + 2000j)
    assert largest(errors, "unstable_damping_ratio") == pytest.approx(zeta)
    assert largest(errors, "growth_rate") == pytest.approx(0.1)
    assert {e.mode for e in errors} == {1, 2}  # the heavily damped one is not judged


def test_heavily_growing_modes_are_judged_too():
    errors, count = root_errors(found([300 + 1000j]), found([310 + 1000j]))
    assert count == (0, 0)
    assert largest(errors, "growth_rate") == pytest.approx(10 / 310)


@pytest.mark.parametrize(
    ("roots", "count"),
    [
        ([-3.0 + 1000j, -1.0 + 2000j], (1, 0)),  # seen as stable
        ([-3.0 + 1000j], (1, 0)),  # not seen
        ([3.0 + 1000j, 20.0 + 2000j], (0, 1)),  # stable, seen as unstable
        ([*TRUE, 30.0 + 2500j], (0, 1)),  # not there
        ([-3.0 + 1000j, 20.0 + 2200j], (1, 1)),  # too far away to be the same
        ([], (1, 0)),
    ],
)
def test_missed_and_spurious_instabilities_are_counted(roots, count):
    assert root_errors(found(roots), found(TRUE))[1] == count


def test_a_light_mode_that_is_lost_is_an_error():
    errors, count = root_errors(found([20.0 + 2000j]), found(TRUE))
    assert count == (0, 0)
    assert largest(errors, "frequency") == 0.05
    assert largest(errors, "damping_ratio") == 0.05


def test_a_value_that_only_the_reference_knows_is_all_wrong():
    unknown = run(40.0)
    unknown["values"]["growth_rate"] = [None, None, None]
    errors, _ = run_errors(unknown, run(40.0))
    assert next(e.error for e in errors if e.quantity == "growth_rate") == 1.0


def run(rms, bounds=(None, None), growth=10.0, shares=None, line=3000.0, what="limit_cycle"):
    values = {
        "growth_rate": [growth, growth, growth],
        "torque_rms": [rms, *(b if b is not None else rms for b in bounds)],
        "torque_mean": [350.0, 350.0, 350.0],
        "dominant_frequency": [line, line, line],
    }
    return {
        "values": values,
        "class": what,
        "torque_static": 357.0,
        "predicted_frequency_hz": 3000.0,
        "energy_share": shares or {"3": 1.0},
    }


def test_levels_with_bounds_are_compared_as_intervals():
    errors, count = run_errors(run(42.0, (40.0, 44.0)), run(40.0, (39.0, 41.0)))
    rms = next(e for e in errors if e.quantity == "torque_rms")
    assert count == (0, 0)
    assert (rms.error, rms.low, rms.high) == pytest.approx((0.05, 0.0, 5.0 / 40.0))
    apart = run_errors(run(50.0, (48.0, 52.0)), run(40.0, (39.0, 41.0)))[0]
    assert next(e for e in apart if e.quantity == "torque_rms").low == pytest.approx(7 / 40)


def test_a_quiet_run_where_the_reference_squeals_is_missed():
    errors, count = run_errors(run(0.0, growth=-3.0), run(40.0))
    assert count == (1, 0)
    assert "dominant_frequency" not in {e.quantity for e in errors}  # nothing to compare
    assert run_errors(run(40.0), run(0.0))[1] == (0, 1)


def test_a_run_that_still_grows_has_no_level():
    errors, count = run_errors(run(40.0, what="growing"), run(30.0, what="growing"))
    assert count == (0, 0)
    assert {e.quantity for e in errors} == {"growth_rate", "torque_mean", "dominant_frequency"}


def test_faint_growth_is_compared_on_the_scale_of_its_frequency():
    errors, _ = run_errors(run(40.0, growth=3.0), run(40.0, growth=1.0))
    growth = next(e for e in errors if e.quantity == "growth_rate")
    assert growth.error == pytest.approx(2.0 / (2 * np.pi * 3.0))


def test_shares_of_modes_that_only_one_hears():
    errors, _ = run_errors(run(40.0, shares={"3": 0.9, "7": 0.1}), run(40.0))
    shares = {e.mode: e.error for e in errors if e.quantity == "energy_share"}
    assert shares == pytest.approx({3: 0.1, 7: 0.1})


numbers = st.floats(1e-6, 1e3)


@given(st.lists(st.tuples(numbers, numbers | st.just(float("nan"))), min_size=1, max_size=30))
def test_front_is_what_no_other_beats(points):
    cost, error = (np.array(x) for x in zip(*points, strict=True))
    front = on_front(cost, error)
    for i in range(len(cost)):
        better = (cost <= cost[i]) & (error <= error[i]) & ((cost < cost[i]) | (error < error[i]))
        same_before = (cost == cost[i]) & (error == error[i])
        if front[i]:
            assert not better.any()
        else:
            assert np.isnan(error[i]) or better.any() or front[same_before].any()


def measurements(rows):
    columns = {"status": "ok", "n_failed": 0, "missed": 0, "spurious": 0, "reference": False}
    return pd.DataFrame([columns | row for row in rows])


def test_default_against_the_cheapest_within_each_tolerance():
    table = measurements(
        [
            {"label": "a", "default": True, "cost": 3.0, "error_x": 1e-3, "error_y": 1e-5},
            {"label": "b", "default": False, "cost": 2.0, "error_x": 1e-3, "error_y": 1e-1},
            {"label": "c", "default": False, "cost": 1.0, "error_x": 0, "error_y": 0, "missed": 1},
            {"label": "d", "default": False, "cost": 0.1, "error_x": 0, "error_y": 0}
            | {"reference": True},
        ]
    )
    found = at_tolerances(table, ["x", "y"], [1e-2, 1e-4]).set_index(["quantity", "tolerance"])
    assert found.loc[("x", 1e-2), ["cheapest", "default", "ratio"]].tolist() == ["b", "a", 1.5]
    assert found.loc[("all", 1e-2), "cheapest"] == "a"  # b is wrong in y; c misses a mode
    assert found.loc[("all", 1e-2), "ratio"] == 1.0
    assert found.loc[("x", 1e-4), "cheapest"] == ""
    assert np.isnan(found.loc[("x", 1e-4), "ratio"])


def onset(value, low=None, high=None):
    return {"onset": [value, low or value, high or value], "onset_range": 0.7}


def test_onsets_are_compared_relative_to_their_size():
    (error,), count = onset_errors(onset(0.303, 0.302, 0.304), onset(0.3, 0.299, 0.3))
    assert count == (0, 0)
    assert error[:2] == ("onset", 0)
    assert error[4:7] == pytest.approx((0.01, 0.002 / 0.3, 0.005 / 0.3))
    assert error.chance == pytest.approx(np.hypot(0.001, 0.0005) / 0.3)
    (early,), _ = onset_errors(onset(0.003), onset(0.0))
    assert early.error == pytest.approx(0.003 / 0.007)


@pytest.mark.parametrize(
    ("own", "truth", "count"), [(None, 0.3, (1, 0)), (0.3, None, (0, 1)), (None, None, (0, 0))]
)
def test_an_onset_that_only_one_has_is_no_error_but_counts(own, truth, count):
    assert onset_errors(onset(own), onset(truth)) == ([], count)


def test_an_onset_costs_its_own_seconds():
    rows = [
        {"label": "a", "default": True, "cost": 1.0, "cost_onset": 9.0},
        {"label": "b", "default": False, "cost": 2.0, "cost_onset": 6.0},
    ]
    table = measurements([row | {"error_x": 1e-3, "error_onset": 1e-3} for row in rows])
    found = at_tolerances(table, ["x", "onset"], [1e-2]).set_index("quantity")
    assert found["cheapest"].to_dict() == {"x": "a", "onset": "b", "all": "b"}
    assert found["ratio"].to_dict() == {"x": 1.0, "onset": 1.5, "all": 1.5}
