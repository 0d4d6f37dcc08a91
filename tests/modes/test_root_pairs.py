"""One pairing of roots: the same modes found twice."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from squealstudy.root_pairs import (
    by_modulus,
    least_assignment,
    paired_with_full_order,
    partner_distances,
    partners,
)

LIMIT = 0.05


def relative(full: np.ndarray, lam: np.ndarray) -> np.ndarray:
    return np.abs(full[:, None] - lam[None, :]) / np.abs(full)[:, None]


@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
def test_a_missing_mode_and_a_spurious_one_leave_the_others_their_partners(seed, count):
    """Modes 1 % apart: partners shifted by one each would be near enough for a pair."""
    rng = np.random.default_rng(seed)
    full = 1j * 1e4 * 1.01 ** np.arange(count) - rng.uniform(1.0, 50.0, count)
    lost = int(rng.integers(count))
    order = rng.permutation(count)
    found = np.delete(full, lost)
    spurious = full[-1] * 1.01 if lost < count // 2 else full[0] / 1.01
    lam = np.append(found, spurious)[order]
    partner = partners(relative(full, lam), LIMIT)
    kept = np.delete(np.arange(count), lost)
    np.testing.assert_array_equal(lam[partner[kept]], full[kept])


def test_no_root_is_the_partner_of_two():
    full = np.array([1.0, 1.001]) * 1j
    assert sorted(partners(relative(full, full[:1]), LIMIT)) == [-1, 0]
    assert np.isinf(partner_distances(full, full[:1])).sum() == 1


def test_two_modes_near_lock_in_share_their_distances():
    """Taking the nearest first would leave the other root its far partner."""
    full, lam = np.array([0.0, 1.0]), np.array([-0.6, 0.45])
    np.testing.assert_allclose(partner_distances(full, lam), [0.6, 0.55])


def test_roots_beyond_the_limit_make_no_pair():
    full = np.array([1.0, 2.0]) * 1j
    np.testing.assert_array_equal(partners(relative(full, 1.06 * full), LIMIT), [-1, -1])
    np.testing.assert_array_equal(partners(relative(full, 1.04 * full[::-1]), LIMIT), [1, 0])
    assert len(partners(np.zeros((0, 3)))) == 0
    np.testing.assert_array_equal(partners(np.zeros((2, 0))), [-1, -1])


@given(st.integers(0, 6), st.integers(0, 6), st.integers(0, 10**6), st.booleans())
def test_total_cost_is_the_least(n, m, seed, near_diagonal):
    rng = np.random.default_rng(seed)
    cost = rng.normal(size=(n, m))
    if near_diagonal:  # where the shortest way is taken
        cost -= 5.0 * np.eye(n, m)
    rows, columns = least_assignment(cost)
    assert len(rows) == len(columns) == min(n, m)
    assert (np.diff(rows) > 0).all()
    assert len(np.unique(columns)) == len(columns)
    assert cost[rows, columns].sum() <= cost[linear_sum_assignment(cost)].sum() + 1e-12


def test_round_off_does_not_number_modes_of_one_modulus():
    """Two that locked in, the growing one last, beside a third; overdamped ones behind all."""
    up, down = 3.0 + 300j, -3.0 + 300j
    for nudge in (0.0, 1e-12, -1e-12):
        lam = np.array([-50.0, up * (1 + nudge), 310j, down, 20j])
        order = by_modulus(lam, lam.imag == 0)
        assert order.tolist() == [4, 3, 1, 2, 0]
        rows = by_modulus(np.array([lam, lam[::-1]]), np.array([lam, lam[::-1]]).imag == 0)
        assert rows.tolist() == [[4, 3, 1, 2, 0], [0, 1, 3, 2, 4]]
    assert by_modulus(np.zeros((2, 0)), np.zeros((2, 0))).shape == (2, 0)


def test_a_root_at_the_edge_of_the_band_is_not_missed_where_its_partner_lies_beyond():
    """Of paper_stability: 7999.9 Hz at full order, 8000.6 Hz reduced, of a band to 8000 Hz."""
    full = 2j * np.pi * np.array([3000.0, 5000.0, 7999.9]) - 1.0
    reduced = full[:2] * (1 + 5e-5)
    band_hz = (500.0, 8000.0)
    assert paired_with_full_order(reduced, full, 0.0, band_hz).missed == 0
    assert paired_with_full_order(reduced, full, 0.0).missed == 1  # of no band
    exact = full[:2] * (1 + 1e-9)  # a reduction that does not err so much
    assert paired_with_full_order(exact, full, 0.0, band_hz).missed == 1
    within = np.append(full[:2], 2j * np.pi * 7900.0)
    assert paired_with_full_order(reduced, within, 0.0, band_hz).missed == 1
    rough = full[:2] * (1 + 2e-2)  # however much it errs: 1e-3 at most
    assert paired_with_full_order(rough, within, 0.0, band_hz).missed == 1
