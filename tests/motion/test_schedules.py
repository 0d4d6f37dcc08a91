"""Speed and pressure over time: judged by pieces between events, by hand, and by bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import reduce_brake
from groan_reference import AHEAD, STICK
from schedule_reference import Scheduled
from scipy.interpolate import PchipInterpolator
from study_runs import command, plan_of, solved

from squealstudy.engine.motion_shapes import end_motion
from squealstudy.errors import ModelError, ParameterError, ResultsError, StudyFileError
from squealstudy.kinds.transient.window_screen import windows
from squealstudy.laboratory.integrators.explicit import CentralDifference
from squealstudy.motion.schedule import Schedule
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.warmup import smallest_system
from squealstudy.screen import as_text
from squealstudy.wording import moment

STUDIES = Path(__file__).parents[2] / "studies"
SPEED = 0.2  # m/s, of the design point
STOP = [(0.0, 0.2), (0.05, 0.2), (0.35, 0.0)]
THROUGH = [(0.0, 0.2), (0.05, 0.2), (0.35, -0.2)]  # zero
PULL_AWAY = [(0.0, 0.0), (0.02, 0.0), (0.32, 0.3)]
RISE = [(0.0, 1.5e6), (0.1, 1.5e6), (0.4, 3e6)]  # Pa, on 1e-3 m2


def groan(pressed=False):
    """The pad on a caliper, pressed by a force or by the brake pressure on a piston."""
    text = (STUDIES / "lumped" / "groan.toml").read_text()
    if not pressed:
        return text
    text = text.replace('force = "normal_force"', 'area = "face"')
    piston = '{ default = 1e-3, unit = "m2", description = "piston" }\npressure = 1.5e6'
    lines = [x for x in text.splitlines() if not x.startswith("normal_force")]
    return "\n".join([*lines, f"face = {piston}"])


def study(folder, more, pressed=False, parameters="", kind="transient"):
    (folder / "groan.toml").write_text(groan(pressed))
    return f"""
[study]
name = "changing"
kind = "{kind}"
[model]
file = "{folder / "groan.toml"}"
[parameters]
sliding_speed = {SPEED}
"contact.regularisation_speed" = 5e-5
{parameters}
[modes]
band = [10.0, 2000.0]
[transient]
duration = 0.4
step = 2e-6
perturbation = 0.0
save_every = 20
{more}
"""


def listed(points):
    return f"{{ points = {[list(point) for point in points]} }}"


def follow(speeds=(), presses=(), phase=AHEAD, duration=0.4):
    judge = Scheduled(speed=SPEED, speeds=speeds, presses=presses)
    return judge.follow(duration, 2e-5, [*judge.steady(), 0.0, 0.0], phase)[:2]


def judged(times, forces, row):
    """Mean and RMS about a straight line of the judge's force in a window."""
    inside = (times > row["time_start"]) & (times <= row["time_stop"])
    x, f = times[inside], forces[inside]
    return f.mean(), (f - np.polyval(np.polyfit(x, f, 1), x)).std()


@pytest.fixture(scope="module")
def stop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stop")
    more = f"sliding_speed = {listed(STOP)}\nwindows = 10"
    return solved(study(folder, more), folder / "results")


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pressed")
    speeds = [(0.0, 0.2), (0.4, 0.15)]
    more = f"sliding_speed = {listed(speeds)}\npressure = {listed(RISE)}\nwindows = 8"
    return solved(study(folder, more, pressed=True), folder / "results"), speeds


def test_a_stop_is_that_of_pieces_between_events(stop):
    times, forces = follow(STOP)
    for row in stop.windows.to_dict("records")[:7]:  # behind them friction holds what creeps
        mean, rms = judged(times, forces, row)
        assert row["torque_mean"] == pytest.approx(mean, rel=2e-3)
        assert row["torque_rms"] == pytest.approx(rms, rel=0.01, abs=0.05)
    speeds = stop.windows["sliding_speed_stop"].to_numpy()
    assert speeds == pytest.approx(np.interp(stop.windows["time_stop"], *np.array(STOP).T))
    # of steady sliding, whatever is imposed: in the last window less and less, and nothing
    assert stop.points["stick_creep"].iloc[0] == pytest.approx(5e-5 / SPEED, rel=0.01)


