"""Verdicts that must not be told wrong: undamped models, contact that would have to pull."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cycle_models import BAND, Designs
from stick_slip_cycle import stick_slip
from study_runs import solved

from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import families
from squealstudy.cycles.growth import without_noise
from squealstudy.cycles.outcomes import band_level
from squealstudy.cycles.trials import OPEN, ended, run_on
from squealstudy.engine.template import study_text
from squealstudy.engine.validity import motion_reason
from squealstudy.laws import CONTACT_LAWS

UNDAMPED = {"friction": 0.5, "sliding_speed": 0.5, "damping_ratio": 0.0}
RADIANS = tuple(2 * np.pi * hz for hz in BAND)


def undamped_roots(mass, k1, k2, k3, alpha1, alpha2, friction):
    """Roots of Hoffmann's oscillator (Hoffmann et al. 2002), by its 2 x 2 matrix."""
    angles = np.deg2rad([alpha1, alpha2])
    rows = np.column_stack([np.cos(angles), np.sin(angles)])
    K = rows.T @ np.diag([k1, k2]) @ rows + np.array([[0.0, -friction * k3], [0.0, k3]])
    return np.sqrt(-np.linalg.eigvals(K / mass).astype(complex))


@pytest.fixture(scope="module")
def undamped():
    return Designs("hoffmann", UNDAMPED, law="bilateral").at()


def test_an_undamped_model_is_neutral(undamped):
    """Its roots have no real part: any small motion stays, as large as it began."""
    values = Designs("hoffmann", UNDAMPED, law="bilateral").nominal.values
    names = ("mass", "k1", "k2", "contact_stiffness", "alpha1", "alpha2", "friction")
    roots = undamped_roots(*(values[n] for n in names))
    assert np.abs(roots.real).max() < 1e-9
    found = families(undamped, RADIANS, None, 1e-7, Search(None, 1e-2, 1.0, 1e4)).families
    lam = np.array([family.lam for _, family in found])
    np.testing.assert_allclose(np.sort(lam.imag), np.sort(np.abs(roots.imag)), rtol=1e-4)
    assert [family.verdict for _, family in found] == ["neutral", "neutral"]
    assert all(not family.cycles for _, family in found)
    for _, family in found:  # the next point of the curve loses; how far off it is, steps decide
        velocities = [p["contact_velocity"] for p in family.curve]
        beyond = family.curve[velocities.index(family.undamped) + 1]
        assert beyond["added_damping"] < -1.0
        assert 0.5 * beyond["contact_velocity"] < family.undamped < 0.8
    assert not any(p["event"] for _, family in found for p in family.curve)


def test_a_run_without_damping_does_not_last_by_itself(undamped):
    q = 1e-5 * np.eye(2)[0]
    start = replace(undamped.point, q0=q, v0=0 * q)
    run = ended("a kick", run_on(undamped, [start], RADIANS)[0])
    assert run.outcome == OPEN
    assert np.isnan(run.torque_rms)


@pytest.mark.full_size  # by default what is undamped is neutral: above and below
def test_the_study_to_start_from_has_damping(tmp_path):
    """As written it is silent, then squeals; without damping silent designs are neutral."""
    text = study_text("start", "limit_cycles", "hoffmann").replace("num = 4", "num = 2")
    assert re.search(r"^damping_ratio = 0\.005$", text, re.MULTILINE)
    points = solved(text, tmp_path / "start").points
    assert points["verdict"].tolist() == ["no_cycle_found", "squeals"]
    points = solved(text.replace("= 0.005", "= 0.0"), tmp_path / "undamped").points
    assert points["verdict"].tolist() == ["neutral", "squeals"]
    silent = points.iloc[0]
    assert np.isnan(silent["torque_rms"])
    assert np.isnan(silent["frequency_hz"])


def curve(*dampings):
    """Motions with these added dampings; zeros of round-off (None) between."""
    one = PeriodicMotion(np.zeros((3, 1)), 1.0)
    return [
        CurveMotion(replace(one, parameter=d or 0.0), 0.0, 0.0, "" if d is not None else "C")
        for d in dampings
    ]


