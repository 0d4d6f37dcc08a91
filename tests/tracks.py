"""Labels of a whole tree of design points in one call."""

from __future__ import annotations

import numpy as np

from squealstudy.modes.tracking.labels import TrackTree
from squealstudy.modes.tracking.ragged import Ragged


class Known:
    """Shapes of points in common coordinates, (m, k) each (see `steps.Shapes`)."""

    def __init__(self, shapes):
        self.shapes = shapes

    def coordinate_system(self, a, b):
        return np.array([self.shapes[i].shape[1] for i in b])

    def of(self, a, b):
        return tuple(np.stack([self.shapes[i] for i in points]) for points in (a, b))


def track(parents, lams, shapes, coordinates=None):
    """Tracks of points with roots `lams` and shapes in common coordinates (see TrackTree)."""
    tree = TrackTree(np.array(parents), Ragged.of(lams), coordinates)
    return tree.label(tree.stepper(Known(shapes)).pair_all())
