"""Parametric systems against dense algebra, and the brake's terms against its linearisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from blocks import OPERATING as BLOCKS_OPERATING
from blocks import blocks
from conftest import NOMINAL, build_model
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.errors import ModelError
from squealstudy.laws import contact_law, friction_curve
from squealstudy.linalg.companion import all_pairs, all_roots
from squealstudy.models.operating import DesignState
from squealstudy.modes.reanalysis.polynomials import collocate
from squealstudy.reduction.cmt import ReductionSettings, component_modes
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.prepared import prepare
from squealstudy.reduction.working_point import working_point
from squealstudy.system.linearise import (
    linearise,
    reduced_structure,
    symmetric_stiffness,
    unreduced_structure,
)
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    SUM_FIRST_ABOVE,
    ParametricSystem,
    Term,
)


# -- any system --------------------------------------------------------------------------------
@st.composite
def systems(draw):
    """A system with all kinds of terms, its weights and the dense terms it stands for."""
    n = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    terms, weights, dense = [], [], []
    for _ in range(draw(st.integers(1, 6))):
        order = draw(st.sampled_from([STIFFNESS, DAMPING, MASS]))
        k = draw(st.integers(1, 5))
        sides = draw(st.sampled_from(["none", "left", "right", "both"]))
        k = k if sides == "both" else n
        scalar = draw(st.booleans())
        w = draw(st.sampled_from([0.0, 1.0, -2.5])) if scalar else rng.standard_normal(k)
        left, right = rng.standard_normal((2, k, n))
        as_stored = sp.csr_matrix if draw(st.booleans()) else np.asarray
        L = left if sides in ("left", "both") else np.eye(n)
        R = right if sides in ("right", "both") else np.eye(n)
        terms.append(
            Term(
                order,
                as_stored(L) if sides in ("left", "both") else None,
                as_stored(R) if sides in ("right", "both") else None,
            )
        )
        weights.append(w)
        dense.append((order, L.T @ np.diag(np.broadcast_to(w, (k,))) @ R))
    return ParametricSystem(n, tuple(terms)), tuple(weights), dense, rng


def summed(dense, n, order):
    return sum((A for o, A in dense if o == order), start=np.zeros((n, n)))


@given(systems())
@settings(max_examples=80)
def test_matrices_are_the_sums_of_their_terms(case):
    system, weights, dense, _ = case
    stored = [replace(t, left=_sparse(t.left), right=_sparse(t.right)) for t in system.terms]
    sparse = ParametricSystem(system.n, tuple(stored)).sparse_matrices(weights)
    for A, S, order in zip(
        system.matrices(weights), sparse, (MASS, DAMPING, STIFFNESS), strict=True
    ):
        expected = summed(dense, system.n, order)
        np.testing.assert_allclose(A, expected, atol=1e-12)
        np.testing.assert_allclose(S @ np.eye(system.n), expected, atol=1e-12)


def _sparse(side):
    return None if side is None else sp.csr_matrix(side)


@given(systems())
@settings(max_examples=80)
def test_products_with_vectors(case):
    """Q(lam_j) x_j, its adjoint, y_j^H Q'(lam_j) x_j, and y^H Q x by either."""
    system, weights, dense, rng = case
    n, m = system.n, 3
    X, Y = rng.standard_normal((2, n, m)) + 1j * rng.standard_normal((2, n, m))
    lam = rng.standard_normal(m) + 1j * rng.standard_normal(m)
    M, C, K = (summed(dense, n, order) for order in (MASS, DAMPING, STIFFNESS))
    Q = [s**2 * M + s * C + K for s in lam]
    ahead = system.apply(weights, lam, X)
    behind = system.apply_adjoint(weights, lam, Y)
    slope = system.slopes(weights, lam, X, Y)
    for j in range(m):
        np.testing.assert_allclose(ahead[:, j], Q[j] @ X[:, j], atol=1e-11)
        np.testing.assert_allclose(behind[:, j], Q[j].conj().T @ Y[:, j], atol=1e-11)
        expected = Y[:, j].conj() @ (2 * lam[j] * M + C) @ X[:, j]
        np.testing.assert_allclose(slope[j], expected, atol=1e-10)
        either = Y[:, j].conj() @ ahead[:, j], behind[:, j].conj() @ X[:, j]
        np.testing.assert_allclose(*either, atol=1e-11)


