"""Growth, frequency and damping of roots, and how they change with the root."""

from __future__ import annotations

import numpy as np


def figures(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Growth rate [1/s], frequency |lambda|/2 pi [Hz] and damping ratio of roots (n,) [rad/s]."""
    size = np.abs(lam)
    return lam.real, size / (2 * np.pi), -lam.real / np.where(size > 0, size, 1.0)


def figure_slopes(lam: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Their first-order change with a change `slope` (n,) of the roots, by the chain rule.

    d|lambda| = Re(conj(lambda) d lambda) / |lambda|,
    d zeta = -(Re d lambda + zeta d|lambda|) / |lambda|.
    """
    size = np.where(np.abs(lam) > 0, np.abs(lam), 1.0)
    d_size = (lam.conj() * slope).real / size
    zeta = -lam.real / size
    return slope.real, d_size / (2 * np.pi), -(slope.real + zeta * d_size) / size
