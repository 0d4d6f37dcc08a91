"""Working points of whole boxes against those solved one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import NOMINAL
from synthetic import random_points

from squealstudy.errors import ConvergenceError
from squealstudy.laws import contact_law
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import state_working_point
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import interpolation
from squealstudy.reduction.gap_equations import GapEquations
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.reduction.working_point_field import WorkingPointField

BAND = (500.0, 4000.0)
ENERGETIC = ("caliper", 7)


def friction_pressure(theta):
    operating = replace(
        NOMINAL, friction=0.35 + 0.35 * theta[0], brake_pressure=2e5 * 20 ** ((1 + theta[1]) / 2)
    )
    return DesignState(operating)


def with_components(theta):
    """Friction, and the frequencies of two component modes by +-50 %."""
    operating = replace(NOMINAL, friction=0.35 + 0.35 * theta[0])
    scale = {ENERGETIC: 1 + 0.5 * theta[1], ("disc", 8): 1 - 0.5 * theta[1]}
    return DesignState(operating, scale)


def own_residual(problem, state, point):
    """Imbalance by the equations of a single point, on the exactly changed structure."""
    space = problem.prepared.space.changed(problem._changes(state))
    equations = GapEquations(space, [state.operating])
    F, _, _ = equations.imbalance(point.gap[None])
    return equations.relative(F, point.gap[None])[0]


@pytest.mark.parametrize("state_at", [friction_pressure, with_components])
def test_working_points_of_a_box(prepared, state_at):
    problem = BrakeProblem(prepared, 2, state_at, BAND)
    theta = np.vstack([random_points(12, 2), [[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]])
    states = [state_at(row) for row in theta]
    changes = [problem._changes(s) for s in states]
    found = problem.field.solve(theta, [s.operating for s in states], changes)
    assert sum(p is None for p in found) <= 2  # these go to the single solver
    for state, point in zip(states, found, strict=True):
        if point is None:
            continue
        alone = state_working_point(prepared, state)
        size = np.abs(alone.gap).max()
        np.testing.assert_allclose(point.gap, alone.gap, atol=1e-7 * size)
        stiffest = alone.tangent.max()
        np.testing.assert_allclose(point.tangent, alone.tangent, atol=1e-6 * stiffest)
        assert point.residual <= 1e-8
        assert own_residual(problem, state, point) <= 1e-8
        assert point.open_share == pytest.approx(alone.open_share, abs=0.01)


def test_a_part_of_the_box_needs_fewer_steps(prepared):
    problem = BrakeProblem(prepared, 2, friction_pressure, BAND)
    box = Box(np.array([0.1, 0.2]), np.array([0.4, 0.5]))
    local = problem.local_field(box, interpolation(3, 2))
    theta = box.place(random_points(8, 2))
    states = [friction_pressure(row) for row in theta]
    operating, none = [s.operating for s in states], [{}] * len(states)
    near, far = local.solve(theta, operating, none), problem.field.solve(theta, operating, none)
    for a, b, state in zip(near, far, states, strict=True):
        np.testing.assert_allclose(a.gap, b.gap, atol=1e-8 * np.abs(b.gap).max())
        assert a.iterations <= b.iterations
        assert own_residual(problem, state, a) <= 1e-8


@pytest.mark.parametrize("state_at", [friction_pressure, with_components])
def test_batches_have_the_equations_of_single_points(prepared, state_at):
    """At any gaps, balanced or not, several points at once."""
    problem = BrakeProblem(prepared, 2, state_at, BAND)
    states = [state_at(row) for row in random_points(4, 2, seed=3)]
    changes = [problem._changes(s) for s in states]
    batch = GapEquations(prepared.space, [s.operating for s in states], changes)
    rng = np.random.default_rng(0)
    g = prepared.nominal_gap + 1e-6 * rng.standard_normal((4, len(prepared.nominal_gap)))
    F, p, kappa = batch.imbalance(g)
    relative = batch.relative(F, g)
    for i, (state, change) in enumerate(zip(states, changes, strict=True)):
        single = GapEquations(prepared.space.changed(change), [state.operating])
        (F1,), (p1,), (kappa1,) = single.imbalance(g[i][None])
        np.testing.assert_allclose(F[i], F1, atol=1e-9 * np.abs(F1).max())
        np.testing.assert_array_equal(p[i], p1)
        np.testing.assert_array_equal(kappa[i], kappa1)
        assert relative[i] == pytest.approx(single.relative(F1[None], g[i][None])[0], rel=1e-6)


def test_lift_off_of_part_of_the_contact(prepared):
    """Unilateral law: gaps have kinks where points open, and the starts are then poor."""

    def state_at(theta):
        law = contact_law("unilateral", stiffness=5e11)
        friction, pressure = 0.35 + 0.35 * theta[0], 6e5 * (1 + 0.5 * theta[1])
        return DesignState(replace(NOMINAL, friction=friction, brake_pressure=pressure, law=law))

    problem = BrakeProblem(prepared, 2, state_at, BAND)
    theta = random_points(8, 2, seed=5)
    points = problem.working_points(theta)
    shares = []
    for row, point in zip(theta, points, strict=True):
        alone = state_working_point(prepared, state_at(row))
        assert isinstance(point, WorkingPoint)
        size = np.abs(alone.gap).max()
        np.testing.assert_allclose(point.gap, alone.gap, atol=1e-6 * size)
        assert point.residual <= 1e-8
        np.testing.assert_array_equal(point.tangent > 0, alone.tangent > 0)
        shares.append(point.open_share)
    assert max(shares) > 0.05  # part of the contact is open indeed


def test_a_node_without_a_working_point_leaves_no_field(prepared, monkeypatch):
    from squealstudy.modes.reanalysis import brake_problem

    genuine = state_working_point

    def failing(prepared_, state, known=None):
        if state.operating.friction > 0.69:
            raise ConvergenceError("working_point", "none here")
        return genuine(prepared_, state, known)

    monkeypatch.setattr(brake_problem, "state_working_point", failing)
    problem = BrakeProblem(prepared, 1, lambda t: friction_pressure([t[0], 0.0]), BAND)
    assert problem.field is None
    box = Box(np.array([-1.0]), np.array([1.0]))
    assert problem.local_field(box, interpolation(8, 1)) is None
    theta = np.array([[0.0], [1.0]])
    there, none = problem.working_points(theta)  # each for itself then
    assert isinstance(there, WorkingPoint)
    assert isinstance(none, ConvergenceError)
    with pytest.raises(ConvergenceError, match="none here"):
        problem.weights(theta[1])


def test_points_far_beyond_the_nodes_are_refused_rather_than_wrong(prepared):
    """Simplified Newton from absurd starts gives None or the working point."""
    problem = BrakeProblem(prepared, 1, lambda t: friction_pressure([0.0, t[0]]), BAND)
    good = problem.field
    wild = WorkingPointField(
        good.space, good.node_gaps - 1e-4, good.cardinals, good.anchors
    )  # pressures beyond 1e20 Pa
    theta = np.linspace(-1, 1, 5)[:, None]
    states = [problem.state_at(row) for row in theta]
    found = wild.solve(theta, [s.operating for s in states], [{}] * 5)
    for state, point in zip(states, found, strict=True):
        assert point is None or own_residual(problem, state, point) <= 1e-8
    assert None in found