@given(systems(), st.integers(1, 4))
@settings(max_examples=80)
def test_projections(case, r):
    """Expanded weights of projected terms give W^T Q V, and so do forms with vectors."""
    system, weights, dense, rng = case
    n = system.n
    W, V = rng.standard_normal((2, n, r))
    several = [tuple(w * s for w in weights) for s in (1.0, -0.3, 2.0)]
    expanded = collocate(system, several, W, V, 1e-13)
    C, K = (expanded.summed(order, [weights]) for order in (DAMPING, STIFFNESS))
    lam = rng.standard_normal(r) + 1j * rng.standard_normal(r)
    M, D, S = (W.T @ summed(dense, n, order) @ V for order in (MASS, DAMPING, STIFFNESS))
    found = system.forms(weights, lam, V.astype(complex), W.astype(complex))
    np.testing.assert_allclose(found, lam**2 * M + lam * D + S, atol=1e-10)
    np.testing.assert_allclose(C[0], W.T @ summed(dense, n, DAMPING) @ V, atol=1e-10)
    np.testing.assert_allclose(K[0], W.T @ summed(dense, n, STIFFNESS) @ V, atol=1e-10)


def test_a_mass_that_varies_is_divided_by():
    rng = np.random.default_rng(0)
    n = 5
    A = rng.standard_normal((4, n, n))
    M0, M1 = A[0] @ A[0].T + n * np.eye(n), A[1] @ A[1].T
    terms = (Term(MASS, None, M0), Term(MASS, None, M1), Term(DAMPING, None, A[2]))
    system = ParametricSystem(n, (*terms, Term(STIFFNESS, None, A[3])))
    weights = [(1.0, a, 0.1, 2.0) for a in (0.0, 0.5, 1.0)]
    expanded = collocate(system, weights, np.eye(n), np.eye(n), 1e-12)
    C, K = expanded.matrices(weights)
    for i, w in enumerate(weights):
        M = M0 + w[1] * M1
        np.testing.assert_allclose(C[i], np.linalg.solve(M, 0.1 * A[2]), atol=1e-12)
        np.testing.assert_allclose(K[i], np.linalg.solve(M, 2.0 * A[3]), atol=1e-12)
        np.testing.assert_allclose(expanded.mass(w), M, atol=1e-12)
    assert not expanded.unit_mass


def test_a_mass_that_is_the_identity_in_the_basis_is_not_divided_by():
    """Of one term or of two, in a basis that is orthonormal in it; not where it varies."""
    rng = np.random.default_rng(2)
    A = rng.standard_normal((5, 5))
    M, K = A @ A.T + np.eye(5), np.diag([1.0, 2.0, 3.0, 4.0, 5.0])
    V = np.linalg.inv(np.linalg.cholesky(M)).T[:, :3]
    system = ParametricSystem(5, (Term(MASS, None, A @ A.T), Term(MASS), Term(STIFFNESS, None, K)))
    weights = [(1.0, 1.0, k) for k in (1.0, 2.0)]
    expanded = collocate(system, weights, V, V, 1e-12)
    assert expanded.unit_mass
    np.testing.assert_array_equal(expanded.mass(weights[0]), np.eye(3))
    np.testing.assert_allclose(expanded.matrices(weights)[1][1], 2 * V.T @ K @ V, atol=1e-12)
    varying = collocate(system, [*weights, (1.0, 1.1, 1.0)], V, V, 1e-12)
    assert not varying.unit_mass
    np.testing.assert_allclose(varying.mass((1.0, 1.1, 1.0)), np.eye(3) + 0.1 * V.T @ V, atol=1e-12)


def test_weights_that_vanish_at_some_points():
    """A zero may be a number at one design point and an array at the next."""
    rng = np.random.default_rng(1)
    N = rng.standard_normal((4, 3))
    system = ParametricSystem(3, (Term(MASS), Term(STIFFNESS), Term(DAMPING, N, N)))
    some = (1.0, np.ones(3), np.array([1.0, 2.0, 3.0, 4.0]))
    none = (1.0, 2.0, 0.0)
    expanded = collocate(system, [some, none], np.eye(3), np.eye(3), 1e-12)
    for batch in ([some, none], [none], [some], [none, none]):
        C, K = expanded.matrices(batch)
        for w, c, k in zip(batch, C, K, strict=True):
            _, expected_C, expected_K = system.matrices(w)
            np.testing.assert_allclose(c, expected_C, atol=1e-12)
            np.testing.assert_allclose(k, expected_K, atol=1e-12)


