"""Transient studies from the file to the tables: bad input, batches, resume, continuation."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.signal
from study_runs import plan_of, solved
from study_texts import study_text

from squealstudy.engine.plan import Plan
from squealstudy.engine.result_names import HISTORIES, STATES
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.kinds.transient.batch import training_path
from squealstudy.motion.settings import steps_between_rows
from squealstudy.plots.growth_comparison import growth_pairs

BELT = (
    study_text("belt", "transient", "belt")
    + """\
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 0.9, 1.1, 1.2, 1.3]
[modes]
band = [10.0, 1000.0]
[transient]
duration = {duration}
step = 2e-5
perturbation = 1e-5
save_every = {save_every}
{more}
"""
)


def belt(duration=0.5, save_every=20, more="") -> Plan:
    return plan_of(BELT.format(duration=duration, save_every=save_every, more=more))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    directory = tmp_path_factory.mktemp("belt") / "belt"
    return solved(belt(), directory, jobs=2)


# -- bad input -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("step = 2e-5", "step = 0.0"), "expected more than 0, got 0"),
        (("step = 2e-5", "step = -1e-6"), "expected more than 0"),
        (("step = 2e-5", "step = 1.0"), "shorter than one step"),
        (("duration = 0.5", "duration = nan"), "finite"),
        (("perturbation = 1e-5", "perturbation = -1.0"), "perturbation"),
        (("perturbation = 1e-5", "perturb_modes = [0.5]"), "perturb_modes"),
        (("perturbation = 1e-5", "sensors = [800.0, 500.0]"), "low < high"),
        (("perturbation = 1e-5", "sensors = []"), "empty list"),
        (("perturbation = 1e-5", "sensors = [0, 3]"), "mode numbers from 1"),
        (("perturbation = 1e-5", 'methd = "newmark"'), "did you mean 'method'"),
        (("perturbation = 1e-5", 'method = "newmrk"'), "did you mean 'newmark'"),
        (("perturbation = 1e-5", 'start_point = "ab"'), "needs a results directory"),
        (("perturbation = 1e-5", "pod_vectors = 5"), "give modes_below too"),
        (("perturbation = 1e-5", "pod_step = 1e-6"), "give pod_vectors too"),
        (
            ("perturbation = 1e-5", "modes_below = 1e3\npod_vectors = 1\npod_step = 1.0"),
            "longer than pod_duration",
        ),
        (
            ("perturbation = 1e-5", 'storage = "single"\nrepresentation = "hybrid"'),
            "storage = .single. is not for representation",
        ),
        (
            ("perturbation = 1e-5", 'method = "exponential"\nprewarp = true'),
            'prewarp is not for method = "exponential"',
        ),
        (
            ("perturbation = 1e-5", 'method = "exponential"\nrepresentation = "hybrid"'),
            "method = .exponential. is not for representation",
        ),
        (('kind = "transient"', 'kind = "complex_modes"'), 'needs kind = "transient"'),
    ],
)
def test_bad_sections_are_one_clear_error(change, message):
    text = BELT.format(duration=0.5, save_every=20, more="")
    assert change[0] in text
    with pytest.raises(StudyFileError, match=message) as caught:
        plan_of(text.replace(*change))
    assert "study.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("sensors = [2000.0, 9000.0]", "no assembly mode lies between 2000 and 9000 Hz"),
        ("sensors = [3]", "the assembly has 2 modes"),
        ("perturb_modes = [7]", "modes 1 to 2"),
    ],
)
def test_what_only_the_model_shows_is_told_before_anything_is_written(tmp_path, more, message):
    with pytest.raises(StudyFileError, match=message):
        run_study(belt(more=more), tmp_path / "belt", jobs=1)
    assert not (tmp_path / "belt").exists()


def test_a_damped_assembly_mode_must_exist(tmp_path):
    text = BELT.format(duration=0.5, save_every=20, more="")
    text = text.replace("[modes]", '[parameters]\n"modes[9].damping_ratio" = 0.1\n[modes]')
    with pytest.raises(StudyFileError, match="the assembly has modes 1 to 2"):
        run_study(plan_of(text), tmp_path / "belt", jobs=1)


# -- what comes out ------------------------------------------------------------------------------
def test_classes_on_both_sides_of_the_stability_boundary(finished):
    """Stable for v > ln(10)/2 = 1.151293 (THEORY.md eq. (98))."""
    points = finished.points
    assert (points["status"] == "ok").all()
    stable = points["sliding_speed"] > np.log(10) / 2
    assert (points["predicted_growth_rate"] < 0).equals(stable)
    assert (points["growth_rate"] < 0).equals(stable)
    assert (points.loc[stable, "class"] == "stable").all()
    assert points.loc[points["sliding_speed"] == 0.5, "class"].item() == "limit_cycle"
    assert ((points["n_unstable"] > 0) == ~stable).all()


def test_growth_in_the_table_is_that_of_the_complex_mode(finished):
    points = finished.points
    error = points["growth_rate"] / points["predicted_growth_rate"] - 1
    assert error.abs().max() < 0.03
    assert (points["growth_rate_low"] <= points["growth_rate"]).all()
    assert (points["growth_rate"] <= points["growth_rate_high"]).all()
    assert (points["growth_method"] == "left_vector").all()


def test_the_other_columns(finished):
    points, modes = finished.points, finished.modes
    cycle = points[points["sliding_speed"] == 0.5].iloc[0]
    assert cycle["settled"]
    assert 0 < cycle["settled_time"] < 0.5
    history = finished.history(cycle["point_id"])
    end = history[history["time"] > 0.3]
    f, power = scipy.signal.periodogram(end["torque"], 1 / 4e-4, nfft=2**16, detrend="linear")
    assert cycle["torque_line_hz"] == pytest.approx(f[np.argmax(power)], rel=0.005)
    assert cycle["dominant_mode"] == 1
    assert cycle["dominant_share"] > 0.99
    assert abs(points["energy_balance"]).max() < 1e-3
    np.testing.assert_allclose(points["time_reached"], 0.5)
    assert points["stick_share_max"].max() == 1.0
    assert (modes.groupby("point_id")["energy_share"].sum() <= 1.0 + 1e-9).all()
    assert set(modes["mode"]) == {1}
    assert len(finished.growth) == len(points)
    assert finished.growth["unstable"].tolist() == (points["n_unstable"] > 0).tolist()
    shares = finished.growth["level_share"].dropna()
    assert (shares <= 1.0).all()
    assert (shares > 0.99).all()  # stick-slip of one mass
    assert finished.growth["expressed"].dtype == "boolean"
    assert points["valid"].tolist() == [True] * len(points)
    assert points.columns[-2:].tolist() == ["valid", "invalid_reason"]


def test_histories(finished):
    assert finished.manifest["units"]["torque"] == "N"  # of a belt it is a friction force
    name = finished.points["point_id"].iloc[0]
    history = finished.history(name)
    np.testing.assert_allclose(history["time"], np.arange(len(history)) * 20 * 2e-5, atol=1e-12)
    assert {"torque", "normal_force", "stick", "slip", "open", "energy"} <= set(history)
    assert history["time"].iloc[-1] == pytest.approx(0.5)
    shares = history[["stick", "slip", "open"]].sum(axis=1)
    np.testing.assert_allclose(shares, 1.0, atol=1e-6)
    for number in (0, np.int64(0), -len(finished.points)):
        pd.testing.assert_frame_equal(finished.history(number), history)
    count = len(finished.points)
    for nothing in ("nonsense", count, -count - 1, 0.5):
        with pytest.raises(
            ResultsError, match=rf"no design point .*0 to {count - 1}, or a point_id"
        ):
            finished.history(nothing)


def test_nothing_is_kept_where_nothing_is_asked_for(tmp_path, finished):
    """Without histories the summary is the same: it has samples of its own."""
    report = run_study(belt(save_every=0), tmp_path / "belt", jobs=1)
    assert not (report.directory / HISTORIES).exists()
    points = Results.open(tmp_path / "belt").points
    for name in ("torque_rms", "growth_rate"):
        np.testing.assert_allclose(points[name], finished.points[name], rtol=0.01)


def test_tables_do_not_depend_on_batches_or_workers(tmp_path, finished):
    points = solved(belt(more="batch = 2"), tmp_path / "belt").points
    assert points["point_id"].tolist() == finished.points["point_id"].tolist()
    for name in points.select_dtypes("number").columns.drop("wall_s"):
        np.testing.assert_allclose(points[name], finished.points[name], rtol=1e-6, err_msg=name)


def test_a_run_goes_on_where_points_are_missing(tmp_path, finished):
    directory = tmp_path / "belt"
    shutil.copytree(finished.directory, directory)
    text = BELT.format(duration=0.5, save_every=20, more="").replace("0.5, 0.9", "0.5, 0.7, 0.9")
    report = run_study(plan_of(text), directory, jobs=1)
    assert report.n_solved == 1
    assert len(Results.open(directory).points) == 6
    assert run_study(plan_of(text), directory, jobs=1).n_solved == 0


# -- continuation --------------------------------------------------------------------------------
def continued(start: Path, point: str, duration=0.2, more="") -> Plan:
    text = BELT.replace("perturbation = 1e-5\n", "")
    text = text.format(duration=duration, save_every=20, more=f'start = "{start}"\n{point}\n{more}')
    return plan_of(text.replace("[0.5, 0.9, 1.1, 1.2, 1.3]", "[0.5]"))


def test_a_final_state_goes_on(tmp_path, finished):
    """0.5 s and 0.2 s more are a run of 0.7 s."""
    name = finished.points["point_id"].iloc[0]
    plan = continued(finished.directory, f'start_point = "{name}"')
    run_study(plan, tmp_path / "more", jobs=1)
    whole = plan_of(
        BELT.format(duration=0.7, save_every=20, more="").replace(
            "[0.5, 0.9, 1.1, 1.2, 1.3]", "[0.5]"
        )
    )
    run_study(whole, tmp_path / "whole", jobs=1)
    more, all_of_it = Results.open(tmp_path / "more"), Results.open(tmp_path / "whole")
    end = more.history(more.points["point_id"][0])["torque"].to_numpy()
    same = all_of_it.history(all_of_it.points["point_id"][0])["torque"].to_numpy()
    # the torque of the first row is that of an instant, of all others a mean over the last step
    np.testing.assert_allclose(end[1:], same[1 - len(end) :], atol=1e-3 * np.ptp(same))
    np.testing.assert_allclose(end[0], same[-len(end)], rtol=0.01)
    assert more.points["perturbation"][0] == 0.0


def test_start_of_nothing(tmp_path):
    with pytest.raises(StudyFileError, match="there are none in"):
        run_study(continued(tmp_path / "nowhere", ""), tmp_path / "out", jobs=1)


def test_start_needs_a_choice_of_points(tmp_path, finished):
    with pytest.raises(StudyFileError, match="has 5 final states: name one by start_point"):
        run_study(continued(finished.directory, ""), tmp_path / "out", jobs=1)
    plan = continued(finished.directory, 'start_point = "feed"')
    with pytest.raises(StudyFileError, match="is not finished, failed, or is unknown"):
        run_study(plan, tmp_path / "out", jobs=1)


def test_start_of_another_model(tmp_path, finished):
    name = finished.points["point_id"].iloc[0]
    plan = continued(finished.directory, f'start_point = "{name}"')
    text = plan.study.source.text.replace("[modes]", "[parameters]\nfriction = 0.6\n[modes]")
    with pytest.raises(
        StudyFileError, match=r"another model, basis, .*version.* run that study again"
    ):
        run_study(plan_of(text), tmp_path / "out", jobs=1)


def test_start_of_an_unfinished_point(tmp_path, finished):
    directory = tmp_path / "belt"
    shutil.copytree(finished.directory, directory)
    shutil.rmtree(directory / STATES)
    with pytest.raises(StudyFileError, match=r"no design point of .* has reached its end"):
        run_study(continued(directory, ""), tmp_path / "out", jobs=1)


def test_start_of_a_complex_mode_study(tmp_path):
    text = BELT[: BELT.index("[transient]")].replace('"transient"', '"complex_modes"')
    run_study(plan_of(text), tmp_path / "modes", jobs=1)
    with pytest.raises(StudyFileError, match="which has no final state"):
        run_study(continued(tmp_path / "modes", ""), tmp_path / "out", jobs=1)


def test_no_perturbation_at_a_stable_point(tmp_path):
    """Allowed, and reported: nothing moves."""
    text = BELT.format(duration=0.1, save_every=20, more="").replace("1e-5", "0.0")
    points = solved(plan_of(text.replace("0.5, 0.9, 1.1, ", "")), tmp_path / "belt").points
    assert (points["class"] == "stable").all()
    assert (points["perturbation"] == 0.0).all()
    assert points["growth_rate"].isna().all()


def test_a_failed_point_is_a_row_and_the_others_go_on(tmp_path):
    """Friction too soft to saturate at the belt's speed has no steady sliding to start from."""
    text = BELT.format(duration=0.1, save_every=20, more="")
    text = text.replace(
        "[modes]", '[[sweep]]\nparameter = "contact.kt"\nvalues = [0, 1e3]\n[modes]'
    )
    points = solved(text, tmp_path / "belt").points
    soft = points["contact.kt"] == 1e3
    assert (points.loc[~soft, "status"] == "ok").all()
    assert (points.loc[soft, "status"] == "parameter").all()
    assert (points.loc[soft, "class"] == "failed").all()
    assert points.loc[soft, "message"].str.contains("must saturate at the sliding speed").all()
    assert points.loc[soft, "torque_rms"].isna().all()
    assert soft.sum() == 5
    found = ["n_unstable", "n_unstable_above", "settled", "dominant_mode", "halvings"]
    assert points.loc[soft, found].isna().all(axis=None)  # unknown, not none
    assert points.loc[~soft, found].notna().all(axis=None)
    assert points["n_unstable"].dtype == "Int64"
    assert points["settled"].dtype == "boolean"


