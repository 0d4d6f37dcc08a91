"""Roots of any matrices: singular, indefinite, unsymmetric, badly scaled: never wrong and ok."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import squealstudy
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.band_roots import BandRoots, roots_in_band

TOLERANCE = 1e-4  # of [modes]: a point with larger estimated errors is inaccurate, not ok
EDGE = 1.01  # roots this near to an end of the band may be found or not

numbers = st.sampled_from([0.0, 0.0, 1.0, -1.0, 2.0, -3.0, 5.0, 1e-3, 40.0])
units = st.sampled_from([1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12])


def solved(M, C, K, band) -> BandRoots:
    return roots_in_band(*(sp.csr_matrix(A) for A in (M, C, K)), band)


def states(lam: np.ndarray) -> int:
    """Roots with conjugates: of two equal real ones round-off may make a pair."""
    return len(lam) + int((lam.imag > 0).sum())


def turned(seed: int, n: int) -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]


@given(
    st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=4),
    st.integers(0, 1000),
    st.booleans(),
    units,
    units,
)
@settings(max_examples=300)
def test_roots_of_scalar_equations_behind_full_matrices(scalars, seed, same, unit, second):
    """m lambda^2 + c lambda + k = 0 of each, mixed by rotations and other units: known roots.

    Masses and stiffnesses are zero or negative as well; an equation without any is no problem.
    """
    n = len(scalars)
    left = turned(seed, n)
    right = left.T if same else turned(seed + 1, n)
    M, C, K = (unit * left @ np.diag(one) @ right for one in zip(*scalars, strict=True))
    M, C = M / second**2, C / second  # another unit of time
    band = (1e-4 * second, 1e3 * second)
    every = np.concatenate([np.roots(s) * second for s in scalars])
    try:
        found = solved(M, C, K, band)
    except ConvergenceError:
        return
    if (
        any(not (m or c or k) for m, c, k in scalars)
        or (found.error > TOLERANCE * abs(found.lam)).any()
    ):
        return
    expected = every[
        (every.imag >= 0) & (abs(every) > EDGE * band[0]) & (EDGE * abs(every) < band[1])
    ]
    for lam in found.lam:
        assert abs(every - lam).min() < TOLERANCE * abs(lam)
    for lam in expected:
        assert abs(found.lam - lam).min(initial=np.inf) < TOLERANCE * abs(lam)
    assert states(found.lam) >= states(expected)


def test_massless_points_of_a_free_body_lose_no_root():
    """K and M both singular: 1/lambda of the rigid motion drowned all other roots, in silence."""
    M = np.diag([0.0, 0.0, 0.0])
    M[0, 2] = -2.0
    C = np.array([[14.8, 2.12, 4.43], [2.12, 1.88, 0.91], [4.43, 0.91, 2.98]])
    K = np.array([[0.0, -0.905, -0.688], [0.905, 0.0, 0.482], [0.688, -0.482, 0.0]])
    found = solved(M, C, K, (1e-2, 8.0))
    expected = [0.0016276910989487 + 0.2801115774987172j, -3.163626053531815]
    np.testing.assert_allclose(found.lam, expected, rtol=1e-9)


def test_slow_roots_beside_overdamped_ones_are_not_lost():
    """Twenty decades apart: as the roots of a companion matrix they are round-off."""
    M = np.array([[546.8, 146.9], [146.9, 352.4]])
    C = np.array([[1.48e16, -3.1e15], [-3.1e15, -6.3e15]])
    K = np.diag([-2.8e15, -9.8e9]) * 1e-6
    found = solved(M, C, K, (1e-14, 1e-5))
    slow = -np.linalg.eigvals(np.linalg.solve(C, K))
    np.testing.assert_allclose(np.sort(found.lam.real), np.sort(slow), rtol=1e-6)


def test_a_pencil_that_is_singular_everywhere_has_no_roots():
    """Skew-symmetric matrices of odd size: any number is a root, what is found is round-off."""
    skew = np.array([[0.0, 1.68e-4, 2.66e7], [-1.68e-4, 0.0, -5.4e6], [-2.66e7, 5.4e6, 0.0]])
    with pytest.raises(ConvergenceError, match="singular"):
        solved(skew, 0.0 * skew, 41.0 * skew, (2.8, 13.0))


@pytest.mark.parametrize("damping", [1e6, 1e10, 1e12])
@pytest.mark.parametrize("coupling", [0.0, 3.0])
def test_a_slow_root_beside_one_that_is_far_faster_is_there(damping, coupling):
    """m = 1, k = -1: the root 1/c of a pushed mass was lost with status ok from c = 1e10 on."""
    K = np.array([[1e4, coupling], [coupling, -1.0]])
    slow = -(K[1, 1] - coupling**2 / K[0, 0]) / damping
    modes = squealstudy.matrices(np.eye(2), K, C=np.diag([0.0, damping])).at().modes()
    assert modes.status == "ok"
    np.testing.assert_allclose(modes.lam, [100j, slow, -damping], rtol=1e-6)
    assert modes.unstable.tolist() == [False, True, False]


def test_a_light_mass_has_its_mode_and_spoils_no_other():
    """1e-18 kg beside 1 kg counted as singular: its mode was missing, others erred by .02."""
    K = np.array([[2e4, -1e4, 0.0], [-1e4, 2e4, -1e4], [0.0, -1e4, 2e4]])
    M, C = np.diag([1.0, 1.0, 1e-18]), np.diag([0.1, -1.0, 0.0])
    held = K[:2, :2] - np.outer(K[:2, 2], K[2, :2]) / K[2, 2]  # the light mass follows
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-held, -C[:2, :2]]])
    roots = np.linalg.eigvals(A)
    expected = np.sort_complex(roots[roots.imag > 0])
    modes = squealstudy.matrices(M, K, C=C).at()
    found = modes.modes().lam
    np.testing.assert_allclose(np.sort_complex(found[:2]), expected, rtol=1e-9)
    assert abs(found[2]) == pytest.approx(np.sqrt(2e22), rel=1e-6)
    narrow = modes.modes((1.0, 1000.0))
    assert narrow.error_rung.max() < 1e-6
    np.testing.assert_allclose(np.sort_complex(narrow.lam), expected, rtol=1e-9)
