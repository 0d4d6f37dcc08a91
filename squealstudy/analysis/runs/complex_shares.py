"""Share of a vibration's energy in each of several complex modes, which are not orthogonal."""

from __future__ import annotations

import numpy as np

RANK = 1e-10  # eigenvalues of the overlap below this are axes that others span


def complex_shares(states: np.ndarray, overlap: np.ndarray, energy: float) -> np.ndarray:
    """Shares of the vibration's energy over a window, each from 0 to 1, their sum at most 1.

    The energy of a motion's projection on a mode's plane (`transient.mode_planes`) is that of the
    motion where it is along this mode alone. Planes of several modes overlap, so that energies of
    projections may add up to more than there is. Each mode is therefore given what its plane adds
    to the planes of those before it, that of the largest projection first: together they have the
    energy of the projection on all of them.

    Parameters
    ----------
    states : ndarray (rows, 2 m)
        Coordinates on the planes of m modes, side by side, sqrt(J); their means over the window,
        which are a static shift, are taken off.
    overlap : ndarray (2 m, 2 m)
        Scalar products of the axes.
    energy : float
        Mean energy of the vibration, without that of a static shift, J.

    Returns
    -------
    ndarray (m,)
        NaN where nothing vibrates.
    """
    m = len(overlap) // 2
    rest = states - states.mean(axis=0)
    product = rest.T @ rest / len(rest)
    order = np.argsort([-_projected(product, overlap, [k]) for k in range(m)], kind="stable")
    share, held = np.zeros(m), 0.0
    for place, k in enumerate(order):
        found = _projected(product, overlap, list(order[: place + 1]))
        share[k], held = max(found - held, 0.0), max(found, held)
    whole = max(energy, held)
    return share / whole if whole > 0 else np.full(m, np.nan)


def _projected(product: np.ndarray, overlap: np.ndarray, modes: list[int]) -> float:
    """Mean energy of the projection on the planes of some modes together, J."""
    axes = [2 * k + i for k in modes for i in (0, 1)]
    part = np.ix_(axes, axes)
    inverse = np.linalg.pinv(overlap[part], rcond=RANK, hermitian=True)
    return 0.5 * float(np.sum(inverse * product[part]))
