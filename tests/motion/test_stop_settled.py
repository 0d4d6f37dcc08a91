"""Runs that stop once their outcome is known: pauses that change nothing, and who may stop."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motions import changed, growing, made_up, started
from study_runs import command, plan_of
from study_texts import study_text

from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.kernels.newmark_layout import HISTORY, TORQUE_MEAN
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.growing_modes import GrowingModes
from squealstudy.motion.integrators.newmark import Newmark, NewmarkNewton
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.energies import moving_energy
from squealstudy.motion.outcome.periods import judged_rows
from squealstudy.motion.outcome.settling import known_outcome, level_drift, longer_window
from squealstudy.motion.outcome.summary import run_levels, summarise
from squealstudy.motion.outcome.torque import levels_of
from squealstudy.motion.outcome.verdict import expected_rise, run_verdict
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

SHORT = MotionSettings(duration=1.2e-3, step=2e-6, save_every=5)
N = 10


@pytest.fixture(scope="module")
def lively() -> tuple[ModalSystem, list[MotionPoint]]:
    """Ten modes over twelve points that stick, slip and open; designs need unlike iterations."""
    rng = np.random.default_rng(3)
    one = np.ones(12)
    system = ModalSystem(
        omega2=(2 * np.pi * np.linspace(1e3, 8e3, N)) ** 2,
        N=rng.normal(size=(12, N)),
        T1=rng.normal(size=(12, N)),
        T2=rng.normal(size=(12, N)),
        area=1e-4 * one,
        frictional=one,
        radius=0.1 * one,
        gap=0 * one,
        k_ref=50.0 * one,
        force=np.column_stack([10.0 * one, -4.0 * one, 0 * one]),
        sensed=np.arange(3) + 1,
    )
    law = contact_law("exponential", p0=1e5, lam=5e5)
    speeds = (0.05, 0.1, 0.2, 0.4, 0.8)
    designs = [
        MotionPoint(law, FrictionLaw(mu, 1e7), speed, np.full(N, 20.0))
        for mu, speed in zip(np.linspace(0.2, 0.6, 5), speeds, strict=True)
    ]
    kick = 0.02 * rng.normal(size=N)
    return system, started(designs, 0 * kick, kick)


def never(k: int, run: Motion) -> str:
    return ""


def same(a: Motion, b: Motion, rows: int | None = None) -> bool:
    """Histories bit by bit, of `a` its first `rows`."""
    pairs = [(a.history[name], b.history[name]) for name in b.history]
    pairs += [(a.displacement, b.displacement), (a.velocity, b.velocity)]
    return all(np.array_equal(x[:rows], y) for x, y in pairs)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_pauses_change_nothing(lively, count):
    """Also where designs of a batch are at different times when one of them pauses."""
    system, designs = lively
    times: list[tuple[int, float]] = []

    def judge(k: int, run: Motion) -> str:
        times.append((k, run.time))
        return ""

    whole = simulate(system, designs[:count], SHORT)
    watch = Watch([37, 50, 64, 85, 1000][:count], judge)
    looked_at = simulate(system, designs[:count], SHORT, watch)
    assert len({r.mean_iterations for r in whole}) == count
    for a, b in zip(whole, looked_at, strict=True):
        assert b.outcome == "ok"
        assert b.stop_reason == "end"
        assert same(a, b)
        assert np.array_equal(a.q, b.q)
        assert np.array_equal(a.v, b.v)
        assert a.energy == b.energy
        assert (a.mean_iterations, a.max_iterations) == (b.mean_iterations, b.max_iterations)
    first = [t for k, t in times if k == 0]
    np.testing.assert_allclose(first, 2e-6 * np.arange(40, 600, 40))  # 37 steps are 8 rows


@pytest.mark.parametrize("method", [NewmarkNewton(), Newmark(contact_factor=4.0)])
def test_pauses_change_nothing_of_factored_jacobians(lively, method):
    system, designs = lively
    settings = replace(SHORT, duration=2e-4, integrator=method)
    whole = simulate(system, designs[:2], settings)
    looked_at = simulate(system, designs[:2], settings, Watch([10, 25], never))
    for a, b in zip(whole, looked_at, strict=True):
        assert a.outcome == "ok"
        assert same(a, b)
        assert np.array_equal(a.v, b.v)
        assert a.newton_steps == b.newton_steps


@pytest.mark.parametrize("count", [1, 2])
def test_a_stopped_run_is_the_shorter_run(lively, count):
    system, designs = lively
    watch = Watch([100] * count, lambda k, run: "known" if run.time > 3.9e-4 else "")
    stopped = simulate(system, designs[:count], SHORT, watch)
    for design, a in zip(designs, stopped, strict=False):
        (b,) = simulate(system, [design], replace(SHORT, duration=4e-4))
        assert a.stop_reason == "known"
        assert a.time == pytest.approx(4e-4, rel=1e-12)
        assert same(a, b) or count > 1
        np.testing.assert_allclose(a.q, b.q, rtol=1e-6, atol=1e-12)
        assert a.energy.stored_end == pytest.approx(b.energy.stored_end, rel=1e-6)
        assert a.energy.residual == pytest.approx(b.energy.residual, rel=1e-3, abs=1e-12)


def test_designs_of_a_batch_stop_one_by_one(lively):
    system, designs = lively
    whole = simulate(system, designs, SHORT)
    watch = Watch([100] * 5, lambda k, run: "known" if run.time > 1.9e-4 * (k + 1) else "")
    stopped = simulate(system, designs, SHORT, watch)
    for k, (a, b) in enumerate(zip(whole, stopped, strict=True)):
        assert b.time == pytest.approx(2e-4 * (k + 1), rel=1e-9)
        assert len(b.history["time"]) == 20 * (k + 1) + 1
        scale = np.abs(a.velocity).max()
        np.testing.assert_allclose(b.velocity, a.velocity[: len(b.velocity)], atol=1e-6 * scale)


def test_a_failed_design_does_not_stop_the_others(lively):
    """Its law is too stiff for the step; round-off decides when, and between which pauses."""
    system, designs = lively
    law = contact_law("exponential", p0=1e5, lam=1e9)
    bad = replace(designs[1], contact=law)
    looked_at: dict[int, float] = {}

    def judge(k: int, run: Motion) -> str:
        looked_at[k] = run.time
        return "known" if k == 0 else ""

    runs = simulate(system, [designs[0], bad, designs[2]], SHORT, Watch([100] * 3, judge))
    assert [r.stop_reason for r in runs] == ["known", "failed", "end"]
    assert runs[1].outcome != "ok"
    assert runs[1].message
    assert 0 < runs[1].time < SHORT.duration
    assert looked_at.pop(1, 0.0) <= runs[1].time  # failed, it is looked at no more
    assert looked_at[0] == pytest.approx(2e-4)
    assert looked_at[2] == pytest.approx(1e-3)
    assert runs[2].time == pytest.approx(SHORT.duration)


def test_a_design_has_sensors_of_its_own(lively):
    """They come after those of the system, and no other design of the batch has them."""
    system, designs = lively
    own = np.arange(2.0 * N).reshape(2, N)
    watching = GrowingModes(sensors=own)
    some = [replace(designs[0], growing=watching), designs[1]]
    runs = simulate(system, some, replace(SHORT, save_q=True))
    assert [r.displacement.shape[1] for r in runs] == [5, 3]
    sensed = np.eye(N)[:3]
    for run, seen in zip(runs, (np.vstack([sensed, own]), sensed), strict=True):
        np.testing.assert_allclose(run.displacement, run.q_history @ seen.T, atol=1e-15)
        np.testing.assert_allclose(run.velocity[-1], seen @ run.v, atol=1e-12)
    few = replace(watching, sensors=own[:, 1:])
    with pytest.raises(ModelError, match="'sensors' needs rows of 10 finite values"):
        simulate(system, [replace(designs[0], growing=few)], SHORT)


def test_watches_that_cannot_look(lively):
    system, designs = lively
    with pytest.raises(ParameterError, match="saved rows"):
        simulate(system, designs[:1], replace(SHORT, save_every=0), Watch([5], never))
    for steps in ([0], [5, 5]):
        with pytest.raises(ParameterError, match="positive number of steps"):
            simulate(system, designs[:1], SHORT, Watch(steps, never))


# -- what counts as known ------------------------------------------------------------------------
DURATION, LINE, OTHER = 0.2, 3000.0, 5000.0  # s, Hz, Hz
TOLERANCE = 0.01


def saturating(time, rate, start=1e-3):
    return 1 / np.sqrt(1 + (1 / start**2 - 1) * np.exp(-2 * rate * time))


def recorded(until, rates, *sizes, forced=0.02, heard=(20.0, 20.0), drag=0.0, more=None) -> Motion:
    """A run as far as `until`: modes of predicted `rates`, their amplitudes functions of time.

    The first one's second harmonic is seen by the others too. `heard` is what each does to the
    torque, whose mean changes by `drag` a second and to which `more`, a function of time, is added.
    """
    time = np.arange(0.0, until, 2e-5)
    omega = 2 * np.pi * np.array([LINE, OTHER])[: len(sizes)]
    a = np.array([size(time) for size in sizes])
    xi = a * np.exp(1j * np.outer(omega, time))
    xi[1:] += forced * a[0] * np.exp(2j * omega[0] * time)
    v, q = (a * np.cos(np.outer(omega, time))).T, (a * np.sin(np.outer(omega, time))).T / omega
    energy = 0.5 * (a**2).sum(axis=0)
    torque = 300 + drag * time + v @ heard[: len(sizes)] + 4 * a[0] * np.cos(2 * omega[0] * time)
    torque = torque if more is None else torque + more(time)
    known = {"time": time, "torque": torque, "modal_energy": energy}
    history = {name: known.get(name, 0 * time) for name in HISTORY}
    history |= dict.fromkeys(HISTORY[TORQUE_MEAN:], np.full(len(time), np.nan))  # not summed
    lam = np.array(rates) + 1j * omega
    m = len(lam)
    known = {"energy": np.full(m, 0.5), "overlap": np.eye(2 * m)}
    modes = growing(lam, np.zeros((2, m), dtype=complex), sum(r > 0 for r in rates), **known)
    seen = np.zeros((len(time), 8 * m))
    seen[:, : 4 * m : 4], seen[:, 1 : 4 * m : 4] = xi.real.T, xi.imag.T
    seen[:, 4 * m :: 4], seen[:, 4 * m + 1 :: 4] = v, omega * q
    return replace(made_up(history, q, v, omega, modes, (0 * seen, seen)), time=until)


def fast(time):
    return saturating(time, 250.0)


def steady(time):
    return np.full_like(time, 0.02)


def test_a_limit_cycle_is_known_once_the_last_window_is_clear_of_its_growth():
    """Settled from 40 ms on, which the last 40 % of the record see from 65 ms on."""
    found = [known_outcome(recorded(t, [250.0], fast), DURATION, TOLERANCE) for t in
             (0.01, 0.03, 0.04, 0.05, 0.08, 0.1)]  # fmt: skip
    assert found == ["", "", "", "", "settled", "settled"]


@pytest.mark.parametrize(("rate", "outcome"), [(0.0, "settled"), (5.0, ""), (40.0, "")])
def test_a_second_instability_that_rises_keeps_the_run_going(rate, outcome):
    """At 0.02 of the first it has 4e-4 of the energy: the torque does not show it yet.

    However late it matters: a run that ended now would be undecided.
    """

    def slow(time):
        return 0.02 * np.exp(rate * (time - 0.1))

    run = recorded(0.1, [250.0, 60.0], fast, slow)
    levels, window = run_levels(run)
    assert levels["torque_rms"] == pytest.approx(20 / np.sqrt(2) * np.sqrt(1.04), rel=2e-3)
    assert known_outcome(run, DURATION, TOLERANCE) == outcome
    rise = expected_rise(run, window, DURATION)
    middle = 0.02**2 * np.exp(-2 * rate * 0.005)  # of the last of four stretches
    assert rise == pytest.approx(middle * np.expm1(2 * rate * 0.1), rel=0.05, abs=1e-6)
    assert known_outcome(run, 0.11, TOLERANCE) == outcome


@pytest.mark.parametrize("predicted", [60.0, -60.0])
@pytest.mark.parametrize("rate", [-5.0, 0.0, 5.0, 40.0])
def test_a_limit_cycle_behind_which_a_mode_rises_is_undecided(rate, predicted):
    """Its level may change once that has come up, which `undecided_until` foresees.

    A mode that is stable at steady sliding may rise too: limit cycles shed into pairs of modes
    whose frequencies add up to their own.
    """

    def slow(time):
        return 0.02 * np.exp(rate * (time - 0.1))

    run = recorded(0.1, [250.0, predicted], fast, slow)
    found = run_verdict(run, moving_energy(run))
    if rate <= 0:
        assert found.name == "limit_cycle"
        return
    assert found.name == "undecided"
    assert 0.6 * found.until == pytest.approx(0.1 + np.log(50) / rate, rel=0.1)


def test_forced_motion_that_follows_a_cycle_to_its_level_does_not_rise_behind_it():
    """The second mode is moved by the first, at a line near its own, and bends with it."""

    def late(time):
        return 0.02 * saturating(time, 40.0, 0.1)

    run = recorded(0.1, [250.0, 60.0], fast, late)
    assert run_verdict(run, moving_energy(run)).name == "limit_cycle"


def test_forced_motion_at_other_lines_is_no_growth_of_a_mode():
    """The second mode's own line is steady; harmonics of the first still rise a little."""

    def late(time):
        return saturating(time, 100.0)

    run = recorded(0.1, [250.0, 60.0], fast, steady, forced=0.5)
    assert known_outcome(run, DURATION, TOLERANCE) == "settled"
    assert known_outcome(recorded(0.1, [100.0], late), DURATION, TOLERANCE) == ""


