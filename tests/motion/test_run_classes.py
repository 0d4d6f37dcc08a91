"""Classes of runs of small models: alike for alike motion, and true against longer runs."""

from __future__ import annotations

import re
from dataclasses import replace
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from conftest import benchmark
from lumped_files import TWO_PADS
from rich.console import Console
from study_runs import plan_of, solved
from study_texts import study_text

import squealstudy as sq
from squealstudy import screen
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.kinds.transient.preparation import warnings
from squealstudy.kinds.transient.screen import SCREEN

BELT = (
    study_text("belt", "transient", "belt")
    + """\
[parameters]
damping_ratio = {damping}
[[sweep]]
parameter = "sliding_speed"
values = {speeds}
[modes]
band = [10.0, 1000.0]
[transient]
duration = {duration}
step = 5e-5
perturbation = {kick}
save_every = 0
{more}
"""
)


def results_of(
    directory: Path,
    speeds: list[float],
    *,
    damping: float = 0.05,
    duration: float = 1.0,
    kick: float = 4.0,
    more: str = "",
) -> Results:
    text = BELT.format(speeds=speeds, damping=damping, duration=duration, kick=kick, more=more)
    return solved(text, directory)


@pytest.fixture(scope="module")
def kicked(tmp_path_factory) -> Results:
    """Stick-slip on both sides of the onset (1.1513 m/s) up to its fold, and rest."""
    return results_of(tmp_path_factory.mktemp("classes") / "belt", [1.15, 1.16, 1.6, 2.2])


def test_the_same_stick_slip_has_one_class_on_both_sides_of_the_onset(kicked):
    points = kicked.points.set_index("sliding_speed")
    assert points["n_unstable"].tolist() == [1, 0, 0, 0]
    assert points["class"].tolist() == ["limit_cycle"] * 3 + ["stable"]
    assert points["settled"].all()
    assert points["undecided_until"].isna().all()
    assert points["torque_rms"][1.16] == pytest.approx(points["torque_rms"][1.15], rel=0.01)
    ranked = kicked.rank()
    assert ranked["points"].tolist() == [3] * len(ranked)


def test_a_subcritical_cycle_ends_a_run_that_may_stop(tmp_path, kicked):
    more = 'stop = "settled"\nsettle_tolerance = 0.05\n'
    points = results_of(tmp_path / "belt", [1.15, 1.16, 1.6, 2.2], duration=2.0, more=more).points
    assert points["stop_reason"].tolist() == ["settled"] * 3 + ["decayed"]
    assert points["class"].tolist() == kicked.points["class"].tolist()
    np.testing.assert_allclose(points["torque_rms"][:3], kicked.points["torque_rms"][:3], rtol=0.02)


def test_a_light_decay_is_undecided_until_the_duration_that_it_names(tmp_path):
    """Damping 1e-5 far above the onset: a hundred periods fall by 0.6 %."""
    light = {"damping": 1e-5, "kick": 1e-3}
    points = results_of(tmp_path / "short", [12.0], more='stop = "settled"', **light).points
    row = points.iloc[0]
    assert (row["class"], row["stop_reason"]) == ("undecided", "end")
    assert not row["settled"]
    assert 2.0 < row["undecided_until"] < 10.0
    longer = results_of(tmp_path / "long", [12.0], duration=row["undecided_until"], **light)
    assert longer.points["class"].tolist() == ["stable"]


def test_a_duration_that_nobody_would_run_is_not_named():
    """Damping 1e-10 halves a motion of 100 Hz in some 10^7 s."""
    system = sq.model("belt", sliding_speed=12.0, damping_ratio=1e-10).at()
    row = system.simulate(duration=1.0, step=2e-5).summary().iloc[0]
    assert (row["class"], row["undecided_until"]) == ("undecided", np.inf)


