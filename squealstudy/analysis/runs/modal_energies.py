"""Mechanical energy of each mode of a run, and the share it has of all (THEORY.md eq. (86))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.runs.levels import mean_interval

FIRST = 0.1  # of a record: its first window


@dataclass(frozen=True)
class ModalShares:
    """Shares of the mechanical energy over a window.

    Attributes
    ----------
    share, low, high : ndarray (ns,)
        Of the energy of all modes, with 95 % bounds within 0 and 1; zeros where nothing moves.
    mean : ndarray (ns,)
        Mean energy of each mode, J.
    outside : float
        Share outside the sensed modes.
    """

    share: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mean: np.ndarray
    outside: float


def mode_energies(q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Mechanical energies (v^2 + omega^2 q^2) / 2 of modes of unit mass (THEORY.md eq. (86)).

    Parameters
    ----------
    q, v : ndarray (rows, ns)
        Modal amplitudes [m sqrt(kg)] and velocities.
    omega : ndarray (ns,)
        rad/s.

    Returns
    -------
    ndarray (rows, ns)
        J.
    """
    energies: np.ndarray = 0.5 * (v**2 + (omega * q) ** 2)
    return energies


def vibration_energy(v: np.ndarray) -> np.ndarray:
    """Twice the kinetic energy (rows,) of modal velocities (rows, ns), J.

    Over a period its mean is the mechanical energy of the vibration; a static shift of the mean
    position, which is in `mode_energies`, is not in it.
    """
    energy: np.ndarray = np.einsum("ij,ij->i", v, v)
    return energy


def static_energy(q: np.ndarray, omega: np.ndarray) -> float:
    """Energy of the mean position of modes over a window, J: a static shift, no vibration.

    Parameters
    ----------
    q : ndarray (rows, ns)
        Modal amplitudes over the window.
    omega : ndarray (ns,)
        rad/s.
    """
    return float(0.5 * ((omega * q.mean(axis=0)) ** 2).sum())


def energy_outside(energies: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Energy (rows,) outside the sensed modes, J.

    Parameters
    ----------
    energies : ndarray (rows, ns)
    total : ndarray (rows,)
        Of all modes (history column `modal_energy`).
    """
    outside: np.ndarray = np.maximum(total - energies.sum(axis=1), 0.0)
    return outside


def first_window(rows: int) -> slice:
    """The first tenth of a record, one row at least."""
    return slice(0, max(1, round(FIRST * rows)))


def modal_shares(energies: np.ndarray, total: np.ndarray) -> ModalShares:
    """Ratio of mean energies over a window, with bounds from its sub-windows.

    The bounds are those of the linearised ratio: of the mean of energy - share * total.

    Parameters
    ----------
    energies : ndarray (rows, ns)
        The window only, J.
    total : ndarray (rows,)
        Of all modes, J.
    """
    mean, whole = energies.mean(axis=0), float(total.mean())
    if not whole > 0:
        zero = np.zeros(energies.shape[1])
        return ModalShares(zero, zero, zero, mean, 0.0)
    share = mean / whole
    _, low, high = mean_interval((energies - share * total[:, None]) / whole)
    return ModalShares(
        share,
        np.clip(share + low, 0.0, share),
        np.clip(share + high, share, np.maximum(share, 1.0)),
        mean,
        float(max(0.0, 1.0 - share.sum())),
    )
