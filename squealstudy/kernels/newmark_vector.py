"""Loops over modal vectors (n,) that the Newmark kernels share; they vectorise."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import fast_kernel


@fast_kernel
def dot(x: np.ndarray, y: np.ndarray) -> float:
    """x^T y; with x = y, a NaN or inf anywhere stays in it, which a maximum would lose."""
    total = 0.0
    for j in range(x.size):
        total += x[j] * y[j]
    return total


@fast_kernel
def move(x: np.ndarray, factor: float, step: np.ndarray) -> None:
    """Add factor times step (n,) to x (n,) in place."""
    for j in range(x.size):
        x[j] += factor * step[j]


@fast_kernel
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Target = source, without numpy's checks of shapes, which take long to compile."""
    for j in range(target.size):
        target[j] = source[j]


@fast_kernel
def fill(x: np.ndarray, value: float) -> None:
    """Set all entries of x (n,) to a value."""
    for j in range(x.size):
        x[j] = value
