"""Labels of a whole tree of design points in one call."""

from __future__ import annotations

from squealstudy.modes.tracking.labels import TrackTree, pair_points


def track(parents, lams, shapes, coordinates=None):
    """Tracks of points with roots `lams` and shapes in common coordinates (see TrackTree)."""
    tree = TrackTree(parents, lams, coordinates)

    def pair(a, b):
        return shapes[a], shapes[b]

    return tree.label(pair_points(tree.children, tree.parents, tree.step, lams, pair, {}))
