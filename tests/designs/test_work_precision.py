"""Work-precision studies: files, runs, tables, screens."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from made_results import made
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from study_runs import command, load_plan
from study_texts import study_text, sweep_text
from typer.testing import CliRunner

from squealstudy import open_results
from squealstudy.cli.app import app
from squealstudy.columns import unit_of
from squealstudy.engine.manifest_file import read_manifest, write_manifest
from squealstudy.engine.runner import run_study
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers
from squealstudy.errors import ConvergenceError, ResultsError, SquealstudyError, StudyFileError
from squealstudy.kinds.complex_modes import measuring, problems
from squealstudy.kinds.transient.measuring import pooled_findings
from squealstudy.kinds.work_precision import kind as kind_module
from squealstudy.modes.point import solve_point
from squealstudy.reduction.prepared import PreparedModel

SPEED = '"contact.regularisation_speed" = 0.08'
BELT = (
    study_text("belt_base", "transient", "belt")
    + """\
[parameters]
"contact.regularisation_speed" = 0.08
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 0.75]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.25
step = 2e-5
perturbation = 1e-1
save_every = 0
"""
)
IN_TIME = """
[study]
name = "steps"
kind = "work_precision"
[work_precision]
base = "base.toml"
points = 1
repeats = 2
quantities = ["torque_rms", "torque_mean"]
tolerance = 1e-2
[reference]
name = "small steps"
set.transient.step = 2e-6
[[method]]
name = "Newmark"
set.transient.method = "newmark"
knob = "transient.step"
values = [2e-5, 2e-4]
default = true
[[method]]
name = "Newton"
integrator = "newmark_newton"
set.transient.step = 2e-4
"""
HULTEN = (
    study_text("hulten_base", "complex_modes", "hoffmann")
    + sweep_text("friction", 0.0, 0.6, 61)
    + """\