@pytest.mark.parametrize("duration", [0.05, 0.1, 0.4])
def test_no_duration_decides_what_neither_grows_nor_decays(duration):
    """Undamped, below flutter: one of .4 s told that 3.1 s would decide, as would any other."""
    system = sq.model("hulten", friction=0.2).at()
    row = system.simulate(duration=duration, step=2e-5).summary().iloc[0]
    assert (row["class"], row["undecided_until"]) == ("undecided", np.inf)


def test_round_off_has_no_frequency():
    """Steady sliding that nothing disturbs was told to move at 89 Hz, with an RMS of 0."""
    system = sq.model("belt", sliding_speed=0.5).at()
    row = system.simulate(duration=0.4, step=2e-5, save_every=5, perturbation=0.0).summary().iloc[0]
    assert (row["class"], row["torque_rms"]) == ("undecided", pytest.approx(0.0, abs=1e-9))
    assert row[["frequency_hz", "frequency_error", "torque_line_hz"]].isna().all()


@pytest.mark.parametrize("duration", [0.8, 1.5])
def test_a_cycle_far_below_the_kick_is_not_rest(duration):
    """Lift-off that lasts: RMS 1.16 N of .53 N, 1 % of what the kick began with."""
    values = {"friction": 0.7, "sliding_speed": 0.3, "damping_ratio": 0.01, "normal_force": 1.0}
    system = sq.model("hoffmann", contact_law="unilateral", **values).at()
    run = {"step": 2e-5, "save_every": 5, "perturbation": 0.5}
    row = system.simulate(duration=duration, **run).summary().iloc[0]
    assert row["class"] != "stable"
    if row["class"] == "undecided":
        row = system.simulate(duration=row["undecided_until"], **run).summary().iloc[0]
    assert row["class"] == "limit_cycle"


@pytest.mark.parametrize("periods", [0.1, 0.4, 2, 8])
def test_a_run_of_few_periods_names_a_duration_that_tells(periods):
    """Of 10 ms each: growth is not over, or stick-slip is too short to be seen to repeat."""
    system = sq.model("belt", friction=0.4, sliding_speed=0.3).at()
    run = {"step": 2e-5, "perturbation": 1e-2, "save_every": 5}
    short = system.simulate(duration=0.01 * periods, **run).summary().iloc[0]
    assert short["class"] == "undecided"
    longer = system.simulate(duration=short["undecided_until"], **run).summary().iloc[0]
    assert longer["class"] == "limit_cycle"


@pytest.mark.parametrize(("start", "still"), [("working_point", True), ("stuck", False)])
def test_without_a_perturbation_steady_sliding_stays_and_what_is_stuck_moves(start, still):
    more = f'start = "{start}"'
    text = BELT.format(speeds=[1.0], damping=0.05, duration=0.1, kick=0.0, more=more)
    told = any("steady sliding stays as it is" in one for one in warnings(plan_of(text)))
    assert told == still


def test_undecided_runs_are_told_and_not_ranked(tmp_path, monkeypatch):
    results = results_of(tmp_path / "belt", [1.0, 12.0], damping=1e-5, kick=1e-3)
    assert sorted(results.points["class"]) == ["limit_cycle", "undecided"]
    assert (results.rank()["points"] == 1).all()
    console = Console(width=200, file=(text := StringIO()))
    monkeypatch.setattr(screen, "console", console)
    screen.show(*results.screen.findings(results))
    printed = " ".join(text.getvalue().split())
    until = results.points["undecided_until"].max()
    assert "1 of 2 runs is too short to tell what it comes to" in printed
    assert f"a duration of about {until:.2g} s would decide it" in printed


def test_rest_on_an_unstable_equilibrium_is_undecided(tmp_path):
    """Nothing moves at either speed; at one of them anything would grow."""
    points = results_of(tmp_path / "belt", [1.0, 1.3], duration=0.1, kick=0.0).points
    assert points["class"].tolist() == ["undecided", "stable"]
    assert points["undecided_until"].tolist()[0] == np.inf


