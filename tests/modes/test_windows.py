"""Windows against exact roots: every way in which following modes over a box may go wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from synthetic import (
    HZ,
    Audit,
    SyntheticProblem,
    constant,
    in_order,
    matched,
    random_brake,
    random_points,
    solved,
    whole_box,
)

from squealstudy.errors import ConvergenceError
from squealstudy.modes.point import DENSE
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.polynomials import collocate, interpolation
from squealstudy.modes.reanalysis.problem import lightly_damped
from squealstudy.modes.reanalysis.ritz import ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import build_sweep_basis
from squealstudy.modes.rungs.windows import Windows


def line(count, ends=1.0):
    """Points (count, 1) over [-ends, ends]."""
    return np.linspace(-ends, ends, count)[:, None]


def audited(problem, theta, tolerance, box=None):
    """Solve, check against exact roots, and give back the solver and its points."""
    windows, found = solved(problem, theta, tolerance, box)
    assert len(found) == len(theta)
    Audit(problem, theta, found, tolerance).check(tolerance)
    return windows, found


def share(found, method):
    return np.mean([p.method == method for p in found])


def mixed(n, seed=3):
    """An orthogonal change of coordinates (n, n): nothing stays diagonal."""
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]


def in_coordinates(Q, parts):
    return [(Q @ A @ Q.T, f) for A, f in parts]


def oscillators(frequencies_hz, damping=0.001):
    """Stiffness and damping terms of uncoupled modes."""
    w = HZ * np.asarray(frequencies_hz, dtype=float)
    return np.diag(w**2), np.diag(2 * damping * w)


# -- boxes of any dimension ------------------------------------------------------------------
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
@pytest.mark.parametrize(("dimension", "n"), [(1, 6), (1, 40), (2, 20), (3, 12), (5, 12)])
def test_roots_of_a_box_keep_the_tolerance(dimension, n, tolerance):
    audited(random_brake(n, dimension, seed=1), random_points(120, dimension), tolerance)


def test_patches_serve_many_points_of_few_dimensions():
    for dimension in (1, 2):
        windows, found = solved(random_brake(20, dimension, 1), random_points(300, dimension), 1e-4)
        assert share(found, "windows") > 0.95
        assert windows.counts["nodes"] < 100


@pytest.mark.parametrize("seed", range(4))
def test_strong_veering(seed):
    problem = random_brake(20, 1, seed, coupling=0.4)
    audited(problem, line(101), 1e-4)


@pytest.mark.parametrize("seed", range(2))
def test_undamped_lock_ins_of_many_pairs(seed):
    audited(random_brake(30, 1, seed, coupling=0.8, damping=0.0), line(101), 1e-4)


def test_the_sweep_basis_serves_few_points():
    _, found = audited(random_brake(20, 2, 1), random_points(12, 2), 1e-4)
    assert share(found, "sweep_basis") == 1.0


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_box_without_width_in_one_direction(dimension):
    problem, theta = random_brake(12, dimension, 3), random_points(150, dimension)
    theta[:, -1] = 0.3
    _, tight = audited(problem, theta, 1e-4)
    flat = whole_box(dimension)
    flat.low[-1] = flat.high[-1] = 0.3
    _, found = audited(problem, theta, 1e-4, flat)
    for a, b in zip(tight, found, strict=True):
        np.testing.assert_allclose(a.lam, b.lam, rtol=1e-10)


def test_one_point_many_times_and_none_at_all():
    problem = random_brake(12, 2, 3)
    _, found = audited(problem, np.tile([[0.3, -0.2]], (60, 1)), 1e-6)
    for p in found:
        np.testing.assert_allclose(p.lam, found[0].lam, rtol=1e-10)
    assert solved(problem, np.zeros((0, 2)), 1e-4)[1] == []


def test_corners_and_faces_of_a_box():
    """Nodes lie inside: corners are extrapolated."""
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 11)] * 2), -1).reshape(-1, 2)
    audited(random_brake(20, 2, 5), grid, 1e-5)
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    audited(random_brake(12, 3, 5), np.vstack([corners, random_points(150, 3)]), 1e-4)


def test_a_part_of_the_box():
    problem = random_brake(20, 2, 1)
    part = Box(np.array([-0.2, 0.1]), np.array([0.3, 0.9]))
    audited(problem, part.place(random_points(150, 2)), 1e-6, part)


def test_results_do_not_depend_on_the_order_of_points():
    problem, theta = random_brake(20, 2, 1), random_points(120, 2)
    order = np.random.default_rng(9).permutation(len(theta))
    _, plain = solved(problem, theta, 1e-5)
    _, shuffled = solved(problem, theta[order], 1e-5)
    for row, p in zip(order, shuffled, strict=True):
        assert plain[row].method == p.method
        np.testing.assert_allclose(p.lam, plain[row].lam, rtol=1e-10)


# -- coalescence and closeness ---------------------------------------------------------------
def hulten_in_a_crowd(coupling, seed=5, extra=8):
    """An undamped pair that locks in beside other modes; `coupling` turns its subspace with mu."""
    rng = np.random.default_rng(seed)
    w = HZ * np.concatenate([[100.0, 75.0], np.sort(rng.uniform(150, 400, extra))])
    n = len(w)
    Kf = np.zeros((n, n))
    Kf[0, 1], Kf[1, 0] = -(w[1] ** 2), w[0] ** 2
    A = rng.standard_normal((n, n)) / np.sqrt(n)
    S = coupling * np.diag(w) @ (A + A.T) @ np.diag(w)
    Q = mixed(n, seed)
    return [Q @ B @ Q.T for B in (np.diag(w**2), Kf, S)]


def over_friction(matrices, middle, span, damping=0.0):
    """mu = middle (1 + span theta); stiffness K0 + mu Kf + mu^2 S."""
    K0, Kf, S = matrices
    mu = lambda t: middle * (1 + span * t[0])  # noqa: E731
    dampers = [(damping * np.eye(len(K0)), constant())]
    stiffness = [(K0, constant()), (Kf, mu), (S, lambda t: mu(t) ** 2)]
    return SyntheticProblem(stiffness, dampers, 1, (50.0, 500.0))


def exceptional_friction(matrices):
    """mu where the pair near 88 Hz coalesces: (s1 - s2)^2 is analytic there, s1 and s2 are not."""
    K0, Kf, S = matrices

    def discriminant(mu):
        s = np.linalg.eigvals(K0 + mu * Kf + mu**2 * S)
        a, b = s[np.argsort(np.abs(s - (HZ * 88) ** 2))[:2]]
        return ((a - b) ** 2).real

    mu = np.linspace(0.05, 0.6, 100)
    d = np.array([discriminant(x) for x in mu])
    i = np.flatnonzero((d[:-1] > 0) & (d[1:] <= 0))[0]
    return brentq(discriminant, mu[i], mu[i + 1], xtol=1e-16, rtol=1e-14)


@pytest.mark.parametrize("coupling", [0.0, 0.05, 0.25])
@pytest.mark.parametrize("span", [0.9, 0.1])
def test_an_undamped_pair_keeps_1e_6_near_its_exceptional_point(coupling, span):
    matrices = hulten_in_a_crowd(coupling)
    critical = exceptional_friction(matrices)
    problem = over_friction(matrices, critical, span)
    distance = 10.0 ** -np.arange(2.0, 9.0)
    theta = np.concatenate([distance / span, -distance / span, np.linspace(-1, 1, 60)])
    theta = theta[np.abs(theta) <= 1][:, None]
    _, found = solved(problem, theta, 1e-6)
    assert share(found, "windows") > 0.9
    for at, p in zip(theta, found, strict=True):
        _, K = problem.matrices(at)
        s = np.linalg.eigvals(K).astype(complex)  # undamped: half the size, half the round-off
        exact = np.sqrt(-s)
        exact = np.where(exact.imag < 0, -exact, exact)
        exact = exact[(np.abs(exact) > problem.band[0]) & (np.abs(exact) < problem.band[1])]
        assert len(exact) == len(p.lam)
        error, partner = matched(exact, p.lam)
        assert (error <= 1e-6 * np.abs(exact)).all()
        assert (error <= 5 * p.error[partner] + 1e-10 * np.abs(exact)).all()


def test_lock_in_of_hulten_in_closed_form():
    matrices = hulten_in_a_crowd(0.0)
    problem = over_friction(matrices, 0.35, 1.0)
    theta = line(81)
    _, found = solved(problem, theta, 1e-6)
    w1, w2 = HZ * 100, HZ * 75
    for at, p in zip(theta, found, strict=True):
        mu = 0.35 * (1 + at[0])
        root = np.emath.sqrt(((w1**2 - w2**2) / 2) ** 2 - (mu * w1 * w2) ** 2)
        s = (w1**2 + w2**2) / 2 + np.array([root, -root])
        exact = np.emath.sqrt(-s.astype(complex))
        exact = np.where(exact.imag < 0, -exact, exact)
        pair = p.lam[np.argsort(np.abs(p.lam - exact.mean()))[:2]]
        error, _ = matched(exact, pair)
        assert (error <= 1e-6 * np.abs(exact)).all()
        if mu > 0.2917:
            assert np.isclose(pair.real.max(), exact.real.max(), atol=1e-6 * abs(exact[0]))
            assert pair.real.max() > 0


@pytest.mark.parametrize("split", [0.0, 1e-8, 1e-5])
def test_doublets_of_a_disc(split):
    """Pairs split by 1e-8 and less, turned against each other by friction and by nothing."""
    frequencies = [500.0, 500.0 * (1 + split), 900.0, 900.0 * (1 + split), 1300.0, 2000.0]
    K, C = oscillators(frequencies)
    rng = np.random.default_rng(0)
    A = 0.03 * np.sqrt(K) @ rng.standard_normal((6, 6)) @ np.sqrt(K)
    for pattern in (np.zeros((6, 6)), A):
        parts = [(K, constant()), (pattern, lambda t: 1 + t[0])]
        Q = mixed(6)
        problem = SyntheticProblem(
            in_coordinates(Q, parts), in_coordinates(Q, [(C, constant())]), 1, (200.0, 2500.0)
        )
        audited(problem, line(60), 1e-5)


@pytest.mark.parametrize("lowest", [200.0, 0.0])
def test_rigid_modes_below_the_band(lowest):
    """lambda = 0 twice per rigid mode, defective, whatever the friction."""
    K, C = oscillators([0.0, 0.0, 400.0, 700.0, 1100.0, 1500.0])
    rng = np.random.default_rng(1)
    B = np.vstack([np.zeros((2, 6)), rng.standard_normal((4, 6))])
    B[:, :2] = 0
    A = 0.1 * np.sqrt(K) @ B @ np.sqrt(K)
    Q = mixed(6)
    problem = SyntheticProblem(
        in_coordinates(Q, [(K, constant()), (A, lambda t: 1 + t[0])]),
        in_coordinates(Q, [(C, constant())]),
        1,
        (max(lowest, 1.0), 2000.0),
    )
    audited(problem, line(60), 1e-5)


def test_crossing_without_mixing():
    """Modes of different symmetry cross: their frequencies meet, their vectors never do."""
    K, C = oscillators([500.0, 600.0, 700.0, 1200.0])
    move = np.diag([0.6, 0.0, -0.3, 0.0]) @ K
    Q = mixed(4)
    problem = SyntheticProblem(
        in_coordinates(Q, [(K, constant()), (move, lambda t: t[0])]),
        in_coordinates(Q, [(C, constant())]),
        1,
        (100.0, 1500.0),
    )
    windows, found = audited(problem, line(90), 1e-6)
    assert windows.counts["patches"] == 1
    assert share(found, "windows") == 1.0


# -- edges -----------------------------------------------------------------------------------
def moved_mode(law, coupling, still=(300.0, 600.0, 800.0, 950.0, 1300.0), band=(200.0, 1000.0)):
    """A mode whose stiffness is `law(theta)` [Hz^2], coupled to others that stay."""
    n = len(still) + 1
    K, C = oscillators([0.0, *still])
    first = np.zeros((n, n))
    first[0, 0] = HZ**2
    rng = np.random.default_rng(4)
    A = rng.standard_normal((n, n))
    A = coupling * (HZ * 700) ** 2 * (A + A.T) / n
    C[0, 0] = 2 * 0.001 * HZ * 800
    Q = mixed(n)
    return SyntheticProblem(
        in_coordinates(Q, [(K + A, constant()), (first, law)]),
        in_coordinates(Q, [(C, constant())]),
        1,
        band,
    )


@pytest.mark.parametrize("coupling", [0.0, 0.02, 0.3])
def test_a_mode_moved_through_the_band(coupling):
    """From below the band, across all other modes, to beyond it."""
    problem = moved_mode(lambda t: (650.0 + 600.0 * t[0]) ** 2, coupling)
    audited(problem, line(120), 1e-5)


@pytest.mark.parametrize("nominal", [1400.0, 1600.0, 1900.0, 1990.0, 1999.0, 2100.0])
def test_a_component_mode_halved_into_the_band(nominal):
    """In the band at the very end of the box only, outside at every node."""
    law = lambda t: nominal**2 * (0.25 + (t[0] + 1) / 2 * 2.0)  # noqa: E731
    audited(moved_mode(law, 0.01), line(120), 1e-4)


@pytest.mark.parametrize("nominal", [131.0, 134.0, 140.0])
def test_a_component_mode_raised_into_the_band_from_below(nominal):
    law = lambda t: nominal**2 * (0.25 + (t[0] + 1) / 2 * 2.0)  # noqa: E731
    audited(moved_mode(law, 0.01), line(120), 1e-4)


def test_a_mode_that_dips_into_the_band_between_nodes():
    """Beyond the band at every node, inside for a moment between two of them."""
    nodes = interpolation(5, 1).nodes[:, 0]
    at = (np.sort(nodes)[3] + np.sort(nodes)[4]) / 2
    law = lambda t: 990.0**2 + 1.25e6 * (t[0] - at) ** 2  # noqa: E731
    audited(moved_mode(law, 0.01), line(150), 1e-4)


def test_a_mode_that_enters_at_one_corner_only():
    n = 6
    K, C = oscillators([300.0, 500.0, 600.0, 800.0, 950.0, 0.0])
    last = np.zeros((n, n))
    last[-1, -1] = HZ**2
    C[-1, -1] = 10.0
    Q = mixed(n)
    corner = lambda t: (995.0 + 400.0 * (3.0 - t.sum()) / 6.0) ** 2  # noqa: E731
    problem = SyntheticProblem(
        in_coordinates(Q, [(K, constant()), (last, corner), (0.02 * K, lambda t: t[0])]),
        in_coordinates(Q, [(C, constant())]),
        3,
        (200.0, 1000.0),
    )
    theta = np.vstack(
        [np.ones((1, 3)), random_points(300, 3), 1 - 0.02 * random_points(20, 3) ** 2]
    )
    audited(problem, theta, 1e-4)


# -- overdamped roots ------------------------------------------------------------------------
def damped_mode(law, couple=0.0, frequencies=(500.0, 700.0, 900.0, 1200.0, 1500.0)):
    """The second mode has the damper 2 w law(theta); `couple` ties its damper to the others."""
    K, C = oscillators(frequencies)
    n = len(K)
    rng = np.random.default_rng(2)
    b = couple * rng.standard_normal(n)
    b[1] = 1.0
    damper = 2 * HZ * frequencies[1] * np.outer(b, b)
    Q = mixed(n)
    return SyntheticProblem(
        in_coordinates(Q, [(K, constant())]),
        in_coordinates(Q, [(C, constant()), (damper, law)]),
        1,
        (200.0, 2000.0),
    )


@pytest.mark.parametrize("couple", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("low", [0.0, 0.45, 0.9])
def test_a_complex_pair_that_turns_into_two_real_roots(couple, low):
    """Damping ratio from `low` to 1.6: none of the two real roots is lost."""
    problem = damped_mode(lambda t: low + (1.6 - low) * (t[0] + 1) / 2, couple)
    _, found = audited(problem, line(121), 1e-5)
    assert any((p.lam.imag == 0).any() for p in found)


@pytest.mark.parametrize("couple", [0.1, 0.4])
def test_many_overdamped_roots(couple):
    K, C = oscillators([300.0, 450.0, 600.0, 800.0, 900.0, 1200.0, 1500.0, 1900.0])
    rng = np.random.default_rng(6)
    B = rng.standard_normal((3, 8)) * np.sqrt(2 * HZ * 600)
    Q = mixed(8)
    problem = SyntheticProblem(
        in_coordinates(Q, [(K, constant()), (couple * 0.1 * K, lambda t: t[0])]),
        in_coordinates(Q, [(C, constant()), (B.T @ B, lambda t: 1.1 + t[0])]),
        1,
        (200.0, 2000.0),
    )
    _, found = audited(problem, line(121), 1e-5)
    assert any((p.lam.imag == 0).any() for p in found)


def strongly_damped(n, dampers, seed=6):
    """Overdamped roots run through decades: friction-like coupling and damping by theta_0."""
    rng = np.random.default_rng(seed)
    K, C = oscillators(np.sort(rng.uniform(250.0, 6000.0, n)))
    B = rng.standard_normal((dampers, n)) * np.sqrt(2 * HZ * 300) / 2
    Q, A, root = mixed(n), rng.standard_normal((n, n)), np.sqrt(K)
    coupling = 0.1 * root @ (A - A.T) @ root / np.sqrt(n)
    stiffness = [(K, constant()), (coupling, lambda t: 1 + t[0]), (0.2 * K, lambda t: t[1])]
    damping = [(C, constant()), (B.T @ B, lambda t: 1.1 + t[0])]
    return SyntheticProblem(
        in_coordinates(Q, stiffness), in_coordinates(Q, damping), 2, (200.0, 2000.0)
    )


@pytest.mark.parametrize("dampers", [2, 3])
def test_estimates_of_heavily_damped_roots(dampers):
    """They hold, and are not so large that patches are divided without need."""
    problem = strongly_damped(30, dampers)
    theta = np.random.default_rng(1).uniform(-1, 1, (150, 2))
    windows, found = audited(problem, theta, 1e-3)
    assert share(found, "windows") > 0.95
    assert windows.counts["nodes"] < len(theta)
    audit = Audit(problem, theta, found, 1e-3)
    seen = audit.heavy_true > 1e-9
    ratio = audit.heavy_true[seen] / audit.heavy_estimate[seen]
    assert len(ratio) > 100
    assert ratio.max() <= 5.0
    assert (ratio <= 2.0).mean() >= 0.95


@pytest.mark.parametrize("dampers", [3, 5])
def test_roots_far_from_the_band_are_no_doubt_of_heavy_ones_in_it(dampers):
    """Those err by a thousand times their size: no basis is made for them."""
    problem = strongly_damped(30, dampers)
    problem.band = (200 * HZ, 900 * HZ)
    theta = np.random.default_rng(1).uniform(-1, 1, (150, 2))
    _, found = solved(problem, theta, 1e-3)
    assert share(found, "windows") > 0.8
    audit = Audit(problem, theta, found, 1e-3)
    assert len(audit.heavy_true) > 300
    assert audit.heavy_estimate.max() < 0.2
    ratio = audit.heavy_true / np.maximum(audit.heavy_estimate, 1e-9)
    assert ratio.max() <= 2.0


def interpolated_roots(patch, theta):
    """Roots (b, m) of the interpolated matrices of the blocks alone."""
    flat, found, offset = patch.cardinals(theta) @ patch.S, [], 0
    for _, k in patch.slices:
        found.append(np.linalg.eigvals(flat[:, offset : offset + k * k].reshape(-1, k, k)))
        offset += k * k
    return np.hstack(found)


def test_heavy_roots_are_bounded_by_their_first_order_distance():
    """Where the second-order estimate is far above it: overdamped roots that collide."""
    problem = strongly_damped(30, 5)
    basis = build_sweep_basis(problem, 1e-4)
    box = Box(np.array([-1.0, -1.0]), np.array([-0.7, -0.7]))
    followed = Windows(problem, basis, 1e-3)._patch(box, interpolation(4, 2))
    theta = box.place(np.random.default_rng(2).uniform(-1, 1, (40, 2)))
    roots = ritz_roots(followed.patch, basis, theta, [problem.weights(t) for t in theta])
    first = interpolated_roots(followed.patch, theta)
    distance = np.abs(roots.lam[:, :, None] - first[:, None, :]).min(axis=2)
    heavy = ~lightly_damped(roots.lam)
    assert heavy.sum() > 300
    allowed = 2.1 * distance + 1e-8 * np.abs(roots.lam)  # roots are shifted once more
    assert (roots.error <= allowed)[heavy].all()


# -- points that fail, points that need more -------------------------------------------------
def refused_beyond(limit):
    def refused(theta):
        if theta[0] > limit:
            return ConvergenceError("working_point", f"none at {theta[0]:g}")
        return None

    return refused


def test_points_without_a_working_point_are_rows_with_their_reason():
    plain = random_brake(12, 1, 1)
    problem = random_brake(12, 1, 1)
    problem.refused = refused_beyond(0.43)
    theta = line(150)
    _, found = solved(problem, theta, 1e-5)
    lost = [i for i, p in enumerate(found) if isinstance(p, ConvergenceError)]
    assert lost == list(np.flatnonzero(theta[:, 0] > 0.43))
    assert all("none at" in str(found[i]) for i in lost)
    there = [p for p in found if not isinstance(p, ConvergenceError)]
    assert share(there, "windows") > 0.3
    Audit(plain, theta, found, 1e-5).check(1e-5)


def truncated_basis(problem, kept):
    """A basis too small on purpose: the first `kept` real modes of K0."""
    basis = build_sweep_basis(problem, 1e-9)
    V = basis.V[:, :kept]
    samples = [problem.weights(t) for t in random_points(20, problem.dimension)]
    small = collocate(problem.system, samples, V, V, 1e-12)
    return replace(basis, V=V, flexibility=basis.flexibility[:kept], small=small)


def test_points_that_the_basis_cannot_serve_are_solved_in_the_full_problem():
    """The estimate sees what the basis lacks; nothing is passed off as better than it is."""
    problem, theta = random_brake(20, 1, 1), line(60)
    basis = truncated_basis(problem, 14)
    found = in_order(Windows(problem, basis, 1e-6).solve(whole_box(1), theta))
    assert share(found, DENSE) == 1.0
    Audit(problem, theta, found, 1e-6).check(1e-6)


@pytest.mark.parametrize("kept", [26, 30, 34])
def test_estimates_of_a_coarse_basis_hold(kept):
    """Window errors and basis errors together; modes of the lower half of the spectrum."""
    problem, theta = random_brake(40, 1, 8, coupling=0.05), line(60)
    problem.band = (problem.band[0], HZ * 1200)
    basis = truncated_basis(problem, kept)
    found = in_order(Windows(problem, basis, 1e-2).solve(whole_box(1), theta))
    assert share(found, "windows") > 0.5
    audit = Audit(problem, theta, found, 1e-2)
    audit.check(1e-2)
    assert audit.true.max() > 1e-8  # the basis is coarse indeed


def test_errors_of_light_modes_only_decide():
    problem = damped_mode(lambda t: 0.6 + 0.3 * t[0], 0.3)
    windows, found = solved(problem, line(60), 1e-5)
    for p in found:
        slight = lightly_damped(p.lam)
        assert (p.error[slight] <= 1e-5 * np.abs(p.lam[slight])).all()
        assert windows.within_tolerance(p)
        another = p._replace(complete=False)  # root may lie in the band
        assert not windows.within_tolerance(another)