def test_a_run_that_stays_quiet_while_its_speed_rises_balances(tmp_path):
    """Beyond the speed of onset, without a kick: friction follows its curve."""
    text = study(tmp_path, f"sliding_speed = {listed([(0.0, 0.2), (0.3, 0.8)])}")
    text = text.replace(
        f"sliding_speed = {SPEED}\n", f"sliding_speed = {SPEED}\ndamping_ratio = 0.1\n"
    )
    results = solved(text, tmp_path / "results")
    point = results.points.iloc[0]
    assert (point["valid"], point["invalid_reason"]) == (True, "")
    assert (results.windows["class"] == "quiet").all()
    assert "growth_comparison" not in dir(results.plot)  # nothing grows at one speed
    assert "torque_history" in dir(results.plot)


def test_the_sign_of_slip_turns_with_the_belt(tmp_path):
    """Through zero speed friction turns, with the belt's; both ways as pieces between events."""
    more = f"sliding_speed = {listed(THROUGH)}\nwindows = 8"
    found = solved(study(tmp_path, more), tmp_path / "results")
    times, forces = follow(THROUGH)
    rows = found.windows.to_dict("records")
    for row in rows:
        mean, rms = judged(times, forces, row)
        assert row["torque_mean"] == pytest.approx(mean, rel=5e-3, abs=3.0)
        assert row["torque_rms"] == pytest.approx(rms, rel=0.02, abs=0.05)
    assert rows[0]["torque_mean"] > 600.0
    assert rows[-1]["torque_mean"] < -600.0


def test_a_pull_away_from_rest(tmp_path):
    more = f'sliding_speed = {listed(PULL_AWAY)}\nstart = "stuck"\nwindows = 10'
    found = solved(study(tmp_path, more), tmp_path / "results")
    times, forces = follow(PULL_AWAY, phase=STICK)
    for row in found.windows.to_dict("records"):
        mean, rms = judged(times, forces, row)
        assert row["torque_mean"] == pytest.approx(mean, rel=6e-3)
        assert row["torque_rms"] == pytest.approx(rms, rel=0.03, abs=1.0)


STUCK = """
[study]
name = "stuck"
kind = "transient"
[model]
name = "MODEL"
[parameters]
sliding_speed = 0.5
"contact.regularisation_speed" = 1e-3
[modes]
band = [1.0, 1000.0]
[transient]
duration = 0.2
step = 2e-5
save_every = 5
start = "stuck"
windows = 2
sliding_speed = { points = [[0.0, 0.0], [1.0, 0.0]] }
"""


def test_a_stuck_start_is_held_by_friction(tmp_path):
    """Friction began at zero and rose within less than a step: to 525 N, and 37 times this RMS.

    A belt at rest: m x'' + (c + d) x' + k x = 0 with d = friction's slope, on its slow root.
    """
    found = solved(STUCK.replace("MODEL", "belt"), tmp_path / "results")
    omega, force = 200 * np.pi, 200 * np.pi * 0.5 * (1 + np.exp(-1.0))
    damping = 2 * 0.05 * omega + 200 * np.pi / 1e-3
    root = -2 * omega**2 / (damping + np.sqrt(damping**2 - 4 * omega**2))
    history = found.history(0)
    exact = force * np.exp(root * history["time"].to_numpy())
    assert history["torque"].to_numpy() == pytest.approx(exact, rel=3e-4)
    times = np.linspace(0.0, 0.2, 50001)
    for row in found.windows.to_dict("records"):
        mean, rms = judged(times, force * np.exp(root * times), row)
        assert row["torque_mean"] == pytest.approx(mean, rel=1e-4)
        assert row["torque_rms"] == pytest.approx(rms, rel=0.005)


def test_a_stuck_start_of_several_points_is_at_rest(tmp_path):
    """Two contacts that turn into each other; a static ratio lets friction hold both."""
    text = STUCK.replace("MODEL", "hulten").replace(
        "[modes]", '"friction_law.static_ratio" = 1.5\n"friction_law.decay_speed" = 0.1\n[modes]'
    )
    history = solved(text, tmp_path / "results").history(0)
    assert history["torque"].iloc[0] == pytest.approx(history["torque"].iloc[20], rel=0.02)
    assert history["stick"].iloc[:20].to_numpy() == pytest.approx(1.0)