def test_the_scale_of_mass_does_not_matter(tmp_path):
    """The energy below which nothing moves follows the work of friction."""
    text = BELT.format(speeds=[1.0, 1.3], damping=0.05, duration=0.5, kick=1e-3, more="")
    mass, stiffness, force = 1e-9, 1e-9 * (200 * np.pi) ** 2, 1e-9 * 200 * np.pi
    structure = f"mass = {mass}\nstiffness = {stiffness}\nnormal_force = {force}\n"
    found = []
    for name, more in (("one", ""), ("other", structure + "contact_stiffness = 0.1\n")):
        plan = plan_of(text.replace("[[sweep]]", more + "[[sweep]]"))
        run_study(plan, tmp_path / name, jobs=1)
        found.append(Results.open(tmp_path / name).points)
    assert found[0]["class"].tolist() == found[1]["class"].tolist()
    np.testing.assert_allclose(found[1]["growth_rate"], found[0]["growth_rate"], rtol=1e-4)


@pytest.mark.full_size
def test_classes_are_those_of_runs_ten_times_longer():
    """Six runs of the table of truth, of a third of the length or less.

    At twice the step the belt's sticking friction alternates, which hides how flat its level is.
    """
    truth = benchmark("class_truth")
    families = (
        replace(truth.BELT, kicks=(1e-3, 8.0), count=4, duration=1.0, step=5e-5),
        replace(truth.HOFFMANN, kicks=(3e-2,), count=2, duration=1.0, step=1e-4),
    )
    for family in families:
        table = truth.judged(family, seed=5)
        known = table[~table["truth"].isin(["undecided", "failed"])]
        decided = known[known["class"] != "undecided"]
        assert decided["right"].all(), truth.report(table)
        open_ = table[table["class"] == "undecided"]
        assert (open_["undecided_until"] > family.duration).all()
        if family is families[0]:  # the other is too short here for most of its beats to die away
            assert len(decided) >= 0.7 * len(known)


@pytest.fixture(scope="module")
def two_pads(tmp_path_factory):
    """Runs of 1.5 s by friction, speed, mass, friction of the second pad, and stiffness."""
    path = tmp_path_factory.mktemp("pads") / "two_pads.toml"
    path.write_text(TWO_PADS)
    values = np.array(
        [
            (0.39107, 0.45075, 2.72789, 0.80494, 3.07406e6),
            (0.25764, 0.38352, 1.23654, 0.82816, 3.43540e6),
            (0.57236, 0.60106, 0.92461, 0.31624, 2.29892e6),
        ]
    )
    names = ("friction", "sliding_speed", "mass_a", "factor_b", "k_ab")
    more = {"contact.kt": 2.5e8}
    model = sq.model(str(path), contact_law="unilateral", **more)
    batch = model.at(**dict(zip(names, values.T, strict=True)))
    return batch.simulate(duration=1.5, step=1e-5, perturbation=0.01).summary()


def test_a_mode_that_feeds_another_is_no_limit_cycle(two_pads):
    """Energy keeps its level while the torque falls from 39 to 23 N; 49.9 N last from 3 s on."""
    assert two_pads["class"][0] == "undecided"
    assert two_pads["undecided_until"][0] == pytest.approx(3.0)


UNLIKE_PADS = """
mass = [
  { name = "a", mass = 1.0, directions = ["x", "y"] },
  { name = "b", mass = 1.5, directions = ["x", "y"] },
]
spring = [
  { between = ["a", "ground"], direction = "x", stiffness = 1e6 },
  { between = ["a", "b"], direction = "x", stiffness = 2e5 },
  { between = ["b", "ground"], direction = "x", stiffness = 2e6 },
]
load = [
  { on = "a", direction = "-y", force = 500.0 },
  { on = "b", direction = "-y", force = 500.0 },
]
[[contact]]
between = ["a", "belt"]
normal = "y"
sliding = "x"
stiffness = 1e8
friction_law = { static_ratio = 1.5 }
[[contact]]
between = ["b", "belt"]
normal = "y"
sliding = "x"
stiffness = 1e8
friction_law = { static_ratio = 1.05 }
[parameters]
friction = 0.4
sliding_speed = 0.4
damping_ratio = 0.002
"friction_law.decay_speed" = 0.2
"""