def test_levels_that_drift_are_not_known():
    def drifting(time):
        return fast(time) * (1 + 0.4 * (time - 0.1))  # 1.1 % between thirds of 13 ms at 0.1 s

    run = recorded(0.1, [250.0], drifting)
    assert known_outcome(run, DURATION, TOLERANCE) == ""
    assert known_outcome(run, DURATION, 0.05) == "settled"
    sagging = recorded(0.1, [250.0], fast, drag=-120.0)
    levels, _ = run_levels(sagging)
    assert (
        levels["torque_rms_high"] - levels["torque_rms_low"] < 2 * TOLERANCE * levels["torque_rms"]
    )
    assert known_outcome(sagging, DURATION, TOLERANCE) == ""


def test_levels_that_beat_are_known_within_their_bounds_only():
    """Thirds of the last 40 ms agree, each has one beat; the sub-windows of the RMS do not."""

    def beating(time):
        return fast(time) * (1 + 0.06 * np.cos(2 * np.pi * time * 3 / 0.04))

    run = recorded(0.1, [250.0], beating)
    window = run_levels(run)[1]
    assert level_drift(run.history["torque"][window]) < TOLERANCE
    assert known_outcome(run, DURATION, TOLERANCE) == ""
    assert known_outcome(run, DURATION, 0.1) == "settled"


