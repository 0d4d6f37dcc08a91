"""An integrator of the kernel from one file outside the package: its order, and a study by name."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from motions import run_one
from study_texts import study_text
from test_newmark import linear_case, random_system

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ParameterError
from squealstudy.motion.integrator import integrator
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.settings import MotionSettings
from squealstudy.study.definition import parse_study

BELT = (
    study_text("belt", "transient", "belt")
    + """\
[[sweep]]
parameter = "sliding_speed"
values = [0.5]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.5
step = 2e-5
perturbation = 1e-2
"""
)


@pytest.fixture(scope="module", autouse=True)
def newmark_family():
    """Known while these tests last."""
    sys.modules.pop("my_integrator", None)
    return importlib.import_module("my_integrator").NewmarkFamily


@pytest.mark.parametrize(("gamma", "order"), [(0.5, 2), (0.6, 1)])
def test_order_against_expm(newmark_family, gamma, order):
    """Bilateral contact and sticking friction are linear: the end is known in closed form."""
    system, design, K, C, load = linear_case()
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    rest = np.concatenate([np.linalg.solve(K, load), np.zeros(2)])
    start = np.array([0.01, -0.02, 1.0, 0.5])
    end = rest + la.expm(A * 0.08) @ (start - rest)
    counts, errors = [400, 800, 1600], []
    for count in counts:
        method = newmark_family(gamma=gamma)
        settings = MotionSettings(0.08, 0.08 / count, 0, method, tolerance=1e-11)
        r = run_one(system, design, settings, start[:2], start[2:])
        assert r.outcome == "ok"
        errors.append(la.norm(np.concatenate([200 * (r.q - end[:2]), r.v - end[2:]])))
    fitted = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert fitted == pytest.approx(order, abs=0.05)


def test_the_member_of_the_package_is_the_packages(newmark_family):
    """Stick, slip and lift-off through the same iteration."""
    system, design = random_system()
    settings = MotionSettings(4e-4, 2e-6, 0, tolerance=1e-10)
    kick = np.random.default_rng(5).normal(size=12) * 3.0
    ours, theirs, other = (
        run_one(system, design, replace(settings, integrator=method), np.zeros(12), kick)
        for method in (newmark_family(beta=0.25), Newmark(), newmark_family())
    )
    assert ours.outcome == other.outcome == "ok"
    np.testing.assert_allclose(ours.v, theirs.v, rtol=1e-9, atol=1e-9)
    assert la.norm(other.v - theirs.v) > 1e-3 * la.norm(theirs.v)


def test_a_study_by_name(tmp_path):
    """Its limit cycle is that of the package's method, its design points have other names."""
    found = {}
    for method in ("newmark", "newmark_family"):
        text = f'{BELT}method = "{method}"\n'
        report = run_study(Plan(parse_study(text, Path("study.toml"))), tmp_path / method, jobs=1)
        found[method] = Results.open(report.directory).points.iloc[0]
    ours, theirs = found["newmark_family"], found["newmark"]
    assert ours["status"] == theirs["status"] == "ok"
    assert ours["point_id"] != theirs["point_id"]
    assert ours["torque_rms"] == pytest.approx(theirs["torque_rms"], rel=1e-3)
    assert ours["torque_rms"] != theirs["torque_rms"]


def test_its_source_is_part_of_what_a_result_is(newmark_family, monkeypatch):
    text = f'{BELT}method = "newmark_family"\n'
    ids = []
    for source in (newmark_family.outside_source(), "another text"):
        monkeypatch.setattr(newmark_family, "outside_source", classmethod(lambda _, s=source: s))
        ids.append(Plan(parse_study(text, Path("study.toml"))).tasks[0].point_id)
    assert ids[0] != ids[1]
    assert Newmark.outside_source() == ""


def test_its_options_are_its_fields(newmark_family):
    assert integrator("newmark_family", {"beta": 0.25}) == newmark_family(beta=0.25)
    with pytest.raises(ParameterError, match="expected more than 0"):
        integrator("newmark_family", {"beta": 0.0})
    with pytest.raises(ParameterError, match="no such option"):
        integrator("newmark_family", {"prewarp": True})