def test_a_second_mode_that_rises_with_much_of_the_energy_is_no_limit_cycle(tmp_path):
    """It has 6 % of the energy after 1 s, 27 % in the end, whose RMS is 75.7 and not 66.5 N."""
    (tmp_path / "pads.toml").write_text(UNLIKE_PADS)
    model = sq.model(str(tmp_path / "pads.toml")).at()
    row = model.simulate(duration=1.0, step=1e-5, perturbation=1e-3, band=(10.0, 2000.0)).summary()
    assert row["class"][0] == "undecided"
    assert 1.0 < row["undecided_until"][0] < 6.0


def test_levels_are_those_after_the_transient(two_pads):
    """By Runge and Kutta's method at steps of 2e-6 s over the last .3 of 3 s: 9.905, 26.07 N."""
    for row, rms in ((1, 9.905), (2, 26.07)):
        told = two_pads.iloc[row]
        assert told["class"] == "limit_cycle"
        assert told["torque_rms"] == pytest.approx(rms, rel=2e-3)
        assert told["torque_rms_high"] - told["torque_rms_low"] < 0.02 * rms


def test_a_run_with_too_long_a_step_is_told_a_shorter_one_and_no_duration(tmp_path):
    """Two steps a period: neither its class nor its balance of energy is of any worth."""
    text = BELT.format(speeds=[1.0], damping=0.05, duration=1.0, kick=0.5, more="")
    results = solved(text.replace("step = 5e-5", "step = 0.03"), tmp_path / "out")
    row = results.points.iloc[0]
    assert "a step of" in row["invalid_reason"]
    steps = dict(results.screen.next_steps(results))
    assert "decide runs" not in steps
    shorter = float(re.search(r"step = (\S+) in \[transient\]", steps["shorten the step"])[1])
    assert shorter < 0.03
    printed = " ".join(map(str, results.screen.findings(results)))
    assert "too short to tell" not in printed


@pytest.mark.parametrize(
    ("duration", "step", "told"),
    [
        (1.0, 4.4e-3, ""),
        (5.0, 8e-3, ""),
        (20.0, 5e-3, ""),
        (0.5, 1e-3, ""),
        (0.5, 2e-5, "limit_cycle"),
    ],
)
def test_steps_longer_than_the_motion_decide_nothing(duration, step, told):
    """Of one that grows: steps of a period were told as irregular, of .2 periods as stable."""
    model = sq.model("hoffmann", contact_law="unilateral", friction=0.78, damping_ratio=0.01)
    run = model.at(sliding_speed=0.1).simulate(duration=duration, step=step, save_every=1)
    row = run.summary().iloc[0]
    if told:
        assert row["class"] == told
    else:
        assert (row["class"], row["undecided_until"]) == ("undecided", np.inf)
        assert "the step resolves the fastest mode" in row["invalid_reason"]


@pytest.mark.parametrize(
    ("classes", "manifest", "told"),
    [
        (["undecided", "stable"], {}, True),
        (["undecided", "stable"], {"simulated_time": {}}, False),
        (["undecided"], {}, False),
    ],
)
def test_runs_that_are_decided_need_not_last_longer_with_the_others(classes, manifest, told):
    points = pd.DataFrame({"class": classes, "undecided_until": 1.6, "time_reached": 0.1})
    results = SimpleNamespace(points=points, manifest=manifest, directory=Path("results/runs"))
    advice = dict(SCREEN.next_steps(results))["decide runs"]
    assert advice.startswith("a duration of 1.6 s in [transient]")
    assert ('stop = "settled"' in advice) == told
