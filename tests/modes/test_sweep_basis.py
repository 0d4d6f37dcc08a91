"""Sweep bases and windows of the coarse brake against dense, at points no basis was trained on."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import NOMINAL
from synthetic import (
    HZ,
    SyntheticProblem,
    constant,
    in_order,
    random_brake,
    random_points,
    whole_box,
)

from squealstudy.errors import ConvergenceError
from squealstudy.laws import contact_law, friction_curve
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import state_working_point
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.reanalysis.estimate import bounded, two_sided_error
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import collocate
from squealstudy.modes.reanalysis.problem import in_band, lightly_damped
from squealstudy.modes.reanalysis.sweep_basis import (
    BASIS_BAND_FACTOR,
    _first_points,
    _next_points,
    _snapshots,
    _truncated,
    build_sweep_basis,
    corners,
    estimated_error,
    sample_box,
)
from squealstudy.modes.rungs.windows import Windows
from squealstudy.system.linearise import linearise

BAND = (500.0, 4000.0)
ABOVE = (2500.0, 4000.0)  # of many modes
TOLERANCE = 1e-4
ENERGETIC = ("caliper", 7)


def friction_pressure(theta):
    pressure = 4e5 * 5 ** ((1 + theta[1]) / 2)
    return DesignState(replace(NOMINAL, friction=0.35 + 0.35 * theta[0], brake_pressure=pressure))


def friction(theta):
    return DesignState(replace(NOMINAL, friction=0.35 + 0.35 * theta[0]))


def falling_friction(theta):
    """From no friction at all on: the term of the slope vanishes there."""
    operating = replace(
        NOMINAL, friction=0.35 + 0.35 * theta[0], curve=friction_curve(static_ratio=1.3)
    )
    return DesignState(operating)


def component_frequency(theta):
    return DesignState(NOMINAL, {ENERGETIC: 1.0 + 0.5 * theta[0]})


def component_damping(theta):
    return DesignState(NOMINAL, mode_damping={ENERGETIC: 0.05 * (1 + theta[0])})


def lifting_off(middle, half):
    law = contact_law("unilateral", stiffness=5e11)

    def state_at(theta):
        friction = middle + half * theta[0]
        return DesignState(replace(NOMINAL, friction=friction, brake_pressure=6e5, law=law))

    return state_at


def dense(prepared, state, band=BAND):
    """Roots of the band by the path of single points: own working point, own linearisation."""
    point = state_working_point(prepared, state)
    system = linearise(prepared.model, point, state)
    return dense_roots(system.C, system.K, tuple(2 * np.pi * f for f in band))[0]


def compared(prepared, problem, theta, found, tolerance):
    """Light roots against dense ones: true and estimated relative errors, unstable modes alike."""
    true, estimate = [], []
    for at, p in zip(theta, found, strict=True):
        exact = dense(prepared, problem.state_at(at))
        edge = np.abs(np.abs(exact)[:, None] / np.array(problem.band) - 1).min(axis=1)
        clear = exact[lightly_damped(exact) & (edge > 50 * tolerance)]
        distance = np.abs(clear[:, None] - p.lam[None])
        partner = distance.argmin(axis=1)
        assert len(set(partner)) == len(clear)  # none missed
        true.append(distance.min(axis=1) / np.abs(clear))
        estimate.append(p.error[partner] / np.abs(clear))
        nearest = np.abs(p.lam[:, None] - exact[None]).min(axis=1)
        mine = lightly_damped(p.lam) & (nearest > 20 * tolerance * np.abs(p.lam))
        assert not mine.any()  # none made up
        complete = 3 * tolerance * np.abs(exact)
        assert (exact.real > complete).sum() <= (p.lam.real > 0).sum()
        assert (p.lam.real > 3 * tolerance * np.abs(p.lam)).sum() <= (exact.real > 0).sum()
    return np.concatenate(true), np.concatenate(estimate)


def covered(true, estimate, floor):
    ratio = (true / estimate)[true > floor]
    assert ratio.max(initial=0.0) <= 5.0
    assert (ratio <= 2.0).sum() >= 0.95 * len(ratio)


# -- the basis alone -------------------------------------------------------------------------
@pytest.fixture(scope="module")
def map_problem(prepared):
    return BrakeProblem(prepared, 2, friction_pressure, BAND)


@pytest.fixture(scope="module")
def map_basis(map_problem):
    return build_sweep_basis(map_problem, TOLERANCE)


def test_the_basis_meets_its_tolerance(prepared, map_problem, map_basis):
    """And its estimates tell by how much, mode by mode."""
    assert map_basis.error <= TOLERANCE
    assert map_basis.V.shape[1] < 0.8 * prepared.model.n
    true, estimate = [], []
    interpolated = map_problem.interpolation_error()
    for theta in random_points(4, 2, seed=42):
        assert np.abs(map_basis.trained - theta).sum(axis=1).min() > 1e-3
        weights = map_problem.weights(theta)
        pairs = map_basis.pairs(weights)
        pairs = pairs.take(in_band(pairs.lam, map_problem.band, 1.05))
        full = map_basis.expand(weights, pairs)
        error = bounded(two_sided_error(map_problem, weights, full), pairs.lam)
        error += interpolated * np.abs(pairs.lam)
        exact = dense(prepared, friction_pressure(theta))
        exact = exact[lightly_damped(exact)]
        distance = np.abs(exact[:, None] - pairs.lam)
        true.append(distance.min(axis=1) / np.abs(exact))
        estimate.append(error[distance.argmin(axis=1)] / np.abs(exact))
    true, estimate = np.concatenate(true), np.concatenate(estimate)
    assert true.max() <= 3 * TOLERANCE
    covered(true, estimate, 0.02 * TOLERANCE)  # parts of smaller ones may cancel by chance


@pytest.mark.full_size  # by default of the whole band: below
def test_a_band_with_modes_below_it_has_no_root_that_none_of_the_brake_is(prepared):
    """Parts of modes that a basis lacked had Ritz values in the band: errors of 7, not 1e-4."""
    problem = BrakeProblem(prepared, 1, lambda theta: friction_pressure([theta[0], 0.0]), ABOVE)
    basis = build_sweep_basis(problem, TOLERANCE)
    assert basis.error <= TOLERANCE
    pairs = basis.pairs(problem.weights(np.array([0.3])))
    found = pairs.lam[in_band(pairs.lam, problem.band, 1.0)]
    exact = dense(prepared, friction_pressure([0.3, 0.0]), ABOVE)
    assert (np.abs(exact) < 1.01 * problem.band[1]).sum() > 10
    away = np.abs(found[:, None] - exact).min(axis=1) / np.abs(found)
    assert away[np.abs(found.imag) > 0].max() < 10 * TOLERANCE


def test_two_points_are_trained_at_where_both_need_it():
    points = np.array([[-1.0, 0.0], [-0.9, 0.0], [1.0, 0.0]])

    def chosen(*errors):
        return _next_points(points, np.array(errors), 1e-4)[:, 0].tolist()

    assert chosen(3e-3, 2e-3, 1e-3) == [-1.0, 1.0]  # the neighbour would tell the same
    assert chosen(3e-3, 2e-5, 1e-5) == [-1.0]
    assert chosen(1e-3, 1e-3, 3e-3) == [1.0, -1.0]
    assert _next_points(points[:1, :0], np.array([1e-3]), 1e-4).shape == (0, 0)


def test_the_estimate_corrects_its_root(prepared, map_problem, map_basis):
    """Added to the roots of a coarse basis, the signed estimate takes most of the error away."""
    theta = np.array([0.3, -0.4])
    weights = map_problem.weights(theta)
    exact = dense(prepared, friction_pressure(theta))
    exact = exact[lightly_damped(exact)]
    pairs = map_basis.pairs(weights)
    partner = np.abs(exact[:, None] - pairs.lam).argmin(axis=1)
    pairs = pairs.take(partner)
    signed = two_sided_error(map_problem, weights, map_basis.expand(weights, pairs))
    before, after = np.abs(pairs.lam - exact), np.abs(pairs.lam - signed - exact)
    assert after.max() < 0.5 * before.max()


def test_the_basis_is_orthonormal_with_diagonal_stiffness(map_problem, map_basis):
    V = map_basis.V
    np.testing.assert_allclose(V.T @ V, np.eye(V.shape[1]), atol=1e-9)
    K0 = V.T @ (np.linalg.inv(map_problem.flexibility(np.eye(len(V))))) @ V
    scale = np.sqrt(np.outer(map_basis.flexibility, map_basis.flexibility))
    np.testing.assert_allclose(K0 * scale, np.eye(V.shape[1]), atol=1e-5)


# -- windows over the brake ------------------------------------------------------------------
@pytest.mark.parametrize(
    ("state_at", "tolerance", "count"),
    [
        (falling_friction, 1e-4, 10),
        (component_damping, 1e-5, 50),
        pytest.param(friction, 1e-4, 60, marks=pytest.mark.full_size),
        pytest.param(component_frequency, 1e-5, 50, marks=pytest.mark.full_size),
    ],
)
def test_windows_along_a_line(prepared, state_at, tolerance, count):
    problem = BrakeProblem(prepared, 1, state_at, BAND)
    basis = build_sweep_basis(problem, tolerance / 3)
    theta = np.vstack([[[-1.0], [1.0]], random_points(count - 2, 1, seed=1)])
    found = in_order(Windows(problem, basis, tolerance).solve(whole_box(1), theta))
    assert any(p.method == "windows" for p in found) == (count >= 50)
    some = [i for i in range(len(theta)) if i < 2 or i % (count // 5) == 0]
    chosen = [found[i] for i in some]
    true, estimate = compared(prepared, problem, theta[some], chosen, tolerance)
    assert true.max() <= 2 * tolerance
    covered(true, estimate, 1e-3 * tolerance)


def test_no_unstable_mode_is_missed_or_made_up(prepared, map_problem, map_basis):
    """Over friction and pressure, against dense at 10 of 40 random points."""
    part = Box(np.array([-1.0, -1.0]), np.array([0.0, 0.0]))
    theta = part.place(random_points(40, 2, seed=8))
    found = in_order(Windows(map_problem, map_basis, 3 * TOLERANCE).solve(part, theta))
    true, estimate = compared(prepared, map_problem, theta[::4], found[::4], 3 * TOLERANCE)
    assert true.max() <= 6 * TOLERANCE
    covered(true, estimate, 1e-7)


def damped_map(theta):
    """Modal damping of all assembly modes, which rises with the friction."""
    return replace(friction_pressure(theta), damping_ratio=0.004 * (1.5 + 0.5 * theta[0]))


@pytest.mark.full_size  # other tests of interpolated damping stand below
def test_modal_damping_over_friction_and_pressure(prepared):
    """Its matrix has no terms of its own: it is interpolated, and no error estimate sees that."""
    problem = BrakeProblem(prepared, 2, damped_map, BAND)
    assert problem.interpolation_error() < 0.1 * TOLERANCE
    basis = build_sweep_basis(problem, TOLERANCE / 3)
    part = Box(np.array([-1.0, -1.0]), np.array([0.0, 0.0]))
    theta = part.place(random_points(40, 2, seed=8))
    found = in_order(Windows(problem, basis, TOLERANCE).solve(part, theta))
    assert any(p.method == "windows" for p in found)
    true, _ = compared(prepared, problem, theta[::8], found[::8], TOLERANCE)
    assert true.max() <= 2 * TOLERANCE
    _, exact = problem.pairs(theta[0], 1.0)
    point = dense(prepared, damped_map(theta[0]))
    assert np.abs(exact.lam[:, None] - point).min(axis=1).max() < 1e-8 * problem.band[1]


def damped_box(theta):
    """Modal damping over friction, pressure and speed, itself a parameter too."""
    state = friction_pressure(theta)
    operating = replace(state.operating, sliding_speed=0.1 * 30 ** ((theta[2] + 1) / 2))
    return replace(state, operating=operating, damping_ratio=0.005 + 0.001 * theta[3])


def test_modal_damping_is_interpolated_over_what_stiffens_the_brake(prepared):
    """Neither the speed nor the damping itself does: more nodes are left for the others."""
    problem = BrakeProblem(prepared, 4, damped_box, BAND)
    assert problem.interpolation_error() < 0.1 * 1e-4
    theta = random_points(1, 4, seed=2)
    weights = problem.modal_damping.weights
    np.testing.assert_array_equal(weights(theta), weights(theta * [1, 1, 0, 0]))
    assert np.abs(weights(theta) - weights(theta * [0.9, 1, 1, 1])).max() > 0


def test_damping_of_a_design_without_parameters(prepared):
    """Interpolated over nothing: at its one point the damping is exact."""
    problem = BrakeProblem(
        prepared, 0, lambda theta: DesignState(NOMINAL, damping_ratio=0.01), BAND
    )
    assert len(problem.modal_damping.matrices) == 1
    assert problem.interpolation_error() < 1e-10 * 0.01
    rising = BrakeProblem(
        prepared, 1, lambda theta: DesignState(NOMINAL, damping_ratio=0.01 * (1 + theta[0])), BAND
    )
    assert rising.modal_damping is not None  # though there is none at one end


def test_interpolated_damping_is_looked_at_inside_the_box_too(prepared):
    """A field is wrong there and right at the corners: up to the band's top, times the ratio."""
    problem = BrakeProblem(prepared, 2, damped_map, BAND)

    def wrong_inside(theta, K, top):
        return top / problem.band[1] * (np.abs(theta) < 1).all()

    problem.modal_damping = SimpleNamespace(error=wrong_inside)
    assert 0.004 < problem.interpolation_error() < 0.008


