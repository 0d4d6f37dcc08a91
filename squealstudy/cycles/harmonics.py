"""Fourier series of periodic motions, and how they are sampled.

A series (2 H + 1, n) has the rows q_0, cosines 1 to H, sines 1 to H of the angle theta = omega t.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

LEAST_SAMPLES = 256  # samples of a period
# least number of samples for each harmonic: exact up to H, and beyond, for forces of fourth power
SAMPLES_A_HARMONIC = 10
MOST_FINER = 39  # most harmonics of a finer series: more cost as much as the whole cycle
# the same for few coordinates, and the number of equations it is limited by: a contact that opens
# needs more harmonics
MOST_FINER_OF_FEW, MOST_FINER_EQUATIONS = 100, 420


@dataclass(frozen=True)
class Sampling:
    """Samples of a period for series of H harmonics.

    Attributes
    ----------
    order : ndarray (2 H + 1,)
        Harmonic of each row.
    synthesis, slope : ndarray (S, 2 H + 1)
        Matrices from a series to its samples, and to those of its derivative by theta.
    analysis : ndarray (2 H + 1, S)
        Matrix from samples to the series.
    cosines, sines : ndarray (2 H + 1, S)
        Matrices from samples to their mean products with cosines and sines of orders 0 to 2 H.
    """

    order: np.ndarray
    synthesis: np.ndarray
    slope: np.ndarray
    analysis: np.ndarray
    cosines: np.ndarray
    sines: np.ndarray


@lru_cache(maxsize=32)
def sampling(harmonics: int, min_samples: int = LEAST_SAMPLES) -> Sampling:
    """Sampling with `min_samples`, doubled until there are ten for each harmonic."""
    count = min_samples
    while count < SAMPLES_A_HARMONIC * harmonics:
        count *= 2
    theta = 2 * np.pi * np.arange(count) / count
    synthesis, slope = series_at(theta, harmonics)
    weights = np.full(2 * harmonics + 1, 2.0 / count)
    weights[0] = 1.0 / count
    angles = np.arange(2 * harmonics + 1)[:, None] * theta
    return Sampling(
        order=orders(harmonics),
        synthesis=synthesis,
        slope=slope,
        analysis=weights[:, None] * synthesis.T,
        cosines=np.cos(angles) / count,
        sines=np.sin(angles) / count,
    )


def orders(harmonics: int) -> np.ndarray:
    """Order (2 H + 1,) of the harmonic in each row of a series."""
    h = np.arange(1, harmonics + 1)
    return np.concatenate([[0], h, h])


def series_at(theta: np.ndarray, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (S, 2 H + 1) that give states and their derivatives by theta at angles (S,)."""
    h = np.arange(1, harmonics + 1)
    c, s = np.cos(np.outer(theta, h)), np.sin(np.outer(theta, h))
    ones = np.ones((len(theta), 1))
    return np.hstack([ones, c, s]), np.hstack([0 * ones, -h * s, h * c])


@lru_cache(maxsize=32)
def period_at(count: int, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """`series_at` for `count` even samples of a period; the matrices are read-only."""
    matrices = series_at(2 * np.pi * np.arange(count) / count, harmonics)
    for matrix in matrices:
        matrix.flags.writeable = False
    return matrices


def derivative(series: np.ndarray) -> np.ndarray:
    """Series of the derivative by theta of a series; both (2 H + 1, ..)."""
    H = (len(series) - 1) // 2
    h = np.arange(1, H + 1)[:, None]
    c, s = series[1 : H + 1], series[H + 1 :]
    return np.vstack([np.zeros_like(series[:1]), h * s, -h * c])


def with_harmonics(series: np.ndarray, harmonics: int) -> np.ndarray:
    """The series with another number of harmonics: cut off, or filled up with zeros."""
    H = (len(series) - 1) // 2
    resized = np.zeros((2 * harmonics + 1, *series.shape[1:]))
    n_common = min(H, harmonics)
    resized[: n_common + 1] = series[: n_common + 1]
    resized[harmonics + 1 : harmonics + 1 + n_common] = series[H + 1 : H + 1 + n_common]
    return resized


def most_finer(coordinates: int) -> int:
    """Most harmonics of the finer series that a cycle of so many coordinates is compared with."""
    return max(MOST_FINER, min(MOST_FINER_OF_FEW, MOST_FINER_EQUATIONS // (2 * coordinates)))