def test_pressure_and_speed_change_together(pressed):
    results, speeds = pressed
    times, forces = follow(speeds, [(t, 1e-3 * p) for t, p in RISE])
    for row in results.windows.to_dict("records")[:4]:
        mean, rms = judged(times, forces, row)
        assert row["torque_mean"] == pytest.approx(mean, rel=2e-3)
        assert row["torque_rms"] == pytest.approx(rms, rel=0.01, abs=0.05)
    history = results.history(0)
    expected = 1e-3 * np.interp(history["time"], *np.array(RISE).T)
    assert history["normal_force"].to_numpy() == pytest.approx(expected, rel=2e-3)
    assert history["pressure"].to_numpy() == pytest.approx(1e3 * expected)
    assert results.points["energy_balance"].abs().max() < 1e-4


LAWS = {
    "exponential_fall": {},
    "stribeck": {'"friction_law.viscous_rise"': 0.3},
    "table": {'"friction_law.speed_1"': 0.02, '"friction_law.ratio_1"': 1.5}
    | {'"friction_law.speed_2"': 0.3, '"friction_law.ratio_2"': 1.0},
}


def coefficient(law, s):
    falls = 0.5 * np.exp(-((s / 0.1) ** (2.0 if law == "stribeck" else 1.0)))
    if law == "table":
        ends = ([0.02, 0.3], [1.5, 1.0])
        curve = PchipInterpolator(*ends)
        slow = s <= 0.02
        share = np.clip((s - 0.02) / 0.28, 0.0, 1.0)
        level = 1.5 - 0.5 * share**2 * (3.0 - 2.0 * share)  # level at both ends
        assert curve(0.16) == pytest.approx(1.25)
        return 0.4 * np.where(slow, 1.5, level)
    return 0.4 * (1.0 + falls + (0.3 * s if law == "stribeck" else 0.0))


@pytest.mark.parametrize("law", LAWS)
def test_every_law_opposes_slip_both_ways(law, tmp_path):
    """A stiff, heavily damped block follows the curve at the belt's own speed, with its sign."""
    stiff = {"pad_stiffness": 7e9, "caliper_stiffness": 7e9, "damping_ratio": 0.9}
    values = stiff | LAWS[law] | ({} if law == "table" else {'"friction_law.decay_speed"': 0.1})
    if law != "table":
        values |= {'"friction_law.static_ratio"': 1.5}
    text = study(tmp_path, f"sliding_speed = {listed(THROUGH)}")
    given = "\n".join(f"{name} = {value}" for name, value in values.items())
    text = text.replace("[modes]", f"{given}\n[modes]")
    text = text.replace("[parameters]", f'friction_law = "{law}"\n[parameters]')
    (tmp_path / "groan.toml").write_text(_without_law(groan()) if law == "table" else groan())
    history = solved(text, tmp_path / "results").history(0)
    speed = np.interp(history["time"], *np.array(THROUGH).T)
    slides = np.abs(speed) > 2e-3
    expected = 1500.0 * np.sign(speed) * coefficient(law, np.abs(speed))
    assert history["torque"][slides].to_numpy() == pytest.approx(expected[slides], rel=2e-3)


def _without_law(text):
    return "\n".join(x for x in text.splitlines() if "friction_law" not in x)


@pytest.mark.parametrize("more", ["", 'method = "newmark_newton"'])
def test_a_schedule_that_stays_changes_no_bit(more, tmp_path):
    constant = "sliding_speed = { points = [[0.0, 1.0], [0.1, 1.0]], relative = true }"
    short = more + "\nduration = 0.05"
    runs = []
    for name, line in (("one", ""), ("two", constant)):
        text = study(tmp_path, f"{line}\n{short}").replace("duration = 0.4\n", "")
        text = text.replace("perturbation = 0.0", "perturbation = 0.05")
        runs.append(solved(text, tmp_path / name).history(0))
    pd.testing.assert_frame_equal(runs[0], runs[1].drop(columns="sliding_speed"))


