"""Sentences on runs say what the run did, with the errors of their numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from made_results import made
from transient_tables import growth_table, modes_table, points_table

from squealstudy.kinds.transient.answer import _where_it_sticks
from squealstudy.kinds.transient.screen import SCREEN as RUNS
from squealstudy.kinds.transient.screen import _error_share_text, _growth_marks
from squealstudy.kinds.transient.window_screen import in_words


@pytest.mark.parametrize(
    ("rate", "width", "forecast", "text"),
    [
        (-1.887, 0.0, -1.887, "It decayed by 1.887 1/s (complex mode: 1.887)."),
        (-1.9, 0.4, 0.3, "It decayed by 1.90 +- 0.20 1/s (complex mode: grows by 0.3)."),
        (57.49, 3.0, 58.0, "It grew by 57.5 +- 1.5 1/s (complex mode: 58)."),
    ],
)
def test_a_run_that_dies_away_does_not_grow(rate, width, forecast, text):
    """It was told to grow "by -1.887 1/s"."""
    numbers = {"growth_rate_low": rate - width / 2, "growth_rate_high": rate + width / 2}
    numbers |= {"growth_rate": rate, "predicted_growth_rate": forecast, "settled_time": np.nan}
    points = points_table({"friction": [0.5]}, ["undecided"], **numbers)
    run = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    assert RUNS.verdict(run).endswith(text)


def test_how_much_a_contact_sticks_has_the_digits_that_hold():
    """It was "10.6 %" of a run whose contact sticks for 11.1 % by the judge of runs."""
    points = points_table({"friction": [0.5]}, ["limit_cycle"]).assign(stick_share=0.1064)
    run = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    assert "its contact sticks for about 11 % of area and time." in RUNS.verdict(run)


def test_a_level_without_a_known_error_says_so():
    levels = {"torque_rms_low": np.nan, "torque_rms_high": np.nan, "torque_rms": [60.0]}
    points = points_table({"friction": [0.5]}, ["limit_cycle"], **levels)
    run = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    assert "RMS of the torque 60 (error not known) N m" in RUNS.verdict(run)


@pytest.mark.parametrize(
    ("hz", "text"),
    [
        ([200.0, 230.0, 260.0], "200 to 260 Hz"),
        ([260.0, 230.0, 200.0], "260 to 200 Hz"),
        ([200.0, 260.0, 210.0], "200 to 260 Hz"),
        ([np.nan, 200.0, 210.0], "first without a period, then 200 to 210 Hz"),
        ([200.0, np.nan, 210.0], "200 to 210 Hz, at times without a period"),
        ([200.0, 210.0, np.nan], "200 to 210 Hz, then without a period"),
    ],
)
def test_frequencies_of_windows_are_those_of_all_of_them(hz, text):
    """Of 200, 260 and 210 Hz "200 to 210 Hz" was told, and nothing of a first part without any."""
    times = 0.1 * np.arange(4)
    windows = {"point_id": "p0", "class": "limit_cycle", "torque_rms": [1.0, 2.0, 3.0]}
    windows |= {"time_start": times[:-1], "time_stop": times[1:], "frequency_hz": hz}
    windows |= {"sliding_speed_start": 1.0, "sliding_speed_stop": 1.0, "torque_line_hz": 200.0}
    results = made(kind="transient", windows=pd.DataFrame(windows))
    assert f"limit cycle to 300 ms ({text})." in in_words(results, "N")


@pytest.mark.parametrize(
    ("method", "why"),
    [
        ("too_short", "; -: fewer than five periods grow or decay exponentially"),
        ("not_linear", "; -: small motion has another frequency than the mode"),
        ("", "; -: nothing moves"),
    ],
)
def test_a_dash_in_place_of_growth_says_why(method, why):
    """It said 'fewer than five periods' of every dash, and where no run had one."""
    points = points_table({"friction": [0.5]}, ["limit_cycle"])
    points = points.assign(growth_rate=np.nan, growth_method=method)
    assert _growth_marks(points) == f"~: with wide bounds{why}"
    assert _growth_marks(points.assign(growth_rate=3.0)) == "~: with wide bounds"
    assert _growth_marks(points.assign(**{"class": "failed"})) == "~: with wide bounds"


def test_a_slope_that_changes_nothing_has_no_error():
    """Of a contact that never sticks it was 'below 2.2 % (its runs tell no less)'."""
    assert _error_share_text({"error": 0.0, "chance": 0.02}) == "0 % (both runs are the same)"
    assert _error_share_text({"error": 0.001, "chance": 0.02}).startswith("below 2.0 %")


@pytest.mark.parametrize(("settled", "text"), [(0.005, "its start"), (24.0, "24 s")])
def test_of_the_first_period_nobody_says_from_when_on_it_is_steady(settled, text):
    """A block whose cycle repeats in twelve seconds was "steady from 5 ms on"."""
    numbers = {"settled_time": settled, "frequency_hz": 0.0833}
    points = points_table({"friction": [0.5]}, ["limit_cycle"]).assign(**numbers)
    run = made(kind="transient", points=points, modes=modes_table({}), growth=growth_table([]))
    assert RUNS.verdict(run).endswith(f"was steady from {text} on.")


@pytest.mark.parametrize(
    ("shares", "text"),
    [
        ([0.0, 4.1e-7, 7.4e-4], " in 2 of these 3, for up to about 0.074 % of area and time: at"),
        ([0.0, 4.1e-7, 5e-7], " in 2 of these 3, for less than 0.01 % of area and time: at"),
        ([0.1, 0.2, 0.3], " in all 3 of these, for about 10 % to 30 % of area and time."),
    ],
)
def test_a_contact_that_hardly_sticks_is_told_without_digits(shares, text):
    """It was "for about 4.1e-05 % to 0.074 % of area and time"."""
    points = points_table({"friction": [0.4, 0.5, 0.6]}, ["limit_cycle"] * 3)
    told = _where_it_sticks(points.assign(stick_share=shares), "friction", "")
    assert f"The contact sticks{text}" in told
