"""The real modes that a complex mode is made of, against the closed form of two coupled modes."""

from __future__ import annotations

import numpy as np
import pytest

from squealstudy.system.coupled_pair import coupled_pair

APART = 0.1  # omega_2^2 - omega_1^2


def growing(a, signs=(1.0, 1.0)):
    """The fastest mode of q'' + K q = 0, its real modes with other signs, and their growth."""
    K = np.array([[1.0, a], [-a, 1.0 + APART]])
    phi = np.diag(signs)
    lam2, x = np.linalg.eig(-K)
    lam = np.sqrt(lam2.astype(complex))
    k = int(np.argmax(lam.real))
    return phi, x[:, k], lam[k]


@pytest.mark.parametrize("a", [0.051, 0.07, 0.2, 3.0])
@pytest.mark.parametrize("signs", [(1.0, 1.0), (-1.0, 1.0)])
def test_beyond_coalescence_the_phase_is_that_of_the_closed_form(a, signs):
    phi, x, lam = growing(a, signs)
    pair = coupled_pair(phi, x * np.exp(0.7j))
    assert np.cos(np.radians(pair.phase_deg)) == pytest.approx(APART / (2 * a), rel=1e-9)
    np.testing.assert_allclose(pair.share, 0.5, rtol=1e-9)
    # the work of the coupling is what the mode grows by: Im lambda^2 = a sin(phase)
    assert abs((lam**2).imag) == pytest.approx(a * np.sin(np.radians(pair.phase_deg)), rel=1e-9)


def test_apart_they_are_in_step_and_one_has_most():
    phi, x, lam = growing(0.02)
    pair = coupled_pair(phi, x)
    assert abs(lam.real) < 1e-12
    assert pair.phase_deg == pytest.approx(0.0, abs=1e-9)
    assert pair.share[0] > 0.9
    assert pair.share.sum() == pytest.approx(1.0)


def test_a_third_mode_is_left_out_and_one_alone_is_no_pair():
    x = np.array([0.1, 2.0, 1.0j])
    pair = coupled_pair(np.eye(3), x)
    assert pair.modes.tolist() == [1, 2]
    assert pair.share.sum() == pytest.approx(5.0 / 5.01)
    assert pair.phase_deg == pytest.approx(90.0)
    alone = coupled_pair(np.eye(1), np.array([1.0 + 0j]))
    assert alone.modes.tolist() == [0, 0]
    assert np.isnan(alone.phase_deg)
