"""Answers of studies that follow some modes alone: those that squeal beside them are told."""

from __future__ import annotations

from types import SimpleNamespace

import pandas as pd

from squealstudy.kinds.limit_cycles.screen import SCREEN
from squealstudy.kinds.limit_cycles.tables import SUMMARY_FIELDS, summary

# of own_brake_cycles: mode, Hz, growth 1/s, verdict and end of the curve, by design point
MODES = [
    ("a", 23, 3799.9, -36.9, "no_cycle_found", "far"),
    ("a", 35, 6302.9, 106.7, "squeals", "not_followed"),
    ("b", 2, 860.4, 11.9, "squeals", "not_followed"),
    ("b", 22, 3793.2, 149.1, "squeals", "not_followed"),
    ("b", 23, 3801.9, -144.4, "no_cycle_found", "far"),
    ("b", 35, 6309.5, 299.8, "squeals", "not_followed"),
]


def results_of(modes):
    names = ["point_id", "mode", "frequency_hz", "growth_rate", "verdict", "curve_end"]
    verdicts = pd.DataFrame(modes, columns=names)
    points = pd.DataFrame({"point_id": ["a", "b"], "friction": [0.4, 0.5], "verdict": "squeals"})
    return SimpleNamespace(
        points=points, parameters=["friction"], units={}, table={"verdicts": verdicts}.__getitem__
    )


def test_modes_that_squeal_and_were_not_followed_are_told_beside_those_that_were():
    assert SCREEN.followed_in_words(results_of(MODES)) == (
        " At 2 of 2 designs it squeals by modes that were not followed, near 860, 3793 and 6303 "
        "Hz; followed was mode 23 near 3800 Hz: no cycle found at friction 0.4 to 0.5 (2 points)."
    )
    some = SCREEN.followed_in_words(results_of(MODES[1:]))  # none of mode 23 at the first point
    assert some.endswith("followed was mode 23 near 3802 Hz: no cycle found at 1.")
    assert SCREEN.followed_in_words(results_of(MODES[:1])) == ""  # all that squeal are followed


def test_the_reason_of_a_design_that_squeals_is_of_its_fastest_mode():
    numbers = dict.fromkeys([n for n, _ in SUMMARY_FIELDS], float("nan"))
    rows = [
        numbers
        | {"mode": n, "growth_rate": g, "verdict": v, "unstable": g > 0, "reason": "why"}
        | dict.fromkeys(("cycle_frequency_hz", "cycle_frequency_error"), float("nan"))
        | {"threshold_cycle": "", "invalid_reason": ""}
        for point, n, _, g, v, _ in MODES
        if point == "b"
    ]
    row = summary(rows, [], 0, False)
    assert row["reason"] == "mode 35: why"
    assert row["max_growth_rate"] == 299.8