HOFFMANN = """\
[study]
name = "hoffmann"
kind = "{kind}"
[model]
name = "hoffmann"
contact_law = "unilateral"
[parameters]
friction = 5.0
sliding_speed = -0.5
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.3, 0.8, 5.0]
[modes]
band = [10.0, 1000.0]
"""


def steady_friction(friction):
    """Of Hoffmann's mass, the belt pulling it the other way, N: the balance of two springs."""
    k, angles = np.array([178633.0, 2.48803e6]), np.deg2rad([150.0, 30.0])
    c, s, contact = np.cos(angles), np.sin(angles), 4e6 / 3
    K = np.array([[k @ c**2, k @ (c * s)], [k @ (c * s), k @ s**2]])
    K[:, 1] += contact * np.array([friction, 1.0])
    return friction * contact * np.linalg.solve(K, [0.0, 100.0])[1]


@pytest.mark.parametrize("kind", ["transient", "limit_cycles"])
def test_parameters_without_steady_sliding_fail_their_own_points_alone(kind, tmp_path):
    """The basis is made at less friction: that of [parameters] jams the mass."""
    text = HOFFMANN.format(kind=kind)
    if kind == "transient":
        text += "[transient]\nduration = 0.02\nstep = 1e-5\nslope_pilot = 'never'\n"
    else:
        text += "[limit_cycles]\nreach = 0.01\nundecided_in_time = false\n"
    points = solved(text, tmp_path / kind).points.sort_values("friction")
    assert points["status"].tolist() == ["ok", "ok", "working_point"]
    assert steady_friction(5.0) < 0.0
    if kind == "transient":
        forces = points["torque_mean"].abs()[:2]
        assert forces.tolist() == pytest.approx([steady_friction(x) for x in (0.3, 0.8)], rel=1e-3)
        text = text.replace("values = [0.3, 0.8, 5.0]", "values = [5.0]")
        with pytest.raises(ResultsError, match="every design point failed"):
            solved(text, tmp_path / "none")