def test_a_mode_that_dies_away_unheard_must_be_gone():
    def dying(time):
        return 3 * np.exp(-20 * time)

    run = recorded(0.1, [250.0, 1.0], fast, dying, heard=(20.0, 0.0))
    assert known_outcome(run, DURATION, TOLERANCE) == ""
    quiet = recorded(0.1, [250.0, 1.0], fast, lambda t: 0.01 * dying(t), heard=(20.0, 0.0))
    assert known_outcome(quiet, DURATION, TOLERANCE) == "settled"


def test_drift_does_not_see_where_windows_cut_periods():
    t = np.arange(3000) / 3000
    assert level_drift(50 + np.cos(2 * np.pi * 31.4 * t)) < 2e-3
    assert level_drift(50 + (1 + 0.1 * t) * np.cos(2 * np.pi * 31.4 * t)) == pytest.approx(
        0.1 * 2 / 3 / 1.05, rel=0.05
    )


@pytest.mark.parametrize(
    "more",
    [
        lambda t: 10 * np.exp(-t / 5e-3) * np.cos(2 * np.pi * 700 * t),  # its RMS and peaks
        lambda t: 100 * np.exp(-t / 5e-3),  # its mean
        lambda t: np.where((t > 0.019) & (t < 0.0201), 60.0 * np.sin(2e4 * t), 0.0),  # its peaks
    ],
)
def test_the_settled_time_is_that_of_the_torque_too(more):
    """The vibration continues a limit cycle; the torque has a transient of its own, of 20 ms."""
    run = recorded(0.1, [250.0], np.ones_like, more=more)
    run = changed(run, continued=True)
    told = summarise(run).point
    assert (told["class"], told["settled"]) == ("limit_cycle", True)
    assert 0.01 < told["settled_time"] < 0.04
    rest = run.history["torque"][run.times >= told["settled_time"]]
    assert rest.mean() == pytest.approx(told["torque_mean"], rel=0.01)
    assert rest.std() == pytest.approx(told["torque_rms"], rel=0.05)
    assert np.ptp(rest) == pytest.approx(told["torque_peak_to_peak"], rel=0.1)
    calm = summarise(changed(recorded(0.1, [250.0], np.ones_like), continued=True)).point
    assert (calm["settled"], calm["settled_time"]) == (True, 0.0)


