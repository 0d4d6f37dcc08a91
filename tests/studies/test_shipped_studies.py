"""Every shipped study, at reduced size, with one of its numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from study_runs import plan_of, solved
from tiny_meshes import tiny_cache, tiny_meshes

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.kinds.design.plan import first_plan
from squealstudy.modes.point import solve_point
from squealstudy.study.components import inspected
from squealstudy.study.definition import load_any

SHIPPED = Path(__file__).parents[2] / "studies"
STUDIES = sorted(SHIPPED.glob("*.toml"))
OUTSIDE = sorted((SHIPPED / "outside_data").glob("*.toml"))


QUICK = ("[modes]", "[modes]\nrefine_tracking = false\nrefine_onsets = false\nreference_points = 0")


@pytest.fixture
def tiny():
    """For one test alone: those of full size below have the coarse mesh."""
    with tiny_meshes(tiny_cache()):
        yield


def reduced(name: str, num: int, *changes: tuple[str, str]) -> Plan:
    """The study with the coarse mesh, a narrower band and `num` values a sweep; and changes.

    Without enrichment all studies of the brake have one reduction.
    """
    path = next(p for p in STUDIES if p.stem == name)
    text = path.read_text().replace('"medium"', '"coarse"\ncontact_points = 2')
    text = text.replace("8000.0", "4000.0")
    text = re.sub(r"num = \d+", f"num = {num}", text)
    text = text.replace("[modes]", "[reduction]\nenrichment = false\n\n[modes]")
    for old, new in changes:
        text = text.replace(old, new)
    return plan_of(text, path)


def results_of(plan: Plan, directory: Path) -> Results:
    results = solved(plan, directory)
    assert (results.points["status"] == "ok").all()
    assert (results.points["working_point_residual"] < 1e-10).all()
    assert (results.modes["residual"] < 1e-13).all()
    return results


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: p.stem)
def test_file_is_valid_and_named_after_its_study(path: Path) -> None:
    study = load_any(path)
    assert study.definition.study.name == path.stem
    if study.kind.of_methods:
        assert study.kind.plan(study).tasks[0]


@pytest.mark.parametrize("path", OUTSIDE, ids=lambda p: p.stem)
def test_file_that_needs_outside_data_is_valid(path: Path, m0_files, monkeypatch) -> None:
    monkeypatch.setenv("SQUEALSTUDY_DATA", str(m0_files.parent))
    test_file_is_valid_and_named_after_its_study(path)


def test_no_other_study_needs_outside_data() -> None:
    assert {path.stem for path in OUTSIDE} == {"m0_speed", "reanalysis_m0"}
    for path in STUDIES:
        assert not {"matrices", "m0"} & set(re.findall(r"\w+", path.read_text())), path


def test_the_design_study_that_is_timed() -> None:
    """As its page says: 192 operating points, six targets."""
    plan = first_plan(load_any(SHIPPED / "benchmarks" / "quiet_brake.toml"))
    assert len(plan.tasks) == 192
    assert len(plan.design_study.variables) == 6
    assert all(".modes[" in v.name for v in plan.design_study.variables)


def test_the_study_of_limit_cycles_that_is_timed() -> None:
    """As its page says: 200 designs of one structure."""
    plan = Plan(load_any(SHIPPED / "benchmarks" / "brake_verdicts.toml"))
    assert len(plan.tasks) == 200
    assert len(plan.structures) == 1
    assert plan.study.section.share_curves


@pytest.mark.full_size
def test_own_brake() -> None:
    """Its files are understood without a doubt, and are small.

    By default its design study below, and models of other files in test_model_file.py.
    """
    study = load_any(SHIPPED / "own_brake" / "own_brake.toml")
    assert study.definition.study.name == "own_brake"
    found, _ = inspected(study.model)
    assert not found.doubts
    texts = [text for _, text in found.facts]
    assert sum("6 rigid modes" in text for text in texts) == 4
    assert sum("100.0 % of the slave" in text for text in texts) == 2
    assert sum(p.stat().st_size for p in (SHIPPED / "own_brake").iterdir()) < 3e6


@pytest.mark.full_size("a worn pad")  # has a day apart from other long ones
def test_worn_pad(tmp_path: Path) -> None:
    """As the gallery says: worn pads squeal near 3.15 kHz, and hardly at 3.8 kHz as new ones do."""
    path = SHIPPED / "own_brake" / "worn_pad.toml"
    text = path.read_text().replace("start = 0.3\nstop = 0.6\nnum = 4", "values = [0.5]")
    results = solved(plan_of(text, path), tmp_path / "worn")
    found = results.modes.merge(results.points[["point_id", "worn"]], on="point_id")

    def growth(worn: float, low: float, high: float) -> float:
        inside = found[(found["worn"] == worn) & found["frequency_hz"].between(low, high)]
        return inside["growth_rate"].max()

    assert growth(0.0, 3750.0, 3850.0) > 10 * growth(1e4, 3750.0, 3850.0) > 0.0
    assert growth(0.0, 3050.0, 3250.0) < -50.0
    assert growth(1e4, 3050.0, 3250.0) == pytest.approx(300.0, rel=0.05)


@pytest.mark.full_size("an own brake with brackets")  # has a day apart from other long ones
def test_own_abutment(tmp_path: Path) -> None:
    """As the gallery says: pads that slide on their brackets squeal sooner and faster."""
    path = SHIPPED / "own_brake" / "own_abutment.toml"
    assert not inspected(load_any(path).model)[0].doubts
    text = path.read_text().replace(
        "start = 0.1\nstop = 0.7\nnum = 7", "values = [0.1, 0.2, 0.3, 0.7]"
    )
    results = solved(plan_of(text, path), tmp_path / "abutment")
    of_points = results.points[["point_id", "friction", "abutment_state"]]
    growth = results.modes.merge(of_points).groupby(["friction", "abutment_state"])["growth_rate"]
    largest = growth.max().unstack()
    assert largest.loc[[0.1, 0.2], 1.0].max() < 0 < largest.loc[[0.1, 0.2], 0.0].min()
    assert largest[0.0][0.7] / largest[1.0][0.7] == pytest.approx(3.7, abs=0.05)
    onsets = results.onsets
    stuck = onsets[(onsets["abutment_state"] == 1.0) & (onsets["direction"] == "in")]
    assert stuck["onset"].min() == pytest.approx(0.213, abs=5e-4)


@pytest.mark.full_size
def test_rotor_angle(tmp_path: Path) -> None:
    """As the gallery says, and with the clip alone: of 0 kg the angles are the same."""
    path = SHIPPED / "own_brake" / "rotor_angle.toml"
    text = path.read_text().replace('"45 deg", "90 deg", ', "").replace("num = 4", "num = 2")
    points = solved(plan_of(text, path), tmp_path / "clip").points
    at_least = points[points["friction"] == 0.3].set_index("rotor_angle")["n_unstable"]
    assert at_least.to_dict() == {0.0: 0, 135.0: 1}
    bare = text.replace("60 g", "0 g").replace("stop = 0.6\n", "stop = 0.4\n")
    results = solved(plan_of(bare, path), tmp_path / "bare")
    growth = results.modes.merge(results.points[["point_id", "friction", "rotor_angle"]])
    largest = growth.groupby(["friction", "rotor_angle"])["growth_rate"].max().unstack()
    assert largest[135.0].to_numpy() == pytest.approx(largest[0.0].to_numpy(), rel=1e-4)


def test_pads_of_one_mean_friction() -> None:
    """What the inner pad has more than the mean, the outer has less."""
    plan = plan_of((SHIPPED / "pad_friction.toml").read_text())
    assert len(plan.structures) == 5
    for task in plan.tasks:
        factors = [task.values[f"{pad}_pad.friction_factor"] for pad in ("inner", "outer")]
        assert np.mean(factors) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.full_size
def test_pad_friction(tmp_path: Path) -> None:
    """As the gallery says: pads alike are stable up to the highest friction."""
    path = SHIPPED / "pad_friction.toml"
    text = path.read_text().replace("stop = 1.3\nnum = 5", "stop = 1.3\nnum = 3")
    results = solved(plan_of(text, path), tmp_path / "pads")
    onsets = results.onsets.query("direction == 'in'")
    first = onsets.groupby("inner_pad.friction_factor")["onset"].min()
    assert first.loc[0.7] == pytest.approx(0.184, abs=2e-3)
    assert first.loc[1.0] == pytest.approx(0.287, abs=2e-3)
    assert first.loc[1.3] == pytest.approx(0.214, abs=2e-3)


def test_own_brake_design() -> None:
    """As its page says: nine operating points, a mass and damping."""
    plan = first_plan(load_any(SHIPPED / "own_brake" / "own_brake_design.toml"))
    assert len(plan.tasks) == 9
    study = plan.design_study
    assert [v.name for v in study.variables] == ["added_mass.caliper.GUIDES", "damping_ratio"]
    assert [(v.low, v.high) for v in study.variables] == [(0.0, 0.3), (0.0, pytest.approx(0.02))]
    assert plan.band_hz == (500.0, 9000.0)  # the mode at 6.3 kHz takes the most damping


def test_least_change_is_a_small_question() -> None:
    """Two operating points and no check that takes minutes: it ends in about a minute."""
    plan = first_plan(load_any(SHIPPED / "least_change.toml"))
    assert len(plan.tasks) == 2
    goal = plan.design_study.goal
    assert (goal.in_time, goal.full_order, goal.cycles or 0) == (0, 0, 0)


@pytest.mark.full_size
def test_least_change(tmp_path: Path) -> None:
    """As the gallery says: damping alone, and all points between meet the margin in the end."""
    path = SHIPPED / "least_change.toml"
    results = solved(first_plan(load_any(path)), tmp_path / "least")
    proof = results.proof
    last = proof[proof["round"] == proof["round"].max()]
    assert last["passed"].astype(bool).all()
    assert "0.005 -> 0.0156" in results.screen.verdict(results)


def test_hulten_flutter(tmp_path: Path) -> None:
    results = results_of(reduced("hulten_flutter", 121), tmp_path / "r")
    threshold = results.rank()["threshold"].iloc[0]
    assert 0.2916667 - 0.005 <= threshold <= 0.2916667 + 0.005


def test_friction_pressure(tiny, tmp_path: Path) -> None:
    fewer = ("values = [2e5, 4e5, 8e5, 12e5, 20e5, 30e5]", "values = [2e5, 12e5, 30e5]")
    lower = ("stop = 0.7", "stop = 0.5")  # where the smallest mesh squeals
    once = ("[modes]", "[modes]\nreference_points = 1")
    plan = reduced("friction_pressure", 3, fewer, lower, once)
    results = results_of(plan, tmp_path / "r")
    points = results.points
    assert len(points) == 9
    assert (points.loc[points["friction"] == 0, "n_unstable"] == 0).all()  # nothing drives it
    assert points.loc[points["friction"] == 0.5, "n_unstable"].max() >= 1
    assert np.nanmax(points["reference_frequency_error"]) < 2e-2  # without enrichment


@pytest.mark.full_size
def test_friction_pressure_map(tmp_path: Path) -> None:
    """By default windows of the brake: test_sweep_basis.py, studies: test_reanalysis_study.py."""
    plan = reduced("friction_pressure_map", 23, QUICK)
    results = solved(plan, tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    assert (results.points["working_point_residual"] < 1e-8).all()
    served = results.manifest["method"]["points"]
    assert sum(served.values()) == 529
    assert served["windows"] > 200
    for task in plan.tasks[7::89]:  # against the exact rung, at points of no grid line of nodes
        exact = solve_point(load_prepared(task.structure), task.state(), plan.band_hz)
        found = results.modes[results.modes["point_id"] == task.point_id]
        within = np.abs(exact.lam) < 2 * np.pi * plan.band_hz[1] * (1 - 1e-4)
        light = exact.lam[within & (np.abs(exact.lam.real) < 0.05 * np.abs(exact.lam))]
        zeta = -light.real / np.abs(light)
        frequency = np.abs(light) / (2 * np.pi)
        near = np.abs(frequency[:, None] - found["frequency_hz"].to_numpy()).argmin(axis=1)
        assert within.sum() <= len(found) <= within.sum() + 1  # one may be on either side
        assert np.abs(found["frequency_hz"].to_numpy()[near] / frequency - 1).max() < 1e-4
        assert np.abs(found["damping_ratio"].to_numpy()[near] - zeta).max() < 1e-4


@pytest.mark.full_size
def test_robust_brake(tmp_path: Path) -> None:
    """By default the file is read above, and test_robust.py has the same of minimal models."""
    fewer = ("samples = 64", "samples = 8"), ("[modes]", "[modes]\nreference_points = 0")
    plan = reduced("robust_brake", 0, *fewer)
    results = results_of(plan, tmp_path / "r")
    table = results.robust()
    assert (table["points"] == 16).all()
    assert table["probability"].is_monotonic_decreasing
    assert table["probability"].iloc[0] > 0.5
    indices = results.sobol_indices(top=0).set_index("parameter")
    assert indices.index.tolist() == results.swept
    assert indices["total"].between(0, 2).all()
    assert indices["total"]["caliper.modes[7-9].frequency_scale"] < indices["total"].max()


def test_stability_boundary(tiny, tmp_path: Path) -> None:
    fewer = ("levels = 3", "levels = 1"), ("stop = 0.7", "stop = 0.5")
    plan = reduced("stability_boundary", 3, *fewer, QUICK)
    results = results_of(plan, tmp_path / "r")
    nodes, solved = results.nodes
    assert len(nodes) == 5 * 5
    assert len(results.points) == solved.sum() <= 25
    assert (nodes.loc[nodes["friction"] == 0, "n_unstable"] == 0).all()  # nothing drives it
    assert nodes["n_unstable"].max() >= 1


@pytest.mark.full_size  # two studies of a brake
def test_caliper_modes_and_damping_agree_where_nothing_is_changed(tiny, tmp_path: Path) -> None:
    bare = "sliding_speed = 0.5\ndamping_ratio = 0.0\nstiffness_damping = 0.0"
    fewer = ("stop = 1.5", "stop = 1.0")
    plan = reduced("caliper_modes", 2, QUICK, fewer, ("sliding_speed = 0.5", bare))
    modes = results_of(plan, tmp_path / "modes")
    damping = results_of(reduced("caliper_damping", 2, QUICK), tmp_path / "damping")
    same = modes.points[(modes.points.filter(like="caliper") == 1.0).all(axis=1)]
    none = damping.points[(damping.points.filter(like="caliper") == 0.0).all(axis=1)]
    assert len(same) == len(none) == 1

    def roots(results: Results, point_id: str) -> np.ndarray:
        found = results.modes[results.modes["point_id"] == point_id]
        return found[["frequency_hz", "growth_rate"]].to_numpy()

    np.testing.assert_allclose(
        roots(modes, same["point_id"].iloc[0]), roots(damping, none["point_id"].iloc[0]), atol=1e-6
    )
    shifted = modes.modes.groupby("point_id")["growth_rate"].max()
    assert np.ptp(shifted) > 1.0  # a shifted caliper changes who squeals


@pytest.mark.full_size
def test_sensitivity(tmp_path: Path) -> None:
    """By default test_sensitivity_study.py, and a material of test_component_damping.py."""
    plan = reduced(
        "sensitivity",
        1,
        ('modes = "unstable"', "modes = 1"),
        ('    "disc.modes[*].frequency_scale",\n', ""),
        ('    "inner_pad.modes[*].frequency_scale",\n', ""),
        ('    "caliper.density",\n', ""),
        ('    "disc.young_modulus",\n', ""),
    )
    table = solved(plan, tmp_path / "r").sensitivities
    assert table["frequency_hz"].nunique() == 1
    assert table["frequency_hz"].between(3000.0, 3600.0).all()  # the first lock-in
    assert (table["residual"] < 1e-9).all()
    fastest = table[(table["mode"] == 1) & ~table["near_coalescence"]]
    seen = fastest[fastest["predicted_growth_change"].abs() > 1.0]
    assert {"friction", "pressure", "caliper.modes[7].damping_ratio"} <= set(seen["parameter"])
    assert "caliper.young_modulus" in set(seen["parameter"])
    ratio = seen["finite_growth_change"] / seen["predicted_growth_change"]
    assert ratio.between(0.8, 1.25).all()


def test_groan_to_honk(tmp_path) -> None:
    """At 0.1 m/s pad and caliper stick and slip, at 0.2 m/s the pad alone; for a shorter time."""
    path = SHIPPED / "lumped" / "groan_to_honk.toml"
    text = path.read_text().replace("duration = 1.0", "duration = 0.5")
    text = text.replace("[0.1, 0.12, 0.15, 0.2, 0.3]", "[0.1, 0.2]").replace("1e-6", "5e-6")
    points = solved(plan_of(text, path), tmp_path / "groan").points
    assert (points["status"] == "ok").all()
    assert points["torque_mean"].to_list() == pytest.approx([666.2, 640.6], rel=0.02)
    assert points["torque_rms"].to_list() == pytest.approx([165.2, 140.1], rel=0.05)
    assert points["frequency_hz"][1] == pytest.approx(440.0, rel=0.02)


def test_abutment(tmp_path) -> None:
    """Stuck the onset does not follow the abutment's friction; sliding it does, and is lost."""
    path = SHIPPED / "lumped" / "abutment.toml"
    text = path.read_text().replace("num = 13", "num = 4")
    onsets = solved(plan_of(text, path), tmp_path / "abutment").onsets
    refined = onsets[onsets["status"] == "refined"].set_index(
        ["abutment_state", "abutment_friction"]
    )
    onset = refined["onset"][refined["direction"] == "in"]
    assert onset[1.0].to_list() == pytest.approx([0.247] * 4, abs=1e-3)
    assert onset[0.0].round(3).to_dict() == {0.0: 0.26, 0.1: 0.253}
    below = onsets[onsets["status"] == "below_range"]
    assert below["abutment_friction"].round(1).to_list() == [0.3]


