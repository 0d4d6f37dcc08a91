"""Reanalysis of families of matrices: exact pairs, sweep basis, windows, two-sided basis, M0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from reference import MU_C, W1, W2

from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.linalg.band_roots import roots_in_band
from squealstudy.linalg.factor import SparseCholesky
from squealstudy.models.matrices.expression import Expression
from squealstudy.models.matrices.family import FamilyTerm, MatrixFamily
from squealstudy.modes.reanalysis.estimate import solve_alone, two_sided_error
from squealstudy.modes.reanalysis.family_problem import FamilyProblem, biorthogonal
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import lightly_damped
from squealstudy.modes.reanalysis.sweep_basis import build_sweep_basis
from squealstudy.modes.rungs.perturbation import make_anchor, perturbed_roots
from squealstudy.modes.rungs.two_step import two_step_roots
from squealstudy.modes.rungs.windows import Windows

STUDIES = Path(__file__).resolve().parents[2] / "studies"
LOW, HIGH = 2 * np.pi, 40 * np.pi


def family(*terms):
    """A family of (letter, matrix, coefficient)."""
    orders = {"K": 0, "C": 1, "M": 2}
    return MatrixFamily(
        tuple(FamilyTerm(orders[k], sp.csr_matrix(A), Expression(c)) for k, A, c in terms)
    )


def hulten(low, high, band=(10.0, 1000.0)):
    """Hulten's undamped mode coupling over a range of friction."""
    friction = [[0.0, -(W2**2)], [W1**2, 0.0]]
    made = family(("M", np.eye(2), "1"), ("K", np.diag([W1**2, W2**2]), "1"), ("K", friction, "mu"))
    middle, half = (low + high) / 2, (high - low) / 2
    return FamilyProblem(made, 1, lambda t: {"mu": middle + half * float(t[0])}, band)


def closed_form(mu):
    """Both roots of non-negative imaginary part that are nearest i omega."""
    mean, half = (W1**2 + W2**2) / 2, (W1**2 - W2**2) / 2
    squares = mean + np.array([1, -1]) * np.sqrt(half**2 - mu**2 * (W1 * W2) ** 2 + 0j)
    lam = np.sqrt(-squares + 0j)
    return np.where(lam.imag < 0, lam.conj() * np.where(lam.real != 0, 1, 1), lam)


def machine(n=60, seed=2):
    """Damped, gyroscopic and circulatory, with a mass that varies; roots of 60 to 900 Hz."""
    rng = np.random.default_rng(seed)
    q = la.qr(rng.standard_normal((n, n)))[0]
    w = 2 * np.pi * np.linspace(60.0, 900.0, n) * rng.uniform(0.98, 1.02, n)
    root = q * w
    K = root @ root.T
    skew = rng.standard_normal((n, n))
    skew = skew - skew.T
    made = family(
        ("M", np.eye(n), "1"),
        ("M", np.diag(rng.uniform(0.0, 0.1, n)), "a"),
        ("C", 2e-3 * (q * w) @ q.T, "1"),
        ("C", 0.3 * skew, "a"),
        ("K", (K + K.T) / 2, "1"),
        ("K", 0.002 * np.linalg.norm(K, 2) / n * rng.standard_normal((n, n)), "a**2"),
    )
    return FamilyProblem(made, 1, lambda t: {"a": 0.5 + 0.5 * float(t[0])}, (100.0, 400.0))


def dense_roots(problem, theta, band=None):
    """All roots of the problem's band, or another, by LAPACK's generalised solver: its own code."""
    M, C, K = (A.toarray() for A in problem.family.combined(problem.weights(theta)))
    one, zero = np.eye(len(M)), np.zeros_like(M)
    unit = 2e3  # of time: the blocks are of one size
    A = np.block([[zero, one], [-K / unit**2, -C / unit]])
    lam = la.eigvals(A, np.block([[one, zero], [zero, M]])) * unit
    low, high = band or problem.band
    kept = (lam.imag >= 0) & (np.abs(lam) >= low) & (np.abs(lam) <= high)
    return lam[kept]


def distance(lam, exact):
    """Relative error of each exact root."""
    return np.abs(exact[:, None] - lam[None, :]).min(axis=1) / np.abs(exact)


def test_cholesky_of_a_sparse_matrix():
    rng = np.random.default_rng(0)
    B = sp.random(80, 80, 0.05, random_state=rng)
    A = (B @ B.T + sp.identity(80)).tocsr()
    factor, X = SparseCholesky(A), rng.standard_normal((80, 3))
    FX = factor.root(X)
    assert np.allclose(FX.T @ FX, X.T @ (A @ X), rtol=1e-13)
    assert np.allclose(factor.from_root(FX), X, rtol=1e-11)
    assert np.allclose(A @ factor.solve(X + 2j * X), X + 2j * X, rtol=1e-12)


