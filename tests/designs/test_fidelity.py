"""Fidelity: ladders, choices, pilots, audits."""

import json
import time
from dataclasses import replace
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_texts import study_text, sweep_text
from typer.testing import CliRunner

from squealstudy import open_results
from squealstudy.cli.app import app
from squealstudy.cli.run import fidelity as facts
from squealstudy.engine.cache import is_prepared, load_any
from squealstudy.engine.keys import source_hash
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Solved
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.fidelity import frequency_search
from squealstudy.fidelity import pilots as pilots_module
from squealstudy.fidelity import run as fidelity_run
from squealstudy.fidelity.choice import (
    Choice,
    Combination,
    TriedSetting,
    UntriedSetting,
    _path,
    choose,
    pays,
)
from squealstudy.fidelity.frequency_search import ModeSearch, search_modes
from squealstudy.fidelity.ladders import Setting, free_ladders, training_step
from squealstudy.fidelity.pilots import MISCOUNT_ERROR, FidelityStudy, largest_error
from squealstudy.fidelity.run import Audit, _plain, drawn_points, resolve, run_resolved
from squealstudy.fidelity.time_search import RICHARDSON_FACTOR, RunSearch, interior_pilots
from squealstudy.kinds.complex_modes.measuring import _solved
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.study.definition import parse_study
from squealstudy.tables.method_quality import FoundError, Miscount

BELT = (
    study_text("belt", "transient", "belt")
    + """\
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 0.6, 0.7]
[parameters]
"contact.regularisation_speed" = 0.01
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.25
perturbation = 1e-1
save_every = 0
[fidelity]
tolerance = 0.001
audit = 1
"""
)
SHORT = BELT.replace("duration = 0.25", "duration = 0.1")
ONE_POINT = SHORT.replace("[0.5, 0.6, 0.7]", "[0.6]")
LOOSE = ONE_POINT.replace("tolerance = 0.001", "tolerance = 0.01")
SLOPE = '"contact.regularisation_speed" = 0.01'
BRAKE = (
    study_text("brake", "{kind}", "disc_brake")
    + """\
mesh = "coarse"
{model}
"""
    + sweep_text("friction", 0.2, 0.6, 5)
    + """\
[fidelity]
tolerance = 0.01
{more}
"""
)


def quiet(stage, done, total, failed=0):
    pass


def study(text, tmp_path, name="study.toml"):
    return parse_study(text, tmp_path / name)


# -- choosing ------------------------------------------------------------------------------------
TRIED = {
    "basis": [TriedSetting("small", {"b": 1}, 0.02, 1.0), TriedSetting("whole", {}, 0.0, 4.0)],
    "step": [
        TriedSetting("long", {"s": 4}, 0.04, 2.0),
        TriedSetting("middle", {"s": 2}, 0.01, 4.0),
        TriedSetting("short", {"s": 1}, 0.003, 8.0),
    ],
}


def test_cheapest_combination_within_the_tolerance():
    choice = choose(TRIED, 0.0, 10.0, 0.03, None)
    assert choice.chosen.labels == ("small", "middle")
    assert choice.chosen.error == pytest.approx(0.03)
    assert choice.chosen.cost == pytest.approx(20.0)
    assert choice.chosen.changes == {"b": 1, "s": 2}
    assert choice.reason == "meets the tolerance"
    assert choice.cheaper.labels == ("small", "long")
    assert choice.dearer.labels == ("small", "short")


def test_a_budget_buys_the_least_error():
    choice = choose(TRIED, 0.0, 10.0, 0.01, budget=50.0)
    assert choice.chosen.labels == ("small", "short")
    assert "the budget buys an error of 2.3e-02, not 0.01" in choice.reason
    assert choose(TRIED, 0.0, 10.0, 0.01, budget=1e3).chosen.labels == ("whole", "middle")
    assert "not even the cheapest" in choose(TRIED, 0.0, 10.0, 0.01, budget=5.0).reason


def test_a_tolerance_that_no_setting_meets_is_said():
    choice = choose(TRIED, 0.0, 10.0, 1e-4, None)
    assert choice.chosen.labels == ("whole", "short")
    assert "no setting tried meets the tolerance of 0.0001" in choice.reason


