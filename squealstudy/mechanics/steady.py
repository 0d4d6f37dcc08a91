"""Steady sliding of a design point, or of a batch, in arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class SteadySliding:
    """Contact in steady sliding (THEORY.md eq. (13)); a batch has a leading axis (m, ...).

    Attributes
    ----------
    gap : ndarray (nc,)
        Gap of each contact point, m, positive where open. After the contact points come the
        nonlinear springs, with their elongations; each counts as a contact point of 1 m2.
    pressure : ndarray (nc,)
        Contact pressure, Pa.
    tangent : ndarray (nc,)
        Contact stiffness per area, -dp/dg, Pa/m.
    force : ndarray (nc, 3)
        Normal force, and friction along and across the sliding direction, N.
    residual : float or ndarray (m,)
        Largest imbalance of a gap, relative to the largest movement of a gap under the load.
    open_share : float or ndarray (m,)
        Share of the contact area that is open, 0 to 1.
    iterations : int or ndarray (m,)
        Number of iterations of Newton's method; -1 where it fails.
    status, message : str or ndarray (m,) of str
        ``ok``, or why there is no steady sliding; the numbers of such a row are NaN.

    Examples
    --------
    >>> import squealstudy as sq
    >>> steady = sq.model("hulten", friction=0.5).at().steady
    >>> steady.status, steady.pressure.shape
    ('ok', (2,))
    >>> sq.model("hulten").at(friction=[0.2, 0.4, 0.6]).steady.force.shape
    (3, 2, 3)
    """

    gap: np.ndarray
    pressure: np.ndarray
    tangent: np.ndarray
    force: np.ndarray
    residual: float | np.ndarray
    open_share: float | np.ndarray
    iterations: int | np.ndarray
    status: str | np.ndarray
    message: str | np.ndarray