@pytest.mark.parametrize(
    "A", [np.diag([1.0, -1.0]), np.diag([1.0, 0.0]), [[1.0, -1.0], [-1.0, 1.0]]]
)
def test_cholesky_refuses_what_is_not_definite(A):
    with pytest.raises(ConvergenceError, match=r"is singular|not positive definite") as caught:
        SparseCholesky(sp.csr_matrix(A))
    assert caught.value.status == "singular"


@pytest.mark.parametrize("mu", [0.1, 0.28, 0.32, 0.6])
def test_pairs_of_mode_coupling_in_closed_form(mu):
    problem = hulten(0.0, 2 * mu)
    weights, pairs = problem.pairs(np.zeros(1), 1.0)
    exact = closed_form(mu)
    wanted = np.concatenate([exact, -exact.conj()]) if mu > MU_C else exact
    assert distance(pairs.lam, wanted).max() < 1e-10
    assert len(pairs.lam) == 2
    assert np.allclose(problem.system.slopes(weights, pairs.lam, pairs.X, pairs.Y), 1.0)
    assert np.abs(problem.system.apply_adjoint(weights, pairs.lam, pairs.Y)).max() < 1e-8 * W1**2


def test_pairs_of_a_family_with_varying_mass():
    problem = machine()
    theta = np.array([0.4])
    weights, pairs = problem.pairs(theta, 1.0)
    exact = dense_roots(problem, theta)
    assert len(pairs.lam) == len(exact) > 15
    assert distance(pairs.lam, exact).max() < 1e-9
    assert np.abs(two_sided_error(problem, weights, pairs) / pairs.lam).max() < 1e-9


def nearly_coalescing(seed, n=60):
    """Gyroscopic and circulatory, every third frequency next to another; roots of 80 to 3000 Hz."""
    rng = np.random.default_rng(seed)
    q = la.qr(rng.standard_normal((n, n)))[0]
    hz = np.sort(rng.uniform(80.0, 3000.0, n))
    hz[1::3] = hz[: len(hz[1::3]) * 3 : 3] * (1.0 + 10.0 ** rng.uniform(-4.0, -2.0, len(hz[1::3])))
    w = 2 * np.pi * hz
    skew = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(0.0, 2.0) / np.sqrt(n)
    pulled = rng.standard_normal((n, 3)) @ rng.standard_normal((3, n))
    K = (q * w**2) @ q.T
    made = family(
        ("M", np.eye(n), "1"),
        ("C", (q * (0.002 * w)) @ q.T, "1"),
        ("C", skew - skew.T, "1"),
        ("K", (K + K.T) / 2, "1"),
        ("K", 0.01 * np.mean(w**2) / n * pulled, "mu"),
    )
    return FamilyProblem(made, 1, lambda t: {"mu": 0.3 + 0.3 * float(t[0])}, (100.0, 1000.0))


def by_basis(problem, theta):
    basis = build_sweep_basis(problem, 1e-3)
    return solve_alone(problem, theta, "", lambda w: basis.expand(w, basis.pairs(w)))


def by_perturbation(problem, theta):
    return perturbed_roots(problem, make_anchor(problem, 0.9 * theta, 30.0), theta, 2)


@pytest.mark.parametrize(
    "found_by", [lambda p, t: two_step_roots(p, t, 1.5), by_basis, by_perturbation]
)
def test_errors_that_are_told_are_hardly_exceeded(found_by):
    """By LAPACK's roots of the whole problem; first order with static responses is, by most."""
    ratios = []
    for seed, theta in ((0, -0.9), (1, 0.7), (2, 0.1), (3, -0.3)):
        problem = nearly_coalescing(seed)
        found = found_by(problem, np.array([theta]))
        exact = dense_roots(problem, np.array([theta]), (400.0, 8000.0))
        true = np.abs(found.lam[:, None] - exact).min(axis=1)
        told = np.isfinite(found.error) & (true > 1e-9 * np.abs(found.lam))
        ratios.append(true[told] / found.error[told])
    ratios = np.concatenate(ratios)
    assert len(ratios) > 20
    assert ratios.max() < 1.0
    assert np.median(ratios) > 0.02


