"""Facets of meshes: shape functions, quadrature, normals."""

from __future__ import annotations

import numpy as np
import pytest
from touching import FACETS, plane

from squealstudy.errors import ModelError
from squealstudy.models.components.facet_geometry import Facets, rule, shape_values

# corners, middles of edges, centre: the order of VTK
QUAD = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]])
TRIANGLE = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])


@pytest.mark.parametrize("kind", FACETS)
def test_shape_functions_are_one_at_their_node_and_slopes_are_theirs(kind):
    nodes = (TRIANGLE if kind in (3, 6) else QUAD)[:kind].astype(float)
    np.testing.assert_allclose(shape_values(kind, nodes)[:, 0, :kind], np.eye(kind), atol=1e-15)
    places, h = rule(kind, 3)[0], 1e-6
    N = shape_values(kind, places)
    np.testing.assert_allclose(N.sum(axis=2), np.tile([1, 0, 0], (len(places), 1)), atol=1e-14)
    for axis in range(2):
        step = h * np.eye(2)[axis]
        ends = [shape_values(kind, places + s * step)[:, 0] for s in (1, -1)]
        np.testing.assert_allclose((ends[0] - ends[1]) / 2 / h, N[:, 1 + axis], atol=1e-8)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("kind", [3, 4])
def test_rules_integrate_their_degree(kind, n):
    places, weights = rule(kind, n)
    assert (weights > 0).all()
    a, b = places.T
    degree = [1, 2, 4, 6, 8][n - 1] if kind == 3 else 2 * n - 1
    for i in range(degree + 1):
        j = degree - i if kind == 3 else i
        if kind == 3:  # i! j! / (i + j + 2)!
            exact = np.prod(range(1, i + 1)) * np.prod(range(1, j + 1))
            exact /= np.prod(range(1, i + j + 3), dtype=float)
        else:
            exact = (2 / (i + 1) * (i % 2 == 0)) ** 2
        assert weights @ (a**i * b**j) == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize("kind", FACETS)
def test_normals_point_outwards_and_areas_add_up(kind):
    facets = plane(kind, (3, 2), up=False, lengths=(0.3, 0.2))
    surface, _ = facets.gauss_points(3)
    np.testing.assert_allclose(surface.normal @ [0, 0, 1], -1)
    assert surface.area.sum() == pytest.approx(0.06, rel=1e-13)
    np.testing.assert_allclose(surface.shape @ facets.coordinates, surface.points, atol=1e-15)


def test_facets_are_checked():
    x = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(ModelError, match="LINING: it has no facet"):
        Facets(x, (), "LINING")
    with pytest.raises(ModelError, match="3, 4, 6, 8 or 9 nodes"):
        Facets(x, (np.array([[0, 1, 2, 3, 0]]),))
    with pytest.raises(ModelError, match="nodes that it does not have"):
        Facets(x, (np.array([[0, 1, 4]]),))
    with pytest.raises(ModelError, match="1 facets have no area, first number 1"):
        Facets(x, (np.array([[0, 1, 2], [0, 1, 1]]),))
    with pytest.raises(ModelError, match="finite"):
        Facets(x * np.nan, (np.array([[0, 1, 2]]),))