[modes]
band = [1.0, 1000.0]
"""
)
RUNGS = """
[study]
name = "rungs"
kind = "work_precision"
[work_precision]
base = "base.toml"
points = 3
repeats = 1
[reference]
name = "dense"
set.modes.method = "dense"
[[method]]
name = "dense again"
[[method]]
name = "perturbation"
set.modes.method = "perturbation"
"""


@pytest.fixture
def write(tmp_path):
    def files(base, text):
        (tmp_path / "base.toml").write_text(base)
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return files


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """A finished study of steps."""
    place = tmp_path_factory.mktemp("steps")
    (place / "base.toml").write_text(BELT)
    (place / "study.toml").write_text(IN_TIME)
    plan = load_plan(place / "study.toml")
    report = run_study(plan, place / "results", 1)
    return plan, place / "results", report


def test_check_of_results_says_how_many_runs_there_are(steps, capsys):
    assert command("check", str(steps[1])) == 0
    assert " ok, 0 missing" in capsys.readouterr().out


def ready(path):
    """Plan of a study with its models made, and the tasks of the reference and of the last run."""
    plan = load_plan(path)
    plan.kind.make_models(plan, Workers(), print)
    first, *_, last = plan.kind.tasks(plan, plan.tasks, Workers())
    return plan, first, last


def test_smaller_steps_cost_more_and_err_less(steps):
    _, directory, report = steps
    table = open_results(directory).measurements.set_index("label")
    fine, coarse = table.loc["Newmark, step 2e-05"], table.loc["Newmark, step 0.0002"]
    assert report.n_solved == 7  # reference once, three settings twice
    assert fine["error_torque_rms"] < 0.3 * coarse["error_torque_rms"] < 0.2
    assert fine["seconds_median"] > coarse["seconds_median"] > 0
    assert (table["rounds"] == np.where(table["reference"], 1, 2)).all()
    assert table.loc["small steps", "error_torque_rms"] == 0.0
    assert (table["seconds_min"] <= table["seconds_median"]).all()
    assert fine["default"]
    assert not table.loc["Newton", "default"]


def test_newton_finds_what_the_fixed_jacobian_finds(steps):
    table = open_results(steps[1]).measurements.set_index("label")
    same = table.loc[["Newton", "Newmark, step 0.0002"], "error_torque_rms"]
    assert same.iloc[0] == pytest.approx(same.iloc[1], rel=0.1)
    assert table.loc["Newton", "iterations"] > 0


def test_errors_table_has_value_and_truth(steps):
    errors = open_results(steps[1]).errors
    rms = errors[(errors["quantity"] == "torque_rms") & (errors["label"] == "Newton")].iloc[0]
    assert rms["error"] == pytest.approx(abs(rms["value"] / rms["truth"] - 1))
    assert rms["low"] <= rms["error"] <= rms["high"]


def test_a_finished_study_is_not_run_again_and_a_broken_one_goes_on(steps):
    plan, directory, _ = steps
    assert run_study(plan, directory, 1).n_solved == 0
    chunks = sorted((directory / "chunks").glob("*.parquet"))
    lost = pq.read_metadata(chunks[0]).num_rows
    chunks[0].unlink()
    write_manifest(directory, read_manifest(directory) | {"status": "running"})
    assert run_study(plan, directory, 1).n_solved == lost > 0


def test_measured_points_lie_in_the_swept_box_and_depend_on_the_seed(write):
    first = load_plan(write(BELT, IN_TIME))
    again = load_plan(write(BELT, IN_TIME))
    other = load_plan(write(BELT, IN_TIME.replace("points = 1", "points = 1\nseed = 4")))

    def drawn(plan):
        first, *_ = plan.content
        return first.plan.swept[list(first.measured)].tolist()

    assert drawn(first) == drawn(again) != drawn(other)
    assert 0.5 < drawn(first)[0][0] < 0.75
    whole = load_plan(write(BELT, IN_TIME.replace("points = 1", "points = 0")))
    assert drawn(whole) == [[0.5], [0.75]]


def test_rungs_of_complex_modes_against_dense(write, tmp_path):
    run_study(load_plan(write(HULTEN, RUNGS)), tmp_path / "out", 1)
    table = open_results(tmp_path / "out").measurements.set_index("label")
    assert table.loc["dense again", "error_frequency"] < 1e-14
    assert table.loc["perturbation", "error_frequency"] > 1e-4
    assert table.loc["perturbation", "cost"] > 0


def test_a_reference_that_fails_is_said(write, tmp_path):
    text = IN_TIME.replace(
        "set.transient.step = 2e-6", "set.transient.step = 2e-6\nset.parameters.contact.kt = 1e-3"
    )
    with pytest.raises(ResultsError, match="reference 'small steps' failed"):
        run_study(load_plan(write(BELT.replace(SPEED, ""), text)), tmp_path / "out", 1)


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ('"work_precision"', '"work_precison"', "study.kind", "did you mean 'work_precision'"),
        ('"base.toml"', '"bass.toml"', "work_precision.base", "there is no study file"),
        ('"transient.step"', '"transient.stap"', "method[1].knob", "did you mean 'stop' or 'step'"),
        ('"torque_rms"', '"torque"', "work_precision.quantities", "'torque' is no quantity"),
        ('"newmark_newton"', '"newton"', "method[2].integrator", "'newton'"),
        ('"Newton"', '"Newmark"', "method[2].name", "two methods are called 'Newmark'"),
        ("[2e-5, 2e-4]", "[]", "method[1]", "knob and values go together"),
        ("[2e-5, 2e-4]", "[2e-5, 2e-5]", "method[1]", "appears twice"),
        ("[2e-5, 2e-4]", "[2e-5, -1.0]", "method[1].knob", "expected more than 0"),
        ("repeats = 2", "repeats = 0", "work_precision.repeats", "at least 1"),
        ("= 2e-4", '= "fast"', "method[2].set", "expected a number"),
        ('"transient.step"', '"sweep.num"', "method[1].knob", "no single table in this file"),
        ('"transient.step"', '"option.aitken"', "method[1]", "name one"),
        ("points = 1", 'points = 1\nset.transient.stop = "settled"', "method[2]", "run to the end"),
        ("values = [2e-5", "valeus = [2e-5", "method[1].valeus", "did you mean 'values'"),
    ],
)
def test_bad_files_name_the_key(write, old, new, key, message):
    path = write(BELT, IN_TIME.replace(old, new))
    with pytest.raises(StudyFileError) as error:
        load_plan(path)
    assert message in str(error.value)
    assert error.value.key.startswith(key)
    assert error.value.path == path


def test_an_integrator_needs_a_transient_base(write):
    text = RUNGS + 'integrator = "newmark"\n'
    with pytest.raises(StudyFileError, match="integrates nothing"):
        load_plan(write(HULTEN, text))


def test_screens(write, tmp_path):
    path = write(HULTEN, RUNGS)
    runner = CliRunner()
    checked = runner.invoke(app, ["check", str(path)])
    assert checked.exit_code == 0
    assert "2 settings of 2 methods" in checked.output
    done = runner.invoke(app, ["run", str(path), "--output", str(tmp_path / "out")])
    assert done.exit_code == 0
    assert "perturbation" in done.output
    assert "cheapest" in done.output
    assert (tmp_path / "out" / "work_precision.png").stat().st_size > 10_000
    with pytest.raises(ResultsError, match="no ranking of modes"):
        open_results(tmp_path / "out").rank()


def test_several_starts_widen_the_bounds():
    one = {
        "status": "ok",
        "class": "irregular",
        "values": {"torque_rms": [10.0, 9.0, 11.0], "growth_rate": [None, None, None]},
        "energy_share": {"3": 1.0},
    }
    other = one | {"values": one["values"] | {"torque_rms": [12.0, 10.0, 14.0]}}
    other |= {"energy_share": {"3": 0.5, "12": 0.5}}
    merged = pooled_findings([one, other])
    assert merged["values"]["torque_rms"] == [11.0, 9.0, 14.0]
    assert merged["values"]["growth_rate"] == [None, None, None]
    assert merged["energy_share"] == {"3": 0.75, "12": 0.25}
    failed = {"status": "not_finite", "message": "t = 1 s"}
    assert pooled_findings([one, failed]) == failed


def test_starts_differ_in_size(write, tmp_path):
    text = IN_TIME.replace("repeats = 2", "repeats = 1\nstarts = 2").replace(
        "[2e-5, 2e-4]", "[2e-5]"
    )
    run_study(load_plan(write(BELT, text)), tmp_path / "out", 1)
    errors = open_results(tmp_path / "out").errors
    rms = errors[(errors["quantity"] == "torque_rms") & (errors["label"] == "small steps")].iloc[0]
    assert rms["error"] == 0.0
    assert rms["high"] > 0.0


def table_of(**columns):
    base = {
        "label": ["a", "b", "c", "truth"],
        "method": ["one", "one", "two", "truth"],
        "value": ["1", "2", "", ""],
        "default": [True, True, False, False],
        "reference": [False, False, False, True],
        "status": ["ok", "ok", "failed", "ok"],
        "n_failed": [0, 0, 1, 0],
        "missed": 0,
        "spurious": 0,
        "cost": [1.0, 2.0, 0.5, 9.0],
        "error_x": [1e-2, 1e-3, np.nan, 0.0],
        "low_x": [5e-3, 1e-3, np.nan, 0.0],
        "high_x": [2e-2, 1e-3, np.nan, 0.0],
        "chance_x": [1.5e-2, 0.0, np.nan, 0.0],
        "within_x": [True, False, False, False],
    }
    return pd.DataFrame(base | columns)


def work_precision(table, quantities, tolerance, facts):
    facts = facts | {"quantities": quantities, "tolerance": tolerance}
    return made("work_precision", measurements=table, facts=facts).plot.work_precision()


def test_picture_draws_front_failures_and_tolerance():
    figure = work_precision(table_of(), ["x"], 1e-2, {"over": 10, "reference": "truth"})
    axes = figure.axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines["one"].get_xdata()) == [1.0, 2.0]
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert [list(c.get_xdata()) for c in crosses] == [[0.5]]
    dashed = [line for line in axes.lines if list(line.get_ydata()) == [1e-2, 1e-2]]
    assert dashed


def test_an_error_of_zero_stands_a_decade_below_the_others():
    table = table_of(error_x=[1e-2, 0.0, np.nan, 0.0])
    axes = work_precision(table, ["x"], 1e-2, {"over": 10, "reference": "truth"}).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert lines["one"].get_ydata() == pytest.approx([1e-2, 1e-3])
    assert [text.get_text() for text in axes.texts] == ["1", "error 0"]


def test_values_of_close_neighbours_do_not_overlap():
    columns = {"error_x": [1e-3, 1e-3, 1e-3, 0.0], "value": ["0.0001", "0.001", "0.01", ""]}
    columns |= {"cost": [1.0, 1.2, 1.44, 50.0], "status": "ok", "n_failed": 0, "method": "one"}
    columns |= {"low_x": np.nan, "high_x": np.nan, "within_x": False, "default": True}
    table = table_of(**columns)
    figure = work_precision(table, ["x"], 1e-2, {"over": 10, "reference": "truth"})
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text, renderer) for text in figure.axes[0].texts]
    assert len(boxes) == 3
    assert not boxes[0].overlaps(boxes[1])
    assert not boxes[1].overlaps(boxes[2])


@pytest.mark.parametrize(("unit", "word"), [("N", "friction force"), ("N m", "torque")])
def test_picture_calls_friction_by_what_it_is(unit, word):
    table = table_of().rename(columns=lambda name: name.replace("_x", "_torque_rms"))
    facts = {"over": 10, "reference": "truth", "units": {"torque": unit}}
    figure = work_precision(table, ["torque_rms"], 1e-2, facts)
    assert figure.axes[0].get_ylabel() == f"{word} RMS [relative]"


def test_a_method_whose_model_cannot_be_made_is_a_failed_row(write, tmp_path, monkeypatch):
    plan, first, last = ready(write(BELT, IN_TIME.replace("repeats = 2", "repeats = 1")))
    monkeypatch.setattr(kind_module, "is_prepared", lambda _: False)
    assert plan.kind.solve(last).rows[0]["status"] == "structure"
    with pytest.raises(ResultsError, match="no reduction of its model can be made"):
        plan.kind.solve(first)


def test_preparing_goes_on_where_one_model_cannot_be_made(write, monkeypatch):
    plan = load_plan(write(BELT, IN_TIME))
    asked = []

    def build(plan, workers):
        asked.append(plan)
        if len(asked) == 2:
            raise SquealstudyError("singular")
        return build_structures(plan, workers)

    monkeypatch.setattr(kind_module, "build_structures", build)
    plan.kind.make_models(plan, Workers(), print)
    assert len(asked) == 4


def test_rounds_alternate_over_the_methods(write):
    runs = [run.content for run in load_plan(write(BELT, IN_TIME)).tasks]
    order = [(variant.label, number) for variant, number in runs]
    labels = ["Newmark, step 2e-05", "Newmark, step 0.0002", "Newton"]
    assert order == [("small steps", 0), *((x, 0) for x in labels), *((x, 1) for x in labels)]


def test_cost_has_its_share_of_the_set_up(steps):
    table = open_results(steps[1]).measurements
    over = open_results(steps[1]).manifest["over"]
    assert over == 2
    share = table["cost"] - table["seconds_median"]
    np.testing.assert_allclose(share, table["setup_seconds"] / over, atol=1e-12)


FLUTTER = HULTEN.replace("hoffmann", "hulten").replace("num = 61", "num = 7")
ONSETS = """
[study]
name = "onsets"
kind = "work_precision"
[work_precision]
base = "base.toml"
points = 2
repeats = 1
quantities = ["onset"]
[work_precision.set]
modes.track = false
[reference]
name = "dense"
set.modes.method = "dense"
[[method]]
name = "sweep basis"
set.modes.method = "sweep_basis"
[[method]]
name = "perturbation"
set.modes.method = "perturbation"
[[method]]
name = "interpolated"
set.modes.refine_onsets = false
"""
LOCK_IN = (100**2 - 75**2) / (2 * 100 * 75)  # friction at which Hulten's two modes merge


@pytest.fixture(scope="module")
def onsets(tmp_path_factory):
    """Results of a study of the lock-in of Hulten's model."""
    place = tmp_path_factory.mktemp("onsets")
    (place / "base.toml").write_text(FLUTTER)
    (place / "study.toml").write_text(ONSETS)
    run_study(load_plan(place / "study.toml"), place / "results", 1)
    return open_results(place / "results")