rungs = st.lists(st.tuples(st.floats(0, 1), st.floats(0.1, 100)), min_size=1, max_size=4)


@given(st.lists(rungs, min_size=0, max_size=3), st.floats(1e-3, 2), st.floats(1, 1e4))
def test_choice_is_never_dearer_than_another_that_is_as_good(ladders, tolerance, cost):
    tried = {
        str(i): [TriedSetting(f"{i}.{k}", {}, e, c) for k, (e, c) in enumerate(ladder)]
        for i, ladder in enumerate(ladders)
    }
    choice = choose(tried, 0.0, cost, tolerance, None)
    for ladder in tried.values():
        for rung in ladder:
            alone = choose(
                {k: [v[0]] if v is not ladder else [rung] for k, v in tried.items()},
                0.0,
                _first(tried, ladder, rung, cost),
                tolerance,
                None,
            ).chosen
            if alone.error <= tolerance:
                assert choice.chosen.cost <= alone.cost * (1 + 1e-9)
    if choice.cheaper != UntriedSetting():
        assert choice.cheaper.cost <= choice.chosen.cost
        assert choice.cheaper.error > choice.chosen.error
    if choice.dearer != UntriedSetting():
        assert choice.dearer.error < choice.chosen.error


def _first(tried, ladder, rung, cost):
    """Cost of the first rungs, but for one ladder's rung."""
    return cost * rung.cost / ladder[0].cost


# -- what is free to choose ----------------------------------------------------------------------
def test_explicit_settings_always_win(tmp_path):
    text = BRAKE.format(kind="transient", model="", more="")
    every = {"step", "slope of friction", "basis", "contact points"}
    assert set(free_ladders(study(text, tmp_path))) == every
    given_ = BRAKE.format(
        kind="transient",
        model="contact_points = 2",
        more=f"[transient]\nstep = 1e-6\nmodes_below = 8e3\n[parameters]\n{SLOPE}",
    )
    assert free_ladders(study(given_, tmp_path)) == {}
    modes = BRAKE.format(kind="complex_modes", model="", more="")
    assert set(free_ladders(study(modes, tmp_path))) == {"reduction"}
    fixed = BRAKE.format(kind="complex_modes", model="", more="[reduction]\ntolerance = 1e-4")
    assert free_ladders(study(fixed, tmp_path)) == {}


def test_pilots_lie_inside_the_sweep(tmp_path):
    plan = Plan(study(BRAKE.format(kind="transient", model="", more=""), tmp_path))
    assert interior_pilots(plan, 2) == [3, 2]  # no ends: a basis is trained there
    assert len(set(interior_pilots(plan, 5))) == 5


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("tolerance = 0.001", "tolerance = 0", "fidelity.tolerance", "more than 0"),
        ("audit = 1", 'budget = "soon"', "fidelity.budget", "'90 s', '5 min' or '2 h'"),
        ("audit = 1", "budget = -1.0", "fidelity.budget", "more than 0"),
        ("audit = 1", "budgte = 3.0", "fidelity.budgte", "did you mean 'budget'"),
        ('"transient"', '"sensitivity"', "transient", "needs kind"),
    ],
)
def test_bad_sections(tmp_path, old, new, key, message):
    with pytest.raises(StudyFileError) as error:
        study(BELT.replace(old, new), tmp_path)
    assert message in str(error.value)
    assert error.value.key == key


@pytest.mark.parametrize(("text", "seconds"), [("90 s", 90), ("5 min", 300), ("0.5h", 1800)])
def test_budgets(tmp_path, text, seconds):
    made = study(BELT.replace("audit = 1", f'budget = "{text}"'), tmp_path)
    assert made.definition.fidelity.budget == seconds


# -- the belt, from pilots to audit --------------------------------------------------------------
@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    place = tmp_path_factory.mktemp("fidelity")
    resolved = resolve(study(BELT, place), 1, quiet)
    report = run_resolved(resolved, place / "results", False, quiet, pytest.fail)
    return resolved, report


