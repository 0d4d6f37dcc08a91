"""The level of a design is that of the loudest motion that was found: larger may last."""

from __future__ import annotations

from dataclasses import replace

import cycle_models as models
import numpy as np
import pandas as pd
import pytest
from made_results import drawn, made

from squealstudy.cycles.arrivals import arrived_at
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.families import families
from squealstudy.cycles.kicked import decided_in_time
from squealstudy.cycles.small_motion import from_small_motion
from squealstudy.cycles.trials import Ended, run_on, state_of
from squealstudy.kinds.limit_cycles.kick_words import untold_kicks
from squealstudy.kinds.limit_cycles.larger import (
    larger_in_words,
    louder_cycles,
    louder_neighbours,
    on_branches,
)
from squealstudy.wording import IF_KICKED, SQUEALS

# Hoffmann's oscillator with contact that opens: in time 0.75 and 0.8 last at 128 and 140 N too
POINTS = pd.DataFrame(
    {
        "point_id": ["a", "b", "c", "d"],
        "friction": [0.8, 0.65, 0.7, 0.75],
        "verdict": [SQUEALS, IF_KICKED, IF_KICKED, SQUEALS],
        "torque_rms": [45.0, 104.3, 116.2, 38.3],
    }
)
CYCLES = pd.DataFrame(
    {
        "point_id": ["a", "a", "b", "c", "d"],
        "torque_rms": [45.0, 76.5, 67.6, 70.5, 38.3],
        "stable": pd.array([None, False, False, False, True], "boolean"),
    }
)
BRANCH = pd.DataFrame(
    {
        "cycle_id": "b-1-1",
        "point_id": "b",
        "along": "friction",
        "value": [0.6, 0.7, 0.8],
        "torque_rms": [90.0, 116.0, 140.0],
        "event": "",
        "stable": pd.array([True, True, True], "boolean"),
    }
)
NO_BRANCH = BRANCH[:0]


def test_levels_that_rise_along_a_branch_of_stable_cycles_are_one_motion():
    """Of kicked_squeal it was told that 36 N may last at friction 0.1, where 23.5 N lasts."""
    rising = POINTS.assign(torque_rms=[300.0, 104.3, 116.2, 20.0], verdict=IF_KICKED)
    rows = on_branches(rising, BRANCH, ["friction"])
    assert rows == [{1, 2}]  # the others have another level than the branch there
    np.testing.assert_array_equal(
        louder_neighbours(rising, ["friction"]), [np.nan, np.nan, np.nan, 300.0]
    )
    steep = rising.assign(torque_rms=[300.0, 104.3, 180.0, 20.0])
    on_it = BRANCH.assign(torque_rms=[60.0, 180.0, 300.0])
    told = louder_neighbours(steep, ["friction"])
    assert told[1] == 180.0
    steep.loc[1, "torque_rms"] = 120.0
    rows = on_branches(steep, on_it, ["friction"])
    assert rows == [{0, 1, 2}]
    told = louder_neighbours(steep, ["friction"], rows)
    np.testing.assert_array_equal(told, [np.nan, np.nan, np.nan, 300.0])


def test_a_cycle_above_the_level_and_a_louder_neighbour_are_told():
    np.testing.assert_array_equal(louder_cycles(POINTS, CYCLES), [76.5, *[np.nan] * 3])
    neighbours = louder_neighbours(POINTS, ["friction"])
    np.testing.assert_array_equal(neighbours, [*[np.nan] * 3, 116.2])
    assert larger_in_words(POINTS, CYCLES, NO_BRANCH, ["friction"], "N") == (
        " At 2 of 4 designs larger motion may last too: a cycle above that level is unstable or "
        "not known as stable (76.5 N); louder motion lasts at a design beside it (116.2 N)."
    )


def test_of_levels_that_rise_evenly_nothing_is_told():
    points = POINTS.assign(torque_rms=[130.0, 104.3, 116.2, 120.0])
    assert larger_in_words(points, CYCLES, NO_BRANCH, ["friction"], "N") == ""


def test_neighbours_of_other_lines_do_not_count():
    points = POINTS.assign(sliding_speed=[0.1, 0.1, 0.2, 0.1])
    neighbours = louder_neighbours(points, ["friction", "sliding_speed"])
    np.testing.assert_array_equal(neighbours, [np.nan, np.nan, np.nan, 104.3])


def test_where_a_kick_was_asked_for_and_none_is_told_the_screen_says_why():
    """Runs that last have no stable cycle that a kick's runs could be seen to come to."""
    verdicts = pd.DataFrame(
        {
            "verdict": [IF_KICKED, IF_KICKED, SQUEALS],
            "kick_velocity": [np.nan, 0.3, np.nan],
            "kick_status": ["no_cycle", "ok", ""],
            "run_status": ["lasts", "", ""],
        }
    )
    told = untold_kicks(verdicts)
    assert told.startswith(
        " No kick along the mode is known for 1 of 2 modes that squeal if kicked: a run"
    )
    assert told.endswith("bisected beside a stable cycle, and none was found (1).")
    assert untold_kicks(verdicts[1:]) == ""


