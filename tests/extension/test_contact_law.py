"""A contact law from one file outside the package, used through a study file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import HERE, in_time, run, run_here
from scipy.optimize import brentq

from squealstudy.engine.plan import Plan
from squealstudy.errors import ExtensionError, ModelError, StudyFileError
from squealstudy.extensions import load_extension
from squealstudy.laws import CONTACT_LAWS, contact_law, register
from squealstudy.laws.contact.exponential import P0
from squealstudy.laws.registry import Registry
from squealstudy.study.definition import parse_study

FILE = "my_contact_law.py"
MU, SPEED, FORCE, K3 = 0.3, 0.5, 100.0, 4e6 / 3
AREA, CUBE = K3 / 5e11, 1.4e18
STUDY = f"""
[study]
name = "cube"
kind = "{{kind}}"
extensions = ["{FILE}"]
[model]
name = "hoffmann"
contact_law = "cube"
[parameters]
friction = {MU}
sliding_speed = {SPEED}
damping_ratio = 0.0
"contact.cube" = {CUBE}
[modes]
band = [1.0, 1000.0]
"""


ANGLES = np.deg2rad([150.0, 30.0])
SPRINGS = 2 / 3 * np.array([2 - 3**0.5, 2 + 3**0.5]) * 1e6
ROWS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
K_S = ROWS.T @ (SPRINGS[:, None] * ROWS)


def tangent_stiffness():
    """Contact stiffness [N/m] of steady sliding: one equation in the contact force F.

    K_s q = (-mu F, F - 100 N), and the law is -q_2 = (F / (A c))^(1/3).
    """

    def gap_error(F):
        q = np.linalg.solve(K_S, np.array([-MU * F, F - FORCE]))
        return q[1] + (F / (AREA * CUBE)) ** (1 / 3)

    F = brentq(gap_error, 1e-6, 1e4, xtol=1e-12, rtol=1e-14)
    return 3 * F / (F / (AREA * CUBE)) ** (1 / 3)


def frequencies():
    """Natural frequencies [Hz] of the model's closed form with that stiffness (mass 1 kg)."""
    K = K_S + tangent_stiffness() * np.array([[0.0, -MU], [0.0, 1.0]])
    return np.sort(np.sqrt(np.linalg.eigvals(K).astype(complex)).real) / (2 * np.pi)


def test_working_point_and_modes_are_those_of_the_closed_form(tmp_path):
    modes = run(STUDY.format(kind="complex_modes"), tmp_path, FILE)["modes"]
    found = np.sort(modes["frequency_hz"])
    np.testing.assert_allclose(found, frequencies(), rtol=1e-9)
    assert abs(frequencies()[1] / np.sqrt(K_S[1, 1] + K3) * 2 * np.pi - 1) > 0.01  # another law


def test_in_time_it_keeps_the_energy_balance_and_the_frequency(tmp_path):
    text = in_time(STUDY.format(kind="transient"), 0.2, 1e-5)
    tables = run_here(text, tmp_path)
    (point,) = tables["points"].itertuples()
    assert point.status == "ok"
    assert abs(point.energy_balance) < 1e-10
    # both modes are neutral: the run begins along the lower one
    assert point.predicted_frequency_hz == pytest.approx(frequencies()[0], rel=1e-9)
    assert point.torque_line_hz == pytest.approx(frequencies()[0], rel=1e-4)


# -- what is not as it should be -----------------------------------------------------------------
@pytest.fixture(autouse=True)
def _registers(monkeypatch):
    """What the tests register in this process ends with them."""
    monkeypatch.setattr(CONTACT_LAWS, "_known", dict(CONTACT_LAWS._known))
    monkeypatch.setattr(Registry, "shared", dict(Registry.shared))