def test_undamped_problems_have_no_modal_damping(map_problem):
    assert map_problem.modal_damping is None
    assert map_problem.interpolation_error() == 0.0


@pytest.mark.parametrize(
    ("middle", "half", "share", "change"),
    [
        pytest.param(0.35, 0.35, 0.15, 0.01, marks=pytest.mark.full_size),
        pytest.param(2.4, 0.5, 0.5, 0.25, marks=pytest.mark.full_size),
    ],
)
def test_lift_off_of_part_of_the_contact(prepared, middle, half, share, change):
    """Points open one after another along the sweep: weights are not smooth there.

    More than half of them do where friction would tip the pads over.
    """
    problem = BrakeProblem(prepared, 1, lifting_off(middle, half), BAND)
    basis = build_sweep_basis(problem, TOLERANCE / 3)
    theta = np.linspace(-1, 1, 12)[:, None]
    found = in_order(Windows(problem, basis, TOLERANCE).solve(whole_box(1), theta))
    opened = [p.at.working_point.open_share for p in found]
    assert max(opened) > share
    assert max(opened) - min(opened) > change
    true, estimate = compared(prepared, problem, theta[::4], found[::4], TOLERANCE)
    assert true.max() <= 2 * TOLERANCE
    covered(true, estimate, 1e-7)


