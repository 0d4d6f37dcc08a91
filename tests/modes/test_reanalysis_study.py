"""Methods of reanalysis in studies: choice, charts, boxes, tables, audit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import MU_C, hulten_stiffness
from study_runs import plan_of, solved

from squealstudy.engine.forecast import Estimate, _timed, run_seconds
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers
from squealstudy.errors import ConvergenceError, StudyFileError
from squealstudy.kinds.complex_modes import full_order_check as reference
from squealstudy.kinds.complex_modes import problems
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.problems import chart_of, swept_structures
from squealstudy.kinds.complex_modes.solve_tasks import solve_points, solve_tasks, split_boxes

HULTEN = """
[study]
name = "flutter"
kind = "complex_modes"

[model]
name = "hulten"

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 41

[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
BRAKE = """
[study]
name = "map"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "coarse"

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.7
num = {friction}

[[sweep]]
parameter = "pressure"
start = 2e5
stop = 30e5
num = {pressure}
scale = "log"

[modes]
"""


def run(text, tmp_path, name="results"):
    return solved(text, tmp_path / name)


def closed_form(mu):
    """Both roots of Hulten's model of imaginary part >= 0, or of either sign of a pair."""
    lam = np.sqrt(-np.linalg.eigvals(hulten_stiffness(mu)).astype(complex))
    return np.concatenate([lam, -lam, lam.conj(), -lam.conj()])


def largest_error(results):
    modes = results.modes.merge(results.points[["point_id", "friction"]], on="point_id")
    size = 2 * np.pi * modes["frequency_hz"].to_numpy()
    real = modes["growth_rate"].to_numpy()
    lam = real + 1j * np.sqrt(np.maximum(size**2 - real**2, 0.0))
    exact = [
        np.abs(closed_form(mu) - x).min() for mu, x in zip(modes["friction"], lam, strict=True)
    ]
    return float((np.array(exact) / size).max())


@pytest.mark.parametrize("method", ["dense", "full", "sweep_basis", "windows", "two_step"])
def test_every_rung_finds_hultens_roots_through_flutter(tmp_path, method):
    results = run(HULTEN + f'method = "{method}"\n', tmp_path)
    assert set(results.points["method"]) == {method}
    assert (results.points["n_modes"] == 2).all()
    assert largest_error(results) < 1e-7  # the flutter point itself is no design point
    assert results.manifest["method"]["points"] == {method: 41}
    assert (results.modes["error_estimate"] < 1e-3).all()


def test_perturbation_fails_beyond_flutter_and_says_so(tmp_path):
    results = run(HULTEN + 'method = "perturbation"\n', tmp_path)
    assert largest_error(results) > 1e-3
    size = 2 * np.pi * results.modes["frequency_hz"]
    assert (results.modes["error_estimate"] / size).max() > 1e-3


@pytest.mark.parametrize(
    ("model", "start", "stop"),
    [("hulten", 0.1, 0.6), ("hulten", 0.2, 0.3), ("hoffmann", 0.3, 1.0), ("hoffmann", 0.5, 0.7)],
)
def test_perturbation_tells_no_root_as_sure_that_it_is_not(tmp_path, model, start, stop):
    """Through lock-in: told errors hold the exact root, stability is told right or not at all."""
    text = HULTEN.replace('"hulten"', f'"{model}"').replace("stop = 0.6", f"stop = {stop}")
    text = text.replace("start = 0.0", f"start = {start}").replace(
        "[[sweep]]", "[parameters]\ndamping_ratio = 0.01\n[[sweep]]"
    )
    found, exact = (
        run(f'{text}method = "{method}"\n', tmp_path, method)
        for method in ("perturbation", "dense")
    )
    one_modes, other_modes = (
        r.modes.merge(r.points[["point_id", "friction"]], on="point_id").groupby("friction")
        for r in (found, exact)
    )
    held = []
    for (_, one), (_, other) in zip(one_modes, other_modes, strict=True):
        lam, sure = (
            m["growth_rate"].to_numpy() + 2j * np.pi * m["frequency_hz"].to_numpy()
            for m in (one, other)
        )
        apart = np.abs(lam[:, None] - sure[None, :])
        held += (apart.min(axis=1) <= one["error_estimate"].to_numpy()).tolist()
        nearest = other["stability"].to_numpy()[apart.argmin(axis=1)]
        told = one["stability"].to_numpy()
        assert ((told == nearest) | (told == "uncertain")).all()
    assert np.mean(held) >= 0.85
    finite = np.isfinite(found.modes["error_estimate"])
    assert finite.sum() > 10  # not told by giving up
    assert (found.points["status"] == "ok").all()


def test_perturbation_of_a_band_without_modes(tmp_path):
    text = HULTEN.replace("band = [1.0, 1000.0]", "band = [400.0, 1000.0]")
    points = run(text + 'method = "perturbation"\n', tmp_path).points
    assert set(points["method"]) == {"perturbation"}
    assert (points["n_modes"] == 0).all()


def test_windows_resume_to_the_same_tables(tmp_path):
    text = HULTEN + 'method = "windows"\n'
    whole = run(text, tmp_path, "whole")
    again = run(text, tmp_path, "again")
    chunks = sorted((tmp_path / "again" / "chunks").glob("*.parquet"))
    chunks[0].unlink()
    for name in ("points.parquet", "modes.parquet", "onsets.parquet"):
        (tmp_path / "again" / name).unlink()
    again = run(text, tmp_path, "again")
    assert again.modes.equals(whole.modes)


def test_an_audit_compares_estimates_with_full_order(tmp_path):
    results = run(HULTEN + 'method = "sweep_basis"\naudit = 0.25\n', tmp_path)
    audit = results.manifest["audit"]
    assert audit["points"] == 11
    assert 6 <= audit["modes"] < 22  # those beyond flutter are not light
    assert audit["missed_modes"] == 0
    assert audit["largest_true_error"] < 1e-9


def test_another_tolerance_is_another_point(tmp_path):
    one = plan_of(HULTEN + 'method = "windows"\ntolerance = 1e-4\n')
    two = plan_of(HULTEN + 'method = "windows"\ntolerance = 1e-5\n')
    exact = plan_of(HULTEN + 'method = "dense"\ntolerance = 1e-5\n')
    auto = plan_of(HULTEN)
    assert one.tasks[0].point_id != two.tasks[0].point_id
    assert exact.tasks[0].point_id == auto.tasks[0].point_id  # exact results serve any tolerance


@pytest.mark.parametrize(
    ("friction", "pressure", "method"),
    [(41, 20, "windows"), (15, 10, "dense"), (201, 1, "windows")],
)
def test_auto_takes_windows_where_there_are_points_enough(tmp_path, friction, pressure, method):
    text = BRAKE.format(friction=friction, pressure=pressure)
    if pressure == 1:
        ends = 'start = 2e5\nstop = 30e5\nnum = 1\nscale = "log"'
        text = text.replace(ends, "values = [2e5]")
    plan = plan_of(text)
    assert plan.method.name == method
    assert "points" in plan.method.reason


@pytest.mark.parametrize(
    ("method", "least", "longest"),
    [("auto", 150.0, 600.0), ("dense", 380.0, 1200.0), ("two_step", 180.0, 700.0)],
)
def test_time_is_estimated_by_the_method_that_serves_the_points(tmp_path, method, least, longest):
    """820 points of 1 s exactly, two workers."""
    text = BRAKE.format(friction=41, pressure=20) + f'method = "{method}"\n'
    cost = Estimate(0, None, 1.0, None, None, "")
    low, high = run_seconds(plan_of(text), cost, 820, 2)
    assert least < low < high < longest


def test_the_first_timed_point_is_timed_without_imports(tmp_path):
    class Slow(ComplexModes):
        calls = 0

        def time_point(self, plan, task):
            self.calls += 1
            return 0.5 if self.calls == 1 else 1e-3

    plan = plan_of(HULTEN)
    assert _timed(Slow(), plan, plan.tasks[:3]) == ([1e-3, 1e-3, 1e-3], "")


DAMPED = "\n[parameters]\n{name} = 0.02\n"


@pytest.mark.parametrize(
    ("name", "method"), [("damping_ratio", "windows"), ('"modes[3].damping_ratio"', "dense")]
)
def test_auto_keeps_to_dense_with_damping_of_single_assembly_modes(tmp_path, name, method):
    plan = plan_of(BRAKE.format(friction=41, pressure=20) + DAMPED.format(name=name))
    assert plan.method.name == method
    assert (name.strip('"') in plan.method.reason) == (method == "dense")


def test_auto_keeps_to_dense_with_modal_damping_over_many_parameters(tmp_path):
    more = '[[sweep]]\nparameter = "{}"\nvalues = [{}, {}]\n'
    sweeps = more.format("contact.lambda", 4e5, 6e5) + more.format("sliding_speed", 0.5, 1.0)
    text = BRAKE.format(friction=41, pressure=20).replace("[modes]", sweeps + "[modes]")
    undamped = DAMPED.format(name="damping_ratio").replace("0.02", "0.0")
    assert plan_of(text + undamped).method.name == "sweep_basis"
    plan = plan_of(text + DAMPED.format(name="damping_ratio"))
    assert plan.method.name == "dense"
    assert "damping_ratio" in plan.method.reason


def test_a_single_mode_without_the_damping_of_all_is_seen(tmp_path):
    text = BRAKE.format(friction=41, pressure=20) + DAMPED.format(name="damping_ratio")
    assert plan_of(text).method.name == "windows"
    same = plan_of(text + '"modes[1].damping_ratio" = 0.02\n')
    assert same.method.name == "windows"
    other = plan_of(text + '"modes[1].damping_ratio" = 0.0\n')
    assert other.method.name == "dense"
    assert "modes[1].damping_ratio" in other.method.reason


@pytest.mark.parametrize("method", ["two_step", "perturbation"])
@pytest.mark.parametrize("single", ["", '"modes[2].damping_ratio" = 0.03\n'])
def test_rungs_for_comparison_serve_modal_damping(tmp_path, method, single):
    """As exactly as without it: two steps keep all real modes here, the step from 0.2 is small."""
    narrow = HULTEN.replace("0.0\nstop = 0.6\nnum = 41", "0.19\nstop = 0.21\nnum = 3")
    damped = DAMPED.format(name="damping_ratio") + "stiffness_damping = 2e-5\n" + single
    found = run(narrow + f'method = "{method}"\n' + damped, tmp_path)
    exact = run(narrow + 'method = "dense"\n' + damped, tmp_path, "exact")
    assert set(found.points["method"]) == {method}
    off = (found.modes["growth_rate"] - exact.modes["growth_rate"]).abs().max()
    assert off < {"two_step": 1e-9, "perturbation": 5e-3}[method]
    assert exact.modes["growth_rate"].max() < -0.5  # so that damping is seen


@pytest.mark.parametrize("method", ["windows", "sweep_basis"])
def test_a_band_without_modes_has_no_basis(tmp_path, method):
    text = HULTEN.replace("[1.0, 1000.0]", "[300.0, 400.0]") + f'method = "{method}"\n'
    with pytest.raises(StudyFileError, match=r"line \d+, key 'modes.method': .*no mode lies"):
        run(text, tmp_path)


def test_a_study_narrowed_in_its_directory_makes_the_basis_of_its_smaller_box(tmp_path):
    """All its points are there; those in between, which tracking and onsets ask for, are not."""
    values = [round(0.05 * i, 2) for i in range(13)]
    for used in (values, values[:8]):
        text = HULTEN.replace("start = 0.0\nstop = 0.6\nnum = 41", f"values = {used}")
        results = run(text + 'method = "sweep_basis"\n', tmp_path)
        assert len(results.points) == len(used)
        assert results.onsets["onset"].tolist() == pytest.approx([MU_C], abs=1e-3)
    assert results.manifest["timings"]["points_solved"] == 0


def test_without_a_basis_auto_solves_all_points_exactly(tmp_path, monkeypatch):
    def refuse(*arguments):
        raise ConvergenceError("not_converged", "nothing is smooth here")

    def windows_anyway(*arguments):
        return "windows", "for the test"

    monkeypatch.setattr("squealstudy.kinds.complex_modes.kind.make_basis", refuse)
    monkeypatch.setattr("squealstudy.engine.method._cheapest", windows_anyway)
    text = HULTEN.replace("num = 41", "num = 17") + "tolerance = 3.7e-5\n"  # a box of its own
    results = run(text, tmp_path)
    assert set(results.points["method"]) == {"dense"}
    assert (results.points["status"] == "ok").all()
    assert "nothing is smooth here" in results.manifest["method"]["reason"]
    with pytest.raises(StudyFileError, match="nothing is smooth here"):
        run(text + 'method = "windows"\n', tmp_path, "other")


def test_windows_with_damping_of_single_assembly_modes_are_refused(tmp_path):
    text = BRAKE.format(friction=4, pressure=2)
    text += 'method = "windows"\n' + DAMPED.format(name='"modes[3].damping_ratio"')
    with pytest.raises(StudyFileError, match=r"study.toml, line \d+, key 'modes.method': .*single"):
        plan_of(text).tasks[0]


@given(mu=st.floats(0.0, 0.7), pressure=st.floats(2e5, 30e5), speed=st.floats(0.1, 3.0))
def test_a_chart_gives_back_the_design(mu, pressure, speed):
    text = BRAKE.format(friction=3, pressure=3).replace(
        "[modes]", '[[sweep]]\nparameter = "sliding_speed"\nvalues = [0.1, 0.5, 3.0]\n[modes]'
    )
    plan = plan_of(text)
    chart = chart_of(plan.tasks, ["friction", "pressure", "sliding_speed"])
    assert chart.scalings == ("linear", "log", "reciprocal")
    values = {"friction": mu, "pressure": pressure, "sliding_speed": speed}
    theta = chart.theta(np.array([[values[name] for name in chart.names]]))[0]
    assert (np.abs(theta) <= 1).all()
    back = chart.design_at(theta).values
    for name in chart.names:
        assert back[name] == pytest.approx(values[name], rel=1e-12, abs=1e-12)


@given(
    n=st.integers(1, 300),
    d=st.integers(0, 3),
    most=st.integers(5, 60),
    seed=st.integers(0, 20),
)
def test_boxes_part_the_points(n, d, most, seed):
    theta = np.random.default_rng(seed).integers(-4, 5, (n, d)) / 4.0
    boxes = split_boxes(theta, most)
    rows = np.concatenate([rows for rows, _ in boxes])
    assert sorted(rows) == list(range(n))
    for rows, box in boxes:
        assert box.holds(theta[rows]).all()
        assert len(rows) <= most or not (box.high > box.low).any()


def test_a_failure_of_the_method_leaves_its_points_to_the_exact_rung(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ConvergenceError("not_converged", "no anchor")

    monkeypatch.setattr("squealstudy.modes.rungs.perturbation.make_anchor", fail)
    plan = plan_of(HULTEN + 'method = "perturbation"\n')
    (task, *_) = solve_tasks(plan, plan.tasks, Workers())
    build_structures(plan, Workers())
    rows = solve_points(task).rows
    assert len(rows) == len(task.points)
    assert {(row["status"], row["method"]) for row in rows} == {("ok", "dense")}


def test_a_box_without_a_basis_names_the_way_out(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ConvergenceError("working_point", "most of the box has no working point")

    monkeypatch.setattr("squealstudy.kinds.complex_modes.kind.make_basis", fail)
    with pytest.raises(StudyFileError, match=r"key 'modes.method': no sweep basis .*dense"):
        run(HULTEN + 'method = "windows"\n', tmp_path)


def test_a_method_in_another_kind_of_study_is_refused(tmp_path):
    text = HULTEN.replace('"complex_modes"', '"transient"') + 'method = "windows"\n'
    with pytest.raises(StudyFileError, match=r"key 'modes.method': a transient study"):
        plan_of(text).tasks[0]


def test_a_structure_that_was_not_built_needs_no_basis(tmp_path):
    """Its points are failed rows already; the others get theirs."""
    plan = plan_of(HULTEN + 'method = "windows"\ntolerance = 3.9e-5\n')
    (task,) = swept_structures(plan)
    unbuilt = replace(task, key="0" * 16)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("squealstudy.kinds.complex_modes.kind.swept_structures", lambda _: [unbuilt])
        ComplexModes().prepare(plan, lambda *_: None)
    assert not unbuilt.has_basis
    build_structures(plan, Workers())
    ComplexModes().prepare(plan, lambda *_: None)
    assert task.has_basis


def test_an_assembly_is_built_once_and_never_without_the_modes_that_a_design_changes(monkeypatch):
    """Two studies of one structure in one process, the second with component modes."""
    made = []

    def point(*modes):
        def assembly():
            made.append(modes)
            return object()

        return SimpleNamespace(structure="key", mode_parameters=lambda: modes, assembly=assembly)

    monkeypatch.setattr(reference, "_built", {})
    monkeypatch.setattr(reference, "component_modes", lambda assembly, cutoff: {"pad": cutoff})
    settings = SimpleNamespace(component_cutoff=1.0)
    first = reference.unreduced_assembly(point(), settings)
    assert reference.unreduced_assembly(point(), settings) is first
    assert first[1] == {}
    assert reference.unreduced_assembly(point("pad.modes[7]"), settings)[1] == {"pad": 1.0}
    assert len(made) == 2


@pytest.mark.parametrize(("tolerance", "trained"), [(1e-2, 1e-4), (1e-4, 1e-4), (1e-6, 1e-6)])
def test_a_looser_tolerance_has_no_dearer_basis(tmp_path, monkeypatch, tolerance, trained):
    """A shorter cut would ask for more training points: that of 1e-4 serves looser ones."""
    asked = []
    made = problems.build_sweep_basis

    def watched(problem, to, **more):
        asked.append(to)
        return made(problem, to, **more)

    monkeypatch.setattr(problems, "build_sweep_basis", watched)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))  # no basis is there yet
    run(HULTEN + f'method = "sweep_basis"\ntolerance = {tolerance}\n', tmp_path)
    assert asked == [pytest.approx(problems.BASIS_TOLERANCE_SHARE * trained)]