def test_columns_of_one_speed_are_empty(stop):
    (row,) = stop.points.to_dict("records")
    assert row["class"] == "changing"
    assert row["growth_method"] == "changing"
    for name in ("torque_rms", "torque_mean", "growth_rate", "frequency_hz", "torque_line_hz"):
        assert np.isnan(row[name])
    assert pd.isna(row["settled"])
    assert row["stick_share_max"] == 1.0
    assert len(stop.modes) == 0
    assert set(stop.growth["fit_status"]) == {"changing"}
    assert stop.growth["fitted_growth_rate"].isna().all()
    with pytest.raises(ResultsError, match="its speed or pressure changes"):
        end_motion(stop, 0)


def test_windows_hold_the_whole_run_once(stop):
    table = stop.windows
    assert table["window"].tolist() == list(range(1, 11))
    assert table["time_start"].iloc[0] == 0.0
    assert table["time_stop"].iloc[-1] == pytest.approx(0.4)
    assert (table["time_start"].iloc[1:].to_numpy() == table["time_stop"].iloc[:-1]).all()
    history = stop.history(0)
    assert table["torque_mean"].mean() == pytest.approx(history["torque_mean"][1:].mean())
    known = table["torque_rms_high"].notna()
    assert known.all()
    assert (table["torque_rms_low"] <= table["torque_rms"]).all()
    assert (table["torque_rms"] <= table["torque_rms_high"]).all()
    assert table["class"].tolist()[0] == "quiet"
    assert table["class"].tolist()[3:5] == ["stick_slip"] * 2
    assert table["stick_share"].iloc[-1] == pytest.approx(1.0)


def test_step_bounds_hold_a_run_of_a_tenth_of_the_step(tmp_path):
    text = study(tmp_path, f"sliding_speed = {listed(STOP)}\nwindows = 5\nduration = 0.25")
    text = text.replace("duration = 0.4\n", "")
    coarse = solved(text.replace("step = 2e-6", "step = 4e-6"), tmp_path / "coarse").windows
    fine = solved(text.replace("step = 2e-6", "step = 4e-7"), tmp_path / "fine").windows
    for name in ("torque_mean", "torque_rms", "torque_peak_to_peak"):
        room = 1e-7 * coarse["torque_mean"]  # of what stays as it is
        assert (fine[name] >= coarse[f"{name}_low"] - room).all()
        assert (fine[name] <= coarse[f"{name}_high"] + room).all()


def test_the_screen_tells_of_windows(stop, capsys):
    assert command("rank", str(stop.directory)) == 0
    said = capsys.readouterr().out
    assert "No mode is ranked of 1 changing run" in said
    text = "\n".join(map(str, stop.screen.findings(stop)))
    assert "1 run, whose speed or pressure changes. From 0 ms on: " in text
    assert "Loudest from " in text
    rows = stop.windows.assign(torque_rms=10.0, torque_rms_low=0.0, torque_rms_high=20.0)
    rows.loc[0, "torque_rms"] = 0.0
    changed = stop.with_tables(windows=rows)
    head, *lines = as_text(windows(changed, "N")).splitlines()
    assert "RMS  +- %" in head
    assert "  10   100 " in lines[1]
    assert ": RMS 10 +- 10 N, " in stop.screen.verdict(changed)
    assert "No mode is ranked" not in text


def test_the_answer_tells_how_the_frequency_moves(stop):
    """Of each part of the run the first and the last frequency, and where none is known."""
    table = stop.windows.assign(
        frequency_hz=[446.0, 440.0, 404.0, np.nan, 60.0, 60.0, np.nan, np.nan, np.nan, np.nan],
        torque_line_hz=446.0,
        torque_rms=np.arange(10, 0, -1.0),
    )
    table["class"] = ["stick_slip"] * 4 + ["vibrates"] * 2 + ["stick_slip"] * 2 + ["quiet"] * 2
    told = stop.screen.verdict(stop.with_tables(windows=table))
    ends = [f"{1e3 * table['time_stop'].iloc[k]:.4g}" for k in (3, 5, 7, 9)]
    assert (
        f"stick slip to {ends[0]} ms (446 to 404 Hz, then without a period), vibrates to "
        f"{ends[1]} ms (60 Hz), stick slip to {ends[2]} ms (no period), quiet to {ends[3]} ms. "
    ) in told
    assert told.endswith(" N, at 446 Hz.")


