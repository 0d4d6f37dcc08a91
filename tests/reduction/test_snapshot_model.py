"""Modes of a brake in a basis of its modes at a few design points; when tracking takes one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from conftest import NOMINAL
from study_runs import plan_of

import squealstudy
from squealstudy.engine.runner import run_study
from squealstudy.kinds.complex_modes import inserted_points
from squealstudy.kinds.complex_modes.inserted_points import MAX_UNLIKENESS, Bases, far_apart
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import linearised_point, solve_point
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.modes.tracking.snapshot_model import (
    SnapshotModel,
    largest_mode_error,
    snapshot_basis,
    snapshots,
)
from squealstudy.root_pairs import angular_band
from squealstudy.system.linearise import linearise, reduced_structure

BAND_HZ = (300.0, 3000.0)
BAND = angular_band(BAND_HZ)


def state_at(friction: float, pressure: float = 12e5) -> DesignState:
    point = replace(NOMINAL, friction=friction, brake_pressure=pressure)
    return DesignState(point, damping_ratio=0.004, stiffness_damping=1e-7)


def exact_modes(prepared, state: DesignState) -> Modes:
    found = solve_point(prepared, state, BAND_HZ)
    return Modes(found.lam[~found.overdamped], found.shapes[~found.overdamped])


def test_on_a_complete_basis_modes_are_exact(prepared):
    """Modal damping and stiffness damping are turned with the coordinates."""
    n = prepared.model.n
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n)))[0]
    state = state_at(0.4)
    point, exact = linearised_point(prepared, state)
    projected = reduced_structure(prepared.model).system.projected(turn)
    turned = linearise(prepared.model, point, state, projected)
    for A, B in ((exact.K, turned.K), (exact.C, turned.C), (exact.K_sym, turned.K_sym)):
        assert np.abs(turn.T @ A @ turn - B).max() <= 1e-11 * np.abs(A).max()
    found = SnapshotModel(prepared, turn, BAND_HZ).modes(state)
    assert largest_mode_error(exact_modes(prepared, state), found, BAND, 0.0) <= 1e-6


def test_a_few_points_have_the_modes_of_others(prepared):
    states = [state_at(mu, p) for mu in (0.0, 0.7) for p in (5e5, 20e5)]
    blocks = [snapshots(prepared, state, BAND_HZ) for state in [*states, state_at(0.35)]]
    V = snapshot_basis(blocks)
    assert np.abs(V.T @ V - np.eye(V.shape[1])).max() < 1e-12
    assert V.shape[1] < prepared.model.n / 2
    few, poor = (SnapshotModel(prepared, W, BAND_HZ) for W in (V, snapshot_basis(blocks[:1])))
    for state in (state_at(0.2, 8e5), state_at(0.55, 16e5)):
        exact = exact_modes(prepared, state)
        assert largest_mode_error(exact, few.modes(state), BAND, 0.01) <= MAX_UNLIKENESS
        assert largest_mode_error(exact, poor.modes(state), BAND, 0.01) > MAX_UNLIKENESS


def test_what_one_set_of_modes_lacks_counts_but_at_the_ends_of_the_band():
    lam = 1j * np.array([1.005, 2.0, 3.0])
    exact = Modes(lam, np.eye(3))
    assert largest_mode_error(exact, exact, (1.0, 4.0), 0.01) == 0.0
    without = Modes(lam[1:], np.eye(3)[1:])
    assert largest_mode_error(exact, without, (1.0, 4.0), 0.01) == 0.0
    assert largest_mode_error(without, exact, (1.0, 4.0), 0.01) == 0.0
    lacking = Modes(lam[:2], np.eye(3)[:2])
    assert largest_mode_error(exact, lacking, (1.0, 4.0), 0.01) > 1.0
    assert largest_mode_error(lacking, exact, (1.0, 4.0), 0.01) > 1.0
    moved = Modes(lam + np.array([0.0, 0.02, 0.0]), np.eye(3))
    assert largest_mode_error(exact, moved, (1.0, 4.0), 0.01) == pytest.approx(0.01)
    assert largest_mode_error(exact, Modes(lam[:0], np.zeros((0, 3))), (1.0, 4.0), 0.01) == np.inf


def test_points_far_apart_are_the_middle_and_the_corners():
    grid = np.array([[x, y] for y in (1e5, 2e5, 3e5) for x in (0.0, 0.1, 0.2, 0.3, 0.4)])
    chosen = grid[far_apart(grid, 5)].tolist()
    assert chosen[0] == [0.2, 2e5]
    assert sorted(chosen[1:]) == [[0.0, 1e5], [0.0, 3e5], [0.4, 1e5], [0.4, 3e5]]
    assert len(far_apart(np.repeat(grid[:3], 4, axis=0), 9)) == 3
    assert far_apart(np.zeros((4, 1)), 3).tolist() == [0]


STUDY = """
[study]
name = "steps"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.7
num = 8

[[sweep]]
parameter = "pressure"
values = [3e5, 20e5]

[modes]
band = [500.0, 5000.0]
refine_points = 400
reference_points = 0
"""


@pytest.mark.full_size  # a brake, tracked twice
@pytest.mark.usefixtures("tiny_brake")
def test_a_study_is_tracked_alike_with_a_basis_and_without(tmp_path, monkeypatch):
    monkeypatch.setattr(inserted_points, "MIN_COORDINATES", 50)
    monkeypatch.setattr(inserted_points, "STEPS_PER_SNAPSHOT", 1)
    tables, manifests, used = {}, {}, []
    of = Bases.of

    def seen(self, point):
        used.append(of(self, point))
        return used[-1]

    for name, basis_of in (("with", seen), ("without", lambda self, point: None)):
        monkeypatch.setattr(Bases, "of", basis_of)
        run_study(plan_of(STUDY), tmp_path / name, jobs=1)
        results = squealstudy.open_results(tmp_path / name)
        tables[name], manifests[name] = results.modes, results.manifest["tracking"]
    assert any(basis is not None for basis in used)
    assert manifests["with"]["refined"] == manifests["without"]["refined"] > 0
    pd.testing.assert_frame_equal(tables["with"], tables["without"])


@pytest.mark.full_size  # a brake, tracked twice
@pytest.mark.usefixtures("tiny_brake")
def test_a_basis_that_lacks_modes_of_other_points_is_not_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(inserted_points, "MIN_COORDINATES", 50)
    monkeypatch.setattr(inserted_points, "STEPS_PER_SNAPSHOT", 1)
    made, served = [], []

    def poor(blocks):
        made.append(snapshot_basis(blocks)[:, -10:])
        return made[-1]

    of = Bases.of

    def recorded(self, point):
        served.append(of(self, point))
        return served[-1]

    monkeypatch.setattr(inserted_points, "_snapshot_models", {})
    monkeypatch.setattr(inserted_points, "snapshot_basis", poor)
    monkeypatch.setattr(Bases, "of", recorded)
    run_study(plan_of(STUDY), tmp_path / "results", jobs=1)
    assert made
    assert served
    assert all(basis is None for basis in served)
