"""Method-stability studies: files, cells, tables, screens."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from shared_kernels import marks_of_case
from study_runs import load_plan
from typer.testing import CliRunner

from squealstudy import open_results
from squealstudy.cli import app as cli
from squealstudy.cli.app import app
from squealstudy.engine.runner import run_study
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.kinds.method_stability.screen import SCREEN
from squealstudy.screen import as_text
from squealstudy.tables.method_quality import agreement

SHIPPED = sorted((Path(__file__).parents[2] / "studies" / "stability").glob("*.toml"))
CAUTIOUS = ("tracking_step",)  # the prediction is where labels may go wrong, not where they do
MAP = """
[study]
name = "map"
kind = "method_stability"
[method_stability]
case = "orthonormalisation"
set.held = 10.0
[[knob]]
name = "dependence"
start = 1e-9
stop = 1e-1
num = 5
scale = "log"
[[knob]]
name = "tolerance"
values = [1e-7, 1e-3]
"""


@pytest.fixture
def write(tmp_path):
    def file(text):
        path = tmp_path / "map.toml"
        path.write_text(text)
        return path

    return file


def test_a_map_of_methods_has_no_mesh_error(write):
    with pytest.raises(SquealstudyError, match=r"map\.toml: --mesh-error .* has not"):
        cli.check(write(MAP), None, 1, mesh_error=True)


def test_cells_of_a_map(write, tmp_path):
    path = write(MAP)
    report = run_study(load_plan(path), tmp_path / "out", 1)
    cells = open_results(tmp_path / "out").cells
    assert len(cells) == 10
    np.testing.assert_allclose(cells["dependence"][:5], np.geomspace(1e-9, 1e-1, 5))
    assert (cells["tolerance"][:5] == 1e-7).all()  # the first knob varies fastest
    assert report.n_solved == 10
    assert report.manifest["agreement"] == 1.0
    assert report.manifest["unflagged_wrong"] == 0
    assert set(cells["outcome"]) == {"converged", "recovered", "failed"} & set(cells["outcome"])
    assert run_study(load_plan(path), tmp_path / "out", 1).n_solved == 0


def test_the_answer_names_the_method_and_counts_right_cells_and_warnings():
    manifest = {"counts": {"converged": 5, "slow": 2, "recovered": 1, "wrong": 3, "failed": 1}}
    manifest |= {"title": "roots of small matrices", "judged": 10, "unpredicted_failures": 1}
    outcomes = ["converged"] * 5 + ["slow"] * 2 + ["recovered"] + ["wrong"] * 3 + ["failed"]
    cells = pd.DataFrame({"outcome": outcomes, "flagged": [True] + [False] * 6 + [True] * 5})
    results = SimpleNamespace(manifest=manifest, table=lambda _: cells)
    manifest |= {"unflagged_wrong": 0, "agreement": 0.7}
    assert SCREEN.verdict(results) == (
        "Roots of small matrices: right in 8 of 12 cells, in 1 of them thanks to a help that steps "
        "in. In 4 it is wrong or has no result, and each says so. A warning also stands at 1 "
        "of those that are right without help and at 1 of those that are right with a help. "
        "Of 10 cells that lie 2 % or more away from the "
        "boundary of theory 70 % are as predicted; those with a help count as predicted; 2 are "
        "right beyond it by themselves; 1 is not right within it."
    )
    manifest |= {"unflagged_wrong": 2, "agreement": None}
    assert "it is wrong or has no result, 2 of these without a warning." in SCREEN.verdict(results)
    manifest["counts"] = {"converged": 1, "failed": 11}
    assert " In 11 it has no result, " in SCREEN.verdict(results)
    manifest["counts"] = {"converged": 1, "wrong": 11}
    assert " In 11 it is wrong, " in SCREEN.verdict(results)
    manifest["counts"], cells["flagged"] = {"converged": 1}, False
    assert SCREEN.verdict(results) == "Roots of small matrices: right in 1 of 1 cell."


def test_a_screen_says_what_slow_cells_are():
    cells = pd.DataFrame({"outcome": ["slow"], "flagged": [False], "a": [1.0], "b": [2.0]})
    manifest = {"counts": {"slow": 1}, "title": "a map", "unflagged_wrong": 0, "agreement": None}
    manifest |= {"knobs": ["a", "b"], "words": {"a": "one"}, "boundary": "none", "values": {}}
    results = SimpleNamespace(manifest=manifest, table=lambda _: cells, units={"a": "s"})
    text = as_text(SCREEN.findings(results))
    assert "slow 1; slow: right, but after many iterations" in text
    assert "a         1 s, 1 value: one" in text


def test_a_finer_map_keeps_the_cells_that_it_has(write, tmp_path):
    run_study(load_plan(write(MAP)), tmp_path / "out", 1)
    more = MAP.replace("[1e-7, 1e-3]", "[1e-7, 1e-5, 1e-3]")
    assert run_study(load_plan(write(more)), tmp_path / "out", 1).n_solved == 5
    assert len(open_results(tmp_path / "out").cells) == 15


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("orthonormalisation", "orthonormal", "method_stability.case", "did you mean"),
        ('"dependence"', '"dependance"', "knob[1]", "did you mean 'dependence'"),
        ("set.held", "set.hold", "method_stability.set.hold", "is none of"),
        ("set.held", "set.tolerance", "method_stability.set.tolerance", "is an axis"),
        ('"tolerance"', '"dependence"', "knob[2].name", "both axes"),
        ("start = 1e-9", "start = 0.0", "knob[1]", "a start above 0"),
        ("start = 1e-9", "start = 1.0", "knob[1]", "start < stop"),
        ("stop = 1e-1", "stop = 1e6", "knob[1]", "must be from"),
        ("values = [1e-7, 1e-3]", "start = 1.0", "knob[2]", "either values, or start and stop"),
        ("num = 5", "num = 1", "knob[1].num", "at least 2"),
        ("[[knob]]", "[[knobs]]", "knobs", "unknown key"),
        (MAP[MAP.rindex("[[knob]]") :], "", "knob", "expected two [[knob]] tables, got 1"),
    ],
)
def test_bad_files_name_the_key(write, old, new, key, message):
    with pytest.raises(StudyFileError) as error:
        load_plan(write(MAP.replace(old, new, 1 if old != "[[knob]]" else -1)))
    assert message in str(error.value)
    assert error.value.key.startswith(key)


def test_screens(write, tmp_path):
    runner, out = CliRunner(), tmp_path / "out"
    checked = runner.invoke(app, ["check", str(write(MAP)), "--output", str(out)])
    assert checked.exit_code == 0
    assert "5 x 2 over dependence and tolerance" in checked.output
    done = runner.invoke(app, ["run", str(write(MAP)), "--output", str(out), "--jobs", "1"])
    assert done.exit_code == 0, done.output
    assert "right in 10 of 10 cells" in done.output
    assert "constant    held = 10" in done.output
    assert "dependence  1e-09 to 0.1, 5 values: " in done.output
    assert "tolerance   1e-07 to 0.001, 2 values: " in done.output
    assert "slow: right, but after many iterations" not in done.output
    assert (out / "method_stability.png").stat().st_size > 10_000


def test_schema_of_experiments():
    runner = CliRunner()
    for kind, table in (("method_stability", "knob"), ("work_precision", "method")):
        shown = json.loads(runner.invoke(app, ["schema", "--kind", kind]).output)
        assert {"study", kind, table} <= set(shown["properties"])
        assert "null" not in json.dumps(shown)
    with pytest.raises(SquealstudyError, match="work_precision, model_file"):
        runner.invoke(app, ["schema", "--kind", "transient"], catch_exceptions=False)


def cells(outcomes, predicted, flagged=True):
    return pd.DataFrame({"outcome": outcomes, "predicted": predicted, "flagged": flagged})


def test_agreement_leaves_out_cells_at_the_boundary():
    found = agreement(
        cells(["converged", "failed", "failed", "converged"], [0.5, 2.0, 0.99, np.inf])
    )
    assert found["judged"] == 3
    assert found["agreement"] == pytest.approx(2 / 3)
    assert found["unpredicted_failures"] == 0
    assert agreement(cells(["failed"], [0.5]))["unpredicted_failures"] == 1
    assert agreement(cells(["failed"], [np.nan]))["agreement"] is None


def test_unflagged_wrong_cells_are_counted():
    table = cells(["wrong", "wrong", "converged"], [2.0, 2.0, 0.5], [True, False, False])
    assert agreement(table)["unflagged_wrong"] == 1


@pytest.mark.parametrize(
    "path", [pytest.param(p, id=p.stem, marks=marks_of_case(p.stem)) for p in SHIPPED]
)
def test_shipped_maps(path, tmp_path):
    """At 5 x 5 cells: nothing wrong that nothing tells of, and as predicted."""
    text = re.sub(r"num = \d+", "num = 5", path.read_text())
    small = tmp_path / path.name
    small.write_text(text)
    plan = load_plan(small)
    assert plan.owner[0] == path.stem
    found = run_study(plan, tmp_path / "out", 1).manifest
    assert found["n_failed"] == 0
    assert found["unflagged_wrong"] == 0
    assert found["unpredicted_failures"] == 0
    assert found["agreement"] >= 0.8 or path.stem in CAUTIOUS
