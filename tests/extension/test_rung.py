"""A rung from outside the package, in use in a study."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from squealstudy import extensions, open_results
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.errors import ConvergenceError, ExtensionError, StudyFileError
from squealstudy.kinds.complex_modes.screen import SCREEN
from squealstudy.models import catalogue
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


@pytest.mark.usefixtures("linear")
def test_the_error_line_says_that_checked_points_are_the_nodes(tmp_path):
    text = HULTEN.replace("reference_points = 0", "reference_points = 2")
    run_study(plan_of(text, tmp_path), tmp_path / "r", jobs=1)
    facts = dict(SCREEN.facts(open_results(tmp_path / "r")))
    told = (
        r"by its own estimate the method errs by less than 0.001 % there, but by [\d.]+ % elsewhere"
    )
    assert re.search(told, facts["error"])
    between = text.replace("reference_points = 2", "reference_points = 3")
    run_study(plan_of(between, tmp_path), tmp_path / "between", jobs=1)
    facts = dict(SCREEN.facts(open_results(tmp_path / "between")))
    assert "its own estimate" not in facts["error"]


CROSSING = """
[study]
name = "crossing"
kind = "complex_modes"

[model]
name = "matrices"

[[model.term]]
matrix = "M"
file = "M.npz"

[[model.term]]
matrix = "K"
file = "K.npz"

[[model.term]]
matrix = "C"
file = "C.npz"

[[model.term]]
matrix = "K"
file = "rise.npz"
coefficient = "friction"

[parameters]
friction = 0.5

[[sweep]]
parameter = "friction"
start = 0.0
stop = 1.0
num = 11

[modes]
band = [10.0, 1000.0]
reference_points = 0
method = "linear"
"""


@pytest.mark.usefixtures("linear")
def test_the_error_holds_where_two_uncoupled_modes_cross(tmp_path):
    rising, level, damping = (2 * np.pi * 100.0) ** 2, (2 * np.pi * 109.0) ** 2, [1.0, 40.0]
    rise = 0.21 * rising
    terms = {"M": [1.0, 1.0], "K": [rising, level], "C": damping, "rise": [rise, 0.0]}
    for name, diagonal in terms.items():
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(np.diag(diagonal)))
    run_study(plan_of(CROSSING, tmp_path), tmp_path / "r", jobs=1)
    results = open_results(tmp_path / "r")
    assert set(results.points["method"]) == {"linear"}
    modes = results.modes.merge(results.points[["point_id", "friction"]], on="point_id")
    assert modes["residual"].isna().all()
    for c, k, slope in zip(damping, (rising, level), (rise, 0.0), strict=True):
        own = modes[np.isclose(modes["growth_rate"], -c / 2, rtol=1e-9)]
        assert len(own) == 11
        assert own["track"].nunique() == 1
        exact = np.sqrt(k + slope * own["friction"]) / (2 * np.pi)
        off = 2 * np.pi * (own["frequency_hz"] - exact).abs()
        assert (off <= own["error_estimate"] + 1e-9).all()


def test_results_know_the_file_of_a_rung_from_outside(linear, tmp_path, monkeypatch):
    before = plan_of(HULTEN, tmp_path).tasks[0].point_id
    monkeypatch.setattr(type(linear), "source_hash", "another text")
    assert plan_of(HULTEN, tmp_path).tasks[0].point_id != before


def keys_with(folder, monkeypatch, file, text, helper="", study=HULTEN):
    """Structure and identity of the first point of a study with this text as an extension."""
    folder.mkdir()
    (folder / file).write_text(text)
    (folder / "constants_of_it.py").write_text(helper)
    monkeypatch.setattr(rungs, "_registered", {})
    monkeypatch.setattr(extensions, "_read", dict(extensions._read))  # no worker is to execute it
    monkeypatch.setattr(catalogue, "MODELS", dict(catalogue.MODELS))
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "constants_of_it", raising=False)
    named = study.replace("[model]", f'extensions = ["{file}"]\n\n[model]', 1)
    task = plan_of(named, folder).tasks[0]
    return task.structure, task.point_id


def test_an_edited_rung_names_rows_anew_but_no_reduction(tmp_path, monkeypatch):
    text = FILE.read_text()
    structure, row = keys_with(tmp_path / "a", monkeypatch, FILE.name, text)
    edited = keys_with(
        tmp_path / "b", monkeypatch, FILE.name, text.replace("SAFETY = 1.5", "SAFETY = 2")
    )
    assert edited[0] == structure
    assert edited[1] != row


def test_an_edited_model_names_a_reduction_anew(tmp_path, monkeypatch):
    text = FILE.with_name("my_model.py").read_text() + "# a copy\n"
    study = """
