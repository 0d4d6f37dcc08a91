"""A kind of study from one file outside the package, run and read as any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command import command
from registries import forget_extensions
from study_runs import load_plan

from squealstudy import open_results
from squealstudy.columns import COLUMNS
from squealstudy.engine.runner import run_study
from squealstudy.errors import StudyFileError
from squealstudy.study.definition import load_study
from squealstudy.study.kinds import kind_named, kind_names, register_kind

FILE = Path(__file__).with_name("my_kind.py")
STUDY = f"""
[study]
name = "pressed"
kind = "steady_sliding"
extensions = ["{FILE}"]

[model]
name = "belt"

[parameters]
normal_force = 300.0

[[sweep]]
parameter = "friction"
values = [0.1, 0.4]

[[sweep]]
parameter = "contact_stiffness"
values = [1e7, 1e8, 1e9]
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "pressed.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_belt_presses_with_its_normal_force(study, tmp_path, jobs):
    report = run_study(load_plan(study), tmp_path / "out", jobs)
    assert report.n_solved == 6
    points = open_results(tmp_path / "out").points
    np.testing.assert_allclose(points["contact_force"], 300.0, rtol=1e-9)
    area = points["contact_stiffness"] / 5e11  # of minimal models: it carries the stiffness
    np.testing.assert_allclose(points["largest_pressure"], 300.0 / area, rtol=1e-9)
    assert run_study(load_plan(study), tmp_path / "out", 1).n_solved == 0


def test_what_it_registered_can_be_forgotten_and_registered_again(study):
    """As after the tests of every file: no other file of tests knows the kind."""
    for _ in range(2):
        load_plan(study)
        assert "steady_sliding" in kind_names()
        assert "steady_sliding" in COLUMNS
        forget_extensions()
        assert "steady_sliding" not in kind_names()
        assert "steady_sliding" not in COLUMNS


def test_commands_read_its_results_when_they_are_given_its_file(study, tmp_path):
    run_study(load_plan(study), tmp_path / "out", 1)
    refused = command("rank", "out", folder=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "squealstudy --extension FILE" in refused.stderr
    shown = command("--extension", FILE, "plot", "out", folder=tmp_path)
    assert shown.returncode == 0, shown.stderr
    wrong = command("--extension", "nowhere.py", "plot", "out", folder=tmp_path)
    assert wrong.returncode == 2
    assert "nowhere.py" in wrong.stderr


def test_a_point_that_fails_is_a_row_and_the_others_go_on(study, tmp_path, monkeypatch):
    plan = load_plan(study)
    module = __import__("sys").modules[type(plan.kind).__module__]
    solve = module.state_working_point

    def fail(prepared, state):
        if state.operating.friction == 0.1:
            raise ValueError("no contact")
        return solve(prepared, state)

    monkeypatch.setattr(module, "state_working_point", fail)
    run_study(plan, tmp_path / "out", 1)
    points = open_results(tmp_path / "out").points
    assert (points["status"] == "failed").sum() == 3
    assert points.loc[points["status"] != "ok", "contact_force"].isna().all()
    assert points.loc[points["status"] == "ok", "contact_force"].notna().all()


def test_sections_of_other_kinds_are_refused(study):
    study.write_text(STUDY + "[transient]\nstep = 1e-5\n")
    with pytest.raises(StudyFileError, match=r'needs kind = "transient", this is steady_sliding'):
        load_study(study)


def test_a_name_that_is_taken_is_refused(study):
    load_study(study)
    other = type("Other", (type(kind_named("steady_sliding")),), {"name": "transient"})
    with pytest.raises(ValueError, match="there is a kind of study 'transient' already"):
        register_kind(other())


def test_methods_of_kinds_serve_under_their_old_names_with_a_warning():
    steady_sliding = type(kind_named("steady_sliding"))
    with pytest.warns(DeprecationWarning, match="Other.ready is called make_models now"):
        other = type("Other", (steady_sliding,), {"ready": lambda self, *arguments: "models"})
    assert other().make_models(None, None, None) == "models"
    assert steady_sliding.ready is steady_sliding.make_models
