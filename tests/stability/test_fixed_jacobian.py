"""The plain fixed Jacobian: closed-form boundaries of one point, agreement on many cells."""

from __future__ import annotations

import itertools
from dataclasses import replace

import newmark_reference as twin
import numpy as np
import pytest
from shared_kernels import OF_TRACED_ITERATIONS, marks_of_case

from squealstudy.errors import ParameterError
from squealstudy.kernels.newmark_layout import POINT_NORMAL
from squealstudy.laboratory.method_stability import fixed_jacobian
from squealstudy.laboratory.method_stability.contact_models import (
    ContactState,
    rough_state,
    sliding_state,
)
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    FAILED,
    SLOW,
    checked,
    known_cases,
)
from squealstudy.laboratory.method_stability.fixed_jacobian import FIXED_JACOBIAN as ROUGH
from squealstudy.laboratory.method_stability.fixed_jacobian import FIXED_JACOBIAN_POINT as POINT
from squealstudy.motion.warmup import warm_kernels


def stuck_state(values):
    """One point that moves with the belt, about a state without friction."""
    state = sliding_state(values)
    v0 = np.array([0.0, -values["sliding_speed"] / state.system.T1[0, 1]])
    pressed = state.design.points(state.system)[POINT_NORMAL]
    force = np.column_stack([pressed, 0 * pressed, 0 * pressed])
    return ContactState(state.system, replace(state.design, force=force, v0=v0))


def crossing(above, low, high):
    """Where `above` turns true, by bisection of the logarithm."""
    assert not above(low)
    assert above(high)
    for _ in range(16):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if above(middle) else (middle, high)
    return np.sqrt(low * high)