def test_terms_that_do_not_fit():
    with pytest.raises(ModelError, match=r"term 1 has 4 columns, expected 3"):
        ParametricSystem(3, (Term(MASS), Term(STIFFNESS, None, np.ones((2, 4)))))
    system = ParametricSystem(2, (Term(MASS), Term(STIFFNESS)))
    with pytest.raises(ModelError, match="1 weights for 2 terms"):
        system.matrices((1.0,))


@pytest.mark.parametrize("count", [2, SUM_FIRST_ABOVE, SUM_FIRST_ABOVE + 1, 9])
def test_many_whole_matrices_are_summed_first(count):
    rng = np.random.default_rng(count)
    n, lam = 5, rng.standard_normal(4) + 1j * rng.standard_normal(4)
    matrices, w = rng.standard_normal((count, n, n)), rng.standard_normal(count)
    X, Y = rng.standard_normal((2, n, 4)) + 1j * rng.standard_normal((2, n, 4))
    system = ParametricSystem(n, (Term(MASS), *(Term(DAMPING, None, A) for A in matrices)))
    weights = (1.0, *w)
    C = np.tensordot(w, matrices, 1)
    np.testing.assert_allclose(system.apply(weights, lam, X), X * lam**2 + C @ X * lam)
    adjoint = Y * lam.conj() ** 2 + C.T @ Y * lam.conj()
    np.testing.assert_allclose(system.apply_adjoint(weights, lam, Y), adjoint)
    slope = np.einsum("ij,ij->j", Y.conj(), 2 * lam * X + C @ X)
    np.testing.assert_allclose(system.slopes(weights, lam, X, Y), slope)


def test_only_numbers_times_whole_matrices_are_summed_first():
    """Those of one order, where they are many; rows with weights of their own stay."""
    rng = np.random.default_rng(3)
    n, lam = 4, rng.standard_normal(3) + 1j
    whole, rowwise = rng.standard_normal((2, SUM_FIRST_ABOVE + 1, n, n))
    X = rng.standard_normal((n, 3)) + 0j
    terms = [Term(MASS), *(Term(STIFFNESS, None, A) for A in (*whole, *rowwise))]
    system = ParametricSystem(n, tuple(terms))
    w, d = rng.standard_normal(SUM_FIRST_ABOVE + 1), rng.standard_normal((SUM_FIRST_ABOVE + 1, n))
    weights = (1.0, *w, *d)
    K = np.tensordot(w, whole, 1) + sum(np.diag(row) @ A for row, A in zip(d, rowwise, strict=True))
    np.testing.assert_allclose(system.apply(weights, lam, X), X * lam**2 + K @ X)
    few, _ = system.gathered(weights)
    assert len(few.terms) == 1 + (SUM_FIRST_ABOVE + 1) + 1
    assert [t.dense for t in few.terms].count(True) == 1
    as_they_are, same = system.gathered((1.0, *d, *d))
    assert as_they_are is system
    assert len(same) == len(terms)


def test_a_weight_that_is_a_whole_matrix():
    rng = np.random.default_rng(4)
    n, lam = 4, rng.standard_normal(3) + 1j
    system = ParametricSystem(n, (Term(MASS), Term(DAMPING, dense=True), Term(STIFFNESS)))
    C, k = rng.standard_normal((n, n)), rng.standard_normal(n)
    X, Y = rng.standard_normal((2, n, 3)) + 1j * rng.standard_normal((2, n, 3))
    weights = (2.0, C, k)
    ahead = 2 * X * lam**2 + C @ X * lam + k[:, None] * X
    np.testing.assert_allclose(system.apply(weights, lam, X), ahead)
    behind = 2 * Y * lam.conj() ** 2 + C.T @ Y * lam.conj() + k[:, None] * Y
    np.testing.assert_allclose(system.apply_adjoint(weights, lam, Y), behind)
    slope = np.einsum("ij,ij->j", Y.conj(), 4 * lam * X + C @ X)
    np.testing.assert_allclose(system.slopes(weights, lam, X, Y), slope)
    np.testing.assert_allclose(system.forms(weights, lam, X, Y), Y.conj().T @ ahead)
    M, D, K = system.matrices(weights)
    for found, expected in ((M, 2 * np.eye(n)), (D, C), (K, np.diag(k))):
        np.testing.assert_array_equal(found, expected)


