"""Modes that turn unstable, or stable again, by a jump: a stop closes, a root becomes real."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_runs import plan_of, solved

import squealstudy
from squealstudy.kinds.complex_modes.onset_table import last_ends, onset_table
from squealstudy.kinds.complex_modes.onset_words import onset_and_end, rows_with_ends
from squealstudy.screen import as_text

FRICTION, STOP = 0.95, 3e9
STUDY = """
[study]
name = "jump"
kind = "complex_modes"
[model]
file = "stop.toml"
[parameters]
friction = 0.95
[modes]
band = [50.0, 8000.0]
reference_points = 0
"""
MODEL = """
[parameters]
friction = 0.4
g = { default = 1e-5, unit = "m" }
mc = { default = "3 kg", unit = "kg" }
F = { default = "0.5 kN", unit = "N" }
[[mass]]
name = "pad"
mass = 1.0
directions = ["x", "y"]
[[mass]]
name = "disc"
mass = 2.0
directions = ["y"]
[[mass]]
name = "caliper"
mass = "mc"
directions = ["x"]
[[contact]]
name = "lining"
between = ["pad", "disc"]
normal = "y"
sliding = "-x"
stiffness = 5e7
[[load]]
on = "pad"
direction = "-y"
force = "F"
[[load]]
on = "disc"
direction = "y"
force = "F"
[[spring]]
name = "stop"
between = ["pad", "ground"]
direction = "x"
stiffness = 3e9
gap = "g"
side = "compression"
[[spring]]
between = ["pad", "ground"]
direction = [1.0, 1.0]
stiffness = 2e7
"""
SPRINGS = (
    ("pad", "caliper", "x", 3e7),
    ("caliper", "ground", "x", 1e7),
    ("disc", "ground", "y", 2e7),
)
DAMPERS = (
    ("caliper", "ground", "x"),
    ("disc", "ground", "y"),
    ("pad", "ground", "y"),
    ("pad", "caliper", "x"),
)
DAMPING = 20.0
UNSTABLE_F, STABLE_F = 200.0, 300.0


def stopped(folder: Path, *sweeps: str) -> squealstudy.Results:
    """A pad that flutters until it touches a stop, over sweeps (`name: TOML`)."""
    text = MODEL
    for a, b, way, k in SPRINGS:
        text += f'[[spring]]\nbetween = ["{a}", "{b}"]\ndirection = "{way}"\nstiffness = {k}\n'
    for a, b, way in DAMPERS:
        text += f'[[damper]]\nbetween = ["{a}", "{b}"]\ndirection = "{way}"\ndamping = {DAMPING}\n'
    (folder / "stop.toml").write_text(text)
    study = STUDY
    for sweep in sweeps:
        name, _, values = sweep.partition(": ")
        study += f'[[sweep]]\nparameter = "{name}"\n{values}\n'
    return solved(plan_of(study, folder / "study.toml"), folder / "results")


def growth(F: float, gap: float = 1e-5, caliper: float = 3.0) -> float:
    """Largest growth rate of x and y of the pad, y of the disc, x of the caliper, 1/s."""
    M, K, C = np.diag([1.0, 1.0, 2.0, caliper]), np.zeros((4, 4)), np.zeros((4, 4))
    pad_caliper, pressed = np.array([1.0, 0, 0, -1]), np.array([0.0, -1, 1, 0])
    x_pad, y_pad, y_disc, x_caliper = np.eye(4)
    for way, k in (
        (pad_caliper, 3e7),
        (x_caliper, 1e7),
        (y_disc, 2e7),
        ((x_pad + y_pad) / np.sqrt(2), 2e7),
    ):
        K += k * np.outer(way, way)
    for way in (x_caliper, y_disc, y_pad, pad_caliper):
        C += DAMPING * np.outer(way, way)
    K -= 5e7 * np.outer([-FRICTION, 1.0, -1.0, 0.0], pressed)
    if -np.linalg.solve(K, [0.0, -F, F, 0.0])[0] > gap:
        K += STOP * np.outer(x_pad, x_pad)
    A = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    return float(np.linalg.eigvals(A).real.max())


def findings(results: squealstudy.Results) -> str:
    return " ".join(as_text(results.screen.findings(results)).split())


def test_a_mode_that_a_jump_makes_stable_has_an_end(tmp_path):
    """The stop closes at 263 N; there was no row "out", and no word on an end."""
    results = stopped(tmp_path, 'F: start = "0.1 kN"\nstop = "2 kN"\nnum = 20')
    assert growth(UNSTABLE_F) > 300.0
    assert growth(STABLE_F) < 0.0
    into, out = results.onsets.sort_values("direction").to_dict("records")
    assert (into["direction"], into["status"]) == ("in", "below_range")
    assert (out["direction"], out["status"], out["track"]) == ("out", "broken", into["track"])
    assert (out["bracket_low"], out["bracket_high"]) == (UNSTABLE_F, STABLE_F)
    forces = results.points.set_index("point_id")["F"]
    assert (forces[out["point_before"]], forces[out["point_after"]]) == (UNSTABLE_F, STABLE_F)
    assert np.isnan(out["onset"])
    told = "already at the least F, still at 0.2 kN, no longer from 0.3 kN on."
    assert told in findings(results)
    (row,) = rows_with_ends(results.rank(), results.onsets, {}, "N").values()
    assert onset_and_end(row, "N") == "below range to <= 300 N"


def test_an_onset_by_a_jump_lies_between_two_solved_points(tmp_path):
    """The gap is too wide for the stop from 19 um on; "20 um or less" was said."""
    results = stopped(tmp_path, 'g: start = "10 um"\nstop = "30 um"\nnum = 9')
    assert growth(500.0, 17.5e-6) < 0.0 < growth(500.0, 20e-6)
    (row,) = results.onsets.to_dict("records")
    assert (row["direction"], row["status"]) == ("in", "broken")
    assert [row["bracket_low"], row["bracket_high"]] == pytest.approx([17.5e-6, 20e-6])
    assert "first at g between 17.5 um and 20 um." in findings(results)
    (ranked,) = results.rank().to_dict("records")
    assert ranked["threshold_kind"] == "bracketed"
    assert ranked["threshold"] == pytest.approx(20e-6)


def test_ends_by_a_jump_are_in_the_tables_of_designs(tmp_path):
    """Of two designs in the answer, of many in the table of first onsets."""
    force = 'F: start = "0.1 kN"\nstop = "0.5 kN"\nnum = 5'
    results = stopped(tmp_path, force, "mc: values = [3.0, 4.0]")
    assert min(growth(UNSTABLE_F, caliper=mc) for mc in (3.0, 4.0)) > 0.0
    assert max(growth(STABLE_F, caliper=mc) for mc in (3.0, 4.0)) < 0.0
    end = "already at the least F, still at 0.2 kN, no longer from 0.3 kN on"
    assert findings(results).count(end) == 2
    ends = last_ends(results, "F")
    assert ends.to_numpy().tolist() == [[STABLE_F, "<= "], [STABLE_F, "<= "]]


def test_of_many_designs_an_end_by_a_jump_is_a_bound(tmp_path):
    force = 'F: start = "0.1 kN"\nstop = "0.5 kN"\nnum = 5'
    gaps = [1e-5, *np.linspace(1e-6, 3e-6, 12).tolist()]  # those small are stable from 0.1 kN on
    results = stopped(tmp_path, force, f"g: values = {gaps}")
    assert growth(100.0, 3e-6) < 0.0
    lines = as_text(onset_table(results)).splitlines()
    (shown,) = [line for line in lines if " to <= " in line]
    assert shown.split()[-4:] == ["to", "<=", "0.3", "kN"]
    assert "to <=: the end is between this value and the solved one before" in " ".join(lines)


LEAVES_BAND = """
[study]
name = "leaves"
kind = "complex_modes"
[model]
name = "hoffmann"
[parameters]
damping_ratio = 0.005
friction = 1.0
[[sweep]]
parameter = "mass"
start = 0.5
stop = 2.0
num = 16
[modes]
band = [200.0, 300.0]
reference_points = 0
"""


def flutter(mass: float) -> complex:
    """Fastest growing root of the model of Hoffmann et al. (2002) at friction 1, rad/s."""
    K = 1.333333e6 * np.array([[0.0, -1.0], [0.0, 1.0]])
    for k, degrees in ((178633.0, 150.0), (2488034.0, 30.0)):
        way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        K += k * np.outer(way, way)
    squares = np.linalg.eigvals(K / mass)
    roots = 1j * np.sqrt(squares.astype(complex))
    return max([*roots, *-roots], key=lambda root: root.real)


def test_a_mode_that_leaves_the_band_unstable_has_a_row_and_words(tmp_path):
    """At 1.4 kg it grows below the band; nothing was said of where the track ends."""
    inside, beyond = flutter(1.3), flutter(1.4)
    assert min(inside.real, beyond.real) > 100.0
    assert abs(beyond) < 2 * np.pi * 200.0 < abs(inside)
    results = solved(plan_of(LEAVES_BAND, tmp_path / "study.toml"), tmp_path / "results")
    seen, left = results.onsets.sort_values("direction").to_dict("records")
    assert (seen["direction"], seen["status"]) == ("in", "first_seen")
    assert (left["direction"], left["status"], left["track"]) == ("leaves", "left_band", 1)
    assert [left["bracket_low"], left["bracket_high"]] == pytest.approx([1.3, 1.4])
    assert np.isnan(left["onset"])
    assert "first at mass 0.6 kg or less, outside the band from 1.4 kg on." in findings(results)
