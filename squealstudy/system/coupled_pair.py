"""The two real modes that a complex mode is made of, and how far friction has coupled them.

The real modes are those of steady sliding without the coupling by friction. A coupling force a q_2
on one mode and -a q_1 on the other does the work 2 pi a |q_1| |q_2| sin(phase) in a cycle: two
modes that move in step, or in opposition, get none. Without damping they move so until friction has
brought their frequencies together; beyond, cos(phase) = (omega_2^2 - omega_1^2) / (2 a).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class CoupledPair(NamedTuple):
    """The two real modes with the largest shares of a complex mode's kinetic energy, largest first.

    Attributes
    ----------
    modes : ndarray (2,) of int
        Their numbers among the real modes, from 0; equal where the model has a single mode.
    share : ndarray (2,)
        Share of each in the kinetic energy of the complex mode.
    phase_deg : float
        Phase between their coordinates, from 0 to 90 degrees, as signs of real modes are
        arbitrary. NaN where the model has a single mode.
    """

    modes: np.ndarray
    share: np.ndarray
    phase_deg: float


def coupled_pair(phi: np.ndarray, x: np.ndarray) -> CoupledPair:
    """Find the pair of real modes of a complex mode.

    Parameters
    ----------
    phi : ndarray (n, n)
        Real modes in coordinates in which the mass is the identity.
    x : ndarray (n,) complex
        Shape of the complex mode, in the same coordinates.
    """
    q = phi.T @ x
    share = np.abs(q) ** 2
    share = share / share.sum()
    order = np.argsort(-share, kind="stable")[:2]
    modes = np.array([order[0], order[-1]])
    phase = np.nan
    if len(order) > 1:
        phase_difference = np.degrees(np.angle(q[order[1]] * np.conj(q[order[0]]))) % 180.0
        phase = float(min(phase_difference, 180.0 - phase_difference))
    return CoupledPair(modes, share[modes], phase)
