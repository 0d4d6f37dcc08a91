"""Onsets between points so close that polynomials through them tell where: no root finding."""

from __future__ import annotations

import numpy as np

HALVINGS = 50
LOOKED_AT = 9  # places between both ends
STEADY = 0.5  # largest change of the slope between neighbouring pairs of points, as its share


def cubic_onsets(x: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Zeros of the cubics through four points, between the second and the third.

    Parameters
    ----------
    x : ndarray (n, 4)
        Ascending.
    f : ndarray (n, 4)
        Of opposite signs, or zero, at the second and third.

    Returns
    -------
    value : ndarray (n,)
    error : ndarray (n,)
        Largest distance of the parabolas through three of the points from the cubic, anywhere in
        the interval, over its least slope there; infinite where the slope between the points
        changes by more than STEADY: at a kink, a square-root onset, a mode wrongly followed.
    """
    c = _divided_differences(x, f)
    value = _zero(x, c)
    part = np.linspace(0.0, 1.0, LOOKED_AT)
    v = x[:, 1, None] + part * (x[:, 2] - x[:, 1])[:, None]
    away = v[:, :, None] - x[:, None, :]
    product = np.maximum(*(np.abs(away[:, :, i : i + 3].prod(axis=2)) for i in (0, 1)))
    slope = np.diff(_evaluated(x[:, :, None], c[:, :, None], v), axis=1) / np.diff(v, axis=1)
    least = np.abs(slope).min(axis=1)
    turns = (np.sign(slope) != np.sign(slope[:, :1])).any(axis=1) | (least == 0)
    turns |= ~_steady(x, f)
    error = np.abs(c[:, 3]) * product.max(axis=1) / np.where(turns, 1.0, least)
    return value, np.where(turns, np.inf, error)


def _steady(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Whether the three secants agree (n,): a third difference may vanish at a kink by chance."""
    secants = np.diff(f, axis=1) / np.diff(x, axis=1)
    size = np.abs(secants).min(axis=1)
    same = (np.sign(secants) == np.sign(secants[:, :1])).all(axis=1)
    steady: np.ndarray = same & (np.abs(np.diff(secants, axis=1)).max(axis=1) <= STEADY * size)
    return steady


def _zero(x: np.ndarray, c: np.ndarray) -> np.ndarray:
    low, high = x[:, 1].copy(), x[:, 2].copy()
    before = np.sign(_evaluated(x, c, low))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        left = np.sign(_evaluated(x, c, middle)) == before
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    zero: np.ndarray = (low + high) / 2
    return zero


def _divided_differences(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Coefficients (n, k) of Newton's form."""
    c = np.array(f, dtype=float)
    for order in range(1, x.shape[1]):
        c[:, order:] = (c[:, order:] - c[:, order - 1 : -1]) / (x[:, order:] - x[:, :-order])
    return c


def _evaluated(x: np.ndarray, c: np.ndarray, at: np.ndarray) -> np.ndarray:
    value = np.zeros_like(at)
    for k in range(c.shape[1] - 1, -1, -1):
        value = value * (at - x[:, k]) + c[:, k]
    return value