def test_step_is_chosen_and_its_error_audited(finished):
    resolved, report = finished
    facts = report.manifest["fidelity"]
    step = facts["chosen"]["changes"]["transient.step"]
    assert step == resolved.plan.study.section.step
    assert facts["chosen"]["estimated_error"] <= 0.001
    assert facts["audit"]["passed"]
    assert facts["audit"]["error"] <= 0.001
    assert facts["audit"]["against"].startswith("step")
    dearer = facts["dearer"]  # a smaller step, tried or not: seconds that were measured say which
    assert float(dearer["settings"].split()[1]) < step
    assert (dearer["estimated_error"] or 0.0) < facts["chosen"]["estimated_error"]
    assert open_results(report.directory).points["status"].eq("ok").all()


def test_estimates_bound_the_error_against_a_much_smaller_step(finished):
    resolved, _ = finished
    fidelity = FidelityStudy(resolved.fidelity.study, 1, quiet)
    chosen = dict(resolved.choice.chosen.changes)
    truth = {**chosen, "transient.step": chosen["transient.step"] / 4}
    error = fidelity.error(fidelity.measure(chosen, [1]), fidelity.measure(truth, [1]))
    assert error <= 1.5 * resolved.choice.chosen.error + 2.5e-3  # fits of growth see other rows


HOFFMANN = """
[study]
name = "irregular"
kind = "transient"
[model]
name = "hoffmann"
contact_law = "unilateral"
[parameters]
damping_ratio = 0.001
sliding_speed = 0.1
friction = 0.85
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.8
perturbation = 0.1
{stop}
[fidelity]
tolerance = 5e-2
audit = 0
"""


@pytest.mark.parametrize(("stop", "known"), [("", 0.01), ("stop = 'end'", 0.0)])
def test_how_well_a_level_is_known_where_a_run_ends_is_part_of_the_estimate(tmp_path, stop, known):
    """That of a motion which does not repeat erred by .8 % by events, and 5e-5 was told."""
    search = RunSearch(FidelityStudy(study(HOFFMANN.format(stop=stop), tmp_path), 1, quiet))
    assert search.settled_error() == known
    assert search.given_error() == known
    if known:
        assert search.always["transient.settle_tolerance"] == known


def test_a_choice_is_made_once(finished, monkeypatch):
    monkeypatch.setattr(fidelity_run, "search_runs", pytest.fail)
    again = resolve(finished[0].fidelity.study, 1, quiet)
    assert again.choice == finished[0].choice


def test_a_failed_audit_leads_to_better_settings(tmp_path, monkeypatch):
    outcomes = [Audit(0.5, (0,), "x"), Audit(0.001, (1,), "x")]
    monkeypatch.setattr(fidelity_run, "audit", lambda *_: outcomes.pop(0))
    said = []
    first = resolve(study(ONE_POINT, tmp_path), 1, quiet)
    report = run_resolved(first, tmp_path / "results", False, quiet, said.append)
    facts = report.manifest["fidelity"]
    assert facts["rounds"] == 2
    assert facts["audit"]["passed"]
    step = first.choice.chosen.changes["transient.step"]
    assert facts["chosen"]["changes"]["transient.step"] < step
    assert sum("the audit found an error" in text for text in said) == 1
    assert "the audit found an error of 5.0e-01" in said[0]


@pytest.mark.full_size  # by default better settings follow an audit that fails: above
def test_a_tolerance_missed_to_the_end_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(fidelity_run, "audit", lambda *_: Audit(0.9, (0,), "x"))
    said = []
    report = run_resolved(
        resolve(study(LOOSE, tmp_path), 1, quiet),
        tmp_path / "results",
        False,
        quiet,
        said.append,
    )
    assert not report.manifest["fidelity"]["audit"]["passed"]
    assert said[-1] == "fidelity: the audit found an error of 9.0e-01, more than 0.01"


def test_a_pilot_that_fails_stops_the_choice(tmp_path):
    text = BELT.replace("values = [0.5, 0.6, 0.7]", "values = [0.6]").replace(
        SLOPE, '"contact.kt" = 1e-3'
    )
    with pytest.raises(SquealstudyError, match="every pilot design point failed, the first with"):
        resolve(study(text, tmp_path), 1, quiet)


