"""The slope of friction at zero sliding: one for a study, what creeps at it, what it errs by."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motions import started
from study_runs import command, plan_of, solved
from study_texts import study_text
from test_newmark import KICK, random_system

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers
from squealstudy.errors import StudyFileError
from squealstudy.fidelity.ladders import free_ladders
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.fidelity.time_search import RunSearch
from squealstudy.kinds.transient import preparation
from squealstudy.kinds.transient import slope_pilot as pilot_module
from squealstudy.kinds.transient.plan_facts import training_designs
from squealstudy.kinds.transient.screen import regularisation
from squealstudy.models.operating import REGULARISATION_SHARE, REGULARISATION_SPEED
from squealstudy.motion.integrator import integrator
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate

NAME = REGULARISATION_SPEED.name
PRESSURE = 200 * np.pi / (1e8 / 5e11)  # of the belt's contact, Pa; its static friction is 1
BELT = (
    study_text("belt", "{kind}", "belt")
    + """\
{parameters}
[[sweep]]
parameter = "sliding_speed"
values = {speeds}
[modes]
band = [10.0, 1000.0]
"""
)
TIME = """
[transient]
duration = {duration}
step = 1e-5
perturbation = {kick}
save_every = 0
{more}
"""


def belt(speeds, values="", duration=0.05, kick=4.0, more="") -> Plan:
    parameters = f"[parameters]\n{values}" if values else ""
    text = BELT.format(kind="transient", parameters=parameters, speeds=list(speeds))
    text += TIME.format(duration=duration, kick=kick, more=more)
    return plan_of(text)


NEVER = 'slope_pilot = "never"'


# -- one speed a study ---------------------------------------------------------------------------
def test_a_design_point_is_the_same_in_any_sweep_of_the_same_slowest_speed(tmp_path):
    """What else is swept changes nothing, and the slope is one: the stick number too."""
    rows = {}
    sweeps = {"two": [0.5, 1.2], "three": [0.5, 0.8, 1.2]}
    for name, speeds in sweeps.items():
        plan = belt(speeds, more=f"batch = 1\n{NEVER}")
        rows[name] = solved(plan, tmp_path / name).points.drop(columns="wall_s")
    same = rows["three"].query("sliding_speed != 0.8").reset_index(drop=True)
    assert same.equals(rows["two"])
    assert rows["three"]["stick_number"].nunique() == 1


def test_a_slower_design_point_changes_every_row_and_every_identity():
    ids = [{t.point_id for t in belt(s).tasks} for s in ([0.5, 1.0], [0.5, 1.0, 0.25])]
    assert not ids[0] & ids[1]
    known = belt([0.5, 1.0, 0.25], f'"{NAME}" = {REGULARISATION_SHARE * 0.5!r}')
    assert ids[0] < {t.point_id for t in known.tasks}
    slope = '"contact.kt" = 1e9'
    given = [{t.point_id for t in belt(s, slope).tasks} for s in ([0.5, 1.0], [0.5, 1.0, 0.25])]
    assert given[0] < given[1]


def test_the_whole_study_decides_at_whatever_points_it_is_tried():
    """Pilots of fidelity and measured points of charts are solved as the study itself."""
    whole = belt([0.25, 0.5, 1.0])
    part = Plan(whole.study, whole.swept[1:])
    assert part.tasks[0].point_id == whole.tasks[1].point_id
    trained = {d.values[NAME] for d in training_designs(whole)}
    assert trained == {REGULARISATION_SHARE * 0.25}


def test_complex_modes_do_not_depend_on_it():
    text = [BELT.format(kind="complex_modes", parameters="", speeds=s) for s in ([0.5], [0.5, 0.1])]
    first, second = (plan_of(t) for t in text)
    assert first.tasks[0].point_id == second.tasks[0].point_id


def test_fold_and_level_of_the_belt_are_those_of_a_far_larger_slope(tmp_path):
    """Alive at 1.82 m/s, silent at 1.85, levels within 1 %: a speed of 2 % of each was silent."""
    speeds = [1.1, 1.82, 1.85]
    stiff = f'"contact.kt" = {PRESSURE / (0.001 * 1.1)!r}'
    level = {}
    for name, values in (("own", ""), ("stiff", stiff)):
        results = solved(belt(speeds, values, 0.5, more=NEVER), tmp_path / name)
        level[name] = results.points.set_index("sliding_speed")["torque_rms"]
    for own, far in zip(level["own"][[1.1, 1.82]], level["stiff"], strict=False):
        assert own == pytest.approx(far, rel=0.01)
    assert level["own"][1.82] > 90
    assert level["own"][1.85] < 1
    assert level["stiff"][1.85] < 1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (f'"{NAME}" = 0.8', "friction must saturate at the sliding speed of 0.5 m/s: at most"),
        (f'"{NAME}" = -1.0', "expected at least 0 m/s, got -1"),
        (f'"{NAME}" = 1e-3\n"contact.kt" = 1e9', "has a contact.kt of its own"),
    ],
)
def test_bad_speeds(tmp_path, values, message):
    with pytest.raises(Exception, match=message) as caught:
        solved(belt([0.5], values), tmp_path / "belt")
    assert NAME in str(caught.value)


def test_without_any_sliding_there_is_no_study():
    with pytest.raises(StudyFileError, match="expected a value other than 0 m/s"):
        belt([0.0])


# -- stick_creep ---------------------------------------------------------------------------------
def creep_of(system, design, q, v):
    """Largest sliding speed of what sticks at each row, from all displacements and velocities."""
    law, friction = design.contact, design.friction
    p0, lam = law.parameters
    p = p0 * np.exp(-lam * (system.gap + q @ system.N.T))
    w = np.hypot(design.speed + v @ system.T1.T, v @ system.T2.T)
    ratio, v_mu = friction.curve.parameters
    mu = friction.friction * (1 + (ratio - 1) * np.exp(-w / v_mu))
    closed = p > 0.01 * (p @ system.area / system.area.sum())[:, None]
    sticks = closed & (friction.k_t * w < mu * p)
    return np.where(sticks, w, 0.0).max(axis=1), sticks


@pytest.mark.parametrize("method", ["exponential", "newmark", "newmark_newton"])
@pytest.mark.parametrize("count", [1, 5])
def test_creep_is_the_largest_sliding_speed_of_what_sticks(method, count):
    """Read from the motion itself, alone and in a batch."""
    system, design = random_system()
    system = replace(system, sensed=np.arange(system.n) + 1)
    settings = MotionSettings(1e-3, 2e-6, 1, integrator(method), tolerance=1e-10)
    for result in simulate(system, started([design] * count, np.zeros(12), KICK), settings):
        assert result.outcome == "ok"
        expected, sticks = creep_of(system, design, result.displacement, result.velocity)
        assert 0 < sticks.mean() < 1
        creep = result.history["creep"] * design.speed
        same = np.isclose(creep, expected, rtol=1e-3, atol=1e-12)
        assert same.mean() > 0.99  # a point at the bound may be seen on either side of it


def test_creep_of_a_study(tmp_path):
    """Below the regularisation speed on the belt, whose pressure is constant; NaN where none."""
    results = solved(belt([0.8, 1.9], duration=0.3, more=NEVER), tmp_path / "belt")
    creep = results.points.set_index("sliding_speed")["stick_creep"]
    assert 0.5 * REGULARISATION_SHARE < creep[0.8] <= REGULARISATION_SHARE
    assert np.isnan(creep[1.9])


# -- its error -----------------------------------------------------------------------------------
def pilot_of(results: Results) -> dict:
    return results.manifest["regularisation"]["pilot"]


SOFT = f'"{NAME}" = 0.02'  # of a slope that errs


@pytest.fixture(scope="module")
def cycles(tmp_path_factory):
    """Stick-slip at 0.9 m/s, grown from steady sliding, and a point that stays silent."""
    return solved(belt([0.9, 1.9], SOFT, 1.0, 1.0), tmp_path_factory.mktemp("slope") / "belt")


@pytest.mark.full_size
def test_the_pilot_estimates_what_a_far_larger_slope_gives(cycles, tmp_path):
    pilot = pilot_of(cycles)
    points = cycles.points.set_index("point_id")
    assert pilot["status"] == "ok"
    assert points["sliding_speed"][pilot["point_id"]] == 0.9
    told = pilot["errors"]["torque_rms"]
    assert told["value"] == points["torque_rms"][pilot["point_id"]]
    far = solved(belt([0.9], f'"{NAME}" = 5e-4', 1.0, 1.0, NEVER), tmp_path / "far").points
    true = abs(told["value"] / float(far["torque_rms"].iloc[0]) - 1)
    assert true > 0.02
    assert 0.5 * true < told["error"] < 1.5 * true


def test_the_pilot_is_not_part_of_a_point(cycles, tmp_path):
    """Switched off it says so, and the points are the same ones."""
    again = belt([0.9, 1.9], SOFT, 1.0, 1.0, NEVER)
    report = run_study(again, cycles.directory, jobs=1)
    assert report.n_reused == 2
    assert report.manifest["regularisation"]["pilot"]["status"] == "skipped"


def test_of_few_points_of_a_meshed_model_there_is_none(monkeypatch):
    monkeypatch.setattr(pilot_module, "has_mesh", lambda study: True)
    found = pilot_module.slope_pilot(belt([0.5, 0.9]), Path(), None, lambda *_: None)
    assert found == {
        "status": "skipped",
        "message": 'fewer than 8 design points; slope_pilot = "always" would tell',
    }


def test_an_error_within_chance_that_may_be_all_of_the_level_is_not_known():
    facts = {"speed": 1e-3, "speed_highest": 1e-3, "automatic": 0}

    def told(chance):
        errors = {"torque_rms": {"error": 0.1, "chance": chance}}
        return regularisation(facts | {"pilot": {"status": "ok", "message": "", "errors": errors}})[
            1
        ][1]

    assert told(1.974).startswith("RMS level not known (its runs scatter too much)")
    assert told(0.2).startswith("RMS level below 20.0 %")


@pytest.mark.parametrize(
    ("own", "double", "status", "words"),
    [
        ("limit_cycle", "limit_cycle", "ok", ""),
        ("limit_cycle", "stable", "undecided", "limit_cycle at k_t, stable at 2 k_t"),
        ("irregular", "irregular", "undecided", "by chance too"),
        (
            "undecided",
            "undecided",
            "undecided",
            "both runs are undecided: neither is known to have reached its level",
        ),
        ("limit_cycle", "", "failed", "at 2 k_t: not_converged: why"),
    ],
)
def test_verdicts(own, double, status, words):
    def finding(name, rms):
        values = {"torque_rms": [rms, rms, rms], "growth_rate": [None] * 3}
        values |= {"torque_mean": [10.0] * 3, "dominant_frequency": [100.0] * 3}
        first = {"status": "ok" if name else "not_converged", "message": "why", "class": name}
        rest = {"torque_static": 10.0, "predicted_frequency_hz": 100.0, "energy_share": {}}
        return first | rest | {"values": values}

    found = pilot_module._verdict(finding(own, 2.0), finding(double, 2.1))
    assert found["status"] == status
    assert words in found["message"]
    if own == double == "limit_cycle":
        assert found["errors"]["torque_rms"]["error"] == pytest.approx(2 * 0.1 / 2.1)
        assert "growth_rate" not in found["errors"]


def test_a_slope_that_is_given_has_no_pilot(tmp_path):
    results = solved(belt([0.9], '"contact.kt" = 1e8'), tmp_path / "belt")
    assert results.manifest["regularisation"] is None


# -- what is said --------------------------------------------------------------------------------
def test_screens(tmp_path, monkeypatch, capsys):
    plan = belt([0.9, 1.9])
    monkeypatch.chdir(tmp_path)
    Path("belt.toml").write_text(plan.study.source.text)
    printed = {}
    for verb, more in (("check", ()), ("run", ("--no-pictures",))):
        assert command(verb, "belt.toml", "--jobs", "1", "--output", "here", *more) == 0
        printed[verb] = " ".join(capsys.readouterr().out.split())
        assert (
            "sticking below 0.0018 m/s: 0.2 % of the slowest sliding speed of the study"
            in printed[verb]
        )
        assert "0.9 m/s (a slower design point changes all results)" in printed[verb]
    assert "by one run at half that speed" in printed["run"]
    told = json.loads(Path("here/manifest.json").read_text())["regularisation"]
    assert told["speed"] == told["speed_highest"] == pytest.approx(0.0018)
    assert told["slowest_sliding_speed"] == 0.9
    assert told["points"] == told["automatic"] == 2


def test_the_warning_names_the_speed_that_would_do():
    plan = belt([0.5], f'"{NAME}" = 1e-6')
    build_structures(plan, Workers())
    (text,) = [w for w in preparation.warnings(plan) if "too stiff" in w]
    speed = float(re.search(rf"{NAME} of (\S+) would do", text).group(1))
    kept = belt([0.5], f'"{NAME}" = {1.1 * speed!r}')
    assert not [w for w in preparation.warnings(kept) if "too stiff" in w]


# -- fidelity ------------------------------------------------------------------------------------
FIDELITY = "[fidelity]\ntolerance = 0.03\naudit = 0\npilots = 1\n"


def ladders_of(values=""):
    return free_ladders(belt([0.6, 0.9], values).study)


def test_the_slope_is_a_ladder_of_fidelity():
    speeds = [r.changes[f"parameters.{NAME}"] for r in ladders_of()["slope of friction"]]
    assert speeds == [REGULARISATION_SHARE * 0.6 * f for f in (1.0, 0.5, 0.25, 0.125)]
    for given in (f'"{NAME}" = 1e-3', '"contact.kt" = 1e9'):
        assert "slope of friction" not in ladders_of(given)


def test_fidelity_chooses_the_slope_by_its_pilots():
    plan = belt([0.6, 0.9], duration=0.3, kick=1.0, more=FIDELITY)
    search = RunSearch(FidelityStudy(plan.study, 1, lambda *_: None))
    search.try_slopes(search.ladders["slope of friction"])
    softest, *_, last = search.tried["slope of friction"]
    assert 0 < softest.error < 0.2
    assert search.now[f"parameters.{NAME}"] in (
        t.changes[f"parameters.{NAME}"] for t in search.tried["slope of friction"]
    )
    assert last.error <= softest.error


def test_a_variant_changes_a_speed_whose_name_the_file_quotes():
    fidelity = FidelityStudy(belt([0.6], f'"{NAME}" = 1e-2').study, 1, lambda *_: None)
    changed = fidelity.variant({f"parameters.{NAME}": 1e-3}, None)
    assert changed.tasks.column(NAME).tolist() == [1e-3]


def test_a_forecast_is_of_steps_and_not_of_kernels_that_are_compiled(monkeypatch):
    """What a process does once, 2 s by this clock, is in no step: the run has 5,000 of them."""
    plan = belt([1.0])
    build_structures(plan, Workers())
    clock, run = {"s": 0.0}, preparation.simulate
    monkeypatch.setattr(preparation.time, "perf_counter", lambda: clock["s"])

    def compiled_first(*arguments):
        clock["s"] += 1e-3 if clock["s"] else 2.0
        return run(*arguments)

    monkeypatch.setattr(preparation, "simulate", compiled_first)
    seconds = plan.kind.time_point(plan, plan.tasks[0])
    assert seconds == pytest.approx(1e-3 * 5000 / preparation.TIMED_STEPS)
