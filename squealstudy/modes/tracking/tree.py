"""Builds the tree of neighbouring design points along which modes are tracked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

DENSE_LIMIT = 2000  # most points for which every pair is an edge of the graph
NEIGHBOURS = 12  # edges from each point if there are more points
POINTS_PER_QUERY = 2**16  # points whose neighbours are sought at once


def tracking_tree(
    coordinates: np.ndarray,
    grid_shape: tuple[int, ...] | None = None,
    structural: Sequence[bool] = (),
) -> np.ndarray:
    """Parent of each design point.

    The tree of a grid has lines along the first parameter; the first points of the lines form a
    line along the second parameter, the first points of the planes a line along the third, and so
    on. Parameters that change the structure come after all others, so that as few steps as possible
    lead from one structure to the next. Points of a line are in order of value, in whatever order a
    study lists the values. The tree of any other design is the minimum spanning tree of its points,
    with each parameter scaled to [0, 1].

    Parameters
    ----------
    coordinates : ndarray (n, p)
        Values of the swept parameters.
    grid_shape : tuple of int or None
        Number of values of each parameter of a grid; the first varies fastest over the points.
    structural : sequence of bool (p,)
        Whether a parameter changes the structure; none by default.

    Returns
    -------
    ndarray (n,) of int
        Index of the parent; -1 for the root, which is the point of least values of a grid, else the
        point nearest to the middle of the box.

    Raises
    ------
    ValueError
        Where `grid_shape` does not hold n points, or a coordinate is not finite.
    """
    x = np.asarray(coordinates, dtype=float)
    if grid_shape is None:
        return _spanning_tree(_unit_box(x))
    if np.prod(grid_shape, dtype=int) != len(x):
        raise ValueError(f"a grid of shape {grid_shape} does not have {len(x)} points")
    columns = range(len(grid_shape))
    order = sorted(columns, key=lambda k: k < len(structural) and structural[k])
    return _grid_tree(x, grid_shape, order)


def cross_edges(
    coordinates: np.ndarray, parents: np.ndarray, grid_shape: tuple[int, ...] | None = None
) -> np.ndarray:
    """Pairs (e, 2) of neighbouring design points that the tree does not connect.

    Neighbours in a grid differ in one parameter only, by one place among its values. In any other
    design they are the nearest points of each point, two for every parameter.
    """
    n = len(parents)
    if grid_shape is not None:
        index = np.arange(n).reshape(grid_shape, order="F")
        positions = value_orders(np.asarray(coordinates, dtype=float), grid_shape)
        index = index[np.ix_(*positions)] if positions else index
        edge_lists = [
            np.column_stack([np.delete(index, -1, k).ravel(), np.delete(index, 0, k).ravel()])
            for k in range(index.ndim)
        ]
        edges = np.vstack([np.zeros((0, 2), dtype=int), *edge_lists])
    else:
        x = _unit_box(np.asarray(coordinates, dtype=float))
        edges = np.column_stack(_numbers(_nearest(x, 2 * x.shape[1]), n))
    a, b = edges.T
    cross: np.ndarray = edges[(parents[a] != b) & (parents[b] != a)]
    return cross


def value_orders(coordinates: np.ndarray, grid_shape: tuple[int, ...]) -> list[np.ndarray]:
    """Indices (n_k,) that sort the listed values of each parameter of a grid.

    Parameters
    ----------
    coordinates : ndarray (n, p)
        Values at the points of the grid; the first parameter varies fastest.
    grid_shape : tuple of int (p,)
    """
    strides = np.cumprod((1, *grid_shape))[:-1]
    columns = zip(coordinates.T, strides, grid_shape, strict=True)
    return [np.argsort(x[: stride * count : stride], kind="stable") for x, stride, count in columns]


def grid_places(coordinates: np.ndarray, grid_shape: tuple[int, ...]) -> np.ndarray:
    """Rank (n, p), from 0, of each point's values among the values of each parameter."""
    listed = np.unravel_index(np.arange(len(coordinates)), grid_shape, order="F")
    orders = value_orders(coordinates, grid_shape)
    indices = np.zeros((len(coordinates), len(grid_shape)), dtype=int)
    for k, (order, index) in enumerate(zip(orders, listed, strict=True)):
        indices[:, k] = np.argsort(order)[index]
    return indices


