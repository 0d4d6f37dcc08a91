"""Decides whether roots are stable, unstable or uncertain within their errors."""

from __future__ import annotations

import numpy as np

from squealstudy.root_pairs import LIGHT_DAMPING

UNSTABLE, STABLE, UNCERTAIN = "unstable", "stable", "uncertain"  # column `stability` of modes


def settled(lam: np.ndarray, error: np.ndarray, tolerance: float) -> np.ndarray:
    """Roots (m,) for judging stability: those that grow by less than their error become neutral.

    A model without damping has roots on the imaginary axis, which an approximate method moves to
    either side of it. Roots whose error exceeds `tolerance` (relative to |lambda|) stay as they
    are.
    """
    neutral = (lam.real > 0) & (lam.real <= error) & (error <= tolerance * np.abs(lam))
    return np.where(neutral, 1j * lam.imag, lam)


def uncertain_roots(lam: np.ndarray, error: np.ndarray, neutral: float) -> np.ndarray:
    """Mask (m,) of roots that may be stable or unstable: |Re lam| <= error, both rad/s.

    Errors up to the damping ratio `neutral`, within which modes neither grow nor decay, do not
    count: roots of undamped models lie on the imaginary axis except for round-off, and are stable.
    A root whose error is not known (NaN) may be either.
    """
    error = np.nan_to_num(error, nan=np.inf)
    error_counts = error > neutral * np.abs(lam)
    uncertain: np.ndarray = error_counts & (np.abs(lam.real) <= error)
    return uncertain


def light_or_growing(lam: np.ndarray) -> np.ndarray:
    """Mask (m,) of roots whose errors count: |damping ratio| < LIGHT_DAMPING, or growing."""
    judged: np.ndarray = (np.abs(lam.real) < LIGHT_DAMPING * np.abs(lam)) | (lam.real > 0)
    return judged


def worst_errors(
    lam: np.ndarray, error: np.ndarray, point: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Largest relative error of the light or growing roots of each point, and its root.

    Parameters
    ----------
    lam, error : ndarray (m,)
        Roots of all points and their estimated errors, rad/s; NaN where there is no estimate.
    point : ndarray (m,) of int
        Index of the point of each root.
    count : int
        Number of points.

    Returns
    -------
    worst : ndarray (count,)
        Largest error over |lam|; 0 where no root counts, or no error is known.
    worst_modes : ndarray (count,) of int
        Index among the m roots; -1 where no root counts.
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
    """Stability (m,) of each mode in words: `UNCERTAIN` if it is, else by `unstable`."""
    names: np.ndarray = np.where(uncertain, UNCERTAIN, np.where(unstable, UNSTABLE, STABLE))
    return names.astype(object)