def onset_of(results, label):
    errors = results.errors
    (row,) = errors[(errors["quantity"] == "onset") & (errors["label"] == label)].to_dict("records")
    return row


def test_onset_of_hulten_by_each_method(onsets):
    basis, reference = onset_of(onsets, "sweep basis"), onset_of(onsets, "dense")
    assert reference["truth"] == pytest.approx(LOCK_IN, abs=1e-4)
    assert basis["value"] == pytest.approx(LOCK_IN, abs=1e-4)
    assert basis["high"] * LOCK_IN <= 4.1e-4  # that of root finding, of both
    read_off = onset_of(onsets, "interpolated")
    assert read_off["error"] == pytest.approx(abs(read_off["value"] / reference["value"] - 1))
    assert read_off["value"] == 0.3  # nothing is damped before: the first point that is unstable
    assert read_off["high"] >= abs(read_off["value"] / LOCK_IN - 1)  # somewhere between two points


def test_a_method_that_misleads_about_the_onset_is_seen_to(onsets):
    assert onset_of(onsets, "perturbation")["error"] > 1e-3


def test_cost_of_an_onset_is_that_of_its_line_and_root_finding(onsets):
    table = onsets.measurements.set_index("label")
    assert (table["onset_seconds"] > 7 * table["seconds_median"]).all()
    share = table["cost_onset"] - table["onset_seconds"]
    np.testing.assert_allclose(share, 7 * table["setup_seconds"] / 7, rtol=1e-9)