def test_snapshots_hold_both_modes_of_their_point(map_problem):
    """Real and imaginary parts, of unit energy each: any phase of a mode is in their span."""
    theta = np.array([0.2, -0.7])
    block = _snapshots(map_problem, theta)
    shapes, (_, pairs) = (
        map_problem.from_energy(block),
        map_problem.pairs(theta, BASIS_BAND_FACTOR, below=True),
    )
    m = len(pairs.lam)
    assert block.shape[1] == 4 * m
    for Z, parts in ((pairs.X, shapes[:, : 2 * m]), (pairs.Y, shapes[:, 2 * m :])):
        turned = Z * np.exp(1j * np.arange(m))
        for seen in (turned.real, turned.imag):
            left = seen - parts @ np.linalg.lstsq(parts, seen, rcond=None)[0]
            assert np.abs(left).max() < 1e-8 * np.abs(seen).max()
    energy = (block**2).sum(axis=0).reshape(2, 2, m).sum(axis=1)
    np.testing.assert_allclose(energy, 1.0, rtol=1e-12)


def test_first_points_are_two_corners_and_the_middle():
    assert _first_points(2).tolist() == [[-1.0, -1.0], [1.0, 1.0], [0.0, 0.0]]
    assert _first_points(0).shape == (1, 0)