def test_growth_is_known_of_runs_whose_work_of_friction_is_not():
    """Adaptive solvers keep no energy balance; their runs move all the same."""
    run = recorded(0.1, [250.0], lambda t: np.exp(60.0 * t))
    known = summarise(run).point
    works = dict.fromkeys(("work_load", "work_belt", "friction", "damping"), np.nan)
    unknown = summarise(replace(run, energy=replace(run.energy, **works))).point
    assert known["growth_rate"] == pytest.approx(60.0, rel=0.02)
    assert unknown["growth_rate"] == known["growth_rate"]


def test_a_torque_that_still_falls_has_not_settled():
    run = recorded(0.1, [250.0], np.ones_like, more=lambda t: 60 * np.sin(9e3 * t) * np.exp(-9 * t))
    told = summarise(changed(run, continued=True)).point
    assert (told["class"], told["undecided_until"]) == ("undecided", pytest.approx(0.2, rel=1e-3))
    assert not told["settled"]
    assert np.isnan(told["settled_time"])


@pytest.mark.parametrize("rows", [1, 2, 9, 10, 14])
def test_a_run_of_few_rows_is_undecided(rows):
    """It has not failed: it ended where it was asked to, before anything can be told."""
    until = (rows - 0.5) * 2e-5
    run = recorded(until, [250.0], np.ones_like)
    told = summarise(run).point
    assert told["class"] == "undecided"
    period = 2 * np.pi / abs(run.point.growing.lam[0])
    assert told["undecided_until"] == pytest.approx(20 * period)
    failed = recorded(until, [250.0], np.ones_like)
    failed = replace(failed, outcome="not_converged")
    assert summarise(failed).point["class"] == "failed"
    assert not np.isfinite(summarise(failed).point.get("undecided_until", np.nan))