def test_times_of_slow_runs_are_in_seconds(stop):
    """A machine that turns once a minute has no run of 16000 ms."""
    first = as_text(windows(stop, "N"))
    slow = as_text(windows(stop.with_tables(windows=stop.windows.assign(time_stop=16.0)), "N"))
    assert [first.split()[0], slow.split()[0]] == ["ms", "s"]
    assert "to 16 " in slow
    assert (moment(0.23), moment(16.0)) == ("230 ms", "16 s")


def test_shares_are_of_each_design_point_and_batches_alike(tmp_path):
    line = "sliding_speed = { points = [[0.0, 1.0], [0.1, 0.5]], relative = true }"
    text = study(tmp_path, f"{line}\nwindows = 2\nduration = 0.12")
    text = text.replace("duration = 0.4\n", "").replace(f"sliding_speed = {SPEED}\n", "")
    sweep = "[[sweep]]\nparameter = 'sliding_speed'\nvalues = [0.3, 0.2]\n[modes]"
    found = solved(text.replace("[modes]", sweep), tmp_path / "both")
    by_point = found.windows.groupby("point_id", sort=False)["sliding_speed_stop"]
    assert by_point.last().tolist() == pytest.approx([0.15, 0.1])
    alone = solved(text.replace("[modes]", sweep.replace("0.3, 0.2", "0.2")), tmp_path / "alone")
    both = found.windows[(found.windows["point_id"] == found.points["point_id"][1]).to_numpy()]
    for name in ("torque_mean", "torque_rms"):
        assert both[name].to_numpy() == pytest.approx(alone.windows[name].to_numpy(), rel=1e-9)


FILES = {
    "good.csv": "time,rpm,sliding_speed\n0,1,0.2\n1,-,0.1\n",
    "back.csv": "time, sliding_speed\n0, 0.2\n0.5, 0.1\n0.4, 0.0\n",
    "one.csv": "time, sliding_speed\n0, 0.2\n",
    "nan.csv": "time, sliding_speed\n0, 0.2\n1, nan\n",
    "word.csv": "time; sliding_speed\n0; 0.2\n1; slow\n",
    "names.csv": "t, v\n0, 0.2\n1, 0.1\n",
    "twice.csv": "time,sliding_speed,Sliding_Speed\n0,0.2,0.3\n1,0.1,0.2\n",
    "few.csv": "time,rpm,sliding_speed\n0,1,0.2\n1,0.1\n",
    "empty.csv": "",
}
REFUSED = [
    ('{ file = "back.csv" }', "back.csv, line 4: the time 0.4 s follows 0.5 s"),
    ('{ file = "one.csv" }', "expected two points or more, got 1"),
    ('{ file = "nan.csv" }', "nan.csv, line 3: expected finite numbers"),
    ('{ file = "word.csv" }', "word.csv, line 3: expected numbers, got '1, slow'"),
    ('{ file = "names.csv" }', "names.csv, line 1: there is no column 'time'"),
    ('{ file = "twice.csv" }', "twice.csv, line 1: there are two columns 'sliding_speed'"),
    ('{ file = "few.csv" }', "few.csv, line 3: expected 3 cells, got 2"),
    ('{ file = "empty.csv" }', "empty.csv is empty"),
    ('{ file = "none.csv" }', "there is no file"),
    ("{ points = [[0.0, 0.2]] }", "expected two points or more, got 1"),
    ("{ points = [[0.0, 0.2], [1.0, inf]] }", "expected a finite number, got inf"),
    ("{ points = [[0.0, 0.2], [0.0, 0.1]] }", "point 2: the time 0 s follows 0 s"),
    ("{ points = [[-1.0, 0.2], [1.0, 0.1]] }", "point 1: the time -1 s is before the run"),
    ("{ points = [0.0, 0.2] }", r"expected points \[\[time, value\]"),
    (
        "{ points = [[0.0, 0.1], [1.0, 0.0]] }",
        "this begins with 0.1 m/s: expected the same, or relative = true",
    ),
    ("{ points = [[0.0, 0.5], [1.0, 0.0]], relative = true }", "expected 1 as the first share"),
    ("{}", "expected points = .* or file"),
    ('{ file = "good.csv", points = [[0.0, 0.2], [1.0, 0.1]] }', "expected points = .* or file"),
    ('{ fil = "good.csv" }', "unknown key; did you mean 'file'"),
    ('"good.csv"', "expected a table of keys, got 'good.csv'"),
    ("0.3", "expected a table of keys, got 0.3"),
]


