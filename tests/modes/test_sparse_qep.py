"""The sparse quadratic eigensolver and its parts against dense algebra."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import reference
import scipy.linalg as la
import scipy.sparse as sp
from conftest import build_model
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.errors import ConvergenceError
from squealstudy.linalg import factor as linalg_factor
from squealstudy.linalg.band_roots import judged_roots
from squealstudy.linalg.dense_qep import backward_error, dense_roots
from squealstudy.linalg.factor import MODULES, PLAIN_ERROR, factorise, is_definite, is_full
from squealstudy.linalg.quadratic_pencil import QuadraticPencil, SparseShiftedFactor
from squealstudy.linalg.real_modes import BlockKrylov, real_modes
from squealstudy.linalg.sparse_qep import (
    DENSE_LIMIT,
    LowRankSum,
    WoodburyFactor,
    roots_below,
    smallest_roots,
)

SPARSE = DENSE_LIMIT + 30  # degrees of freedom that go the ARPACK way
KRYLOV = 300  # and those of which a block Krylov space is small beside all states


def chain(n, seed, rank):
    """M, C, K of a chain of masses with dampers, friction couplings and low-rank terms."""
    rng = np.random.default_rng(seed)
    M = sp.diags(rng.uniform(0.5, 2.0, n)).tocsr()
    k = rng.uniform(0.5, 2.0, n + 1) * 1e6
    K = sp.diags([k[:-1] + k[1:], -k[1:-1], -k[1:-1]], [0, 1, -1]).tolil()
    for i in rng.integers(0, n - 3, 4):  # one-sided couplings, as of friction
        K[i, i + 3] -= 2e5
    C = sp.diags(rng.uniform(0.0, 20.0, n)).tocsr()
    U = rng.standard_normal((n, rank))
    return (
        M,
        LowRankSum(C, U, rng.uniform(0, 5.0, rank)),
        LowRankSum(K.tocsr(), U, rng.uniform(-1e4, 1e5, rank)),
    )


def dense(A):
    return A.sparse.toarray() + A.U @ np.diag(A.d) @ A.U.T


@pytest.mark.parametrize("rank", [0, 3])
@pytest.mark.parametrize("seed", range(5))
def test_against_the_dense_companion(seed, rank):
    M, C, K = chain(SPARSE, seed, rank)
    lam, psi = smallest_roots(M, C, K, 40, 1e3)
    exact = reference.quadratic_roots(M.toarray(), dense(C), dense(K))
    exact = exact[np.argsort(np.abs(exact))]
    upper = exact[exact.imag >= 0][: len(lam)]
    # 40 were asked for; a pair counts twice, and is never cut in two
    assert 40 <= 2 * (lam.imag > 0).sum() + (lam.imag == 0).sum() <= 41
    # conjugate pairs have one modulus: their order among equals is free
    np.testing.assert_allclose(np.abs(lam), np.abs(upper), rtol=1e-9)
    distance = np.abs(lam[:, None] - upper[None, :]).min(axis=1)
    assert (distance < 1e-8 * np.abs(lam)).all()
    assert reference.residuals(M, C, K, lam, psi).max() < 1e-10
    np.testing.assert_allclose(np.linalg.norm(psi, axis=0), 1.0, rtol=1e-12)


def test_conjugates_are_roots_too():
    M, C, K = chain(SPARSE, 1, 2)
    lam, psi = smallest_roots(M, C, K, 20, 1e3)
    assert (lam.imag > 0).sum() >= 5
    assert reference.residuals(M, C, K, lam.conj(), psi.conj()).max() < 1e-10
    assert (np.diff(np.abs(lam)) >= 0).all()


@pytest.mark.parametrize("limit", [3.0, 250.0, 600.0])  # rad/s: above none, some, most of n = 20
@pytest.mark.parametrize("n", [20, SPARSE, KRYLOV])
@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.full_size), 3])
def test_all_roots_below_a_limit(n, rank, limit):
    M, C, K = chain(n, 3, rank)
    C.sparse = C.sparse + sp.diags(np.r_[4e4, np.zeros(n - 1)])  # an overdamped one, near -20
    lam, psi = roots_below(M, C, K, limit)
    exact = reference.quadratic_roots(M.toarray(), dense(C), dense(K))
    upper = exact[(exact.imag >= 0) & (np.abs(exact) <= limit)]
    assert len(lam) == len(upper)
    assert np.abs(lam[:, None] - upper).min(axis=0, initial=np.inf).max(initial=0.0) < 1e-6
    assert (np.diff(np.abs(lam)) >= 0).all()
    assert (lam.imag == 0).any() == (limit > 100.0)
    assert reference.residuals(M, C, K, lam, psi).max(initial=0.0) < 1e-9
    np.testing.assert_allclose(np.linalg.norm(psi, axis=0), 1.0, rtol=1e-12)


@pytest.mark.parametrize("softness", [1.0, 1e-6, 1e-12])
def test_roots_of_a_body_that_is_held_softly_need_no_larger_space(softness):
    """1/lambda of its first root drowns what the others leave: they end at round-off."""
    n, asked = 2000, []
    free = np.r_[1.0, np.full(n - 2, 2.0), 1.0] + softness * np.eye(1, n)[0]
    K = 1e6 * sp.diags([-1.0, free, -1.0], [-1, 0, 1], shape=(n, n)).tocsr()
    M, C = sp.identity(n, format="csr"), LowRankSum(1e-2 * sp.identity(n, format="csr"))
    factor = factorise(K)

    class Counted:
        def solve(self, b):
            asked.append(b.shape[1])
            return factor.solve(b)

    limit = 40.0
    lam, psi = roots_below(M, C, LowRankSum(K), limit, Counted())
    assert sum(asked) <= 200
    w2 = la.eigvalsh_tridiagonal(1e6 * free, np.full(n - 1, -1e6))
    exact = np.concatenate([np.roots([1.0, 1e-2, x]) for x in w2[w2 < limit**2]])
    exact = exact[exact.imag >= 0]
    spare = 0 if softness > 1e-8 else 1  # of roots that err so much one may cross the limit
    assert abs(len(lam) - len(exact)) <= spare
    assert len(exact) > 20
    found, _ = judged_roots(M, C, LowRankSum(K), lam, psi, (0.1, limit))
    distance = np.abs(found.lam[:, None] - exact).min(axis=1)
    assert (distance <= found.error).all()  # which is told, however large
    if softness > 1e-8:  # else round-off of the processor decides how much they err
        assert distance.max() < 1e-9


@pytest.mark.parametrize("n", [4, 20])
def test_small_systems_give_all_roots(n):
    M, C, K = chain(n, 5, 1)
    lam, psi = smallest_roots(M, C, K, 2 * n, 1e3)
    exact = reference.quadratic_roots(M.toarray(), dense(C), dense(K))
    exact = exact[exact.imag >= 0]
    np.testing.assert_allclose(lam, exact[np.argsort(np.abs(exact))], rtol=1e-9)
    assert reference.residuals(M, C, K, lam, psi).max() < 1e-10


@pytest.mark.parametrize("n", [40, SPARSE])
def test_real_roots_are_listed_each(n):
    # overdamped: mass 1, k 1e4, c 1e3 has roots near -10 and -990
    C = np.zeros(n)
    C[0] = 1e3
    k = np.full(n, 1e6)
    k[0] = 1e4
    lam, _ = smallest_roots(
        sp.eye(n, format="csr"),
        LowRankSum(sp.diags(C).tocsr()),
        LowRankSum(sp.diags(k).tocsr()),
        12,
        1e3,
    )
    real = np.sort(lam[lam.imag == 0].real)
    split = np.sqrt(1e6 - 4e4)
    np.testing.assert_allclose(real, [(-1e3 - split) / 2, (-1e3 + split) / 2], rtol=1e-9)


@given(seed=st.integers(0, 1000), scale=st.sampled_from([1e2, 1e3, 3e4]))
@settings(max_examples=30)
def test_scale_of_time_changes_nothing(seed, scale):
    M, C, K = chain(SPARSE, seed, 1)
    lam, _ = smallest_roots(M, C, K, 10, scale)
    again, _ = smallest_roots(M, C, K, 10, 500.0)
    np.testing.assert_allclose(lam, again, rtol=1e-8)


@pytest.mark.parametrize("rank", [0, 1, 4])
def test_low_rank_products_and_solves(rank):
    _, _, K = chain(30, 7, rank)
    A = dense(K)
    b = np.random.default_rng(2).standard_normal((30, 5))
    factor = WoodburyFactor(K)
    for x in (b, b[:, 0], b + 1j * b[:, ::-1]):
        np.testing.assert_allclose(K @ x, A @ x, rtol=1e-10, atol=1e-3)
        np.testing.assert_allclose(factor.solve(x), np.linalg.solve(A, x), rtol=1e-9, atol=1e-15)


def spoiled(n):
    """A matrix whose first pivot is tiny: without refinement its solves lose digits."""
    rng = np.random.default_rng(0)
    A = sp.diags([rng.uniform(1, 2, n), np.ones(n - 1), np.ones(n - 1)], [0, 1, -1]).tolil()
    A[0, 0] = 1e-11
    return LowRankSum(A.tocsr())


def test_solves_are_refined_where_a_trial_shows_that_they_must_be():
    A = spoiled(SPARSE)
    factor = factorise(A.sparse, backend="superlu")
    assert factor.plain_error > PLAIN_ERROR
    b = np.random.default_rng(1).standard_normal(SPARSE)
    x = WoodburyFactor(A, refined=False).solve(b)
    assert np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()
    np.testing.assert_array_equal(x, WoodburyFactor(A).solve(b))


def test_a_large_solution_of_a_soft_matrix_is_no_reason_to_refine():
    n = 20_000  # |b - A x| is round-off of |A||x|, far above |b|: refining leaves as much
    A = symmetric_chain(n) + 1e-3 * sp.identity(n)
    factor = factorise(A)
    b = np.random.default_rng(0).standard_normal(n)
    plain, refined = (np.abs(b - A @ x).max() for x in (factor.solve_once(b), factor.solve(b)))
    assert plain > 1e-11
    assert refined > plain / 10
    assert factor.plain_error < PLAIN_ERROR
    assert factor.lean() == factor.solve_once


def test_solves_that_lose_nothing_are_not_refined():
    _, _, K = chain(SPARSE, 3, 0)
    factor = WoodburyFactor(K, refined=False)
    b = np.random.default_rng(1).standard_normal(SPARSE)
    once = factorise(K.sparse).solve_once(b)
    assert np.abs(once - factorise(K.sparse).solve(b)).max() > 0
    np.testing.assert_array_equal(factor.solve(b), once)


def symmetric_chain(n):
    """The stiffness of a chain of equal springs."""
    return 1e6 * sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)).tocsr()


# -- its neighbours in linalg and analysis -------------------------------------------------------
@pytest.mark.parametrize("columns", [1, 5, 150])
@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("backend", ["superlu", "cholmod", "pardiso"])
def test_factor_solves_blocks(columns, kind, backend):
    if backend != "superlu":
        pytest.importorskip(MODULES[backend])
    K = symmetric_chain(60)
    b = np.random.default_rng(0).standard_normal((60, columns)).astype(kind)
    if kind is complex:
        b = b + 1j * b[::-1]
    factor = factorise(K, backend, definite=True)
    x = factor.solve(b)
    assert x.shape == b.shape
    np.testing.assert_allclose(K @ x, b, atol=1e-12 * np.abs(b).max())
    first = factor.solve(b[:, 0])
    np.testing.assert_allclose(first, x[:, 0], rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("backend", ["superlu", "cholmod", "pardiso"])
def test_zero_pivot_is_a_named_failure(backend):
    if backend != "superlu":
        pytest.importorskip(MODULES[backend])
    A = sp.csc_matrix(np.diag([1.0, 0.0]) if backend != "pardiso" else [[1.0, 2.0], [2.0, 1.0]])
    with pytest.raises(ConvergenceError, match="singular"):
        factorise(A, backend, definite=True)


def test_large_definite_matrices_alone_go_to_cholmod(monkeypatch):
    pytest.importorskip("cholespy")
    monkeypatch.setattr("squealstudy.linalg.factor.CHOLMOD_MIN_ROWS", 60)
    monkeypatch.setattr(
        "squealstudy.linalg.factor.find_spec", lambda name: None if name == "pypardiso" else name
    )
    K = symmetric_chain(60)
    names = [type(factorise(K, definite=d)).__name__ for d in (True, False)]
    assert names == ["CholmodFactor", "SuperLUFactor"]
    small = sp.eye(59, format="csr")
    assert type(factorise(small, definite=True)).__name__ == "SuperLUFactor"
    b = np.random.default_rng(0).standard_normal((60, 3))
    one, two = (factorise(K, definite=d).solve(b) for d in (True, False))
    np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-16)
    again = pickle.loads(pickle.dumps(factorise(K, definite=True)))
    np.testing.assert_array_equal(again.solve(b), one)


@pytest.mark.parametrize("n", [300, 450])
def test_real_modes_of_a_free_chain(n):
    # masses m in a row, springs k between: omega_j = 2 sqrt(k/m) sin(j pi / 2n), rigid mode first
    k, m = 4e8, 2.0
    D = sp.diags([np.ones(n - 1), -np.ones(n - 1)], [0, 1], shape=(n - 1, n))
    K, M = (k * (D.T @ D)).tocsr(), (m * sp.eye(n)).tocsr()
    exact = 2 * np.sqrt(k / m) * np.sin(np.arange(n) * np.pi / (2 * n))
    # 300 goes the dense way, 450 the Lanczos way
    omega, phi = real_modes(M, K, exact[60] / (2 * np.pi) * 1.001)
    assert len(omega) == 61
    np.testing.assert_allclose(omega[1:], exact[1:61], rtol=1e-9)
    assert omega[0] < 1e-3 * exact[1]
    assert np.abs(phi.T @ (M @ phi) - np.eye(61)).max() < 1e-12
    K_modal = phi.T @ (K @ phi)
    assert np.abs(K_modal - np.diag(np.diag(K_modal))).max() < 1e-12 * 4 * k / m


@pytest.mark.parametrize("copies", [4, 5])
def test_multiple_real_modes_are_all_found(copies):
    # five copies are more than a block of states holds: round-off and refining find the last
    k, n = 1e6, 150
    D = sp.diags([np.ones(n), -np.ones(n)], [0, -1], shape=(n + 1, n))
    K = sp.block_diag([k * (D.T @ D)] * copies).tocsr()
    exact = 2e3 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))
    omega, _ = real_modes(sp.eye(n * copies).tocsr(), K, 1.001 * exact[11] / (2 * np.pi))
    np.testing.assert_allclose(omega, np.repeat(exact[:12], copies), rtol=1e-9)


def test_krylov_space_of_few_eigenvalues_goes_on_with_other_states():
    values = np.repeat([3.0, 2.0, 1.0], 40)
    space = BlockKrylov(lambda x: values[:, None] * x / 2.0, 120, 2.0 * sp.eye(120))
    space.grow(60)
    V = space.vectors
    assert np.abs(2.0 * V.T @ V - np.eye(60)).max() < 1e-12
    np.testing.assert_allclose(2.0 * V.T @ (values[:, None] * V), space.projected, atol=1e-12)
    found = np.linalg.eigvalsh(space.projected)[::-1]
    assert (np.abs(found[:20] - 3.0) < 1e-12).all()


def test_krylov_space_of_an_unsymmetric_matrix_without_a_mass():
    A = np.random.default_rng(0).standard_normal((150, 150))
    space = BlockKrylov(lambda x: A @ x, 150, None)
    space.grow(80)
    V, H = space.vectors, space.projected
    np.testing.assert_allclose(V.T @ V, np.eye(80), atol=1e-12)
    np.testing.assert_allclose(V.T @ A @ V, H, atol=1e-12)
    outside = A @ V - V @ H
    assert np.abs(outside[:, :-4]).max() < 1e-12  # of all but the last block
    y = np.random.default_rng(1).standard_normal((80, 3))
    np.testing.assert_allclose(space.left_out(y), np.linalg.norm(outside @ y, axis=0), rtol=1e-9)


@pytest.mark.parametrize("softness", [1e3, 1.0, 1e-6])
def test_real_modes_about_no_shift_of_a_body_that_is_held_softly(softness):
    """Of 1/omega^2 the first one drowns the others' residuals: they end at round-off."""
    n, cutoff = 1500, 10.0
    K = symmetric_chain(n) - 1e6 * sp.diags(np.r_[1.0 - 1e-6 * softness, np.zeros(n - 2), 1.0])
    M = sp.identity(n, format="csr")
    asked = []

    class Counted:
        def __init__(self):
            self.factor = factorise(K)

        def solve_once(self, b):
            asked.append(b.shape[1])
            return self.factor.solve_once(b)

        def lean(self):
            return self.factor.solve

    omega, phi = real_modes(M, K, cutoff, Counted(), 0.0)
    expected, _ = real_modes(M, K, cutoff)
    assert len(omega) == len(expected) > 20
    assert sum(asked) < (150 if softness > 1e-3 else 60)  # then about another shift
    np.testing.assert_allclose(omega, expected, rtol=1e-6, atol=1e-9 * omega[-1])
    residual = np.linalg.norm(K @ phi - M @ phi * omega**2, axis=0)
    assert residual.max() < 1e-8 * omega[-1] ** 2


