"""What a rung of reanalysis gives of one design point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.analysis.reanalysis.problem import Sample
from squealstudy.errors import ConvergenceError


class PointRoots(NamedTuple):
    """Roots of one design point inside the band, and who found them.

    Attributes
    ----------
    row : int
        Of theta.
    sample : Sample or None
    failure : ConvergenceError or None
    lam : ndarray (m,) complex
    X : ndarray (n or r, m) complex
        Right vectors, in full coordinates where `full`, else reduced.
    error : ndarray (m,)
        Estimated error of lam, rad/s.
    residual : ndarray (m,)
    method : str
    full : bool
    sure : bool
        No other root may lie in the band, as far as the estimates tell.
    """

    row: int
    sample: Sample | None
    failure: ConvergenceError | None
    lam: np.ndarray
    X: np.ndarray
    error: np.ndarray
    residual: np.ndarray
    method: str
    full: bool
    sure: bool = True


def failed(index: int, reason: ConvergenceError) -> PointRoots:
    """A design point without roots."""
    none = np.zeros(0)
    return PointRoots(
        index, None, reason, none.astype(complex), np.zeros((0, 0)), none, none, "", True
    )
