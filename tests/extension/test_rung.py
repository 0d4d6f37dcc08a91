"""A rung from outside the package, in use in a study."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from squealstudy import open_results
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.errors import ConvergenceError, ExtensionError, StudyFileError
from squealstudy.modes import rungs
from squealstudy.modes.rungs import all_rungs, exact_rung, register_rung, rung_named, rung_names
from squealstudy.study.definition import parse_study

FILE = Path(__file__).with_name("my_rung.py")
HULTEN = """
[study]
name = "interpolated"
kind = "complex_modes"

[model]
name = "hulten"

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.2
num = 21

[modes]
band = [1.0, 1000.0]
reference_points = 0
method = "linear"
"""
SECOND = '[[sweep]]\nparameter = "damping_ratio"\nvalues = [0.0, 0.01]\n[modes]'
W1, W2 = 2 * np.pi * 100.0, 2 * np.pi * 75.0


@pytest.fixture
def linear(monkeypatch):
    """The rung of my_rung.py, registered for a test."""
    monkeypatch.setattr(rungs, "_registered", {})
    spec = spec_from_file_location("my_rung", FILE)
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "my_rung", module)
    spec.loader.exec_module(module)
    return rung_named("linear")


def plan_of(text, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return Plan(parse_study(text, path))


def closed_form(mu):
    """Both frequencies of Hulten's undamped model below flutter, Hz."""
    K = np.array([[W1**2, -mu * W2**2], [mu * W1**2, W2**2]])
    return np.sort(np.sqrt(np.linalg.eigvals(K).real)) / (2 * np.pi)


def found_frequencies(results):
    modes = results.modes.merge(results.points[["point_id", "friction"]], on="point_id")
    modes = modes.sort_values(["friction", "frequency_hz"])
    return modes, np.concatenate([closed_form(mu) for mu in np.unique(modes["friction"])])


@pytest.mark.usefixtures("linear")
def test_a_rung_of_ones_own_serves_a_study_by_name_and_its_error_holds(tmp_path):
    run_study(plan_of(HULTEN, tmp_path), tmp_path / "r", jobs=1)
    results = open_results(tmp_path / "r")
    assert set(results.points["method"]) == {"linear"}
    modes, exact = found_frequencies(results)
    off = np.abs(modes["frequency_hz"].to_numpy() - exact)
    chord = (closed_form(0.0) + closed_form(0.2)) / 2 - closed_form(0.1)
    assert off.max() == pytest.approx(np.abs(chord).max(), rel=0.03)
    assert (off[:2] < 1e-9).all()  # the ends are exact
    assert (2 * np.pi * off <= modes["error_estimate"].to_numpy() + 1e-9).all()


def test_results_know_the_file_of_a_rung_from_outside(linear, tmp_path, monkeypatch):
    before = plan_of(HULTEN, tmp_path).tasks[0].point_id
    monkeypatch.setattr(type(linear), "source_hash", "another text")
    assert plan_of(HULTEN, tmp_path).tasks[0].point_id != before


def test_what_a_rung_of_ones_own_leaves_over_is_solved_exactly(linear, tmp_path, monkeypatch):
    solve = type(linear).solve

    def half(self, problem, points, box):
        for i, found in solve(self, problem, points, box):
            if i == 10:
                raise ConvergenceError("not_converged", "half is enough")
            yield i, found

    monkeypatch.setattr(type(linear), "solve", half)
    run_study(plan_of(HULTEN + "track = false\n", tmp_path), tmp_path / "r", jobs=1)
    served = open_results(tmp_path / "r").points["method"]
    assert served.tolist() == ["linear"] * 10 + ["dense"] * 11
    why = open_results(tmp_path / "r").manifest["method"]["left_over"]
    assert why == {
        "points": 11,
        "first": "left over by linear: not_converged: half is enough",
    }


@pytest.mark.usefixtures("linear")
def test_a_rung_says_why_it_cannot_serve_a_study_and_others_are_named(tmp_path):
    text = HULTEN.replace("[modes]", SECOND)
    message = (
        r"key 'modes.method': linear serves one parameter, 2 vary: expected one of dense, full"
    )
    with pytest.raises(StudyFileError, match=message):
        plan_of(text, tmp_path).tasks  # noqa: B018 - the method is looked at with the points


def test_a_name_that_no_rung_has_is_refused_with_the_names_there_are(tmp_path):
    with pytest.raises(StudyFileError, match=r"expected one of 'auto', 'dense', .*got 'linear'"):
        plan_of(HULTEN, tmp_path)
    with pytest.raises(KeyError):
        rung_named("linear")


@pytest.mark.parametrize("name", ["dense", "auto"])
def test_a_name_of_the_package_is_taken(linear, monkeypatch, name):
    monkeypatch.setattr(type(linear), "name", name)
    with pytest.raises(ValueError, match=f"a rung named '{name}' already"):
        register_rung(linear)