def test_sparse_sums_keep_dense_rows_apart():
    """As dense, with numbers, rows of weights, and rows whose weight is zero."""
    rng = np.random.default_rng(5)
    n = 5
    L, R, A = (sp.csr_matrix(rng.standard_normal((m, n))) for m in (3, 3, n))
    U = rng.standard_normal((4, n))
    terms = (Term(MASS, None, A), Term(STIFFNESS, L, R), Term(STIFFNESS, None, A))
    terms += (Term(STIFFNESS, U, U), Term(DAMPING, L, L))
    system = ParametricSystem(n, terms)
    d = np.array([1.0, 0.0, -2.0, 0.5])
    weights = (3.0, rng.standard_normal(3), rng.standard_normal(n), d, -1.5)
    for found, expected in zip(
        system.sparse_matrices(weights), system.matrices(weights), strict=True
    ):
        X = rng.standard_normal((n, 2))
        np.testing.assert_allclose(found @ X, expected @ X, atol=1e-12)
    assert system.sparse_matrices(weights)[2].U.shape == (n, 3)


# -- all roots with both vectors ---------------------------------------------------------------
@given(st.integers(1, 8), st.integers(0, 10_000))
@settings(max_examples=60)
def test_pairs_solve_their_problem_from_both_sides(n, seed):
    rng = np.random.default_rng(seed)
    C, K = rng.standard_normal((2, n, n))
    K = 1e6 * (K + 3 * np.sqrt(n) * np.eye(n))
    lam, X, Y = all_pairs(C, K)
    assert len(lam) == 2 * n
    size = 1e-9 * np.linalg.norm(K)
    assert np.abs(X * lam**2 + C @ X * lam + K @ X).max() < size
    Yh = Y.conj().T
    residual = Yh * lam[:, None] ** 2 + (Yh @ C) * lam[:, None] + Yh @ K
    assert np.abs(residual / np.linalg.norm(Yh, axis=1, keepdims=True)).max() < size
    np.testing.assert_allclose(np.einsum("mi,im->m", Yh, 2 * lam * X + C @ X), 1.0, rtol=1e-6)
    plain = all_roots(C, K)
    assert np.abs(np.sort_complex(plain) - np.sort_complex(lam)).max() < 1e-6 * np.abs(lam).max()


# -- the brake's terms -------------------------------------------------------------------------
@pytest.fixture(scope="module")
def hulten():
    settings_ = ReductionSettings(1e3, 1e3, 1e3)
    return prepare(build_model("hulten"), replace(NOMINAL, law=contact_law("bilateral")), settings_)


STATES = {
    "plain": {},
    "component frequencies": {"frequency_scale": {("caliper", 7): 1.4, ("disc", 8): 0.5}},
    "component dampers": {
        "mode_damping": {("caliper", 7): 0.1, ("disc", 9): 0.02},
        "frequency_scale": {("caliper", 7): 0.7},
    },
    "stiffness damping": {"stiffness_damping": 1e-7},
    "both on changed components": {
        "stiffness_damping": 2e-7,
        "frequency_scale": {("caliper", 8): 1.25},
        "mode_damping": {("caliper", 8): 0.05},
    },
}


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("name", STATES)
@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_the_brakes_terms_are_its_linearisation(brake, reduced, name, falling, friction):
    model, _ = reduced
    operating = replace(NOMINAL, friction=friction, brake_pressure=5e5, sliding_speed=0.2)
    if falling:
        operating = replace(operating, curve=friction_curve(static_ratio=1.5, decay_speed=0.3))
    point = working_point(brake.space, operating)
    state = DesignState(operating, **STATES[name])
    structure = reduced_structure(model)
    weights = structure.weights(point, state)
    M, C, K = structure.system.matrices(weights)
    expected_C, expected_K, symmetric = plain_linearisation(model, point, state)
    np.testing.assert_array_equal(M, np.eye(model.n))
    np.testing.assert_allclose(K, expected_K, atol=1e-12 * np.abs(K).max())
    np.testing.assert_allclose(C, expected_C, atol=1e-12 * max(np.abs(C).max(), 1e-9))
    found = symmetric_stiffness(structure, weights)
    np.testing.assert_allclose(found, symmetric, atol=1e-12 * np.abs(K).max())
    assert bool(np.any(weights.along)) == (falling and friction > 0)
    whole = linearise(model, point, state)
    for own, other in ((whole.C, C), (whole.K, K), (whole.K_sym, symmetric)):
        np.testing.assert_allclose(own, other, atol=1e-12 * max(np.abs(other).max(), 1e-9))