def test_dense_roots_agree_with_the_twin():
    M, C, K = chain(25, 11, 2)
    m = np.sqrt(M.diagonal())
    C_m, K_m = dense(C) / np.outer(m, m), dense(K) / np.outer(m, m)
    lam, psi = dense_roots(C_m, K_m, (0.0, np.inf))
    exact = reference.quadratic_roots(np.eye(25), C_m, K_m)
    exact = exact[exact.imag >= 0]
    np.testing.assert_allclose(lam, exact[np.argsort(np.abs(exact))], rtol=1e-8)
    assert backward_error(C_m, K_m, lam, psi).max() < 1e-14
    assert 2 * (lam.imag > 0).sum() + (lam.imag == 0).sum() == 50
    low, high = np.abs(lam[5]) * 0.999, np.abs(lam[9]) * 1.001
    np.testing.assert_array_equal(dense_roots(C_m, K_m, (low, high))[0], lam[5:10])


def test_backward_error_sees_a_wrong_root():
    assembly = build_model("hulten")
    K = np.diag(assembly.contact.area) * assembly.contact.law.value("contact.stiffness")
    lam, psi = dense_roots(np.zeros((2, 2)), K, (0.0, np.inf))
    assert backward_error(np.zeros((2, 2)), K, lam, psi).max() < 1e-15
    assert backward_error(np.zeros((2, 2)), K, 1.01 * lam, psi).min() > 1e-3