def decaying(rate):
    return lambda time: 1e-3 * np.exp(rate * time)


@pytest.mark.parametrize(
    ("until", "actual", "predicted", "outcome"),
    [
        (0.05, -20.0, -20.0, "decayed"),  # 0.14 of the first energy
        (0.02, -20.0, -20.0, ""),  # 0.45
        (0.05, -20.0, -25.0, ""),  # not as predicted
        (0.05, -160.0, -20.0, "decayed"),  # 1e-7 of the energy: gone
        (0.05, -160.0, 20.0, ""),  # what grows is not there yet
    ],
)
def test_decay(until, actual, predicted, outcome):
    run = recorded(until, [predicted], decaying(actual))
    assert known_outcome(run, DURATION, TOLERANCE) == outcome


def test_what_is_not_followed_may_still_come():
    run = recorded(0.1, [250.0], fast)
    for changes in ({"n_above": 1}, {"n_unstable": 7}):
        modes = replace(run.point.growing, **changes)
        assert known_outcome(changed(run, growing=modes), DURATION, TOLERANCE) == ""


def test_a_decay_beside_what_nobody_follows_is_not_known_to_be_one():
    """A mode above the band may come up after the motion that is seen has gone."""
    run = recorded(0.1, [-100.0], decaying(-100.0))
    assert run_verdict(run, moving_energy(run)).name == "stable"
    for changes in ({"n_above": 1}, {"n_unstable": 7}):
        beside = changed(run, growing=replace(run.point.growing, **changes))
        found = run_verdict(beside, moving_energy(beside))
        assert (found.name, found.until) == ("undecided", np.inf)