def parsed(tmp_path, names):
    text = STUDY.format(kind="complex_modes").replace(f'["{FILE}"]', names)
    return parse_study(text, tmp_path / "study.toml")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "cannot be read: No such file or directory"),
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("def f(:", "SyntaxError"),
        ("from squealstudy.laws import register", "registers nothing: expected register"),
    ],
)
def test_a_file_that_is_absent_or_fails_is_told_with_its_key(tmp_path, content, reason):
    if content is not None:
        (tmp_path / "wrong.py").write_text(content)
    with pytest.raises(StudyFileError, match=reason) as told:
        parsed(tmp_path, '["wrong.py"]')
    assert told.value.key == "study.extensions[1]"
    assert "'wrong.py'" in told.value.message


def test_a_law_without_its_file_is_told_so(tmp_path, monkeypatch):
    monkeypatch.delitem(CONTACT_LAWS._known, "cube", raising=False)  # of tests before it
    text = STUDY.format(kind="complex_modes").replace(f'extensions = ["{FILE}"]\n', "")
    with pytest.raises(StudyFileError, match=r"got 'cube'; one of your own needs its file, ext"):
        parse_study(text, tmp_path / "study.toml")
    other = (HERE / FILE).read_text().replace('"cube"', '"other"').replace(".cube", ".other")
    (tmp_path / FILE).write_text(other)
    with pytest.raises(StudyFileError, match=r"'cube' is in no file of extensions = \['my_con"):
        parsed(tmp_path, f'["{FILE}"]')


@pytest.mark.parametrize("names", ['"my_law.py"', "[1]", "true"])
def test_extensions_are_a_list_of_names(tmp_path, names):
    with pytest.raises(StudyFileError) as told:
        parsed(tmp_path, names)
    assert told.value.key.startswith("study.extensions")


def test_a_file_that_changed_is_refused(tmp_path):
    path = tmp_path / "changing.py"
    text = (HERE / FILE).read_text()
    path.write_text(text)
    load_extension(path)
    load_extension(path)
    path.write_text(text + "A = 2")
    with pytest.raises(ExtensionError, match="has changed"):
        load_extension(path)


def test_registers_refuse_what_contradicts_them():
    def changed(**what):
        return replace(CONTACT_LAWS["exponential"], **what)

    with pytest.raises(ModelError, match="another contact law 'exponential'"):
        register(changed(pressure=other_pressure))
    with pytest.raises(ModelError, match=r"'contact\.p0' is defined otherwise"):
        register(changed(name="softer", parameters=(replace(P0, default=1.0),)))
    with pytest.raises(ModelError, match="is none of exponential"):
        contact_law("hertz")
    with pytest.raises(ModelError, match="has p0, lam, not stiffness"):
        contact_law("exponential", stiffness=1.0)


def other_pressure(g, p0, lam):
    return p0, lam * g


def test_results_are_named_by_the_content_of_the_file(tmp_path):
    keys = []
    for number, default in enumerate(("1e18", "1e18", "1.0e18")):
        folder = tmp_path / str(number)
        folder.mkdir()
        text = (HERE / FILE).read_text().replace("1e18", default)
        (folder / FILE).write_text(text.replace('"cube"', f'"cube_{default}"'))
        study = STUDY.replace('"cube"\n[par', f'"cube_{default}"\n[par')
        study = study.format(kind="complex_modes")
        plan = Plan(parse_study(study, folder / "study.toml"))
        keys.append((plan.tasks[0].point_id, plan.tasks[0].structure))
    assert keys[0] == keys[1]
    assert keys[0][0] != keys[2][0]
    assert keys[0][1] != keys[2][1]


def test_parameters_of_foreign_laws_do_not_name_a_point(tmp_path):
    text = STUDY.format(kind="complex_modes")
    text = text.replace(f'extensions = ["{FILE}"]\n', "").replace('contact_law = "cube"\n', "")
    text = text.replace(f'"contact.cube" = {CUBE}\n', "")
    before = Plan(parse_study(text, Path("study.toml"))).tasks[0].point_id
    other = (HERE / FILE).read_text().replace("contact.cube", "contact.another")
    (tmp_path / FILE).write_text(other.replace('"cube"', '"another"'))
    load_extension(tmp_path / FILE)
    study = parse_study(text, Path("study.toml"))
    assert "contact.another" in study.values
    assert Plan(study).tasks[0].point_id == before