[study]
name = "rubbed"
kind = "complex_modes"

[model]
name = "rubbed_mass"

[[sweep]]
parameter = "added_mass"
values = [0.5, 1.0]

[modes]
band = [1.0, 1000.0]
"""
    before = keys_with(tmp_path / "a", monkeypatch, "my_model.py", text, study=study)
    monkeypatch.delitem(catalogue.MODELS, "rubbed_mass")
    after = keys_with(tmp_path / "b", monkeypatch, "my_model.py", text + "# edited\n", study=study)
    assert after[0] != before[0]


def test_modules_beside_a_rung_are_part_of_its_identity(tmp_path, monkeypatch):
    text = FILE.read_text().replace("SAFETY = 1.5", "from constants_of_it import SAFETY")
    before = keys_with(tmp_path / "a", monkeypatch, FILE.name, text, "SAFETY = 1.5")
    after = keys_with(tmp_path / "b", monkeypatch, FILE.name, text, "SAFETY = 2.5")
    assert after[1] != before[1]
    (tmp_path / "b" / "constants_of_it.py").write_text("SAFETY = 3.5")
    with pytest.raises(ExtensionError, match="has changed since it was executed"):
        extensions.load_extension(tmp_path / "b" / FILE.name)


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
        plan_of(text, tmp_path).tasks[0]


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


def changed(**parts):
    """Yields modes with these figures, made of the right ones."""
    return lambda i, found: [(i, replace(found, **{k: f(found) for k, f in parts.items()}))]


WRONG = {
    "lam of (1,)": changed(lam=lambda found: found.lam[:1]),
    "lam is complex128, expected a complex array": changed(lam=lambda found: found.lam[0]),
    "lam is list, expected a complex array": changed(lam=lambda found: list(found.lam)),
    "shapes is of shape (1, 2)": changed(shapes=lambda found: found.shapes[:1]),
    "shapes is of shape (2, 7), lam of (2,): expected (2, 2)": changed(
        shapes=lambda found: np.ones((2, 7), dtype=np.complex64)
    ),
    "shapes is not finite": changed(shapes=lambda found: np.nan * found.shapes),
    "energies is not finite": changed(energies=lambda found: np.nan * found.energies),
    "energies is of shape (0, 2)": changed(energies=lambda found: found.energies[:0]),
    "point 0 (friction = 0): lam is not finite": changed(lam=lambda found: np.nan * found.lam),
    "error_rung is -1, expected >= 0": changed(error_rung=lambda found: -np.ones(2)),
    "error_rung is of complex128, expected a real": changed(error_rung=lambda f: 1e-9j * f.lam),
    "a root has Im lambda < 0": changed(lam=lambda found: found.lam.conj()),
    "expected roots from 1 to 1000 Hz alone": changed(lam=lambda found: 1e3 * found.lam),
    "working_point is missing": changed(working_point=lambda found: None),
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


def test_an_error_of_a_rung_s_own_code_is_told_with_its_line(linear, tmp_path, monkeypatch):
    monkeypatch.setattr(linear, "_ends_of_boxes", None)
    line = 1 + FILE.read_text().splitlines().index(
        "        boxes = self._ends_of_boxes.setdefault(problem, {})"
    )
    with pytest.raises(ExtensionError, match=rf"my_rung.py: line {line}: rung 'linear': Attribute"):
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
