"""The system linearised about steady sliding, in arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from squealstudy.system.linearise import StructureWeights


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M x'' + C x' + K x = 0 about steady sliding (THEORY.md eq. (17)).

    The coordinates are those of the reduction, in which the mass is the identity; a family of
    matrices has its own degrees of freedom. Matrices of a batch have a leading axis (m, n, n).

    Attributes
    ----------
    M, C, K : ndarray (n, n)
        Mass; damping [rad/s], which includes that of friction and of modes; stiffness [(rad/s)^2],
        not symmetric with friction. Matrices of a family are in the units of its files.
    K_sym : ndarray (n, n)
        Symmetric stiffness without friction, (rad/s)^2: its eigenvalues are squares of real
        frequencies. For a family it is the symmetric part of K.
    weights : StructureWeights, tuple of them or None
        Weights of the terms that the matrices are sums of (`system.linearise`); a batch has one
        entry for each design point. None for a family, and for a design point that failed.
    status, message : str or ndarray (m,) of str
        ``ok``, or why there is no such system; matrices of such a row are NaN.

    Examples
    --------
    The roots of an undamped minimal model, by numpy:

    >>> import numpy as np, squealstudy as sq
    >>> linear = sq.model("hulten", friction=0.0).at().linear
    >>> np.round(np.sqrt(np.linalg.eigvals(linear.K).real) / (2 * np.pi), 6).tolist()
    [100.0, 75.0]
    """

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    K_sym: np.ndarray
    weights: StructureWeights | tuple[StructureWeights | None, ...] | None
    status: str | np.ndarray
    message: str | np.ndarray