def test_a_kick_beyond_an_unfinished_curve_tells_a_louder_level():
    """Contact that opens: `transient` with perturbation 0.4 lasts at 128.3 N; the cycle has 38."""
    values = {"damping_ratio": 0.005, "sliding_speed": 0.1, "friction": 0.75}
    contact = models.Designs("hoffmann", values, "unilateral").at()
    band = (2 * np.pi * 10.0, 2 * np.pi * 1000.0)
    followed = families(contact, band, [1], 1e-9, Search(None, 1e-2, 0.8))
    ((mode, family),) = followed.families
    quiet = replace(family, cycles=(family.loudest,))  # lost before the saddle

    def run(unfinished):
        ((_, judged),) = decided_in_time(
            contact, followed._replace(families=[(mode, unfinished)]), band, 0.8
        ).families
        return judged

    louder = run(quiet)
    assert louder.run.torque_rms == pytest.approx(128.3, rel=5e-3)
    assert louder.reason.startswith(f"{quiet.reason}; the level is that of a louder run in time")
    assert run(replace(quiet, end="far")).run is None  # nothing was left out
    levels = family.loudest.levels | {"torque_rms": 200.0}
    told = run(replace(quiet, cycles=(replace(family.loudest, levels=levels),)))
    assert told.run is None
    assert told.reason.endswith("m/s comes to no louder motion")


@pytest.mark.parametrize("is_stable_known", [False, True])
def test_small_motion_that_grows_to_a_louder_level_is_told(is_stable_known):
    """Also past a stable cycle: 17.3 N was told where squeal grows to 56 N."""
    contact, band, followed, mode, family = small_motion_of_hoffmann()
    level = family.loudest.levels["torque_rms"]
    for other, is_told in ((10.0, True), (60.0, False)):
        beside = Ended("1.1 times the unstable cycle", "limit_cycle", torque_rms=other)
        before = replace(family, cycles=(), run=beside)
        if is_stable_known:  # a cycle that small motion does not come to
            motion = family.loudest.motion
            levels = family.loudest.levels | {"torque_rms": other}
            elsewhere = replace(motion, Q=0.5 * motion.Q)
            cycle = replace(family.loudest, motion=elsewhere, levels=levels)
            before = replace(family, cycles=(cycle,))
        came_to, reached = from_small_motion(
            contact, followed._replace(families=[(mode, before)]), band
        )
        ((_, judged),) = came_to.families
        assert reached.level == pytest.approx(level, rel=5e-3)
        told = reached.told(came_to).families[0][1].reason
        if is_told:
            assert judged.run.torque_rms == reached.level
            assert told == "unstable mode; level of a run in time from small motion"
        else:
            assert judged is before
            assert (
                told == f"{before.reason}; small motion comes to {level / 60:.2g} of the level told"
            )


def test_a_run_from_small_motion_ends_at_a_cycle_that_is_known():
    """The sentence has no clause then; a cycle half as large is not come to."""
    contact, band, followed, mode, family = small_motion_of_hoffmann()
    before = followed._replace(families=[(mode, replace(family, cycles=(family.loudest,)))])
    came_to, reached = from_small_motion(contact, before, band)
    assert came_to is before
    assert reached.level == family.loudest.levels["torque_rms"]
    assert reached.told(came_to).families[0][1].reason == family.reason
    motion = family.loudest.motion
    q, v = state_of(motion, 0.1)
    start = [replace(contact.point, q0=q, v0=v)]
    (run,) = run_on(contact, start, band, cycles=[replace(motion, Q=0.5 * motion.Q), motion])
    assert arrived_at(run) == 1
    torque = run.history["torque"][run.times > run.times[-1] - 4 * 2 * np.pi / motion.omega]
    assert torque.std() == pytest.approx(reached.level, rel=0.05)


def small_motion_of_hoffmann():
    """Hoffmann's oscillator with contact that opens: small motion grows to 38 N."""
    values = {"damping_ratio": 0.005, "sliding_speed": 0.1, "friction": 0.75}
    contact = models.Designs("hoffmann", values, "unilateral").at()
    band = (2 * np.pi * 10.0, 2 * np.pi * 1000.0)
    followed = families(contact, band, [1], 1e-9, Search(None, 1e-2, 0.8))
    ((mode, family),) = followed.families
    return contact, band, followed, mode, family


@pytest.mark.parametrize(("level", "is_told"), [(45.1, False), (128.0, True), (np.nan, False)])
def test_the_spectrum_of_a_cycle_tells_that_louder_motion_lasts_there(level, is_told):
    """Its picture was named "stable cycle, RMS 45 N" and no more where a run of 128 N lasts."""
    row = {"cycle_id": "a-1-1", "point_id": "a", "frequency_hz": 200.0, "level_error": 1e-3}
    cycles = pd.DataFrame([row | {"torque_rms": 45.0, "stable": True}])
    cycles["torque_harmonics"] = [[63.0, 9.0]]
    points = pd.DataFrame({"point_id": ["a"], "status": "ok", "torque_rms": [level]})
    results = made(kind="limit_cycles", points=points, cycles=cycles)
    (title,) = [t for t in drawn(results.plot.cycle_spectrum("a-1-1")) if "RMS" in t]
    end = "; louder motion lasts there, 128 N m" if is_told else ""
    assert title == f"Stable cycle, RMS 45 N m{end}"
