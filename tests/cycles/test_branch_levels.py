"""Levels of cycles on branches are within their errors of the judge's.

A branch keeps the harmonics of its first cycle. On this belt 7 do for fast sliding, and at .77 m/s
the level of 7 is a fifth too large.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from event_reference import design, geometry, run
from matplotlib.figure import Figure

import squealstudy as sq
from squealstudy.cycles import cycle
from squealstudy.cycles.branch import HOPF, BranchPoint
from squealstudy.cycles.branch_levels import level_on_branch
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.folds import FOLD
from squealstudy.cycles.projection import Projection
from squealstudy.cycles.trials import state_of
from squealstudy.kinds.limit_cycles.branch_words import _levels_error, _uncertainty
from squealstudy.plots.cycle_levels import _shade_errors
from squealstudy.plots.style import quantity

TOLERANCE, REACH = 1e-2, 2.0
BELT = {
    "damping_ratio": 0.049928,
    "friction": 0.39546,
    "friction_law.static_ratio": 1.79481,
    "friction_law.decay_speed": 0.691818,
    "contact.regularisation_speed": 0.0241,
    "sliding_speed": 0.771749,
}
PERIODS = 8  # deviations fall to .006 in one


def judged_rms(osc, motion):
    """RMS of the judge's own cycle, to which the motion leads."""
    q, v = state_of(motion)
    rows = osc.B[:, :2].reshape(-1, osc.n)  # normal and tangential, of each contact point
    d = design("belt", **BELT)
    _, _, N, T, _ = geometry(d)
    judged_rows = np.stack([N, T], axis=1).reshape(-1, 2)
    start = np.concatenate([np.linalg.lstsq(judged_rows, rows @ x, rcond=None)[0] for x in (q, v)])
    record = run(d, PERIODS * 2.0 * np.pi / motion.omega, start=start, tolerance=1e-9)
    return record.cycle().levels.rms


@pytest.fixture(scope="module")
def of_seven():
    """Cycles of 7 harmonics, a point of a branch, and the judge's level."""
    found = sq.model("belt", **BELT).at().limit_cycles(7, reach=REACH)
    ((_, stable),) = [(k, c) for k, c in found.cycles if c.multipliers.stable]
    point = BranchPoint(stable.motion, stable.multipliers, stable.residual)
    return found.contact, point, judged_rms(found.contact.oscillator, stable.motion)


def test_a_level_on_a_branch_has_more_harmonics_where_it_needs_them(of_seven):
    contact, point, rms = of_seven
    assert contact.levels(point.motion)["torque_rms"] > 1.15 * rms
    level = level_on_branch(contact, point, Search(None, TOLERANCE, REACH))
    assert abs(level.levels["torque_rms"] / rms - 1.0) < level.error < TOLERANCE
    assert level.point.motion.harmonics > 7


@pytest.mark.parametrize("event", ["", FOLD])
def test_a_level_that_keeps_its_harmonics_has_their_error(of_seven, event):
    """Harmonics that were asked for stay, and so does an event where it was located."""
    contact, point, rms = of_seven
    search = Search(None if event else 7, TOLERANCE, REACH)
    level = level_on_branch(contact, replace(point, event=event), search)
    assert level.point.motion is point.motion
    assert abs(level.levels["torque_rms"] / rms - 1.0) < level.error < 1.0


def test_no_error_is_said_to_be_known_where_it_is_not(of_seven):
    contact, point, _ = of_seven
    at_hopf = level_on_branch(contact, replace(point, event=HOPF), Search(None, TOLERANCE, REACH))
    assert np.isnan(at_hopf.error)

    def said(*errors, events=("", "F", "")):
        return _levels_error(pd.DataFrame({"event": events, "level_error": errors}))

    assert said(1e-7, np.nan, 1e-8) == "; its levels err by less than 0.001 %"
    assert said(0.01, np.nan, 0.002) == "; its levels err by up to 1 %"
    assert said(0.01, np.nan, np.nan) == "; its levels err by up to 1 %, not known at 1 of 2 points"
    assert said(np.nan, 0.1, np.nan) == "; error of its levels not known"
    assert _levels_error(pd.DataFrame({"event": ["", "F"]})) == "; error of its levels not known"


def test_the_error_of_an_event_is_told_where_the_value_does_not_hold_it():
    told = [_uncertainty({"value": 0.4163, "value_error": e}, "") for e in (0.0388, 1e-6)]
    assert told == [" (+- 0.039)", ""]
    assert _uncertainty({"value": 5e5}, "Pa") == ""
    unknown = {"value": 0.4163, "value_error": np.nan}
    assert _uncertainty(unknown, "") == " (error not known)"


def test_a_picture_shades_what_levels_of_a_branch_may_err_by():
    branches = pd.DataFrame(
        {"cycle_id": "a", "value": [1.0, 2.0, 3.0], "torque_rms": [10.0, 20.0, 30.0]}
    )
    over = quantity("speed", branches["value"], {})

    def shaded(**columns):
        axes = Figure().subplots()
        _shade_errors(axes, over, branches.assign(**columns))
        return [p.vertices for c in axes.collections for p in c.get_paths()]

    (band,) = shaded(level_error=[0.1, 0.2, np.nan])  # where it is not known there is none
    ends = {x: band[band[:, 0] == x, 1] for x in (1.0, 2.0)}
    assert (min(ends[1.0]), max(ends[1.0])) == pytest.approx((9.0, 11.0))
    assert (min(ends[2.0]), max(ends[2.0])) == pytest.approx((16.0, 24.0))
    assert band[:, 0].max() == 2.0
    assert shaded(level_error=1e-5) == shaded() == []  # the line hides it; results of before


def test_series_that_agree_by_chance_are_held_against_the_cycle_at_nodes(of_seven, monkeypatch):
    contact, point, rms = of_seven
    monkeypatch.setattr(cycle, "FINER_SERIES_SAFETY_FACTOR", 0.0)  # no series differs
    levels = contact.levels(point.motion)
    projection = Projection.on_harmonics_of(contact.oscillator, point.motion)
    errors, _ = cycle.series_errors(
        contact, projection, cycle.CycleLevels(point.motion, levels), cycle.SeriesErrors()
    )
    error = abs(levels["torque_rms"] / rms - 1.0)
    assert errors.level == pytest.approx(cycle.NODES_SAFETY_FACTOR * error, rel=0.02)