def test_a_pilot_that_fails_gives_way_to_another(tmp_path):
    text = BELT.replace(SLOPE, '"contact.kt" = 4.8e6')
    text = text.replace("[0.5, 0.6, 0.7]", "[0.3, 0.5, 0.6, 0.7]")  # too soft for the slowest
    text = text.replace("audit = 1", "audit = 1\npilots = 4")
    resolved = resolve(study(text, tmp_path), 1, quiet)
    assert resolved.choice.chosen.error <= 0.001
    assert (
        resolved.choice.reason == "meets the tolerance; a design point failed and could be no pilot"
    )


def finding(status):
    return {"status": status, "message": "why"}


def test_failing_pilots_are_replaced_in_order(tmp_path, monkeypatch):
    fidelity = FidelityStudy(study(BELT, tmp_path), 1, quiet)
    monkeypatch.setattr(FidelityStudy, "measure", lambda _, __, points: Found([7, 5], points))
    assert fidelity.pilots({}, [7, 4, 5, 3, 2]) == [4, 3]
    assert fidelity.failed == {7, 5}
    with pytest.raises(SquealstudyError, match="the first with failed: why"):
        fidelity.pilots({}, [7, 5])


class Found:
    """What stands for a measurement where some points fail."""

    seconds, reduction_seconds, setup_seconds = 1.0, 0.0, 0.0

    def __init__(self, bad, points):
        self.findings = {
            str(n): finding("failed" if p in bad else "ok") for n, p in enumerate(points)
        }


def test_a_setting_that_fails_at_a_pilot_is_refused(tmp_path):
    fidelity = FidelityStudy(study(BELT, tmp_path), 1, quiet)
    assert fidelity.point_error(finding("diverged"), finding("ok")) == 1.0
    assert fidelity.point_error(finding("ok"), finding("diverged")) == 1.0


# -- what pilots take ----------------------------------------------------------------------------
MASSES = BELT.replace("sliding_speed", "mass").replace(
    "[0.5, 0.6, 0.7]", "[0.8, 0.9, 1.0, 1.1, 1.2, 1.3]"
)


@pytest.fixture
def masses(tmp_path, monkeypatch):
    """A study of six structures, none of them made."""
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    return FidelityStudy(study(MASSES, tmp_path), 1, quiet)


def test_structures_of_the_pilots_alone_are_made(masses):
    made = masses.measure({}, [1, 4])
    prepared = [is_prepared(key) for key in masses.plan.structures]
    assert prepared == [False, True, False, False, True, False]
    spent = [load_any(list(masses.plan.structures)[i]).timings for i in (1, 4)]
    own = sum(sum(timings.values()) for timings in spent)
    assert made.reduction_seconds == pytest.approx(6 / 2 * own)  # what the study will take


def test_a_structure_that_cannot_be_made_is_a_failed_pilot(masses, monkeypatch):
    failing = list(masses.plan.structures)[1]

    def build(plan, workers, wanted):
        return {failing: "too heavy"} | build_structures(plan, workers, wanted - {failing})

    monkeypatch.setattr(pilots_module, "build_structures", build)
    found = masses.measure({}, [4, 1]).findings
    assert found["0"]["status"] == "ok"
    assert found["1"] == {"status": "structure", "message": "too heavy"}
    with pytest.raises(SquealstudyError, match="too heavy"):
        masses.measure({}, [1])


POINT_ERROR = FidelityStudy.point_error


class Pilots:
    """Stands for measurements: settings asked for, roots of the pilots off by some error."""

    def __init__(self, error, monkeypatch):
        self.asked, self.error = [], error
        monkeypatch.setattr(
            FidelityStudy, "measure", lambda _, changes, points: self.of(changes, points)
        )
        monkeypatch.setattr(FidelityStudy, "point_error", lambda *_: self.error)

    def of(self, changes, points):
        self.asked.append((changes["modes.method"], changes, tuple(points)))
        return Found([], points)

    def of_method(self, name):
        return [(changes, points) for method, changes, points in self.asked if method == name]


@pytest.fixture
def no_finer_model(monkeypatch):
    """Structures without a finer model: pilots are held against full order."""
    monkeypatch.setattr(frequency_search, "finer_finding", lambda *_: None)