@OF_TRACED_ITERATIONS
@pytest.mark.parametrize("contact_factor", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("step", [3e-4, 1e-3])
def test_one_point_converges_up_to_j_lin_and_twice_k_c(step, contact_factor):
    def diverges(preload):
        values = {"step": step, "contact_factor": contact_factor, "preload": preload}
        return POINT.evaluate(values).measured > 1.0

    system = sliding_state(checked(POINT.knobs, {})).system
    k_ref = system.k_ref[0]
    own, mass = (2 * np.pi * 1e3) ** 2, 1 / system.N[0, 0] ** 2
    c = 2 * 0.01 * np.sqrt(own + k_ref / mass)
    j_lin = mass * (4 / step**2 + 2 * c / step + own)
    limit = crossing(diverges, 0.5, 2e2)
    assert limit * k_ref == pytest.approx(j_lin + 2 * contact_factor * k_ref, rel=1e-3)
    values = {"step": step, "contact_factor": contact_factor, "preload": limit}
    assert POINT.evaluate(values).predicted == pytest.approx(1.0, rel=2e-3)


@OF_TRACED_ITERATIONS
@pytest.mark.parametrize("step", [1e-6, 1e-5])
def test_a_stuck_point_converges_up_to_its_stick_number(step):
    values = {"step": step, "friction": 5.0}
    settings = fixed_jacobian.plain_settings(step, 1.0)

    def diverges(kt):
        state = stuck_state(checked(POINT.knobs, {**values, "kt": kt}))
        end = fixed_jacobian.solved(state, step)
        return fixed_jacobian.local_contraction(state, settings, end) > 1.0

    state = stuck_state(checked(POINT.knobs, values))
    own, c = state.system.omega2[1], state.design.c[1]
    D = 1 + step * c / 2 + step**2 * own / 4
    weight = state.system.area[0] * state.system.T1[0, 1] ** 2
    assert crossing(diverges, 1e8, 1e11) == pytest.approx(2 * D / (step * weight), rel=1e-3)


GRIDS = [
    {"step": np.geomspace(1e-7, 3e-5, 9), "kt": np.geomspace(1e8, 1e13, 9)},
    {"preload": np.geomspace(0.1, 100, 9), "contact_factor": [0.0, 1.0, 2.0], "step": [1e-5]},
    {"lambda": np.geomspace(5e4, 5e6, 9), "friction": [0.0, 0.5, 1.0], "step": [1e-5]},
]


@OF_TRACED_ITERATIONS
def test_agreement_away_from_the_boundary():
    cells = [
        ROUGH.evaluate(dict(zip(grid, values, strict=True)))
        for grid in GRIDS
        for values in itertools.product(*grid.values())
    ]
    far = [x for x in cells if abs(x.predicted - 1) > 0.02]
    forecast = np.array([x.predicted < 1 for x in far])
    assert min(forecast.sum(), (~forecast).sum()) > 30
    assert np.mean(forecast == [x.outcome in (CONVERGED, SLOW) for x in far]) >= 0.99
    assert np.mean(forecast == [x.measured < 1 for x in far]) >= 0.99
    assert all(x.flagged == (x.outcome == FAILED) for x in cells)
    slow = [x for x in far if 0.8 < x.predicted < 2.0]
    assert len(slow) > 5
    np.testing.assert_allclose([x.measured for x in slow], [x.predicted for x in slow], rtol=0.1)


def test_the_state_sticks_slips_and_is_open():
    state = rough_state(checked(ROUGH.knobs, {}))
    end = fixed_jacobian.solved(state, 1e-6)
    w = np.abs(state.design.speed + state.system.T1 @ end.v)
    p, _ = state.design.contact.evaluate(state.design.gap + state.system.N @ end.q)
    sticks = state.design.friction.k_t * w < 0.5 * p
    assert sticks.sum() >= 2
    assert (~sticks).sum() >= 3
    assert (p < 0.01 * p.mean()).sum() >= 1


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_consistent_jacobian_is_the_slope_of_the_residual(friction):
    values = checked(ROUGH.knobs, {"friction": friction, "step": 3e-6})
    state, h = rough_state(values), 3e-6
    system = replace(state.system, gap=state.design.gap, force=state.design.force)
    end = fixed_jacobian.solved(state, h)

    a1 = end.pull - state.design.c * end.v - system.omega2 * end.q

    def residual(a):
        q, v = end.q + h * h / 4 * (a - a1), end.v + h / 2 * (a - a1)
        return a - twin.acceleration(system, state.design, q, v)

    size = 1e-4 * np.abs(a1).max()
    slopes = [
        (residual(a1 + size * e) - residual(a1 - size * e)) / (2 * size) for e in np.eye(system.n)
    ]
    _, J = fixed_jacobian.jacobians(state, end.q, end.v, h, 1.0)
    np.testing.assert_allclose(np.array(slopes).T, J, atol=1e-6 * np.abs(J).max())


@OF_TRACED_ITERATIONS
def test_what_newton_cannot_solve_is_a_cell():
    cell = ROUGH.evaluate({"step": 1e-5, "lambda": 5e7})
    assert cell.outcome == FAILED
    assert cell.flagged
    assert "newton" in cell.by
    assert np.isnan(cell.predicted)


def test_rates_are_read_where_they_are_geometric():
    e = 0.9 ** np.arange(200.0)
    assert fixed_jacobian.rate(e) == pytest.approx(0.9)
    assert fixed_jacobian.rate(np.maximum(e, 1e-4)) == pytest.approx(0.9)
    assert fixed_jacobian.rate(np.minimum(1.5 ** np.arange(99.0), 1e6)) == pytest.approx(1.5)
    assert fixed_jacobian.rate(np.array([1.0, 1e7, 1e7])) == pytest.approx(1e7)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=marks_of_case(name)) for name in known_cases()]
)
def test_knobs_are_checked(name):
    if name == "storage":  # in one process of the session: both would take as long
        warm_kernels(single_storage=True)
    case = known_cases()[name]
    knob = next(iter(case.knobs.values()))
    for values, key in (
        ({"nothing": 1.0}, "nothing"),
        ({knob.name: 2 * knob.high}, knob.name),
        ({knob.name: np.nan}, knob.name),
    ):
        with pytest.raises(ParameterError) as caught:
            case.evaluate(values)
        assert caught.value.key == key
    assert all(k.low <= k.default <= k.high for k in case.knobs.values())
    assert case.evaluate({}).outcome == CONVERGED