def test_what_is_kept_of_snapshots_does_not_depend_on_their_size(map_problem):
    block = _snapshots(map_problem, np.array([0.2, -0.7]))
    plain, bigger = (_truncated(map_problem, s * block, 0.3) for s in (1.0, 1e3))
    assert 2 < plain[0].shape[1] == bigger[0].shape[1] < block.shape[1]
    np.testing.assert_allclose(plain[1], bigger[1], rtol=1e-8)


def uncoupled(frequencies, ratios):
    """One coordinate a mode; the first three share a spring that is a parameter."""
    w = HZ * np.array(frequencies)
    spring = np.zeros(len(w))
    spring[:3] = w[0] * np.array([0.1, 0.05, 0.02])
    return SyntheticProblem(
        [(np.diag(w**2), constant()), (np.outer(spring, spring), lambda t: t[0])],
        [(np.diag(2 * np.array(ratios) * w), constant())],
        1,
        (200.0, 1000.0),
    )


@pytest.mark.parametrize(("ratio", "counts"), [(0.002, True), (0.3, False)])
def test_errors_of_light_modes_in_the_band_count_alone(ratio, counts):
    """Of a basis that has all modes without the spring: of its error, the relative one."""
    problem = uncoupled([500.0, 1500.0, 2500.0], [ratio, 0.002, 0.002])
    basis = build_sweep_basis(problem, 1e-10)
    V = np.eye(3)[:, :2]
    samples = [problem.weights(t) for t in ([-1.0], [0.0], [1.0])]
    small = collocate(problem.system, samples, V, V, 1e-12)
    coarse = replace(basis, V=V, flexibility=1 / np.diag(problem.matrices(np.zeros(1))[1])[:2])
    coarse = replace(coarse, small=small)
    theta = np.ones(1)
    exact, found = problem.roots(theta)[0], coarse.pairs(problem.weights(theta)).lam
    true = np.abs(found - exact).min() / np.abs(exact)
    assert true > 1e-9
    estimate = estimated_error(problem, coarse, theta)
    assert estimate == (pytest.approx(true, rel=0.2) if counts else 0.0)