# -- studies -------------------------------------------------------------------------------------
BELT = (
    study_text("belt", "transient", "belt")
    + """\
[parameters]
"contact.regularisation_speed" = 0.01
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 1.1, 1.3]
[[sweep]]
parameter = "contact.kt"
values = [0, 1e3]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 1.0
step = 5e-5
perturbation = 1e-5
save_every = 20
"""
)
EARLY = 'stop = "settled"\nsettle_tolerance = 0.05\n'


def test_a_study_ends_runs_early_and_says_so(tmp_path):
    """Stick-slip settles, 1.1 m/s grows on, 1.3 m/s decays, too soft a friction has no start."""
    points, facts = {}, {}
    for name, more in (("end", ""), ("settled", EARLY)):
        report = run_study(plan_of(BELT + more), tmp_path / name, jobs=1)
        points[name] = Results.open(report.directory).points.set_index("sliding_speed")
        facts[name] = report.manifest.get("simulated_time")
    assert facts["end"] is None
    early = points["settled"]
    soft = early["contact.kt"] > 0
    assert (early.loc[soft, "stop_reason"] == "failed").all()
    early, whole = early[~soft], points["end"][~soft]
    assert early["stop_reason"].to_dict() == {0.5: "settled", 1.1: "end", 1.3: "decayed"}
    assert (whole["stop_reason"] == "end").all()
    assert early["class"].equals(whole["class"])
    assert early["time_reached"][0.5] < 0.7
    assert early["time_reached"][1.1] == pytest.approx(1.0)
    assert early["time_reached"][1.3] < 0.3
    names = ["torque_rms", "torque_mean", "torque_line_hz", "growth_rate"]
    for name, bound in zip(names, (0.05, 0.01, 0.01, 1e-3), strict=True):
        assert early[name][0.5] == pytest.approx(whole[name][0.5], rel=bound)
    saved = float((1.0 - early["time_reached"]).sum())
    expected = {"settled": 1, "decayed": 1, "asked_s": 3.0, "saved_s": pytest.approx(saved)}
    assert facts["settled"] == expected
    history = Results.open(tmp_path / "settled").history(early["point_id"][1.3])
    assert history["time"].iloc[-1] == pytest.approx(early["time_reached"][1.3])
    assert list((tmp_path / "settled" / "states").glob(f"{early['point_id'][0.5]}*"))