def refused(text, path):
    plan_of(text, path).kind.settings(plan := plan_of(text, path))
    return len(plan.tasks)


@pytest.mark.parametrize(("table", "said"), REFUSED)
def test_a_curve_that_is_none_is_refused_in_a_sentence(table, said, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(StudyFileError, match=said) as caught:
        refused(study(tmp_path, f"sliding_speed = {table}"), tmp_path / "study.toml")
    assert "sliding_speed" in caught.value.key


@pytest.mark.parametrize(
    ("more", "key", "said"),
    [
        ('stop = "settled"', "transient", 'nothing settles, expected stop = "end"'),
        ('representation = "hybrid"', "transient", 'is for representation = "modal"'),
        ('slope_pilot = "always"', "transient", "slope_pilot compares levels that settle"),
        ("windows = 0", "transient.windows", "expected at least 1, got 0"),
        ("pressure = { points = [[0.0, 1.0], [1.0, 2.0]] }", "transient.pressure", "no pressure"),
        ("[fidelity]\ntolerance = 0.1", "fidelity", "needs levels that settle"),
    ],
)
def test_what_needs_one_speed_is_refused(more, key, said, tmp_path):
    text = study(tmp_path, f"sliding_speed = {listed(STOP)}\n{more}")
    with pytest.raises(StudyFileError, match=said) as caught:
        refused(text, tmp_path / "study.toml")
    assert caught.value.key == key


def test_windows_need_a_change(tmp_path):
    with pytest.raises(StudyFileError, match="windows are of a run whose sliding_speed"):
        plan_of(study(tmp_path, "windows = 4"), tmp_path / "study.toml")


def test_pressures_below_zero_and_jumps_of_them_are_refused(tmp_path):
    for points, said in (
        ([(0.0, 1.5e6), (1.0, -1.0)], "point 2: the pressure -1 is below zero"),
        ([(0.0, 1e6), (1.0, 2e6)], "this begins with 1e\\+06 Pa: expected the same"),
    ):
        text = study(tmp_path, f"pressure = {listed(points)}", pressed=True)
        with pytest.raises(StudyFileError, match=said):
            refused(text, tmp_path / "study.toml")


def test_a_file_beside_the_study_gives_the_points(tmp_path):
    (tmp_path / "good.csv").write_text(FILES["good.csv"])
    text = study(tmp_path, 'sliding_speed = { file = "good.csv" }')
    plan = plan_of(text, tmp_path / "study.toml")
    assert dict(plan.kind.settings(plan))["over time"] == "sliding_speed 0.2, 0.1 m/s until 1 s"
    first = plan.tasks.ids.tolist()
    (tmp_path / "good.csv").write_text(FILES["good.csv"].replace("0.1", "0.11"))
    assert plan_of(text, tmp_path / "study.toml").tasks.ids.tolist() != first


def test_a_schedule_needs_times_that_rise_and_a_load():
    one = np.ones(2)
    with pytest.raises(ModelError, match="times that rise"):
        Schedule(np.array([1.0, 1.0]), one, one)
    with pytest.raises(ModelError, match="load of the brake pressure"):
        Schedule(np.array([0.0, 1.0]), one, 2 * one)
    with pytest.raises(ModelError, match="two or more"):
        Schedule(np.zeros(1), np.ones(1), np.ones(1))


def test_integrators_outside_the_kernel_refuse_it():
    system, point = smallest_system()
    changing = Schedule(np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.ones(2))
    settings = MotionSettings(1e-5, 1e-6, integrator=CentralDifference())
    with pytest.raises(ParameterError, match="runs at one speed and pressure alone"):
        simulate(system, [replace(point, schedule=changing)], settings)


def test_springs_in_vibration_only_leave_no_load_of_the_pressure(least_brake):
    """A change of the pressure would press against them: such models refuse one over time."""
    assert len(reduce_brake(least_brake)[0].load) == 0
    springs = tuple(replace(s, in_static=True) for s in least_brake.assembly.springs)
    assembly = replace(least_brake.assembly, springs=springs)
    assert np.abs(reduce_brake(replace(least_brake, assembly=assembly))[0].load).max() > 0