# -- how a basis is made -----------------------------------------------------------------------
def test_samples_fill_the_box():
    for dimension in (1, 2, 5):
        points = sample_box(dimension, 50, seed=0)
        assert points.shape == (50, dimension)
        assert np.abs(points).max() <= 1
        assert np.abs(points.mean(axis=0)).max() < 0.1
        np.testing.assert_array_equal(points, sample_box(dimension, 50, seed=0))
        assert len(np.unique(corners(dimension), axis=0)) == min(2**dimension, 16)
        assert (np.abs(corners(dimension)) == 1).all()
    assert sample_box(0, 5, 0).shape == corners(0).shape == (1, 0)


def test_a_study_without_parameters():
    """One design point: the basis of its own modes, the windows of none."""
    plain = random_brake(12, 1, 1)
    C, K = plain.matrices(np.zeros(1))
    problem = SyntheticProblem([(K, constant())], [(C, constant())], 0, (300.0, 2400.0))
    basis = build_sweep_basis(problem, 1e-6)
    found = in_order(Windows(problem, basis, 1e-6).solve(whole_box(0), np.zeros((2, 0))))
    exact = problem.roots(np.zeros(0))
    for p in found:
        np.testing.assert_allclose(np.sort(np.abs(p.lam)), np.abs(exact), rtol=1e-6)


def test_a_mode_that_corners_do_not_show_is_found():
    """Decoupled, in the band in the middle of the box only: no residual of another tells of it."""
    frequencies = 2 * np.pi * np.array([0.0, 300.0, 600.0, 800.0])
    moving = np.diag([(2 * np.pi) ** 2, 0.0, 0.0, 0.0])
    problem = SyntheticProblem(
        [
            (np.diag(frequencies**2), constant()),
            (moving, lambda t: (500.0 + 1500.0 * t[0] ** 2) ** 2),
        ],
        [(np.eye(4), constant())],
        1,
        (200.0, 1000.0),
    )
    basis = build_sweep_basis(problem, 1e-4)
    assert basis.V.shape[1] == 4


def test_its_seconds_are_those_of_the_processor():
    started = time.process_time()
    basis = build_sweep_basis(random_brake(6, 1, 1), 1e-4, report=lambda *_: time.sleep(0.2))
    assert 0.0 < basis.seconds <= time.process_time() - started < 0.2 + basis.seconds


def test_a_box_without_working_points_says_so():
    problem = random_brake(6, 1, 1)
    problem.refused = lambda theta: ConvergenceError("working_point", "none")
    with pytest.raises(ConvergenceError, match="most of the box has no working point"):
        build_sweep_basis(problem, 1e-4)


def test_a_box_without_working_points_at_its_ends():
    problem = random_brake(12, 1, 1)
    problem.refused = lambda theta: (
        ConvergenceError("working_point", "none") if abs(theta[0]) > 0.9 else None
    )
    basis = build_sweep_basis(problem, 1e-4)
    assert np.abs(basis.trained).max() <= 0.9
