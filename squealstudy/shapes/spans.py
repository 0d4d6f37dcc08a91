"""What modes move at points where they are measured."""

from __future__ import annotations

import numpy as np

# motion at the points over a mode's largest one, up to which it is round-off
LEAST_MOTION = 1e-6


def span(motions: np.ndarray) -> np.ndarray:
    """Orthonormal basis (r, k) of what the modes of a group move at some points.

    Motion of round-off is left out, as of points on a nodal line, or in directions in which a mode
    does not move. Of modes at rest at all points k is 0, and so is their MAC with any shape.

    Parameters
    ----------
    motions : ndarray (r, g)
        Motion of each mode there, over its largest one anywhere.
    """
    directions, sizes, _ = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(directions[:, sizes > LEAST_MOTION])