def test_measured_points_on_one_line_share_it(write):
    second = '[[sweep]]\nparameter = "stiffness_damping"\nvalues = [1e-6, 1e-5, 1e-4]\n'
    base = FLUTTER.replace("[modes]", second + "[modes]")

    def lines(text):
        variant, *_ = load_plan(write(base, text)).content
        swept = variant.plan.swept
        return variant, {n: swept[list(rows)] for n, rows in variant.lines.items()}

    variant, found = lines(ONSETS)
    for n, line in found.items():
        own = variant.plan.swept[variant.measured[n]]
        assert set(line[:, 1]) == {own[1]}
        assert line[:, 0] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert list(found) == [0, 1]
    assert list(lines(ONSETS.replace("points = 2", "points = 0"))[1]) == [0, 7, 14]


def test_a_line_with_a_failed_point_has_no_onset(write, tmp_path, monkeypatch):
    def fail(prepared, state, band, known=None):
        if state.operating.friction == 0.6:
            raise ConvergenceError("not_converged", "no working point")
        return solve_point(prepared, state, band, known)

    plan, _, last = ready(write(FLUTTER, ONSETS))
    monkeypatch.setattr(problems, "solve_point", fail)
    (row,) = plan.kind.solve(last).rows
    assert row["status"] == "not_converged"
    assert row["message"] == "on the line of onset: no working point"