@pytest.mark.usefixtures("no_finer_model")
def test_full_order_is_solved_pilot_by_pilot_until_one_refuses(tmp_path, monkeypatch):
    fidelity = FidelityStudy(
        study(BRAKE.format(kind="complex_modes", model="", more=""), tmp_path), 1, quiet
    )
    rung = free_ladders(fidelity.study)["reduction"][2]
    pilots = Pilots(0.0, monkeypatch)
    assert ModeSearch(fidelity).attempt(rung).error == 0.0
    assert [points for _, points in pilots.of_method("full")] == [(4,), (0,)]
    pilots = Pilots(0.5, monkeypatch)
    assert ModeSearch(fidelity).attempt(rung).error == 0.5
    ((changes, points),) = pilots.of_method("full")
    assert points == (4,)
    assert rung.changes.items() <= changes.items()  # a reduction that is there already
    # beyond its share but not beyond the tolerance: the other pilots may be far worse
    between = [0.7 * fidelity.tolerance, 50.0 * fidelity.tolerance]
    Pilots(0.0, monkeypatch)
    monkeypatch.setattr(FidelityStudy, "point_error", lambda *_: between.pop(0))
    assert ModeSearch(fidelity).attempt(rung).error == 50.0 * fidelity.tolerance


@pytest.mark.full_size
@pytest.mark.usefixtures("tiny_brake")
def test_the_finer_model_judges_pilots_as_full_order_does(tmp_path, monkeypatch):
    """By default test_reduction_errors.py: errors told by a finer model cover full order's."""
    band = "[modes]\nband = [500.0, 2000.0]"
    text = BRAKE.format(kind="complex_modes", model="contact_points = 2", more=band)
    fidelity = FidelityStudy(study(text, tmp_path), 1, quiet)
    rung = free_ladders(fidelity.study)["reduction"][0]
    asked = []
    measure = FidelityStudy.measure

    def recorded(self, changes, points):
        asked.append(changes["modes.method"])
        return measure(self, changes, points)

    monkeypatch.setattr(FidelityStudy, "measure", recorded)
    estimated = ModeSearch(fidelity).attempt(rung).error
    assert "full" not in asked
    monkeypatch.setattr(frequency_search, "finer_finding", lambda *_: None)
    true = ModeSearch(fidelity).attempt(rung).error
    assert "full" in asked
    assert true < estimated < 10 * true


def test_a_rung_whose_structure_fails_has_no_finer_model(tmp_path, monkeypatch):
    """Nothing is in the cache to be read then: full order tells whether the rung is to blame."""
    fidelity = FidelityStudy(
        study(BRAKE.format(kind="complex_modes", model="", more=""), tmp_path), 1, quiet
    )
    rung = free_ladders(fidelity.study)["reduction"][2]
    pilots = Pilots(0.0, monkeypatch)
    search = ModeSearch(fidelity)
    search.points, search.truth = [4, 0], {"modes.method": "full"}
    monkeypatch.setattr(FidelityStudy, "point_error", POINT_ERROR)
    changes = {**rung.changes, "modes.method": "dense"}
    assert search._error(Found([4, 0], [4, 0]), changes) == MISCOUNT_ERROR
    assert [points for _, points in pilots.of_method("full")] == [(4,)]


@pytest.mark.usefixtures("no_finer_model")
def test_a_pilot_without_a_full_order_solution_is_left_out(tmp_path, monkeypatch):
    fidelity = FidelityStudy(
        study(BRAKE.format(kind="complex_modes", model="", more=""), tmp_path), 1, quiet
    )
    pilots = Pilots(0.1, monkeypatch)
    bad = [4]
    monkeypatch.setattr(
        pilots,
        "of",
        lambda changes, points: Found(bad if changes["modes.method"] == "full" else [], points),
    )
    rung = free_ladders(fidelity.study)["reduction"][2]
    assert ModeSearch(fidelity).attempt(rung).error == 0.1
    assert fidelity.failed == {4}
    bad.append(0)
    with pytest.raises(SquealstudyError, match="no pilot has a better model to be held to: why"):
        ModeSearch(fidelity).attempt(rung)