@pytest.mark.parametrize("low_rank", [0, 3])
def test_full_sparse_matrices_are_factorised_by_lapack(low_rank, monkeypatch):
    """As a projected assembly has them: the same solutions as of dense ones, either way round."""
    monkeypatch.setattr(linalg_factor, "LEAST_FULL", 60)
    rng = np.random.default_rng(5)
    M, C, K = (rng.standard_normal((60, 60)) for _ in range(3))
    M = M @ M.T + 60.0 * np.eye(60)
    U, d = rng.standard_normal((60, low_rank)), rng.standard_normal(low_rank)
    parts = [LowRankSum(sp.csr_matrix(A), U, d) for A in (C, K)]
    pencil, sigma = QuadraticPencil(sp.csr_matrix(M), *parts), 0.3 + 2.0j
    factor = pencil.factor(sigma)
    assert isinstance(factor, SparseShiftedFactor)
    Q = sigma**2 * M + sigma * (C + (U * d) @ U.T) + K + (U * d) @ U.T
    b = rng.standard_normal((60, 2)) + 1j * rng.standard_normal((60, 2))
    np.testing.assert_allclose(factor.solve(b), np.linalg.solve(Q, b), rtol=1e-9)
    np.testing.assert_allclose(factor.solve_adjoint(b), np.linalg.solve(Q.conj().T, b), rtol=1e-9)


def test_a_full_stiffness_is_solved_with_as_a_sparse_one(monkeypatch):
    rng = np.random.default_rng(6)
    A = rng.standard_normal((50, 50))
    A = sp.csr_matrix(A @ A.T + np.eye(50))
    b = rng.standard_normal((50, 3))
    assert not is_full(A)  # small: by SuperLU
    monkeypatch.setattr(linalg_factor, "LEAST_FULL", 50)
    assert is_full(A)
    np.testing.assert_allclose(factorise(A).solve(b), np.linalg.solve(A.toarray(), b), rtol=1e-9)
    with pytest.raises(ConvergenceError, match="singular"):
        factorise(sp.csr_matrix(np.ones((50, 50))))
    assert is_definite(A)  # by L, U and orders, which SuperLU alone gives