@pytest.mark.parametrize(
    ("dampings", "zeros"),
    [
        ((-1.0, None, 1.0), 1),
        ((-1.0, None, 1e-9, 1.0), 1),  # a motion that happens to be near
        ((1e-9, None, -1e-9, None, 1e-9, -2.0), 0),  # no damping, then decay
        ((-1.0, -1e-9, None, 1e-9, None, -1e-9, 1.0), 0),  # a range without damping
        ((-1.0, None, 1e-9, -1.0), 0),
        ((-1.0, None, 1.0, None, -1.0), 2),
    ],
)
def test_zeros_of_round_off_are_none(dampings, zeros):
    found = without_noise(curve(*dampings), 1e-8)
    assert sum(p.event == "C" for p in found) == zeros
    assert sum(not p.event for p in found) == sum(d is not None for d in dampings)


SLOW = """
[study]
name = "slow"
kind = "limit_cycles"
[model]
name = "belt"
[parameters]
mass = 10.0
stiffness = 4000.0
normal_force = 98.1
friction = 0.2
"friction_law.static_ratio" = 1.5
"friction_law.decay_speed" = 1e-3
damping_ratio = 0.01
[[sweep]]
parameter = "sliding_speed"
values = [0.01]
[modes]
band = [0.1, 100.0]
"""


def test_slow_stick_slip_has_its_verdict_and_level(tmp_path):
    """Truths: by phases without a corner of friction, and 4.758 N, 1.515 Hz with it (DOP853)."""
    point = solved(SLOW, tmp_path / "slow").points.iloc[0]
    assert point["verdict"] == "squeals_if_kicked"
    assert point["level_error"] < 0.02
    assert point["torque_rms"] == pytest.approx(4.758, rel=2e-3)
    assert point["frequency_hz"] == pytest.approx(1.515, rel=1e-3)
    sharp = stick_slip(10.0, 4000.0, 98.1, 0.2, 1.5, 1e-3, 0.01, 0.01)
    without = point["torque_rms"] * (1 + point["regularisation_error"])
    assert without == pytest.approx(sharp.rms, rel=3e-3)


def test_the_part_of_a_level_within_a_band():
    time = 1e-4 * np.arange(20000)
    tones = [(3.0, 120.3), (5.0, 431.7), (2.0, 7.3)]
    torque = 40.0 + sum(a * np.sin(2 * np.pi * hz * time) for a, hz in tones)
    run = SimpleNamespace(times=time, history={"torque": torque})
    rms, spread, line = band_level(run, (2 * np.pi * 50.0, 2 * np.pi * 300.0))
    assert rms == pytest.approx(3.0 / np.sqrt(2), rel=5e-3)
    assert spread < 0.01
    assert line == pytest.approx(120.3, abs=0.05)


CUBIC = """
[study]
name = "pulls"
kind = "limit_cycles"
[model]
name = "hoffmann"
contact_law = "cubic"
[parameters]
k1 = 1541571.79
k2 = 2006111.39
contact_stiffness = 1741561.79
normal_force = 665.871
damping_ratio = 0.0245415
friction = 0.967304
"contact.cubic_stiffness" = 3.30346e17
"contact.regularisation_speed" = 0.160653
[[sweep]]
parameter = "sliding_speed"
values = [8.03265]
[limit_cycles]
reach = 1.5
"""


def test_a_cycle_whose_contact_would_have_to_pull_is_not_valid(tmp_path):
    """Pressure of the law falls below zero in the cycle, which a contact cannot do."""
    results = solved(CUBIC, tmp_path / "pulls")
    point = results.points.iloc[0]
    assert point["verdict"] == "squeals"
    assert np.isfinite(point["torque_rms"])
    assert not point["valid"]
    cycles = results.table("cycles")
    opened = cycles["open_share_max"].max()
    assert opened > 0
    assert point["invalid_reason"] == motion_reason("cubic", opened)


def test_of_laws_that_open_an_open_contact_is_valid():
    for law in CONTACT_LAWS:
        assert bool(motion_reason(law.name, 1.0)) == law.pulls
        assert not motion_reason(law.name, 0.0)