def test_a_name_of_another_extension_is_taken_and_a_class_is_no_rung(linear):
    other = type("Other", (type(linear),), {"__module__": "another_file"})
    with pytest.raises(ValueError, match="a rung named 'linear' already"):
        register_rung(other())
    with pytest.raises(TypeError, match="expected an instance of a Rung"):
        register_rung(type(linear))


def yields(change):
    """What a rung yields once its modes are changed."""

    def solve(self, problem, points, box):
        for i, found in solved(self, problem, points, box):
            yield from change(i, found)

    solved = sys.modules["my_rung"].Linear.solve
    return solve


WRONG = {
    "lam of (1,)": lambda i, found: [(i, replace(found, lam=found.lam[:1]))],
    "lam of ()": lambda i, found: [(i, replace(found, lam=found.lam[0]))],
    "shapes (1,)": lambda i, found: [(i, replace(found, shapes=found.shapes[:1]))],
    "roots of point 0 are not finite": lambda i, found: [
        (i, replace(found, lam=np.full(2, np.nan + 0j)))
    ],
    "expected an index from 0 to": lambda i, found: [(i + 30, found)],
    "yielded point 0 twice": lambda i, found: [(0, found)],
    "expected PointModes": lambda i, found: [(i, found.lam)],
    "expected to yield an index and modes": lambda i, found: [found],
    "IndexError": lambda i, found: [(i, found.lam[99])],
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_answer_of_a_rung_ends_a_study_with_its_name(
    linear, tmp_path, monkeypatch, message
):
    monkeypatch.setattr(type(linear), "solve", yields(WRONG[message]))
    with pytest.raises(ExtensionError, match=rf"my_rung.py: rung 'linear': .*{re.escape(message)}"):
        run_study(plan_of(HULTEN, tmp_path), tmp_path / "r", jobs=1)


def test_roots_in_any_order_under_any_name_are_put_right(linear, tmp_path, monkeypatch):
    def backwards(i, found):
        turned = ("lam", "residual", "error_rung", "shapes")
        parts = {name: getattr(found, name)[::-1] for name in turned}
        yield i, replace(found, **parts, energies=found.energies[:, ::-1], method="dense")

    monkeypatch.setattr(type(linear), "solve", yields(backwards))
    run_study(plan_of(HULTEN, tmp_path), tmp_path / "r", jobs=1)
    results = open_results(tmp_path / "r")
    assert set(results.points["method"]) == {"linear"}
    assert (results.modes.groupby("point_id")["frequency_hz"].diff().dropna() > 0).all()


@pytest.mark.parametrize(
    ("error", "why"),
    [(1.0, "estimated error 1.0e[+]00, beyond the tolerance"), (np.nan, "an error is not known")],
)
def test_points_beyond_the_tolerance_are_solved_exactly(linear, tmp_path, monkeypatch, error, why):
    def wide(i, found):
        worst = error * np.abs(found.lam) if i % 2 else 0.0 * found.error_rung
        yield i, replace(found, error_rung=worst)

    monkeypatch.setattr(type(linear), "solve", yields(wide))
    monkeypatch.setattr(type(linear), "keeps_tolerance", True)
    run_study(plan_of(HULTEN, tmp_path), tmp_path / "r", jobs=1)
    results = open_results(tmp_path / "r")
    assert results.points["method"].tolist() == ["linear", "dense"] * 10 + ["linear"]
    left = results.points["message"][1::2]
    assert left.str.fullmatch(f"left over by linear: {why}.*").all()
    assert (results.points["message"][::2] == "").all()
    assert results.manifest["method"]["left_over"]["points"] == 10
    exact = results.modes[results.modes["method"] == "dense"].merge(results.points, on="point_id")
    for mu, own in exact.groupby("friction"):
        assert own["frequency_hz"].to_numpy() == pytest.approx(closed_form(mu), rel=1e-12)


def test_onsets_that_a_rung_leaves_over_are_found_exactly(linear, tmp_path, monkeypatch):
    """The lock-in of Hulten's model lies between points; alone, points fail this rung."""

    def several(self, problem, points, box):
        if len(points) == 1:
            raise ConvergenceError("not_converged", "not alone")
        return rung_named("dense").solve(problem, points, box)

    monkeypatch.setattr(type(linear), "solve", several)
    text = HULTEN.replace("stop = 0.2", "stop = 0.5").replace("num = 21", "num = 6")
    run_study(plan_of(text, tmp_path), tmp_path / "r", jobs=1)
    onsets = open_results(tmp_path / "r").onsets
    at = (W1**2 - W2**2) / (2 * W1 * W2)  # the discriminant's zero
    assert onsets["onset"].to_numpy() == pytest.approx([at], rel=1e-4)
    assert onsets["status"].tolist() == ["refined"]


def test_every_rung_is_found_by_its_file_under_its_own_name():
    names = ("dense", "full", "perturbation", "sweep_basis", "two_step", "windows")
    assert rung_names() == names
    assert tuple(rung.name for rung in all_rungs()) == names
    assert all(rung.description for rung in all_rungs())
    assert (exact_rung(reduced=True).name, exact_rung(reduced=False).name) == ("dense", "full")