@pytest.mark.full_size  # a stop against own integration: test_schedules.py
def test_groan_stop(tmp_path) -> None:
    """The honk falls with the speed until pad and caliper groan; then the pad sticks."""
    path = SHIPPED / "lumped" / "groan_stop.toml"
    text = path.read_text().replace("step = 2e-6", "step = 4e-6")
    table = solved(plan_of(text, path), tmp_path / "stop").windows
    honk = table["frequency_hz"][1:13].to_numpy()
    assert honk[0] == pytest.approx(446.0, rel=0.01)
    assert (np.diff(honk[np.isfinite(honk)]) < 0).all()
    assert table["torque_line_hz"][15:17].max() < 300.0
    assert table["class"].tolist()[1:17] == ["stick_slip"] * 16
    assert table["stick_share"].iloc[-1] == pytest.approx(1.0)


@pytest.mark.full_size
def test_turning_disc(tmp_path) -> None:
    """Falling friction decides at 0.2 m/s, gyroscopic terms at 12.8 m/s."""
    path = SHIPPED / "turning_disc.toml"
    text = path.read_text().replace("0.4, 0.8, 1.6, 3.2, 6.4, ", "")
    text = text.replace("start = 0.20\nstop = 0.34\nnum = 8", "values = [0.20]")
    points = solved(plan_of(text, path), tmp_path / "disc").points
    keys = ["sliding_speed", "gyroscopic_factor", "friction_law.static_ratio"]
    unstable = points.set_index(keys)["n_unstable"]
    assert {place for place, count in unstable.items() if count} == {
        (0.2, 0.0, 1.2),
        (0.2, 1.0, 1.2),
        (12.8, 1.0, 1.0),
        (12.8, 1.0, 1.2),
    }
