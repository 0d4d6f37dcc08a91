"""The system linearised about steady sliding, in arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from squealstudy.system.linearise import StructureWeights


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M x'' + C x' + K x = 0 about steady sliding (THEORY.md eq. (17)); of a batch (m, n, n).

    The coordinates are those of the reduction, in which the mass is the identity; of a family of
    matrices its own degrees of freedom.

    Attributes
    ----------
    M, C, K : ndarray (n, n)
        Mass; damping [rad/s] with that of friction and modal damping; stiffness [(rad/s)^2], not
        symmetric with friction. Of a family in the units of its files.
    K_sym : ndarray (n, n)
        Symmetric stiffness without friction, (rad/s)^2: its eigenvalues are squares of real
        frequencies. Of a family the symmetric part of K.
    weights : StructureWeights, tuple of them or None
        Of the terms that the matrices are sums of (`system.linearise`); of a batch one of each
        design point. None of a family and of failures.
    status, message : str or ndarray (m,) of str
        ``ok``, or why there is none; rows of these are NaN.

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
