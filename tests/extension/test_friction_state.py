"""Friction with a state in complex modes, against differences of its own law."""

from __future__ import annotations

import numpy as np
import pytest
from my_friction_state import DAMPING, MASS, STIFFNESS, bristle


def roots(speed, force, sigma_0, sigma_1):
    """Of the law as it is written, about its steady sliding: x, x' and z by their rates."""

    def g(w):
        return 0.4 + 0.2 * np.exp(-w / 0.5)

    def rate(state):
        x, v, z = state
        w = speed - v
        z_rate = w - sigma_0 * w * z / g(w)
        pull = force * (sigma_0 * z + sigma_1 * z_rate) - DAMPING * v - STIFFNESS * x
        return np.array([v, pull / MASS, z_rate])

    steady = np.array([force * g(speed) / STIFFNESS, 0.0, g(speed) / sigma_0])
    assert np.abs(rate(steady)).max() < 1e-9
    jacobian = [rate(steady + 1e-30j * unit).imag / 1e-30 for unit in np.eye(3)]  # exact
    return np.linalg.eigvals(np.transpose(jacobian))


@pytest.mark.parametrize(
    ("speed", "sigma_1", "unstable"), [(0.005, 0.0, False), (0.1, 0.0, True), (0.1, 0.2, True)]
)
def test_modes_are_those_of_the_law(speed, sigma_1, unstable):
    exact = roots(speed, 500.0, 1e4, sigma_1)
    exact = exact[exact.imag > 0]
    table = bristle().sweep(speed=[speed], sigma_1=[sigma_1])
    mode = table[~table["overdamped"]]
    np.testing.assert_allclose(mode["growth_rate"], exact.real, rtol=1e-9)
    np.testing.assert_allclose(2 * np.pi * mode["frequency_hz"], np.abs(exact), rtol=1e-9)
    assert mode["unstable"].tolist() == [unstable]