def test_points_that_may_end_early_are_other_points():
    ids = [{t.point_id for t in plan_of(BELT + more).tasks} for more in
           ("", EARLY, 'stop = "settled"\n', 'stop = "end"\n')]  # fmt: skip
    assert len(ids[0] | ids[1] | ids[2]) == 3 * len(ids[0])
    assert ids[3] == ids[0]


def test_screens(tmp_path, monkeypatch, capsys):
    """`check` says that runs may end early; `run` says what was saved."""
    text = BELT.replace("[0.5, 1.1, 1.3]", "[1.3]").replace("values = [0, 1e3]", "values = [0]")
    monkeypatch.chdir(tmp_path)
    for name, more in (("end", ""), ("settled", EARLY)):
        Path(f"{name}.toml").write_text(text + more)
        printed = {}
        for verb, options in (("check", ()), ("run", ("--no-pictures", "--verbose"))):
            study = (f"{name}.toml", "--jobs", "1", "--output", name)
            assert command(verb, *study, *options) == 0
            printed[verb] = " ".join(capsys.readouterr().out.split())
        assert ("end once their outcome is known" in printed["check"]) == (name == "settled")
        assert ("0 runs had settled, 1 had decayed" in printed["run"]) == (name == "settled")
    saved = json.loads(Path("settled/manifest.json").read_text())["simulated_time"]["saved_s"]
    assert f"{saved:.3g} of 1 s not simulated" in printed["run"]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('stop = "setled"', "did you mean 'settled'"),
        ("settle_tolerance = 0.02", 'settle_tolerance needs stop = "settled"'),
        ('stop = "settled"\nsettle_tolerance = 0.0', "settle_tolerance"),
        ('stop = "settled"\nsettle_tolerance = 0.5', "settle_tolerance"),
        ('stop = "settled"\nrepresentation = "hybrid"', "is for the modal representation"),
    ],
)
def test_bad_values(more, message):
    with pytest.raises(StudyFileError, match=message) as caught:
        plan_of(BELT + more)
    assert str(caught.value).startswith("study.toml, line ")
    assert "\n" not in str(caught.value)


def irregular(quiet_from: float) -> Motion:
    """A run of 1 s whose amplitude varies at random, from `quiet_from` s on by a fifth of that."""
    rng = np.random.default_rng(1)
    noise = 0.3 * np.interp(np.arange(0, 1, 2e-5), np.linspace(0, 1, 1001), rng.normal(size=1001))

    def size(time):
        return 1.0 + np.where(time < quiet_from, noise, 0.2 * noise)[: len(time)]

    return recorded(1.0, [250.0], size)


@pytest.mark.parametrize("quiet_from", [0.6, 2.0])
def test_an_irregular_run_that_stopped_has_bounds_that_its_stop_has_not_chosen(quiet_from):
    """It stops when bounds are narrow, which they may be by chance: a longer window tells."""
    run = irregular(quiet_from)
    whole, stopped = (run_levels(replace(run, stopped=why))[0] for why in ("", "settled"))
    widths = [r["torque_rms_high"] - r["torque_rms_low"] for r in (whole, stopped)]
    assert stopped["torque_rms"] == whole["torque_rms"]
    if quiet_from < 1.0:
        assert widths[1] > 1.5 * widths[0]
        longer = levels_of(run, longer_window(run, judged_rows(run)))  # twice as long
        assert widths[1] == pytest.approx(np.sqrt(2.0) * (longer.rms_high - longer.rms_low), 1e-3)
    else:
        assert widths[0] <= widths[1] < 1.5 * widths[0]


def test_a_limit_cycle_that_stopped_keeps_its_bounds():
    run = recorded(0.1, [250.0], fast)
    whole, stopped = (run_levels(replace(run, stopped=why))[0] for why in ("", "settled"))
    assert whole == pytest.approx(stopped, nan_ok=True)