def _grid_tree(x: np.ndarray, shape: tuple[int, ...], order: Sequence[int]) -> np.ndarray:
    """Parents (n,): one step back along the first parameter in `order` not at its least value."""
    index = np.arange(np.prod(shape, dtype=int))
    parents = np.full(len(index), -1)
    strides = np.cumprod((1, *shape))[:-1]
    ordered = value_orders(x, shape)
    for k in reversed(order):
        back = np.zeros(shape[k], dtype=int)  # from each place to that of the next lower value
        back[ordered[k][1:]] = ordered[k][:-1] - ordered[k][1:]
        step = back[(index // strides[k]) % shape[k]]
        inside = step != 0
        parents[inside] = index[inside] + step[inside] * strides[k]
    return parents


def _unit_box(x: np.ndarray) -> np.ndarray:
    """Coordinates scaled so that each has range 1."""
    if not np.isfinite(x).all():
        raise ValueError("coordinates of design points must be finite")
    if not x.size:
        return np.zeros((len(x), 1))
    span = np.ptp(x, axis=0)
    scaled: np.ndarray = (x - x.min(axis=0)) / np.where(span > 0, span, 1.0)
    return scaled


def _spanning_tree(x: np.ndarray) -> np.ndarray:
    """Parents in the shortest spanning tree, whose root is the middle point."""
    from scipy.spatial.distance import cdist

    n = len(x)
    if not n:
        return np.zeros(0, dtype=int)
    graph = cdist(x, x) + 1.0 if n <= DENSE_LIMIT else _neighbour_graph(x)
    middle = (x.min(axis=0) + x.max(axis=0)) / 2
    root = int(((x - middle) ** 2).sum(axis=1).argmin())
    tree = minimum_spanning_tree(graph)
    _, parents = breadth_first_order(tree, root, directed=False)
    return np.where(parents < 0, -1, parents).astype(int)


def _neighbour_graph(x: np.ndarray) -> sp.csr_matrix:
    """Edges to the nearest points, and a chain along each parameter that joins far clusters.

    Lengths are raised by one, since a zero in a sparse matrix would be no edge; that changes no
    spanning tree.
    """
    n = len(x)
    chains = [np.lexsort((*x.T, column)) for column in x.T]
    keys = [_keys(c[:-1], c[1:], n) for c in chains]
    a, b = _numbers(_once(np.concatenate([_nearest(x, NEIGHBOURS), *keys])), n)
    length = np.sqrt(sum((column[a] - column[b]) ** 2 for column in x.T)) + 1.0
    return sp.csr_matrix((length, (a, b)), shape=(n, n))


def _nearest(x: np.ndarray, count: int) -> np.ndarray:
    """Sorted keys (e,) of the pairs of each point of x (n, p) with its `count` nearest others.

    Points are queried in blocks, and a pair is one number, since a million points have 12 million
    neighbours.
    """
    from scipy.spatial import cKDTree

    n, tree = len(x), cKDTree(x)
    key_lists = [np.zeros(0, dtype=np.int64)]
    for i in range(0, n, POINTS_PER_QUERY):
        block = np.arange(i, min(i + POINTS_PER_QUERY, n))
        nearest = tree.query(x[block], min(count + 1, n))[1].reshape(len(block), -1)
        key_lists.append(_keys(np.repeat(block, nearest.shape[1]), nearest.ravel(), n))
    return _once(np.concatenate(key_lists))


def _keys(a: np.ndarray, b: np.ndarray, n: int) -> np.ndarray:
    """One number for each pair of two of n points, the same in both directions, sorted (e,)."""
    key = np.minimum(a, b) * n + np.maximum(a, b)
    return _once(key[a != b])


def _once(key: np.ndarray) -> np.ndarray:
    """The distinct numbers, sorted (in place): np.unique would take several times as long."""
    key.sort()
    first = np.ones(len(key), dtype=bool)
    np.not_equal(key[1:], key[:-1], out=first[1:])
    return key[first]


def _numbers(key: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Both points of each pair, the smaller index first."""
    return np.divmod(key, max(n, 1))


def tree_of_modes(parents: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tree without the points that have no modes.

    Parameters
    ----------
    parents : ndarray (n,) of int
        -1 for a root.
    counts : ndarray (n,) of int
        Number of modes of each point.

    Returns
    -------
    attached : ndarray (n,) of int
        New parent of each point: the nearest ancestor with modes. Without one it is the first
        point with modes below the same root, by depth, then by number. -1 for that first point and
        for points without modes.
    depth : ndarray (n,) of int
        Depth of each point in the new tree; 0 for points without modes.

    Raises
    ------
    ValueError
        Where a parent is no point, or parents form a cycle.
    """
    n = len(parents)
    for i in np.flatnonzero((parents < -1) | (parents >= n))[:1]:
        raise ValueError(f"point {i} has the parent {parents[i]}, expected -1 to {n - 1}")
    depth, root = _depths(parents)
    filled = counts > 0
    attached = parents.copy()
    while len(i := np.flatnonzero((attached >= 0) & ~filled[attached])):
        attached[i] = attached[attached[i]]
    attached[~filled] = -1
    first = np.full(n, -1)  # of each root: the first point with modes below it
    order = np.lexsort((depth, root))
    order = order[filled[order]]
    roots, first_index = np.unique(root[order], return_index=True)
    first[roots] = order[first_index]
    loose = np.flatnonzero(filled & (attached < 0))
    attached[loose] = np.where(first[root[loose]] == loose, -1, first[root[loose]])
    return attached, np.where(filled, _depths(attached)[0], 0)


def _depths(parents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth and root of each point; ValueError where parents form a cycle.

    Each round doubles the distance to the ancestor that is known of each point.
    """
    n = len(parents)
    ancestor, depth = np.where(parents < 0, np.arange(n), parents), (parents >= 0).astype(np.int64)
    for _ in range(max(n, 2).bit_length()):
        further = ancestor[ancestor]
        if np.array_equal(further, ancestor):
            break
        depth += depth[ancestor]
        ancestor = further
    if n and (parents[ancestor] >= 0).any():
        raise ValueError("parents form a cycle")
    return depth, ancestor