@pytest.mark.parametrize(("points", "tried"), [(3, [1, 2]), (100, [1, 2, 0])])
def test_longer_steps_are_tried_where_they_may_save_more_than_the_try(
    points, tried, tmp_path, monkeypatch
):
    text = BELT.replace("values = [0.5, 0.6, 0.7]", f"start = 0.5\nstop = 0.7\nnum = {points}")
    fidelity = FidelityStudy(study(text.replace("0.001", "0.1"), tmp_path), 1, quiet)
    steps = [rung.changes["transient.step"] for rung in free_ladders(fidelity.study)["step"]]
    asked = []

    def measure(_, changes, points):
        asked.append(steps.index(changes["transient.step"]))
        return Found([], points)

    search = RunSearch(fidelity)
    monkeypatch.setattr(FidelityStudy, "measure", measure)
    monkeypatch.setattr(FidelityStudy, "error", lambda *_: 0.01)
    search.try_steps(search.ladders["step"])
    assert list(dict.fromkeys(asked)) == tried
    assert len(search.tried["step"]) == len(tried)


@given(st.floats(0.1, 10), st.floats(0.1, 10))
def test_a_try_must_promise_to_save_twice_its_cost(points, trial):
    assert pays(points, trial) == (points / 2 > 2 * trial)


def test_a_model_without_a_reduction_is_exact(tmp_path):
    text = BELT.replace('"transient"', '"complex_modes"').replace('"belt"\n[[', '"hulten"\n[[')
    text = text.replace("sliding_speed", "friction").split("[transient]")[0]
    text += "[fidelity]\ntolerance = 1e-3\naudit = 2\n"
    resolved = resolve(study(text, tmp_path), 1, quiet)
    assert resolved.choice.chosen.error == 0.0
    report = run_resolved(resolved, tmp_path / "results", False, quiet, pytest.fail)
    assert report.manifest["fidelity"]["audit"]["error"] == 0.0


HULTEN = (
    study_text("hulten", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.6, "{num}")
    + """\
[modes]
band = [1.0, 1000.0]
{more}
[fidelity]
tolerance = 1e-3
"""
)


def test_windows_serve_a_minimal_model_where_they_are_cheaper(tmp_path, monkeypatch):
    measure = FidelityStudy.measure

    def with_fixed_seconds(self, changes, points):  # what a clock says is not under test
        seconds = 1e-4 if changes.get("modes.method") == "windows" else 1e-2
        return replace(
            measure(self, changes, points),
            seconds=seconds,
            reduction_seconds=0.0,
            setup_seconds=0.0,
        )

    monkeypatch.setattr(FidelityStudy, "measure", with_fixed_seconds)
    resolved = resolve(study(HULTEN.format(num=200, more=""), tmp_path), 1, quiet)
    assert resolved.choice.chosen.changes["modes.method"] == "windows"
    assert resolved.choice.chosen.error <= 1e-3
    report = run_resolved(resolved, tmp_path / "results", False, quiet, pytest.fail)
    assert report.manifest["fidelity"]["audit"]["passed"]
    assert report.manifest["method"]["reason"] == "by [fidelity]"
    assert report.manifest["fidelity"]["cheaper"]["reason"] == "there is none"
    assert report.manifest["fidelity"]["dearer"]["settings"] == "dense"


FACTS = {
    "chosen": {"settings": "middle", "estimated_error": 0.01, "seconds": 4.0},
    "reason": "meets the tolerance",
    "tolerance": 0.02,
}


def test_rungs_that_were_not_tried_are_named_beside_the_choice():
    one = Combination(("middle",), {}, 0.01, 4.0)
    rungs = [Setting(name, {}) for name in ("long", "middle", "short")]
    choice = Choice(one, UntriedSetting(), UntriedSetting(), "").with_untried(rungs, ["middle"])
    assert (choice.cheaper, choice.dearer) == (UntriedSetting("long"), UntriedSetting("short"))
    choice = Choice(one, UntriedSetting(), UntriedSetting(), "").with_untried(
        rungs, ["long", "middle", "short"]
    )
    assert (choice.cheaper, choice.dearer) == (UntriedSetting(), UntriedSetting())
    choice = Choice(one, one, UntriedSetting(), "").with_untried(rungs, ["middle"])
    assert choice.cheaper is one
    assert facts(
        {**FACTS, "cheaper": _plain(UntriedSetting("long")), "dearer": _plain(UntriedSetting())}
    )[1:] == [
        ("  next cheaper", "long: not tried"),
        ("  next dearer", "there is none"),
    ]