def test_modes_that_decay_faster_than_asked_for_are_left_out():
    problem, theta = machine(), np.array([0.4])
    _, every = problem.pairs(theta, 1.0)
    least = float(np.median(every.lam.real))
    part = FamilyProblem(problem.family, 1, problem.values_at, (100.0, 400.0), least_growth=least)
    _, kept = part.pairs(theta, 1.0)
    assert 5 < len(kept.lam) < len(every.lam)
    np.testing.assert_allclose(
        np.sort_complex(kept.lam), np.sort_complex(every.lam[every.lam.real >= least]), rtol=1e-9
    )


def test_left_vectors_of_doublets_are_turned_against_the_right():
    one = sp.csr_matrix(np.diag([W1**2, W2**2, W1**2, W2**2, (3 * W1) ** 2]))
    damping = sp.csr_matrix(np.diag([1.0, 2.0, 1.0, 2.0, 3.0]))
    mass = sp.identity(5, format="csr")
    right = roots_in_band(mass, damping, one, (10.0, 1e4))
    turn = la.qr(np.random.default_rng(1).standard_normal((5, 5)))[0]
    left = right.psi.copy()
    for k in (0, 2):  # close pairs: any basis of their subspace
        left[:, k : k + 2] = left[:, k : k + 2] @ turn[:2, :2] + 0.1 * left[:, k : k + 2]
    pairs = biorthogonal(mass, damping, right.lam, right.psi, right.lam, left.conj())
    products = pairs.Y.conj().T @ (pairs.X * (2 * pairs.lam[None, :])) + pairs.Y.conj().T @ (
        damping @ pairs.X
    )
    close = np.abs(pairs.lam[:, None] - pairs.lam[None, :]) < 1e-6
    assert np.allclose(products[close], np.eye(5)[close], atol=1e-8)


def test_vectors_that_do_not_match_are_refused():
    problem = machine()
    M, C, K = problem.family.combined(problem.weights(np.zeros(1)))
    right = roots_in_band(M, C, K, problem.band)
    with pytest.raises(ConvergenceError, match="no left one"):
        biorthogonal(M, C, right.lam, right.psi, right.lam * 1.01, right.psi)
    one_moved = np.where(np.arange(len(right.lam)) == 3, 1.0001 * right.lam, right.lam)
    with pytest.raises(ConvergenceError, match="no left one"):
        biorthogonal(M, C, right.lam, right.psi, one_moved, right.psi)
    with pytest.raises(ConvergenceError, match="not biorthogonal"):
        biorthogonal(M, C, right.lam, right.psi, right.lam, right.psi)
    with pytest.raises(ConvergenceError, match="right and"):
        biorthogonal(M, C, right.lam, right.psi, right.lam[1:], right.psi[:, 1:])


def test_a_coefficient_without_a_value_is_a_failed_point():
    made = family(("M", np.eye(2), "1"), ("K", np.eye(2), "1/x"))
    problem = FamilyProblem(made, 1, lambda t: {"x": float(t[0])}, (0.0, 1.0))
    good, bad = problem.samples(np.array([[0.5], [0.0]]))
    assert good.working_point is None
    assert isinstance(bad, ConvergenceError)
    assert bad.status == "undefined"


def test_a_free_body_gets_a_share_of_the_mass():
    K = np.array([[1.0, -1.0], [-1.0, 1.0]]) * W1**2
    problem = FamilyProblem(
        family(("M", np.eye(2), "1"), ("K", K, "k")), 0, lambda _: {"k": 1.0}, (20.0, 500.0)
    )
    r = np.array([[1.0], [1.0]]) + 0j
    assert np.allclose(problem.flexibility(r), r / (2 * np.pi * 20.0) ** 2)
    hopeless = FamilyProblem(
        family(("M", np.eye(2), "1"), ("K", np.diag([1.0, -1e30]), "1")), 0, lambda _: {}, (1.0, 2)
    )
    with pytest.raises(ModelError, match="not positive definite"):
        hopeless.flexibility(r)


def test_sweep_basis_and_windows_of_a_family():
    problem, tolerance = machine(), 1e-6
    basis = build_sweep_basis(problem, tolerance / 3)
    assert basis.error <= tolerance / 3
    theta = np.random.default_rng(5).uniform(-1, 1, (80, 1))
    windows = Windows(problem, basis, tolerance)
    points = dict(windows.solve(Box(-np.ones(1), np.ones(1)), theta))
    assert sorted(points) == list(range(80))
    for row in range(0, 80, 8):
        point, exact = points[row], dense_roots(problem, theta[row])
        assert len(point.lam) == len(exact)
        slight = lightly_damped(exact)
        assert distance(point.lam, exact[slight]).max() < tolerance
