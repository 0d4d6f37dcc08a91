"""Corners of contact laws: gaps at which a tangent jumps, as of unilateral contact that opens.

A point in balance there has no linearisation: it is stiff to one side and soft to the other. Laws
need not say where their corners are: tangents a little to both sides are compared.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

REL_ROUND_OFF = 1e-13  # error of a gap by round-off, of the sizes that it is the difference of
WIDER = 1e3  # factor on the distance, over which a smooth tangent changes by far more
# of the change over the wider distance, above which the change is a jump; a power 1.5 has 0.03
JUMP_SHARE = 0.9
LEAST_JUMP = 1e-6  # of the tangents: smaller changes are round-off
SMALLEST_GAP = 1e-290  # m: where all sizes are 0

Tangents = Callable[[np.ndarray], np.ndarray]


def balanced_at_a_corner(
    tangents: Tangents, gap: np.ndarray, size: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Whether any contact point (..., nc) is nearer to a jump of its tangent than round-off: (...).

    Parameters
    ----------
    tangents : callable
        Tangents -dp/dg (..., nc) [Pa/m] at gaps (..., nc) [m].
    gap : ndarray (..., nc)
        Gaps in balance, m.
    size : ndarray (...)
        Largest of the terms whose sum the gaps are, m.
    area : ndarray (..., nc)
        Areas, m2; a point without area has no stiffness.
    """
    distance = np.maximum(REL_ROUND_OFF * size, SMALLEST_GAP)[..., None]
    jump, largest = _change(tangents, gap, distance)
    wide, _ = _change(tangents, gap, WIDER * distance)
    is_jump = (jump > LEAST_JUMP * largest) & (jump > JUMP_SHARE * wide) & (area > 0.0)
    cornered: np.ndarray = np.any(is_jump, axis=-1)
    return cornered


def _change(
    tangents: Tangents, gap: np.ndarray, distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change of tangents from one side to the other, and the larger modulus, (..., nc) [Pa/m]."""
    closed, opened = tangents(gap - distance), tangents(gap + distance)
    return np.abs(closed - opened), np.maximum(np.abs(closed), np.abs(opened))