@pytest.mark.parametrize(("num", "more"), [(25, ""), (200, 'method = "dense"')])
def test_windows_are_not_tried_for_few_points_or_against_the_file(num, more, tmp_path):
    fidelity = FidelityStudy(study(HULTEN.format(num=num, more=more), tmp_path), 1, quiet)
    assert search_modes(fidelity).chosen.changes == {"modes.tolerance": 2e-4}


def test_windows_that_miss_the_tolerance_are_refused(tmp_path, monkeypatch):
    fidelity = FidelityStudy(study(HULTEN.format(num=200, more=""), tmp_path), 1, quiet)
    monkeypatch.setattr(FidelityStudy, "error", lambda *_: 9e-4)
    assert "modes.method" not in search_modes(fidelity).chosen.changes


def test_an_explicit_step_that_misses_is_said(tmp_path):
    text = BELT.replace("duration = 0.25", "duration = 0.25\nstep = 1e-3")
    resolved = resolve(study(text, tmp_path), 1, quiet)
    assert resolved.choice.chosen.error > 0.001
    assert "no setting tried meets" in resolved.choice.reason
    said = []
    report = run_resolved(resolved, tmp_path / "results", False, quiet, said.append)
    assert report.manifest["fidelity"]["rounds"] == 1  # there is nothing better to try
    assert not report.manifest["fidelity"]["audit"]["passed"]
    assert len(said) == 2
    assert "friction rings at this step" in said[0]
    assert "the audit found an error" in said[1]


def test_a_point_that_fails_is_left_out_of_the_audit(tmp_path, monkeypatch):
    text = BELT.replace(SLOPE, '"contact.kt" = 4.8e6')
    text = text.replace("[0.5, 0.6, 0.7]", "[0.3, 0.5, 0.6, 0.7]")  # too soft for the slowest
    monkeypatch.setattr(fidelity_run, "drawn_points", lambda *_: (0, 1))
    resolved = resolve(study(text, tmp_path), 1, quiet)
    report = run_resolved(resolved, tmp_path / "results", False, quiet, pytest.fail)
    assert report.manifest["n_failed"] == 1
    assert report.manifest["fidelity"]["audit"]["points"] == [1]


@pytest.mark.full_size  # by default they fail once, or draw others: above and below
def test_audits_look_at_all_points_that_they_have_looked_at(tmp_path, monkeypatch):
    seen = []

    def audit(fidelity, plan, directory, changes, points):
        seen.append(list(points))
        return Audit(0.5 if len(seen) == 1 else 0.0, tuple(points), "x")

    monkeypatch.setattr(fidelity_run, "audit", audit)
    monkeypatch.setattr(fidelity_run, "drawn_points", lambda _, number: (number,))
    resolved = resolve(study(SHORT, tmp_path), 1, quiet)
    report = run_resolved(resolved, tmp_path / "results", False, quiet, lambda _: None)
    assert seen == [[0], [0, 1]]
    assert report.manifest["fidelity"]["audit"]["errors_of_rounds"] == [0.5, 0.0]


def test_an_edited_start_or_file_is_another_study(tmp_path):
    first = FidelityStudy(study(BELT, tmp_path), 1, quiet)
    other = FidelityStudy(study(BELT.replace("0.7]", "0.8]"), tmp_path), 1, quiet)
    assert _path(first) != _path(other)
    assert _path(first) == _path(FidelityStudy(study(BELT, tmp_path), 1, quiet))
    assert _path(first) != _path(FidelityStudy(study(BELT, tmp_path), 1, quiet, asked=1e-4))


def test_fixed_costs_do_not_grow_with_the_rung():
    choice = choose(TRIED, 0.0, 10.0, 0.03, None, fixed=100.0)
    assert choice.chosen.cost == pytest.approx(120.0)


def test_screens(tmp_path, monkeypatch):
    path = tmp_path / "belt.toml"
    path.write_text(BELT)
    checked = CliRunner().invoke(app, ["check", str(path)])
    assert checked.exit_code == 0, checked.output
    assert "fidelity" in checked.output
    assert "next dearer" in checked.output
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["run", str(path), "--output", str(out), "--no-pictures"])
    assert done.exit_code == 0, done.output
    assert "audit" in done.output
    assert "passed" in done.output
    assert json.loads((out / "manifest.json").read_text())["fidelity"]["tolerance"] == 0.001


