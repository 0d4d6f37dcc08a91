"""Roots of dense quadratic problems in a circle, against LAPACK's `geev` on random problems."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from random_quadratics import KINDS, TOP, Problem, brake, difference, random_problem

from squealstudy.linalg import dense_qep
from squealstudy.linalg.companion import right_pairs
from squealstudy.linalg.dense_qep import (
    KRYLOV_MAX_ROOT_SHARE,
    KRYLOV_MIN_SIZE,
    backward_error,
    companion_roots,
    dense_roots,
    pairs_inside,
    roots_inside,
)
from squealstudy.linalg.root_error import TIME_SCALE_RATIO, conditions
from squealstudy.modes.reanalysis.problem import in_band
from squealstudy.root_pairs import one_of_each_pair


@pytest.mark.parametrize("kind", range(len(KINDS)), ids=lambda i: KINDS[i].__name__)
def test_none_missed_and_none_doubled(kind):
    certified = 0
    for number in range(kind, 10 * len(KINDS), len(KINDS)):
        p = random_problem(number, (KRYLOV_MIN_SIZE, 72)[number // len(KINDS) % 2])
        lam, psi = dense_roots(*p)
        assert difference(p, lam) == "", number
        assert (np.diff(np.abs(lam)) >= 0).all()
        assert (lam.imag >= 0).all()
        assert backward_error(p.C, p.K, lam, psi).max(initial=0.0) < 1e-12
        certified += roots_inside(p.C, p.K, p.band[1]) is not None
    assert certified >= 4  # `geev` was not its own twin


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 1.5, 10.0])
def test_a_wrong_guess_of_the_number_of_real_modes_misses_no_root(share):
    p = brake(np.random.default_rng(5), 80)
    top = dense_qep.real_modes_to_know(p.band[1])
    count = int((scipy.linalg.eigvalsh((p.K + p.K.T) / 2) <= top**2).sum())
    lam, _ = dense_roots(*p, real_modes=round(share * count))
    assert difference(p, lam) == ""


def test_the_judge_sees_what_is_missed_and_what_is_doubled():
    p = brake(np.random.default_rng(5), 80)
    lam, _ = companion_roots(*p)
    assert difference(p, lam) == ""
    assert "missed" in difference(p, np.delete(lam, 2))
    assert difference(p, np.append(lam, lam[2]))
    assert "off by" in difference(p, lam * (1 + 1e-8))


def test_a_root_that_is_missed_is_noticed(monkeypatch):
    """A start without any share of some mode would miss it: the probe from elsewhere finds it."""
    n = 80
    w = np.linspace(0.2, 8.0, n) * TOP
    C, K = np.zeros((n, n)), np.diag(w**2)
    start = dense_qep._Krylov._put

    def blind(self, z):
        if not self._held:
            z = z.copy()
            z[[3, n + 3]] = 0.0
        return start(self, z)

    monkeypatch.setattr(dense_qep._Krylov, "_put", blind)
    assert roots_inside(C, K, TOP) is None
    monkeypatch.undo()
    lam, _ = roots_inside(C, K, TOP)
    np.testing.assert_allclose(np.sort(np.abs(lam))[::2], w[w <= TOP], rtol=1e-12)


def test_left_to_lapack_where_that_costs_less():
    p = brake(np.random.default_rng(1), KRYLOV_MIN_SIZE - 1)
    assert roots_inside(p.C, p.K, TOP) is None
    w = TOP * np.linspace(0.1, 0.9 / KRYLOV_MAX_ROOT_SHARE, 100)
    assert roots_inside(np.zeros((100, 100)), np.diag(w**2), 1.2 * TOP / 0.9) is None
    assert roots_inside(np.zeros((100, 100)), np.diag(w**2), np.inf) is None
    lam, _ = dense_roots(np.zeros((100, 100)), np.diag(w**2), (0.0, np.inf))
    np.testing.assert_allclose(lam.imag, w, rtol=1e-12)


def test_a_shift_that_is_a_root():
    """Divergence at the first shift, and at both: another shift, then LAPACK."""
    n = 80
    for shares in (dense_qep.SHIFTS_OVER_RADIUS[:1], dense_qep.SHIFTS_OVER_RADIUS):
        w2 = (np.linspace(0.3, 8.0, n) * TOP) ** 2
        w2[: len(shares)] = [-((share * TOP) ** 2) for share in shares]
        C, K = np.zeros((n, n)), np.diag(w2)
        assert (roots_inside(C, K, TOP) is None) == (len(shares) == 2)
        p = Problem(C, K, (0.01 * TOP, TOP))
        assert difference(p, dense_roots(*p)[0]) == ""


@pytest.mark.parametrize("kind", range(len(KINDS)), ids=lambda i: KINDS[i].__name__)
def test_left_vectors_belong_to_their_roots(kind):
    for number in (kind, kind + len(KINDS)):
        C, K, band = problem = random_problem(number, KRYLOV_MIN_SIZE)
        found = pairs_inside(C, K, band[1])
        pairs = found.take(in_band(found.lam, band, 1.0))
        assert difference(problem, pairs.lam) == ""
        Y = pairs.Y / np.linalg.norm(pairs.Y, axis=0)
        R = Y * pairs.lam.conj() ** 2 + (C.T @ Y) * pairs.lam.conj() + K.T @ Y
        size = np.abs(pairs.lam) ** 2 + np.abs(pairs.lam) * np.linalg.norm(C) + np.linalg.norm(K)
        assert (np.linalg.norm(R, axis=0) / size).max(initial=0.0) < 1e-12
        products = np.einsum("ij,ij->j", pairs.Y.conj(), 2 * pairs.lam * pairs.X + C @ pairs.X)
        lengths = np.linalg.norm(pairs.X, axis=0) * np.linalg.norm(pairs.Y, axis=0)
        clear = lengths * np.abs(pairs.lam) < 1e6  # of a coalescence
        np.testing.assert_allclose(products[clear], 1.0, atol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_condition_of_a_root_is_that_of_the_companion_with_left_vectors(seed):
    rng = np.random.default_rng(seed)
    n = 6
    C, K = rng.normal(size=(2, n, n))
    K = 40.0 * (K @ K.T + 0.3 * rng.normal(size=(n, n)))
    lam, psi = one_of_each_pair(*right_pairs(C, K), (0.0, np.inf))
    told = conditions(lam, psi, np.ones(n))
    for root, condition in zip(lam, told, strict=True):
        s = TIME_SCALE_RATIO ** np.round(np.log(np.abs(root)) / np.log(TIME_SCALE_RATIO))
        A = np.block([[np.zeros((n, n)), s * np.eye(n)], [-K / s, -C]])
        mu, Y, X = scipy.linalg.eig(A, left=True)  # of unit norm
        j = np.argmin(np.abs(mu - root))
        assert condition == pytest.approx(1.0 / abs(np.vdot(Y[:, j], X[:, j])), rel=1e-7)
