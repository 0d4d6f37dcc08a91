"""Stability by roots within their errors, and which errors count."""

from __future__ import annotations

import numpy as np

from squealstudy.root_pairs import LIGHT_DAMPING

UNSTABLE, STABLE, UNCERTAIN = "unstable", "stable", "uncertain"  # column `stability` of modes


def settled(lam: np.ndarray, error: np.ndarray, tolerance: float) -> np.ndarray:
    """Roots (m,) for judging their stability: those that grow by less than their error are neutral.

    A model without damping has roots on the imaginary axis, which an approximate method moves to
    either side of it. Errors beyond the tolerance, relative to |lambda|, excuse no growth.
    """
    neutral = (lam.real > 0) & (lam.real <= error) & (error <= tolerance * np.abs(lam))
    return np.where(neutral, 1j * lam.imag, lam)


def uncertain_roots(lam: np.ndarray, error: np.ndarray, neutral: float) -> np.ndarray:
    """Roots (m,) that may be stable or unstable: |Re lam| <= error, both rad/s.

    An error within the damping ratio `neutral` that stability is not judged by tells of nothing:
    roots of undamped models lie on the imaginary axis but for round-off, and count as stable. A
    root whose error is not known (NaN) may be either.
    """
    error = np.nan_to_num(error, nan=np.inf)
    error_counts = error > neutral * np.abs(lam)
    uncertain: np.ndarray = error_counts & (np.abs(lam.real) <= error)
    return uncertain


def light_or_growing(lam: np.ndarray) -> np.ndarray:
    """Which roots (m,) errors are judged by: |damping ratio| < LIGHT, or growing."""
    judged: np.ndarray = (np.abs(lam.real) < LIGHT_DAMPING * np.abs(lam)) | (lam.real > 0)
    return judged


def worst_errors(
    lam: np.ndarray, error: np.ndarray, point: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Largest relative error of the light or growing roots of each point, and where it is.

    Parameters
    ----------
    lam, error : ndarray (m,)
        Roots of all points and their estimated errors, rad/s; NaN where there is none.
    point : ndarray (m,) of int
    count : int
        Number of points.

    Returns
    -------
    worst : ndarray (count,)
        Of |lam|; 0 where no root is judged.
    worst_modes : ndarray (count,) of int
        Which of the m roots, -1 where none.
    """
    size = np.abs(lam)
    judged = np.flatnonzero(light_or_growing(lam))
    relative = error[judged] / np.maximum(size[judged], np.finfo(float).tiny)
    relative = np.where(np.isnan(relative), 0.0, relative)
    order = np.argsort(relative, kind="stable")
    worst, worst_modes = np.zeros(count), np.full(count, -1)
    worst[point[judged[order]]] = relative[order]  # the largest of a point comes last
    worst_modes[point[judged[order]]] = judged[order]
    return worst, worst_modes


def damping_ratios(lam: np.ndarray) -> np.ndarray:
    """-Re lambda / |lambda| of each root (m,)."""
    zeta: np.ndarray = -lam.real / np.maximum(np.abs(lam), np.finfo(float).tiny)
    return zeta


def unstable_roots(lam: np.ndarray, tolerance: float) -> np.ndarray:
    """The roots whose damping ratio is below minus the tolerance."""
    return lam[damping_ratios(lam) < -tolerance]


def stability_names(unstable: np.ndarray, uncertain: np.ndarray) -> np.ndarray:
    """Name of each mode (m,) of str: uncertain whatever its sign, else by `unstable`."""
    names: np.ndarray = np.where(uncertain, UNCERTAIN, np.where(unstable, UNSTABLE, STABLE))
    return names.astype(object)