def test_audits_draw_other_points_each_round(tmp_path):
    fidelity = FidelityStudy(study(BELT.replace("audit = 1", "audit = 2"), tmp_path), 1, quiet)
    drawn = [drawn_points(fidelity, number) for number in range(6)]
    assert all(len(set(points)) == 2 for points in drawn)
    assert len(set(drawn)) > 1


def test_a_missed_instability_is_an_error_of_one():
    assert largest_error([], Miscount(1, 0), ()) == 1.0
    assert largest_error([], Miscount(0, 1), ()) == 1.0
    error = FoundError("growth_rate", 0, 1.2, 1.0, 0.2, 0.0, 0.5)
    assert largest_error([error], Miscount(0, 0), ("growth_rate",)) == 0.2
    assert largest_error([error], Miscount(0, 0), ("torque_rms",)) == 0.0


def test_steps_are_judged_by_richardson(tmp_path, monkeypatch):
    """A method of order 2: the change to half the step is 3/4 of the error."""
    fidelity = FidelityStudy(study(BELT.replace("0.001", "0.1"), tmp_path), 1, quiet)
    search = RunSearch(fidelity)
    monkeypatch.setattr(search, "measure", lambda x: Step(x["transient.step"], 1.0))
    monkeypatch.setattr(FidelityStudy, "error", lambda _, a, b: 1e7 * (a.step**2 - b.step**2))
    ladder = search.ladders["step"]
    found = search._refined(ladder, RICHARDSON_FACTOR)
    for tried in found:
        assert tried.error == pytest.approx(1e7 * tried.changes["transient.step"] ** 2, rel=1e-9)
    assert len(found) == 3
    assert found[1].error <= search.share < found[0].error


class Step(NamedTuple):
    """What stands for a measurement."""

    step: float
    seconds: float


@pytest.mark.parametrize(
    ("lines", "step"),
    [
        ("", None),
        ("step = 3e-6", 3e-6),
        ("modes_below = 4e3\npod_vectors = 5", None),
        ("modes_below = 4e3\npod_vectors = 5\npod_step = 7e-6", 0.0),
    ],
)
def test_all_steps_are_compared_in_one_basis(lines, step, tmp_path):
    text = BRAKE.format(kind="transient", model="", more=f"[transient]\n{lines}\n")
    fidelity = FidelityStudy(study(text, tmp_path), 1, quiet)
    trained = training_step(fidelity.study).get("transient.pod_step", 0.0)
    steps = free_ladders(fidelity.study).get("step")
    assert trained == (steps[2].changes["transient.step"] if step is None else step)
    bases = free_ladders(fidelity.study).get("basis")
    for rung in bases[:-1] if bases else ():
        assert rung.changes["transient.pod_step"] == trained


def test_candidates_give_way_where_no_structure_can_be_made(tmp_path, monkeypatch):
    fidelity = FidelityStudy(
        study(BRAKE.format(kind="complex_modes", model="", more=""), tmp_path), 1, quiet
    )

    def measure(_, changes, points):
        if set(points) <= set(bad):
            raise SquealstudyError("no structure")
        return Found([], points)

    monkeypatch.setattr(FidelityStudy, "measure", measure)
    count = fidelity.section.pilots
    bad = [100 + n for n in range(count)]
    assert fidelity.pilots({}, [*bad, *range(count)]) == list(range(count))
    assert fidelity.failed == set(bad)


def test_hashes_of_single_files_are_of_their_text():
    assert source_hash(("kinds/transient/section.py",)) != source_hash(())


class SlowAtFirst:
    """Burns processor time in its first call, as imports do."""

    calls = 0

    def solve(self, task):
        self.calls += 1
        started = time.process_time()
        while self.calls == 1 and time.process_time() - started < 0.2:
            pass
        return Solved([])


def test_pilots_are_timed_without_what_the_first_call_of_a_process_owes():
    kind = SlowAtFirst()
    task = SolveTask(structure=None, rung="", points=(), box=None, keep_gaps=True)
    assert _solved(kind, [task])[0] < 0.1
    assert kind.calls == 2
