"""Silent curves of one design that serve the next one, and where they may not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cycle_models as models
import numpy as np
import pytest
from study_runs import solved
from test_limit_cycles_study import study

from squealstudy.cycles import families as searched
from squealstudy.cycles import growth
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import families
from squealstudy.cycles.growth import looked_again
from squealstudy.cycles.harmonics import derivative
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Pace
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles import kind
from squealstudy.kinds.limit_cycles.kind import by_nearness
from squealstudy.kinds.limit_cycles.screen import SCREEN
from squealstudy.screen import as_text
from squealstudy.study.definition import parse_study
from squealstudy.wording import IF_KICKED, NO_CYCLE

SEARCH = Search(5, 1e-2, 15.0)
NAME = "the first"


@pytest.fixture(autouse=True)
def large(monkeypatch):
    """Two coordinates are as many as those of a brake."""
    monkeypatch.setattr(searched, "MAX_UNPROJECTED_COORDINATES", 1)


@pytest.fixture(scope="module")
def designs():
    return models.Designs("hoffmann", models.BISTABLE)


def followed(contact, near=None, search=SEARCH):
    found = families(contact, (1.0, 1e6), [1], 1e-9, search, near=near)
    return found._replace(name=NAME), found.families[0][1]


@pytest.fixture(scope="module")
def damped():
    """Silent by far at the friction at which the others are all but bistable."""
    return models.Designs("hoffmann", models.BISTABLE | {"damping_ratio": 0.014})


@pytest.fixture(scope="module")
def first(damped):
    return followed(damped.at(friction=0.078))[0]


def test_a_silent_curve_serves_the_next_design(damped, first):
    """Its rows are of motions that are balanced there: on the design's own curve."""
    contact = damped.at(friction=0.0782)
    _, own = followed(contact)
    _, served = followed(contact, first)
    assert served.verdict == own.verdict == NO_CYCLE
    assert served.origin == NAME
    assert f"on the curve of {NAME}, a design nearby, checked at" in served.reason
    assert served.reached >= SEARCH.reach
    curve = np.array([[p["frequency_hz"], p["added_damping"]] for p in own.curve])
    assert len(served.curve) > 3
    for row in served.curve:
        here = np.array([row["frequency_hz"], row["added_damping"]])
        a, b = curve[:-1], curve[1:]
        along = ((here - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
        apart = here - a - np.clip(along, 0, 1)[:, None] * (b - a)
        assert np.hypot(*apart.T).min() < 0.05
    again, third = followed(damped.at(friction=0.0783), followed(contact, first)[0])
    assert third.origin == NAME  # whose curve it is, not that of the one between
    assert again.families[0][1].path is first.families[0][1].path


@pytest.mark.parametrize(
    ("first", "last", "step"),
    [
        (0.079, 0.084, 0.002),
        (0.02, 0.17, 0.06),
        pytest.param(0.078, 0.084, 0.0005, marks=pytest.mark.full_size),
        pytest.param(0.02, 0.17, 0.01, marks=pytest.mark.full_size),
    ],
)
def test_verdicts_are_those_of_the_designs_own_curves(designs, first, last, step):
    """Over the fold at .081: the top of damping moves fast in size."""
    near = None
    for friction in np.arange(first, last, step):
        contact = designs.at(friction=float(friction))
        _, own = followed(contact)
        near, family = followed(contact, near)
        assert family.verdict == own.verdict


def test_a_motion_that_is_another_here_is_left_open(damped, first):
    """At a much larger friction the same size is that of quite another motion."""
    path = first.families[0][1].path
    look = looked_again(damped.at(friction=0.11).oscillator, path, (7,), 0.0)
    assert look.open
    same = looked_again(damped.at(friction=0.078).oscillator, path, (7,), 0.0)
    assert not look.checked > same.checked
    assert not same.open


@pytest.mark.parametrize(("aside", "left"), [(0.05, 0), (0.2, 1)])
def test_a_motion_of_another_shape_is_left_open(monkeypatch, aside, left):
    """However much damping it lacks, as much as that of the curve."""

    def motion(size, aside=0.0):
        Q = np.array([[0.0, 0.0], [size, aside * size], [0.0, 0.0]])
        return PeriodicMotion(Q, 1.0, -1.0)

    def more(osc, m, harmonics):
        shaped = CurveMotion(motion(m.size, aside), 0.0, 0.0)
        return SimpleNamespace(weight=np.ones(2)), shaped

    monkeypatch.setattr(growth, "_with_more", more)
    curve = [CurveMotion(motion(size), 0.0, 0.0) for size in (0.1, 0.3, 1.0)]
    assert len(looked_again(None, curve, (5,), 0.0).open) == left
    assert not looked_again(None, curve, (5,)).open


def test_a_motion_that_is_lost_here_is_left_open(damped, first, monkeypatch):
    """However much damping it lacks at the design nearby."""
    path = first.families[0][1].path
    top = max(path, key=lambda p: p.motion.parameter).motion

    def more(osc, motion, harmonics):
        if motion is not top:
            raise ConvergenceError("not_converged", "")
        return whole(osc, motion, harmonics)

    whole = growth._with_more
    monkeypatch.setattr(growth, "_with_more", more)
    osc = damped.at(friction=0.0782).oscillator
    assert not [m for m in looked_again(osc, path, (7,)).open if m.parameter < -36.0]
    assert [m for m in looked_again(osc, path, (7,), 0.0).open if m.parameter < -36.0]


def test_motions_are_apart_whatever_their_phase(first):
    motion = first.families[0][1].path[20].motion
    weight = np.ones(motion.Q.shape[1])
    turned = replace(motion, Q=2.0 * (motion.Q + 1e-3 * derivative(motion.Q)))
    assert growth._rel_distance(weight, motion, turned) < 2e-6
    other = motion.Q.copy()
    other[1] = np.roll(other[1], 1)
    assert growth._rel_distance(weight, motion, replace(motion, Q=other)) > 0.1


def test_modes_that_are_much_alike_are_followed_anew(damped, first):
    """And those that are not alike enough."""
    contact, modes = damped.at(friction=0.0782), first.modes
    assert followed(contact, first)[1].origin
    mixed = modes[:, 0] / np.linalg.norm(modes[:, 0])
    mixed = mixed + 0.3 * modes[:, 1] / np.linalg.norm(modes[:, 1])
    beside = np.column_stack([modes[:, 0], mixed])
    assert not followed(contact, first._replace(modes=beside))[1].origin
    across = np.column_stack([mixed, modes[:, 1]])
    assert not followed(contact, first._replace(modes=across))[1].origin


def test_a_curve_that_is_too_short_does_not_serve(damped, first):
    farther = replace(SEARCH, reach=2.0 * SEARCH.reach)
    _, family = followed(damped.at(friction=0.0782), first, farther)
    assert not family.origin
    assert family.reached > farther.reach


def test_all_is_followed_anew_where_less_grows_than_there(damped, first):
    """What grew at the design nearby may be in a curve that served."""
    growing = replace(first.families[0][1], look=None, verdict=IF_KICKED)
    growing = replace(growing, curve=[{"contact_velocity": 1.0, "added_damping": 1.0}])
    near = first._replace(families=[*first.families, (2, growing)])
    assert near.n_growing == 1
    assert not followed(damped.at(friction=0.0782), near)[1].origin


def test_small_models_are_followed_as_they_are(damped, first, monkeypatch):
    monkeypatch.setattr(searched, "MAX_UNPROJECTED_COORDINATES", 2)
    assert not followed(damped.at(friction=0.0782), first)[1].origin


STUDY = """
[study]
name = "nearby"
kind = "limit_cycles"
[model]
name = "hoffmann"
[[sweep]]
parameter = "friction"
start = 0.1
stop = 0.4
num = 4
[[sweep]]
parameter = "sliding_speed"
start = 9
stop = 10
num = 3
"""


def points():
    return Plan(parse_study(STUDY, Path("nearby.toml"))).tasks


def test_each_design_is_followed_by_one_next_to_it():
    tasks = points()
    order = by_nearness(tasks)
    assert sorted(order.tolist()) == list(range(12))
    x = np.column_stack([tasks.column("friction") / 0.1, tasks.column("sliding_speed") / 0.5])
    steps = np.abs(np.diff(x[order], axis=0)).sum(axis=1)
    np.testing.assert_allclose(steps, 1.0)


def test_parts_are_even_where_a_least_number_is_asked_for():
    slow = Pace(100.0)
    assert [len(part) for part in slow.parts(points(), 2)] == [1] * 12
    assert [len(part) for part in slow.parts(points(), 2, 5)] == [4, 4, 4]
    assert [len(part) for part in slow.parts(points(), 2, 20)] == [12]


def test_a_study_says_whose_curve_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(kind, "MIN_TASKS", 1)
    changes = {
        "damped": ("damping_ratio = 0.01\n", "damping_ratio = 0.014\n"),
        "one": ("tolerance = 1e-3", "families = [1]\ntolerance = 1e-3"),
    }
    values = [0.078, 0.0782, 0.3, 0.3002]
    results = solved(study(values, **changes), tmp_path / "shared")
    names = results.points.set_index("friction")["point_id"]
    found = results.table("verdicts").set_index("point_id").loc[names]
    assert found["curve_of"].tolist() == ["", names[0.078], "", ""]
    assert names[0.078] in found["reason"].iloc[1]
    told = [NO_CYCLE, NO_CYCLE, IF_KICKED, IF_KICKED]
    assert found["verdict"].tolist() == told
    screen = as_text(SCREEN.findings(results))
    assert "(1 mode by the curve of a design nearby: `curve_of`)" in " ".join(screen.split())

    changes["alone"] = ("reach = 0.5", "share_curves = false\nreach = 0.5")
    alone = solved(study(values, **changes), tmp_path / "alone")
    assert (alone.table("verdicts")["curve_of"] == "").all()
    assert alone.points["verdict"].tolist() == results.points["verdict"].tolist() == told
    assert "design nearby" not in as_text(SCREEN.findings(alone))
