"""Mechanical energies of modes and their shares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.motion.outcome.energies import (
    energy_outside,
    first_window,
    modal_shares,
    mode_energies,
    vibration_energy,
)

TIME = np.arange(5000) * 1e-5
OMEGA = 2 * np.pi * np.array([1000.0, 3000.0, 5200.0])


def free_motion(amplitudes, shift=0.0):
    """Modes swinging freely: displacement and velocity."""
    phase = OMEGA * TIME[:, None] + np.arange(len(OMEGA))
    return amplitudes * np.cos(phase) + shift, -amplitudes * OMEGA * np.sin(phase)


def test_energy_of_free_motion_is_constant():
    amplitudes = np.array([1e-4, 2e-5, 0.0])
    q, v = free_motion(amplitudes)
    expected = np.broadcast_to(0.5 * (OMEGA * amplitudes) ** 2, q.shape)
    np.testing.assert_allclose(mode_energies(q, v, OMEGA), expected, rtol=1e-12)


def test_vibration_energy_is_blind_to_a_static_shift():
    q, v = free_motion(np.array([1e-4, 2e-5, 3e-5]))
    shifted, _ = free_motion(np.array([1e-4, 2e-5, 3e-5]), shift=1e-3)
    energies = mode_energies(q, v, OMEGA)
    assert vibration_energy(v).mean() == pytest.approx(energies.sum(axis=1).mean(), rel=1e-3)
    assert mode_energies(shifted, v, OMEGA).sum(axis=1).mean() > 50 * vibration_energy(v).mean()


def test_shares_and_what_is_outside():
    q, v = free_motion(np.array([3e-5, 2e-5, 1e-5]))
    energies = mode_energies(q, v, OMEGA)
    total = energies.sum(axis=1) + 0.25 * energies.sum(axis=1)
    found = modal_shares(energies, total)
    np.testing.assert_allclose(found.share, energies[0] / total[0], rtol=1e-9)
    np.testing.assert_allclose(found.mean, energies[0], rtol=1e-9)
    assert found.outside == pytest.approx(0.2, rel=1e-9)
    assert energy_outside(energies, total) == pytest.approx(0.2 * total, rel=1e-9)
    np.testing.assert_allclose(found.high - found.low, 0, atol=1e-9)


def test_bounds_cover_the_share_of_wandering_energies():
    """Two energies that wander about means of 3 and 1, correlated over 25 rows of 5000."""
    hits = 0
    kernel = np.exp(-np.arange(100) / 25)
    kernel /= np.linalg.norm(kernel)
    for seed in range(200):
        kicks = np.random.default_rng(seed).normal(size=(2, 5099))
        x = np.array([np.convolve(k, kernel, "valid") for k in kicks]).T
        energies = x**2 * np.array([3.0, 1.0])
        found = modal_shares(energies, energies.sum(axis=1))
        hits += found.low[0] <= 0.75 <= found.high[0]
        assert found.outside == pytest.approx(0.0, abs=1e-12)
    assert 170 <= hits <= 198


def test_nothing_moves():
    found = modal_shares(np.zeros((50, 3)), np.zeros(50))
    for values in (found.share, found.low, found.high, found.mean):
        np.testing.assert_array_equal(values, 0.0)
    assert found.outside == 0.0
    assert modal_shares(np.zeros((50, 0)), np.ones(50)).outside == 1.0


@pytest.mark.parametrize(("rows", "stop"), [(1, 1), (4, 1), (100, 10), (10001, 1000)])
def test_first_window(rows, stop):
    assert first_window(rows) == slice(0, stop)


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), scale=st.floats(1e-12, 1e6), rows=st.integers(1, 300))
def test_bounds_contain_shares_within_the_whole(seed, scale, rows):
    rng = np.random.default_rng(seed)
    energies = rng.gamma(0.3, size=(rows, 6))
    total = energies.sum(axis=1) + rng.gamma(0.3, size=rows)
    one, two = modal_shares(energies, total), modal_shares(scale * energies, scale * total)
    assert (one.low >= 0).all()
    assert (one.low <= one.share).all()
    assert (one.share <= one.high).all()
    assert (one.high <= 1).all()
    assert one.share.sum() + one.outside == pytest.approx(1.0)
    np.testing.assert_allclose(two.share, one.share, rtol=1e-9)
    np.testing.assert_allclose(two.low, one.low, rtol=1e-6, atol=1e-9)