def test_steps_that_are_halves_are_seen_at_equal_times():
    def rows(step, save_every=0):
        return steps_between_rows(save_every, step, 8000.0) * step

    assert {f"{rows(h):.1e}" for h in (1.25e-7, 2.5e-7, 5e-7, 1e-6, 2e-6, 4e-6, 8e-6)} == {
        "8.0e-06"
    }
    assert rows(2e-5) == 2e-5
    assert rows(1e-6, 30) == pytest.approx(6e-6)  # a divisor of what is kept


def test_a_training_step_makes_one_basis_of_many_steps():
    def training(**changes):
        more = "".join(f"{k} = {v}\n" for k, v in {"modes_below": 1e3, **changes}.items())
        return training_path(belt(more="pod_vectors = 1\n" + more), "key")

    given = {"pod_step": 1e-4}
    assert training(**given) != training()
    assert training(**given) == training(**given, tolerance=1e-5, method='"exponential"')
    assert training(pod_step=2e-5) == training()  # that of the study
    assert training(pod_duration=0.02) != training()


@pytest.mark.parametrize(
    ("model", "law", "friction", "kick"),
    [("hoffmann", 'contact_law = "unilateral"\n', 1.0, 1e-3), ("hulten", "", 0.5, 1e-2)],
)
def test_growth_that_ends_within_few_periods_is_told_by_no_table(
    tmp_path, model, law, friction, kick
):
    """Energies gave 818 and 506 1/s, from one flank of a ripple, for 188 and 101."""
    text = study_text("short", "transient", model) + (
        f"{law}[parameters]\ndamping_ratio = 0.01\nfriction = {friction}\n"
        "[modes]\nband = [20.0, 1500.0]\n"
        f"[transient]\nduration = 0.1\nstep = 5e-6\nperturbation = {kick}\n"
        'save_every = 5\nslope_pilot = "never"\n'
    )
    results = solved(text, tmp_path / "r")
    row, fit = results.points.iloc[0], results.growth.iloc[0]
    assert row["growth_method"] == fit["fit_status"] == "too_short"
    assert np.isnan([row["growth_rate"], row["growth_rate_low"], fit["fitted_growth_rate"]]).all()
    assert not len(growth_pairs(results.growth, results.points))