def plain_linearisation(model, point, state):
    """C, K and the symmetric stiffness, term by term as they are printed."""
    o, N, T, P = state.operating, model.N, model.T, model.T_perp
    k_el, dampers = model.k_el.copy(), np.zeros(model.n)
    for (name, mode), scale in state.frequency_scale.items():
        k_el[model.mode_coordinate(name, mode)] *= scale**2
    for (name, mode), zeta in state.mode_damping.items():
        i = model.mode_coordinate(name, mode)
        dampers[i] = 2 * zeta * np.sqrt(k_el[i])
    k_n, normal = (np.diag(model.area * x) for x in (point.tangent, point.contact_pressure))
    ratio, decay = o.curve.parameters
    fall = o.friction * (ratio - 1) * np.exp(-o.sliding_speed / decay)
    mu = np.diag(model.frictional) * (o.friction + fall)
    K_sym = np.diag(k_el) + model.K_springs + N.T @ k_n @ N
    C = np.diag(dampers) + state.stiffness_damping * K_sym
    C += P.T @ (mu @ normal / o.sliding_speed) @ P
    C -= T.T @ (np.diag(model.frictional) * fall / decay @ normal) @ T
    return C, K_sym - T.T @ (mu @ k_n) @ N, K_sym


def test_terms_of_an_unreduced_assembly():
    """Changed and damped component modes are rows; stiffness damping is of all of the stiffness."""
    assembly, beta = blocks(), 1e-5
    modes = component_modes(assembly, 6e3)
    point = working_point(
        contact_space(assembly, 1e11, np.zeros((assembly.n_dof, 0))), BLOCKS_OPERATING
    )
    upper, lower = ("upper", 8), ("lower", 7)
    state = DesignState(
        BLOCKS_OPERATING, {upper: 1.2}, {upper: 0.03, lower: 0.02}, stiffness_damping=beta
    )
    structure = unreduced_structure(assembly, modes, state)
    U, d, dk = [], [], []
    for (name, j), scale, zeta in ((upper, 1.2, 0.03), (lower, 1.0, 0.02)):
        mode = next(c for c in assembly.components if c.name == name)
        row, w = np.zeros(assembly.n_dof), modes[name].omega[j - 1]
        row[assembly.slices[name]] = mode.M @ modes[name].phi[:, j - 1]
        U.append(row)
        dk.append((scale**2 - 1) * w**2)
        d.append(2 * zeta * scale * w)
    c, U = assembly.contact, np.array(U)
    normal, mu = (c.N.T @ np.diag(c.area * point.tangent)), 0.5 * np.diag(c.frictional)
    K = (assembly.K_el + assembly.K_springs()).toarray() + U.T @ np.diag(dk) @ U + normal @ c.N
    drag = np.diag(c.area * point.contact_pressure) / BLOCKS_OPERATING.sliding_speed
    C = beta * K + U.T @ np.diag(d) @ U + c.T_perp.T @ (mu @ drag @ c.T_perp.toarray())
    K = K - c.T.T @ (mu @ (normal.T))
    X = np.random.default_rng(6).standard_normal((assembly.n_dof, 2))
    found = structure.system.sparse_matrices(structure.weights(point, state))
    for A, expected in zip(found, (assembly.M.toarray(), C, K), strict=True):
        np.testing.assert_allclose(
            A @ X, expected @ X, rtol=1e-9, atol=1e-9 * np.abs(expected).max()
        )


def test_seconds_of_the_stages_of_a_preparation(hulten):
    names = {"components_s", "working_point_s", "reduction_s"}
    assert set(hulten.timings) == names
    assert all(0 <= seconds < 60 for seconds in hulten.timings.values())


def test_hulten_in_closed_form(hulten):
    """K = [[w1^2, -mu w2^2], [mu w1^2, w2^2]] up to signs of the coordinates."""
    operating = replace(NOMINAL, friction=0.4, law=contact_law("bilateral"))
    point = working_point(hulten.space, operating)
    structure = reduced_structure(hulten.model)
    _, C, K = structure.system.matrices(structure.weights(point, DesignState(operating)))
    a, b = (2 * np.pi * np.array([100.0, 75.0])) ** 2
    assert np.trace(K) == pytest.approx(a + b, rel=1e-9)
    assert np.linalg.det(K) == pytest.approx(a * b * (1 + 0.4**2), rel=1e-9)
    assert not C.any()
