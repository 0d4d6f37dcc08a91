"""Sentences on designs: points at which nothing is unstable, and where growth is fastest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.design_lines import (
    DesignLine,
    growth_in_words,
    quiet_in_words,
)


def test_points_at_which_nothing_is_unstable_are_told_where_the_first_one_is():
    """A mode that is unstable from the least shift on: which shifts silence it?"""
    shifts, speeds = [0.5, 1.0, 1.5, 2.0], [10.0, 20.0, 30.0, 40.0]
    unstable = [[1, 0, 0, 0], [1, 1, 0, 1], [1, 0, 1, 0], [1, 1, 1, 1]]
    points = pd.DataFrame(
        [
            {"shift": a, "speed": v, "status": "ok", "n_unstable_high": n}
            for v, counts in zip(speeds, unstable, strict=True)
            for a, n in zip(shifts, counts, strict=True)
        ]
    )
    results = SimpleNamespace(along="shift", points=points, units={"speed": "m/s", "shift": "Pa"})
    lines = [
        DesignLine({"speed": v}, 1, 4, True, np.nan, "below range", None, None, {}) for v in speeds
    ]
    assert quiet_in_words(results, lines) == (
        " No mode is unstable at shift 1 to 2 Pa (3 points) with speed 10 m/s; 1.5 Pa with speed "
        "20 m/s; 1 to 2 Pa (2 points, not between) with speed 30 m/s."
    )
    alike = [lines[1], lines[1]._replace(design={"speed": 20.0})]
    assert quiet_in_words(results, alike).endswith("with speed 20 m/s or 20 m/s.")
    later = [line._replace(kind="refined") for line in lines]  # an onset tells more
    assert quiet_in_words(results, later) == ""
    assert quiet_in_words(results, lines[3:]) == ""


def test_the_designs_of_the_fastest_and_of_the_slowest_growth_are_named():
    solved = pd.DataFrame({"status": ["ok"] * 12})
    results = SimpleNamespace(units={"angle": "deg"}, points=solved)

    def line(angle, growth, solved=4):
        fastest = {"max_growth_rate": growth} if growth else None
        return DesignLine({"angle": angle}, 2, solved, True, 0.3, "", None, fastest, {})

    lines = [line(0.0, 379.4), line(45.0, 499.2), line(90.0, 421.8)]
    assert growth_in_words(results, lines) == (
        " The fastest growth is largest with angle 45 deg (499.2 1/s) and least with angle 0 deg "
        "(379.4 1/s)."
    )
    for other in (line(135.0, None), line(135.0, 400.0, solved=3)):
        assert growth_in_words(results, [*lines, other]) == ""
    assert growth_in_words(results, [lines[0], line(45.0, 379.5)]) == ""
    failed = SimpleNamespace(units={"angle": "deg"}, points=solved.assign(status="failed"))
    assert growth_in_words(failed, lines) == ""  # as many, but perhaps at other values


def test_designs_that_are_not_named_are_counted_and_not_the_values():
    """Ten designs, of which two each are quiet at one value, another for each pair."""
    values = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    points = pd.DataFrame(
        [
            {"friction": x, "n": float(d), "status": "ok", "n_unstable_high": int(k != 1 + d // 2)}
            for d in range(10)
            for k, x in enumerate(values)
        ]
    )
    results = SimpleNamespace(along="friction", points=points, units={})
    lines = [
        DesignLine({"n": float(d)}, 5, 6, True, np.nan, "below range", None, None, {})
        for d in range(10)
    ]
    text = quiet_in_words(results, lines)
    assert text.endswith("0.5 with n 6 or 7 and at others with 2 other designs.")