@pytest.mark.parametrize(
    ("base", "message"),
    [
        (FLUTTER.replace("num = 7", "num = 1"), "over two values or more"),
        (FLUTTER + '[design]\ntype = "sobol"\nsamples = 8\n', "found on lines of a grid"),
        (BELT, "'onset' is no quantity of a transient study"),
    ],
)
def test_onsets_need_lines(write, base, message):
    base = base.replace("num = 7\n", "") if "sobol" in base else base
    with pytest.raises(StudyFileError, match=message) as error:
        load_plan(write(base, ONSETS))
    assert error.value.key == "work_precision.quantities"


def test_an_onset_is_drawn_over_its_own_cost():
    table = table_of(
        error_onset=[1e-2, 1e-3, np.nan, 0.0],
        low_onset=[1e-2, 1e-3, np.nan, 0.0],
        high_onset=[1e-2, 1e-3, np.nan, 0.0],
        within_onset=False,
        chance_onset=0.0,
        cost_onset=[10.0, 20.0, 5.0, 90.0],
    )
    facts = {"over": 10, "reference": "truth"}
    first, second = work_precision(table, ["x", "onset"], 1e-2, facts).axes
    for axes, factor in ((first, 1.0), (second, 10.0)):
        lines = {line.get_label(): list(line.get_xdata()) for line in axes.lines}
        assert lines["one"] == [factor, 2 * factor]
        crosses = [list(k.get_xdata()) for k in axes.lines if k.get_marker() == "x"]
        assert crosses == [[0.5 * factor]]
    assert "an onset" in second.get_xlabel()


@pytest.mark.parametrize(("unreduced", "size"), [(True, 27000), (False, 447)])
def test_a_model_at_full_order_has_all_its_degrees_of_freedom(monkeypatch, unreduced, size):
    """The table had the size of the reduced model, of which nothing was solved."""
    prepared = object.__new__(PreparedModel)
    for name, item in {"model": SimpleNamespace(n=447), "n_dof": 27000}.items():
        object.__setattr__(prepared, name, item)
    monkeypatch.setattr(measuring, "load_any", lambda _: prepared)
    plan = SimpleNamespace(method=SimpleNamespace(rung=SimpleNamespace(unreduced=unreduced)))
    assert measuring._n_coordinates(plan, "key") == size


@pytest.mark.parametrize("column", ["error", "low", "high", "median", "chance", "within"])
def test_errors_of_growth_are_relative(column):
    """Their unit was told as 1/s, in the tables' own schema and in the report."""
    assert unit_of(f"{column}_growth_rate", "measurements") == ""
    assert unit_of("reference", "measurements") == ""
    assert unit_of("growth_rate", "points") == "1/s"
