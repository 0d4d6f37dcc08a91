"""Answers of several runs that last: the loudest, and the quietest where errors part them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from squealstudy.kinds.transient.answer import (
    UNKNOWN_ROUNDING,
    _settings,
    heard,
    lasting_in_words,
    vibrations_in_words,
)
from squealstudy.tables.energy_ranking import worst_point


def runs(*levels, error=0.7):
    """Limit cycles over damping, as continuation_scene has them."""
    table = pd.DataFrame({"torque_rms": levels, "damping": [0.05 * k for k in range(len(levels))]})
    return table.assign(
        **{"class": "limit_cycle"},
        torque_rms_low=table["torque_rms"] - error,
        torque_rms_high=table["torque_rms"] + error,
        torque_line_hz=3107.0,
        dominant_mode=25,
    )


def said(table):
    return lasting_in_words(table, ["damping"], {}, "N m")


def test_the_quietest_is_told_where_errors_part_it_from_the_loudest():
    assert said(runs(44.26, 39.44, 36.25)).startswith(
        " The loudest that lasts, at damping = 0: RMS of the torque 44.26 +- 0.70 N m, loudest "
        "near 3107 Hz; the quietest, at damping = 0.1: 36.25 +- 0.70 N m."
    )
    assert "quietest" not in said(runs(44.26, 43.4))  # within their errors
    assert "quietest" not in said(runs(44.26, 39.0).assign(torque_rms_high=float("nan")))
    assert "quietest" not in said(runs(44.26))


@pytest.mark.parametrize(
    ("hz", "line", "text"),
    [
        (222.0, 3108.0, "loudest near 3108 Hz, repeating at 222 Hz"),
        (222.0, 222.4, "at 222 Hz"),
        (np.nan, 3108.0, "loudest near 3108 Hz"),
        (np.nan, np.nan, "frequency not known"),
    ],
)
def test_the_loudest_line_is_told_in_hertz_beside_what_repeats(hz, line, text):
    assert heard(pd.Series({"frequency_hz": hz, "torque_line_hz": line})) == text


def test_runs_that_may_be_as_loud_as_the_loudest_are_told():
    """Of 128.9 +- 2.5 and 125.8 +- 1.5 N the first was the loudest, and that was all."""
    one = said(runs(44.26, 43.4, 36.0))
    assert ", within its error no louder than at damping = 0.05; the quietest" in one
    assert ", within its error no louder than 2 others." in said(runs(44.26, 43.4, 43.2))
    assert "no louder" not in said(runs(44.26, 39.44, 36.25))
    assert "no louder" not in said(runs(44.26))


@pytest.mark.parametrize(
    ("stick_share", "pilot", "is_told"),
    [
        (0.008, {"status": "skipped", "message": "fewer than 8 design points"}, True),
        (0.008, {"status": "failed", "message": "it broke down"}, True),
        (0.008, None, True),
        (0.008, {"status": "ok", "errors": {"torque_rms": {"error": 0.1}}}, False),
        (0.0, {"status": "skipped", "message": "fewer than 8 design points"}, False),
        (np.nan, None, False),
    ],
)
def test_an_error_without_that_of_rounded_friction_says_so(stick_share, pilot, is_told):
    """A level of 1144 +- 60 N m is 440 with ten times the speed of rounding, 1270 with half."""
    results = SimpleNamespace(
        points=runs(44.26).assign(stick_share=stick_share),
        parameters=["damping"],
        units={},
        manifest={"regularisation": {"pilot": pilot}},
    )
    assert vibrations_in_words(results, "N m").endswith(UNKNOWN_ROUNDING) == is_told
    results.manifest = {}  # its speed is given
    assert vibrations_in_words(results, "N m").endswith(UNKNOWN_ROUNDING) == (stick_share > 0)
    results.points["class"] = "stable"
    assert UNKNOWN_ROUNDING not in vibrations_in_words(results, "N m")


def test_a_run_of_many_parameters_is_told_by_its_number():
    """Their first three values alone would name two runs alike."""
    points = pd.DataFrame(np.eye(5)[:, 1:], columns=["a", "b", "c", "d"])
    told = _settings(points.iloc[4], ["a", "b", "c", "d"], {})
    assert told == "point 4"
    assert worst_point("a=0, b=0, c=0, d=1", points) == 4
    assert worst_point("b=1", points) == 2
