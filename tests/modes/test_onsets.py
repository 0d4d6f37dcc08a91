"""Onsets: crossings on a grid, root finding on a followed mode, the table of a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import MU_C, W1, W2, hulten_stiffness, oscillating_modes
from study_runs import plan_of, solved
from study_texts import study_text, sweep_text

import squealstudy
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers
from squealstudy.errors import ConvergenceError, ResultsError
from squealstudy.kinds.complex_modes.measuring import first_onset
from squealstudy.kinds.complex_modes.neighbourhood import StudyNeighbourhoods
from squealstudy.modes.tracking.lockstep import ManyModes, refine_onsets_together
from squealstudy.modes.tracking.onsets import (
    FollowedMode,
    SolvedLine,
    cubic_onsets,
    exchanged,
    refine_onset,
)
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.plots.boundary_lines import stability_boundary
from squealstudy.plots.plane import study_plane
from squealstudy.tables.stability import line_crossings

HZ = 2 * np.pi
STUDY = (
    study_text("onset", "complex_modes", "{model}")
    + sweep_text("friction", "{start}", "{stop}", "{num}")
    + """\
[modes]
band = [1.0, 5000.0]
reference_points = 0
"""
)


def study(model: str = "hulten", stop: float = 0.6, num: int = 4, start: float = 0.0) -> str:
    return STUDY.format(model=model, start=start, stop=stop, num=num)


def run(text: str, directory: Path, jobs: int = 1) -> squealstudy.Results:
    return solved(text, directory, jobs=jobs)


def hulten(mu: float, zeta: tuple[float, float] = (0.0, 0.0)) -> Modes:
    C = np.diag([2 * zeta[0] * W1, 2 * zeta[1] * W2])
    return Modes(*oscillating_modes(C, hulten_stiffness(mu)))


def damped_threshold(c1: float, c2: float) -> float:
    """Friction at which two degrees of freedom with dampers c turn unstable (Routh-Hurwitz).

    s^4 + a s^3 + b s^2 + c s + d with a = c1 + c2, c = c1 w2^2 + c2 w1^2 and
    d = w1^2 w2^2 (1 + mu^2): unstable where a b c < c^2 + a^2 d.
    """
    a, c = c1 + c2, c1 * W2**2 + c2 * W1**2
    b = W1**2 + W2**2 + c1 * c2
    return float(np.sqrt((a * b * c - c**2) / (a**2 * W1**2 * W2**2) - 1.0))


# -- crossings


def crossings(x, zeta, track=None, line=None, start=None):
    x, zeta = np.asarray(x, float), np.asarray(zeta, float)
    track = np.ones(len(x), int) if track is None else np.asarray(track)
    line = np.zeros(len(x), int) if line is None else np.asarray(line)
    start = np.full(len(x), x.min()) if start is None else start
    return line_crossings(track, line, x, start, zeta, zeta < 0)


@given(st.floats(0.01, 0.99), st.booleans(), st.randoms())
def test_linear_damping_crosses_where_it_is_zero(zero, falling, random):
    x = sorted([0.0, 1.0, *(random.random() for _ in range(5))])
    zeta = [(zero - v) if falling else (v - zero) for v in x]
    found = crossings(x, zeta)
    crossing = found[found["kind"] == "crossing"]
    assert crossing["value"].to_numpy() == pytest.approx([zero], abs=1e-12)
    assert list(crossing["direction"]) == ["in" if falling else "out"]
    assert (found["kind"] == "below range").sum() == (not falling)


def test_every_change_along_a_line_is_listed_with_both_ends():
    found = crossings([3, 1, 0, 2, 4], [-0.1, -0.1, 0.1, 0.3, 0.1]).sort_values("value")
    assert list(found["direction"]) == ["in", "out", "in", "out"]
    assert found["value"].to_numpy() == pytest.approx([0.5, 1.25, 2.75, 3.5])
    assert list(zip(found["before"], found["after"], strict=True)) == [
        (2, 1), (1, 3), (3, 0), (0, 4),
    ]  # fmt: skip


def test_tracks_and_lines_are_kept_apart():
    found = crossings(
        [0, 1, 0, 1, 1], [0.1, -0.1, -0.1, 0.3, -0.2], [1, 1, 1, 1, 2], [0, 0, 1, 1, 1]
    )
    kinds = {(t, n): k for t, n, k in found[["track", "line", "kind"]].to_numpy() if k}
    assert kinds[2, 1] == "first seen"
    assert list(found["kind"]) == ["crossing", "below range", "crossing", "first seen"]


def test_without_damping_before_the_onset_is_only_bracketed():
    """Zero up to a coalescence: linear interpolation would put it at the last stable point."""
    found = crossings([0, 1, 2, 3, 4], [0.0, 1e-17, -0.1, -0.2, 0.0]).sort_values("value")
    assert list(found["kind"]) == ["bracketed", "bracketed"]
    assert list(found["value"]) == [2, 3]  # the unstable ends
    assert list(found["direction"]) == ["in", "out"]
    (row,) = crossings([0, 1, 2], [0.1, 0.0, -0.1]).to_dict("records")  # it falls through zero
    assert (row["kind"], row["value"]) == ("crossing", 1)


# -- root finding


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.6), (0.25, 0.3), (0.29, 0.2917)])
def test_the_undamped_lock_in_of_hulten(low, high):
    """The growth rate rises with the square root of the distance to the lock-in."""
    samples = SolvedLine(low, hulten(low), high, hulten(high), hulten)
    unstable = int(np.argmax(samples.at(high).lam.real))
    onset = refine_onset(samples, 0, unstable, 1e-7, 0.5e-4)
    assert onset.value == pytest.approx(MU_C, abs=1e-4)
    assert onset.frequency_hz == pytest.approx(np.sqrt((W1**2 + W2**2) / 2) / HZ, rel=5e-3)


@pytest.mark.parametrize("zeta", [(0.01, 0.01), (0.002, 0.03), (0.05, 0.01)])
def test_damped_onsets_are_those_of_routh_and_hurwitz(zeta):
    expected = damped_threshold(2 * zeta[0] * W1, 2 * zeta[1] * W2)
    evaluations = []

    def solve(mu):
        evaluations.append(mu)
        return hulten(mu, zeta)

    high = expected + 0.07
    samples = SolvedLine(0.1, hulten(0.1, zeta), high, hulten(high, zeta), solve)
    unstable = int(np.argmax(samples.at(high).lam.real))
    found = [refine_onset(samples, i, unstable, 0.0, 0.5e-4) for i in range(2)]
    for onset in found:  # the label at the other end may be wrong: the crossing is the same
        assert onset.value == pytest.approx(expected, abs=1e-4)
    assert found[0].evaluations + found[1].evaluations == len(evaluations) == len(set(evaluations))
    assert found[1].evaluations < found[0].evaluations  # what is solved serves the next mode


def test_a_mode_is_followed_from_its_sure_side():
    """Before a lock-in the mode is known from below, behind it from above, wherever one looks."""
    zeta = (0.01, 0.01)
    samples = SolvedLine(
        0.2, hulten(0.2, zeta), 0.4, hulten(0.4, zeta), lambda mu: hulten(mu, zeta)
    )
    unstable = int(np.argmax(samples.at(0.4).lam.real))
    mode = FollowedMode(samples, 0, unstable)
    for mu in (0.3, 0.39, 0.33, 0.21, 0.25):
        lam = hulten(mu, zeta).lam
        assert mode.root(mu) == lam[np.argmax(lam.real) if mu > 0.295 else 0]


def test_a_mode_that_vanishes_is_said_so():
    nothing = Modes(np.zeros(0, complex), np.zeros((0, 2), complex))
    samples = SolvedLine(0.0, hulten(0.0), 0.6, hulten(0.6), lambda mu: nothing)
    with pytest.raises(ConvergenceError, match=r"cannot be followed at 0\.3"):
        FollowedMode(samples, 0, 0).root(0.3)
    stable = SolvedLine(0.0, hulten(0.0, (0.1, 0.1)), 0.1, hulten(0.1, (0.1, 0.1)), hulten)
    with pytest.raises(ConvergenceError, match="does not cross"):
        refine_onset(stable, 0, 0, 0.0, 1e-4)


EXCHANGED_AT = 0.43


def exchanging(x: float) -> Modes:
    """A stable mode of hardly any damping and a growing one, whose shapes change places."""
    lam = np.array([-0.5 + 2000j, 40.0 + 2040j])
    return Modes(lam, np.eye(2, dtype=complex)[:, :: 1 if x < EXCHANGED_AT else -1])


def test_two_modes_that_change_places_are_no_onset():
    """The damping ratio leaps from nearly 0: as it does at a lock-in in a bracket less narrow."""
    assert exchanged(*(exchanging(x).lam[None] for x in (0, 1)), np.array([0]), np.array([1]))[0]
    samples = SolvedLine(0.0, exchanging(0.0), 1.0, exchanging(1.0), exchanging)
    with pytest.raises(ConvergenceError, match="jumps"):
        refine_onset(samples, 0, 1, 1e-7, 1e-4)


def test_of_two_modes_that_change_places_none_is_refined_in_step():
    def solve(rows, x):
        found = [exchanging(v) for v in x]
        at = ManyModes(np.array([m.lam for m in found]), np.array([m.shapes.T for m in found]))
        return at, np.ones(len(rows), dtype=bool)

    at = [solve([0], [x])[0] for x in (0.0, 1.0)]
    ends, places = (np.zeros(1), np.ones(1)), (np.array([0]), np.array([1]))
    found = refine_onsets_together(ends, (at[0], at[1]), places, solve, 1e-7, 1e-4)
    assert found.evaluations[0] > 5
    assert np.isnan(found.value[0])


# -- four neighbouring points


@given(st.floats(-1.0, 1.0), st.floats(0.2, 3.0), st.floats(-0.5, 0.5), st.floats(0.05, 0.95))
def test_the_cubic_onset_is_within_its_error_of_a_smooth_one(at, rate, bend, part):
    """f = -sinh(rate (x - at)) with a bend: the true error is below the estimate."""
    h = 0.05
    x = at + h * (np.arange(6.0) - 2.0 - part)
    f = -np.sinh(rate * (x - at)) + bend * rate**2 * (x - at) ** 2
    (value,), (error,) = cubic_onsets(x[None], f[None])
    assert x[2] < value < x[3]
    assert abs(value - at) <= error + 1e-15
    assert error < 0.05 * h


@given(st.floats(0.001, 0.999))
def test_no_cubic_onset_where_the_damping_ratio_falls_like_a_root_or_a_kink_or_jumps(part):
    """Wherever between the points that is: the third difference vanishes at some places."""
    x = np.linspace(-0.1, 0.4, 6)
    beyond = np.maximum(x - 0.1 - 0.1 * part, 0.0)
    jump = np.where(beyond > 0, -0.02, 0.01)
    f = np.array([1e-9 - np.sqrt(beyond), 1e-9 - beyond, jump])
    _, error = cubic_onsets(np.array([x, x, x]), f)
    assert np.isinf(error).all()


@pytest.mark.parametrize("num", [97, 121, 251, pytest.param(601, marks=pytest.mark.full_size)])
def test_fine_grids_do_not_take_an_undamped_lock_in_for_a_smooth_onset(tmp_path, num):
    (row,) = run(study(num=num), tmp_path / "r").onsets.to_dict("records")
    assert row["status"] == "refined"
    assert row["onset"] == pytest.approx(MU_C, abs=1e-4)


def test_fine_grids_tell_smooth_onsets_without_more_points(tmp_path):
    damped = "[parameters]\ndamping_ratio = 0.02\n"
    results = run(study(num=401).replace("[[sweep]]", damped + "[[sweep]]"), tmp_path / "r")
    (row,) = results.onsets.to_dict("records")
    exact = damped_threshold(2 * 0.02 * W1, 2 * 0.02 * W2)
    assert (row["status"], row["evaluations"]) == ("cubic", 0)
    assert abs(row["onset"] - exact) <= row["error_estimate"] <= 1e-4
    assert results.rank(by="threshold")["threshold"].tolist() == [row["onset"]]


# -- studies


@pytest.mark.parametrize("num", [3, 4, 13])
def test_onset_of_hulten_from_its_study(tmp_path, num):
    results = run(study(num=num), tmp_path / "r")
    (row,) = results.onsets.to_dict("records")
    assert row["status"] == "refined"
    assert row["direction"] == "in"
    assert row["onset"] == pytest.approx(MU_C, abs=1e-4)
    assert row["bracket_low"] < MU_C < row["bracket_high"]
    assert row["frequency_hz"] == pytest.approx(88.388, rel=1e-2)
    ends = results.points.set_index("point_id")["friction"]
    assert ends[row["point_before"]] == row["bracket_low"]
    assert ends[row["point_after"]] == row["bracket_high"]
    ranking = results.rank(by="threshold")
    assert ranking["threshold"].tolist() == pytest.approx([MU_C], abs=1e-4)
    assert ranking["threshold_kind"].tolist() == ["refined"]
    facts = results.manifest["onsets"]
    spent = {"evaluations": row["evaluations"], "left": 0}
    assert facts == {"along": "friction", **spent, "refined": 1}


def test_onset_of_hoffmann_from_its_study(tmp_path):
    results = run(study("hoffmann", 1.5, 6), tmp_path / "r")
    assert results.onsets["onset"].tolist() == pytest.approx([0.75], abs=1e-4)
    assert results.onsets["status"].tolist() == ["refined"]


def test_lines_have_their_own_onsets_and_friction_need_not_come_first(tmp_path):
    sweep = '[[sweep]]\nparameter = "stiffness_damping"\nstart = 1e-6\nstop = 1e-4\nnum = 3\n'
    text = study(num=5).replace("[[sweep]]", sweep + 'scale = "log"\n[[sweep]]', 1)
    onsets = run(text, tmp_path / "r").onsets
    assert list(onsets["stiffness_damping"]) == pytest.approx([1e-6, 1e-5, 1e-4])
    expected = [damped_threshold(b * W1**2, b * W2**2) for b in onsets["stiffness_damping"]]
    assert onsets["onset"].to_numpy() == pytest.approx(expected, abs=1e-4)


LOCK_IN_MAP = (
    study(num=6, stop=0.5)
    .replace("[modes]", '[[sweep]]\nparameter = "frequency_2"\nSWEEP\n[modes]')
    .replace("SWEEP", "start = 72.0\nstop = 96.0\nnum = 4")
)


@pytest.mark.parametrize("design", ["grid", "boundary"])
def test_the_boundary_on_the_map_is_the_closed_form(design, tmp_path):
    """mu_c = |w1^2 - w2^2| / (2 w1 w2); zeta is zero up to it, and tracks change number on it."""
    text = LOCK_IN_MAP
    if design == "boundary":
        text = text.replace("num = 6", "num = 3") + '[design]\ntype = "boundary"\nlevels = 2\n'
    results = run(text, tmp_path / "r")
    points, axes = results.nodes[0], ("friction", "frequency_2")
    plane = study_plane(results, axes)
    found = stability_boundary(plane, results.onsets, results.along)
    (line,) = found.lines
    mu, hz = line.T
    assert (
        found.refined == found.crossings == plane.up.scaled(points[axes[1]].drop_duplicates()).size
    )
    on_lines = np.isin(hz, points[axes[1]])
    mu_c = (1e4 - hz**2) / (200 * hz)
    np.testing.assert_allclose(mu[on_lines], mu_c[on_lines], atol=1e-4)
    step = np.diff(np.unique(points[axes[1]])).max()
    chord = step**2 / 8 * 100 / hz.min() ** 3  # of a straight line between two of them
    assert (np.abs(mu - mu_c) < chord + 1e-4).all()
    assert hz.min() == 72.0
    assert hz.max() == 96.0


def test_a_parameter_swept_in_log_is_refined_relative_to_its_value(tmp_path):
    """More stiffness damping stabilises: the onset is left as it rises."""
    text = study(num=3).replace('"friction"', '"stiffness_damping"').replace("start = 0.0", "start")
    text = text.replace("start\n", 'start = 1e-6\nscale = "log"\n').replace("0.6", "1e-3")
    results = run(text + "[parameters]\nfriction = 0.31\n", tmp_path / "r")
    (first, row) = results.onsets.sort_values("bracket_high").to_dict("records")
    assert (first["status"], row["status"], row["direction"]) == ("below_range", "refined", "out")
    assert np.isnan(first["onset"])
    assert damped_threshold(row["onset"] * W1**2, row["onset"] * W2**2) == pytest.approx(
        0.31, abs=2e-5
    )


def test_without_refinement_the_onset_is_read_off_the_grid(tmp_path):
    results = run(study(num=4) + "refine_onsets = false\n", tmp_path / "r")
    (row,) = results.onsets.to_dict("records")  # no damping up to the lock-in: where, is not known
    assert (row["status"], row["evaluations"]) == ("bracketed", 0)
    assert row["bracket_low"] < MU_C < row["bracket_high"] == row["onset"]
    assert results.rank()["threshold_kind"].tolist() == ["bracketed"]
    damped = study(num=4).replace("[modes]", "[parameters]\ndamping_ratio = 0.02\n[modes]")
    assert set(run(damped + "refine_onsets = false\n", tmp_path / "d").onsets["status"]) == {
        "interpolated"
    }


def test_what_the_budget_of_refinement_leaves_is_told(tmp_path):
    """A line for each of 4 frequencies; the first two onsets spend what is there."""
    text = LOCK_IN_MAP + "refine_points = {}\n"
    every = run(text.format(1000), tmp_path / "all")
    some = run(text.format(9), tmp_path / "some")
    none = run(text.format(0), tmp_path / "none")
    counts = [dict(r.onsets["status"].value_counts()) for r in (every, some, none)]
    left = [r.manifest["onsets"]["left"] for r in (every, some, none)]
    assert left[0] == 0 < left[1] < left[2]
    assert set(counts[0]) == {"refined"}
    assert set(counts[2]) <= {"bracketed", "interpolated"}
    assert counts[1]["refined"] + left[1] == len(some.onsets) == left[2]
    unrefined = some.onsets[some.onsets["status"] != "refined"]
    assert (unrefined["evaluations"] == 0).all()
    assert unrefined["error_estimate"].isna().all()
    told = [dict(r.screen.facts(r)).get("not refined", "") for r in (every, some, none)]
    assert told[0] == ""
    assert f"{left[1]} onset" in told[1]
    assert f"{left[2]} onset" in told[2]


def test_structural_sweeps_of_small_models_are_refined(tmp_path):
    text = study(stop=99.0, start=60.0, num=14).replace('"friction"', '"frequency_2"')
    results = run(text + "[parameters]\nfriction = 0.2\n", tmp_path / "r")
    ((onset, status),) = results.onsets[["onset", "status"]].to_numpy()
    assert status == "refined"
    assert abs(onset - 100.0 * (np.sqrt(1.04) - 0.2)) < 1e-4 * 39.0  # (f1^2 - f2^2) = 2 mu f1 f2


def test_onsets_in_step_are_those_one_by_one(tmp_path, monkeypatch):
    text = LOCK_IN_MAP + "refine_points = 1000\n"
    together = run(text, tmp_path / "together").onsets
    nothing = "squealstudy.kinds.complex_modes.batch_onsets.BatchOnsets.refine"
    monkeypatch.setattr(nothing, lambda self, brackets: [None] * len(brackets.points[0]))
    alone = run(text, tmp_path / "alone").onsets
    assert together["status"].tolist() == alone["status"].tolist()
    assert len(together) > 3
    apart = np.abs(together["onset"] - alone["onset"])
    assert (apart <= together["error_estimate"] + alone["error_estimate"]).all()
    assert (apart > 0).any()


def test_a_point_that_cannot_be_solved_keeps_the_interpolated_onset(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ConvergenceError("not_converged", "no working point")

    monkeypatch.setattr("squealstudy.kinds.complex_modes.batch_onsets.stacked_system", fail)
    monkeypatch.setattr("squealstudy.kinds.complex_modes.neighbourhood.modes_at", fail)
    (row,) = run(study(num=4), tmp_path / "r").onsets.to_dict("records")
    assert row["status"] == "failed"
    assert row["bracket_low"] < row["onset"] <= row["bracket_high"]


def test_a_mode_that_only_changes_its_number_has_no_onset(tmp_path):
    """Numbers run along damping first: at 0.76 the growing mode got another one than at 0.74."""
    text = study("hoffmann", num=2).replace(
        "start = 0.0\nstop = 0.6\nnum = 2", "values = [0.0, 0.01]"
    )
    text = text.replace('"friction"', '"damping_ratio"')
    second = '[[sweep]]\nparameter = "friction"\nvalues = [0.5, 0.74, 0.76, 0.9]\n'
    results = run(text + second, tmp_path / "r")
    damped = results.onsets[results.onsets["damping_ratio"] > 0]
    (onset,) = damped.loc[damped["status"].isin(["refined", "cubic"]), "onset"]
    gone = damped[damped["status"] == "renumbered"]
    assert sorted(gone["direction"]) == ["in", "out"]
    assert gone["onset"].isna().all()
    assert len(damped) == 3
    modes = results.modes.set_index(["point_id", "track"])
    for row in gone.to_dict("records"):
        for end in ("point_before", "point_after"):
            assert modes.loc[(row[end], row["track"]), "track_ambiguous"]
    ranked = results.rank().set_index("track")["threshold"].sort_values()
    assert ranked.to_numpy() == pytest.approx([onset, 0.75], abs=1e-4)  # undamped at 0.75


def test_tables_do_not_depend_on_the_workers(tmp_path):
    sweep = '[[sweep]]\nparameter = "damping_ratio"\nstart = 0.0\nstop = 0.02\nnum = 9\n'
    one, two = (run(study(num=6) + sweep, tmp_path / str(jobs), jobs) for jobs in (1, 2))
    pd.testing.assert_frame_equal(one.onsets, two.onsets)
    assert (one.onsets["status"] == "refined").sum() == 9


def test_no_line_no_onset(tmp_path):
    sweep = '[[sweep]]\nparameter = "damping_ratio"\nstart = 0.0\nstop = 0.02\n'
    random = study().replace("num = 4\n", "") + sweep + '[design]\ntype = "sobol"\nsamples = 8\n'
    assert len(run(random, tmp_path / "a").onsets) == 0  # a line of one point has no onset
    alone = study().split("[[sweep]]")[0] + "[modes]\nband = [1.0, 5000.0]\n"
    assert len(run(alone, tmp_path / "b").onsets) == 0


def test_results_of_an_older_version_are_run_again(tmp_path):
    results = run(study(), tmp_path / "r")
    (tmp_path / "r" / "onsets.parquet").unlink()
    with pytest.raises(ResultsError, match="not finished; run the study again"):
        squealstudy.open_results(tmp_path / "r")
    again = run(study(), tmp_path / "r")
    pd.testing.assert_frame_equal(again.onsets, results.onsets)


def test_between_the_points_of_a_full_order_study_modes_are_of_full_order():
    both = []
    for method in ("full", "dense"):
        text = study() + f'method = "{method}"\n'
        plan = plan_of(text)
        build_structures(plan, Workers())
        both.append(StudyNeighbourhoods(plan).of(1))
    full, dense = both
    assert (full.rung, dense.rung) == ("full", "dense")
    x = np.array([0.23])
    np.testing.assert_allclose(full.solve(x).lam, dense.solve(x).lam, rtol=1e-9)


def test_between_its_points_a_study_by_perturbation_is_solved_so_too(tmp_path):
    """On exact modes root finding would hide what the method errs by."""
    found = {}
    for method in ("perturbation", "dense"):
        text = study() + f'method = "{method}"\ntrack = false\n'
        growth = run(text, tmp_path / method).modes.groupby("point_id")["growth_rate"].max()
        plan = plan_of(text)
        at = StudyNeighbourhoods(plan).of(0).solve(plan.coordinates[2])
        found[method] = at.lam.real.max()
        assert found[method] == pytest.approx(growth[plan.tasks[2].point_id], rel=1e-9)
    assert abs(found["perturbation"] / found["dense"] - 1.0) > 1e-2


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([], (None, None, None)),
        ([("out", 0.2, "refined", 1e-4)], (None, None, None)),
        ([("in", 0.4, "refined", 1e-4), ("in", 0.3, "cubic", 1e-5)], (0.3, 0.29999, 0.30001)),
        ([("in", 0.3, "refined", 1e-4), ("in", np.nan, "below_range", np.nan)], (0.0, 0.0, 0.0)),
        ([("in", 0.2, "first_seen", np.nan)], (0.2, 0.1, 0.2)),
        ([("in", 0.23, "interpolated", np.nan)], (0.23, 0.2, 0.3)),
    ],
)
def test_the_first_onset_of_a_line_has_bounds(rows, expected):
    table = pd.DataFrame(rows, columns=["direction", "onset", "status", "error_estimate"])
    table["bracket_low"], table["bracket_high"] = 0.2, 0.3
    assert first_onset(table, np.array([0.0, 0.1, 0.2, 0.3])) == pytest.approx(expected)
