"""Studies of limit cycles through the engine: verdicts, tables, statuses, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_runs import load_plan, plan_of, solved

import squealstudy as sq
from squealstudy.cycles.projection import Projection
from squealstudy.engine.forecast import Estimate, run_seconds
from squealstudy.errors import ConvergenceError, ResultsError, StudyFileError
from squealstudy.plots.cycle_levels import RUN
from squealstudy.tables.run_levels import run_levels

STUDY = Path(__file__).parents[2] / "studies" / "kicked_squeal.toml"
SWEEP = "start = 0.05\nstop = 1.0\nnum = 20"
FOLLOW = 'follow = "friction"\n'  # in test_limit_cycles_branches
ALONE = "families = [1]                 # the mode that turns unstable\n"


def study(values, **changes):
    text = STUDY.read_text(encoding="utf-8")
    assert text.count(SWEEP) == 1
    assert text.count(FOLLOW) == 1
    text = text.replace(SWEEP, f"values = {values}").replace(FOLLOW, "").replace(ALONE, "")
    for old, new in changes.values():
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="module")
def kicked(tmp_path_factory):
    directory = tmp_path_factory.mktemp("cycles") / "kicked_squeal"
    return solved(plan_of(study([0.4, 0.6, 0.85]), STUDY), directory)


def test_verdicts_of_the_shipped_study(kicked):
    """In time a kick of .9 of the threshold decays, 1.1 of it grows: test_cycles."""
    points = kicked.points.set_index("friction")
    assert (points["status"] == "ok").all()
    assert points["verdict"].tolist() == ["squeals_if_kicked", "squeals_if_kicked", "squeals"]
    assert points.loc[0.6, "torque_rms"] == pytest.approx(154.59, abs=0.01)
    assert points.loc[0.6, "threshold_velocity"] == pytest.approx(0.982, abs=1e-3)
    assert points.loc[0.6, "threshold_share"] == pytest.approx(0.394, abs=1e-3)
    assert np.isnan(points.loc[0.85, "threshold_velocity"])  # it needs no kick
    verdicts = kicked.table("verdicts")
    told = verdicts[verdicts["threshold_cycle"] != ""]
    cycles = kicked.table("cycles").set_index("cycle_id").loc[told["threshold_cycle"]]
    assert len(told) == 2
    assert (cycles["contact_velocity"].to_numpy() == told["threshold_velocity"].to_numpy()).all()
    assert (cycles["energy"].to_numpy() == told["threshold_energy"].to_numpy()).all()
    assert points.loc[0.85, "max_growth_rate"] > 0


def test_tables_join_and_tell_errors(kicked):
    cycles, verdicts, curves = (kicked.table(n) for n in ("cycles", "verdicts", "curves"))
    ids = set(kicked.points["point_id"])
    assert all(set(t["point_id"]) <= ids for t in (cycles, verdicts, curves))
    assert not cycles["cycle_id"].duplicated().any()
    assert len(verdicts) == 2 * len(ids)
    assert (cycles["status"] == "ok").all()
    assert (cycles["level_error"] < 1e-3).all()
    assert (cycles["velocity_error"] < 5e-3).all()
    kicked_ = verdicts["threshold_velocity"].notna()
    assert (verdicts["threshold_error"].notna() == kicked_).all()
    assert (cycles["power_imbalance"].abs() < 1e-6).all()
    assert (cycles["balance_residual"] < 1e-9).all()
    unstable = cycles[~cycles["stable"].astype(bool)]
    assert (unstable["instability"] == "fold").all()
    assert (unstable["n_unstable"] == 1).all()
    zeros = curves[curves["event"] == "C"]
    assert (zeros["added_damping"].abs() < 1e-6).all()
    assert len(zeros) == len(cycles)
    # a curve that was not followed as far as asked is no proof of silence
    lost = verdicts[(verdicts["curve_end"] != "far") & (verdicts["n_cycles"] == 0)]
    assert len(lost)
    assert set(lost["verdict"]) == {"undecided"}
    assert kicked.points.attrs["units"]["threshold_velocity"] == "m/s"


def test_modes_are_those_of_a_study_of_complex_modes(kicked, tmp_path):
    text = study([0.4, 0.6, 0.85]).split("[limit_cycles]")[0]
    text = text.replace('"limit_cycles"', '"complex_modes"')
    modes = solved(plan_of(text, STUDY), tmp_path / "modes").modes
    verdicts = kicked.table("verdicts")
    assert modes["mode"].tolist() == verdicts["mode"].tolist()
    np.testing.assert_allclose(modes["frequency_hz"], verdicts["frequency_hz"], rtol=1e-9)
    size = 2 * np.pi * modes["frequency_hz"].max()
    np.testing.assert_allclose(
        modes["growth_rate"], verdicts["growth_rate"], rtol=1e-9, atol=1e-12 * size
    )


@pytest.mark.full_size
def test_kicks_along_the_mode_stand_beside_thresholds(tmp_path):
    """Along the mode it takes more than along the cycle: part of the kick decays at once.

    By default of cycles alone: test_cycle_thresholds.py.
    """
    changes = {"kick": ("tolerance = 1e-3", "tolerance = 1e-3\nkick_along_mode = true")}
    results = solved(plan_of(study([0.6, 0.85], **changes), STUDY), tmp_path / "kicks")
    verdicts = results.table("verdicts").set_index(["mode", "verdict"])
    found = verdicts.loc[(1, "squeals_if_kicked")]
    assert found["kick_status"] == "ok"
    assert found["kick_velocity"] / found["threshold_velocity"] == pytest.approx(1.47, abs=0.03)
    assert found["kick_error"] < 0.02
    others = verdicts.drop(index=(1, "squeals_if_kicked"))
    assert set(others["kick_status"]) == {""}
    assert others["kick_velocity"].isna().all()
    assert results.table("verdicts").attrs["units"]["kick_phase"] == "rad"


def test_a_second_run_solves_nothing(kicked):
    again = solved(plan_of(study([0.4, 0.6, 0.85]), STUDY), kicked.directory)
    assert again.points["verdict"].tolist() == kicked.points["verdict"].tolist()
    assert len(list((kicked.directory / "chunks").iterdir())) > 0


def test_the_picture_of_a_study(kicked):
    figure = kicked.plot.cycle_levels(along="friction")
    labels = {t for axes in figure.axes for t in axes.get_legend_handles_labels()[1]}
    assert {"stable cycle", "squeals", "squeals if kicked"} <= labels
    verdicts = kicked.table("verdicts").copy()
    verdicts.loc[0, ["run_status", "torque_rms"]] = ("lasts", 77.0)  # a run alone tells a level
    axes = kicked.with_tables(verdicts=verdicts).plot.cycle_levels(along="friction").axes[0]
    crosses = [line for line in axes.lines if line.get_label() == RUN["label"]]
    assert [line.get_ydata().tolist() for line in crosses] == [[77.0]]
    with pytest.raises(ResultsError, match=r"'frction' is not varied.*did you mean 'friction'"):
        kicked.plot.cycle_levels(along="frction")


def test_silent_designs_and_outside_validity(tmp_path):
    """A linear contact spring has no cycle but where its contact opens, and says so."""
    changes = {
        "law": ('contact_law = "cubic"', 'contact_law = "bilateral"'),
        "cubic": ('"contact.cubic_stiffness" = -5.4e17  # Pa/m3\n', ""),
        "reach": ("reach = 0.5 ", "reach = 0.02"),
    }
    quiet = solved(plan_of(study([0.2], **changes), STUDY), tmp_path / "quiet").points.iloc[0]
    assert quiet["verdict"] == "no_cycle_found"
    assert "velocity of 0.2" in quiet["reason"]  # a step further
    assert "with up to 7 harmonics" in quiet["reason"]


@pytest.mark.parametrize(
    ("old", "new", "key", "told"),
    [
        ("tolerance = 1e-3", 'harmonics = "many"', "limit_cycles.harmonics", '"auto" or a number'),
        ("tolerance = 1e-3", "harmonics = true", "limit_cycles.harmonics", '"auto" or a number'),
        ("families = [1]", "families = [0]", "limit_cycles.families", '"screened" or a list'),
        ("families = [1]", "families = []", "limit_cycles.families", '"screened" or a list'),
        ("families = [1]", "families = [1, 1]", "limit_cycles.families", "distinct"),
        ("tolerance = 1e-3", "tolerance = 0.5", "limit_cycles.tolerance", "at most 0.1"),
        ("tolerance = 1e-3", "harmonic = 3", "limit_cycles.harmonic", "harmonics"),
        ("reach = 0.5", "reach = -1.0", "limit_cycles.reach", "more than 0"),
    ],
)
def test_a_wrong_key_is_named(tmp_path, old, new, key, told):
    path = tmp_path / "study.toml"
    path.write_text(STUDY.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(StudyFileError) as caught:
        sq.read_study(path)
    assert caught.value.key.startswith(key)
    assert told in str(caught.value)


def test_points_that_cannot_be_searched_say_why(tmp_path):
    changes = {"families": ("tolerance = 1e-3", "families = [3]")}
    with pytest.raises(ResultsError, match=r"1 no_mode.*mode 3 of 2 modes in the band"):
        solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "third")
    changes = {"families": ("tolerance = 1e-3", "families = [1]\nharmonics = 9")}
    results = solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "first")
    assert set(results.table("verdicts")["mode"]) == {1}
    assert results.points["n_left_out"].tolist() == [1]
    assert set(results.table("cycles")["n_harmonics"]) == {9}
    changes = {"few": ("tolerance = 1e-3", "harmonics = 1\ntolerance = 1e-6")}
    results = solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "few")
    assert set(results.table("cycles")["status"]) == {"inaccurate"}
    assert results.table("cycles")["stable"].isna().all()
    assert results.points["verdict"].tolist() == ["squeals_if_kicked"]  # by a run in time
    decided = results.table("verdicts").set_index("run_status").loc["lasts"]
    assert "a run in time from the cycle lasts" in decided["reason"]
    by_run = run_levels(results.table("verdicts"), results.table("cycles"))
    assert by_run["run_status"].tolist() == ["lasts"]
    exact = solved(plan_of(study([0.6]), STUDY), tmp_path / "exact").points.iloc[0]
    for name in ("torque_rms", "frequency_hz"):
        assert results.points[name].iloc[0] == pytest.approx(exact[name], rel=5e-3)
    assert results.points["level_error"].iloc[0] < 2e-2
    off = {
        "few": ("tolerance = 1e-3", "harmonics = 1\ntolerance = 1e-6\nundecided_in_time = false")
    }
    results = solved(plan_of(study([0.6], **off), STUDY), tmp_path / "off")
    assert results.points["verdict"].tolist() == ["undecided"]
    assert set(results.table("verdicts")["run_status"]) == {""}


def test_modes_that_were_not_followed_are_told(tmp_path):
    """Where one of them is unstable the design squeals all the same."""
    found = {}
    for name, families in {"few": "[2]", "screened": '"screened"\nscreen = 1e-3'}.items():
        changes = {"families": ("tolerance = 1e-3", f"families = {families}")}
        results = solved(plan_of(study([0.6, 0.85], **changes), STUDY), tmp_path / name)
        found[name] = results.points.set_index("friction")
    few, screened = found["few"], found["screened"]
    assert few["n_left_out"].tolist() == [1, 1]
    assert "; 1 mode not followed" in few.loc[0.6, "reason"]
    assert few.loc[0.85, "verdict"] == "squeals"
    assert few.loc[0.85, "reason"] == "mode 1: unstable mode, not followed: level undecided"
    assert screened.loc[0.6, "verdict"] == "undecided"
    assert "no mode was followed; 2 modes not followed" in screened.loc[0.6, "reason"]
    assert screened.loc[0.85, "verdict"] == "squeals"
    assert screened["n_left_out"].tolist() == [2, 1]


def test_cycles_of_which_more_harmonics_are_lost_are_inaccurate(tmp_path, monkeypatch):
    """The level error is then that of the last change; without one there is no cycle."""
    improve = Projection.improve

    def failing(most):
        def improved(self, motion, target, held):
            if motion.harmonics > most:
                raise ConvergenceError("not_converged", "no more")
            return improve(self, motion, target, held)

        return improved

    changes = {"exact": ("tolerance = 1e-3", "tolerance = 1e-11")}
    monkeypatch.setattr(Projection, "improve", failing(7))
    results = solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "seven")
    cycles = results.table("cycles")
    lost = cycles[cycles["status"] == "inaccurate"]
    assert len(lost)
    assert set(lost["n_harmonics"]) == {7}
    assert (lost["level_error"] > 1e-11).all()
    assert np.isfinite(lost["level_error"]).all()
    assert (lost["stable"].notna() == (lost["level_error"] < 0.1)).all()
    monkeypatch.setattr(Projection, "improve", failing(5))
    results = solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "five")
    assert len(results.table("cycles")) == 0
    assert results.table("verdicts")["n_lost"].sum() > 0
    assert results.points["verdict"].tolist() == ["squeals_if_kicked"]  # by a run in time
    assert "the motion nearest to growing" in results.points["reason"].iloc[0]


def test_a_model_that_is_too_large_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("squealstudy.kinds.limit_cycles.designs.MAX_COORDINATES", 1)
    with pytest.raises(ResultsError, match="has 2 coordinates, limit cycles are for 1 at most"):
        solved(plan_of(study([0.6]), STUDY), tmp_path / "large")


@pytest.mark.parametrize(
    ("name", "point_s", "measured_s"),  # of the timed points; of the run, on one idle core
    [("verdict_map", 0.22, 27.0), ("kicked_squeal", 0.33, 10.5), ("cycles_from_onset", 0.09, 3.1)],
)
def test_time_tells_branches_and_borders_too(name, point_s, measured_s):
    plan = load_plan(Path(__file__).parents[2] / "studies" / f"{name}.toml")
    cost = Estimate(0, None, point_s, None, None, "")
    low, high = run_seconds(plan, cost, len(plan.tasks), 1)
    assert low < measured_s < high < 4.0 * measured_s
