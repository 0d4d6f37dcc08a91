"""A patch: a box of design points in which blocks of modes are interpolated between few nodes.

At every node of the patch the modes are expressed by the left and right modes of its middle. Modes
that mix, by veering, lock-in or coalescence, belong to one block. Only the subspace of a block is
followed, which is analytic where single modes are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from squealstudy.linalg.companion import Eigenpairs
from squealstudy.modes.reanalysis.polynomials import Interpolation, spread_points

# least participations at which two modes are mixed, tried in this order
THRESHOLDS = (0.15, 0.3, 0.5)
MOST_MODES = 24  # modes in one block; a patch with more is better divided
FOLLOWED_BAND_FACTOR = 1.02  # factor on the band within which modes are followed
# factor on the band outside which all other modes are at nodes: between nodes they may come nearer
UNFOLLOWED = 1.25
# largest condition of a block's gauge: half of the digits of bases are left, all of Ritz values
WORST_CONDITION = 1e7


@dataclass(frozen=True)
class Box:
    """Design points between two corners, theta in [-1, 1]^d.

    Attributes
    ----------
    low, high : ndarray (d,)
    """

    low: np.ndarray
    high: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Centre of the box (d,)."""
        middle: np.ndarray = (self.low + self.high) / 2
        return middle

    def local(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates (b, d) in [-1, 1] of design points in the box."""
        half = (self.high - self.low) / 2
        scaled: np.ndarray = (theta - self.middle) / np.where(half > 0, half, 1.0)
        return scaled

    def place(self, xi: np.ndarray) -> np.ndarray:
        """Design points (b, d) of local coordinates."""
        theta: np.ndarray = self.middle + xi * (self.high - self.low) / 2
        return theta

    def halves(self, axis: int) -> tuple[Box, Box]:
        """The two halves of the box along direction `axis`."""
        cut_low, cut_high = self.high.copy(), self.low.copy()
        cut_low[axis] = cut_high[axis] = self.middle[axis]
        return Box(self.low, cut_low), Box(cut_high, self.high)

    def holds(self, theta: np.ndarray) -> np.ndarray:
        """Mask (b,) of the points (b, d) in the box, faces included."""
        return np.asarray(((theta >= self.low) & (theta <= self.high)).all(axis=1))


@dataclass(frozen=True)
class Patch:
    """Blocks of modes over a box.

    Attributes
    ----------
    box : Box
    grid : Interpolation
    slices : tuple of (first column, size)
        First column of each block in X and Y, and its number of columns.
    X, Y : ndarray (q, r, m) complex
        Gauged right and left bases at the nodes.
    S, T : ndarray (q, sum of k^2) complex
        Gauged matrices of each block, flattened one after another.
    blocks : tuple of ModeBlock
    mixings : tuple of Mixing
        Mixing of the modes of each node with those of the middle.
    reach : (low, high)
        Bounds of |lambda| [rad/s] within which all modes are followed.
    """

    box: Box
    grid: Interpolation
    slices: tuple[tuple[int, int], ...]
    X: np.ndarray
    Y: np.ndarray
    S: np.ndarray
    T: np.ndarray
    blocks: tuple[ModeBlock, ...]
    mixings: tuple[Mixing, ...]
    reach: tuple[float, float]

    @property
    def m(self) -> int:
        """Number of modes followed over the patch."""
        return int(self.X.shape[2])

    def cardinals(self, theta: np.ndarray) -> np.ndarray:
        """Weights (b, q) of the nodes at design points."""
        return self.grid.cardinals(self.box.local(theta))


def make_patch(
    box: Box,
    grid: Interpolation,
    middle: NodeModes,
    nodes: Sequence[NodeModes],
    band: tuple[float, float],
) -> Patch | np.ndarray:
    """A patch; where modes cannot be followed, how much they mix along each direction (d,).

    `middle` and `nodes` have all pairs of the small problem, conjugates included. So no mode enters
    or leaves the set where a root turns real or its damping grows.
    """
    mixings = [mixing(middle, node) for node in nodes]
    for threshold in THRESHOLDS:
        blocks = find_blocks(mixings, threshold)
        if not _all_followed(blocks, middle, nodes, band):
            continue
        blocks_within = _within_reach(blocks, grid, nodes, band)
        if not blocks_within or max(b.size for b in blocks_within) > MOST_MODES:
            continue
        try:
            return _assembled(box, grid, blocks_within, nodes, mixings, _followed_band(band))
        except np.linalg.LinAlgError:
            continue
    return mixing_by_direction(grid, mixings)


def _within_reach(
    blocks: Sequence[ModeBlock],
    grid: Interpolation,
    nodes: Sequence[NodeModes],
    band: tuple[float, float],
) -> list[ModeBlock]:
    """Blocks with a mode in the band somewhere in the box, not only at the nodes.

    The mean root of a block is interpolated over the box; the distance of its roots from the mean
    is taken as the largest at the nodes. Where no block has a mode in the band the nearest one is
    returned: points without modes are solved by a patch, too.
    """
    if not blocks:
        return []
    roots = [[node.pairs.lam[b.at_nodes[i]] for b in blocks] for i, node in enumerate(nodes)]
    mean = np.array([[lam.mean() for lam in row] for row in roots])
    spread = np.array([[np.abs(lam - lam.mean()).max() for lam in row] for row in roots])
    size = np.abs(grid.cardinals(spread_points(grid.nodes.shape[1])) @ mean)
    low, high = _followed_band(band)
    spread_of_roots = spread.max(axis=0)
    meets = ((size + spread_of_roots >= low) & (size - spread_of_roots <= high)).any(axis=0)
    above = np.array([[(lam.imag >= 0).any() for lam in row] for row in roots]).any(axis=0)
    chosen = meets & above
    if not chosen.any():
        beyond = np.maximum(low - size - spread_of_roots, size - spread_of_roots - high).min(axis=0)
        chosen[np.where(above, beyond, np.inf).argmin()] = True
    return [b for b, is_within in zip(blocks, chosen, strict=True) if is_within]


def _followed_band(band: tuple[float, float]) -> tuple[float, float]:
    return band[0] / FOLLOWED_BAND_FACTOR, band[1] * FOLLOWED_BAND_FACTOR


def _oscillates_in_band(lam: np.ndarray, band: tuple[float, float], margin: float) -> np.ndarray:
    size = np.abs(lam)
    inside: np.ndarray = (size >= band[0] / margin) & (size <= band[1] * margin)
    return inside & (lam.imag >= 0)


def _all_followed(
    blocks: Sequence[ModeBlock],
    middle: NodeModes,
    nodes: Sequence[NodeModes],
    band: tuple[float, float],
) -> bool:
    """Whether every mode in the band or near it, at the middle and at every node, is in a block."""
    for number, solved in enumerate([middle, *nodes]):
        followed = np.zeros(len(solved.pairs.lam), dtype=bool)
        for block in blocks:
            followed[block.middle if number == 0 else block.at_nodes[number - 1]] = True
        if (_oscillates_in_band(solved.pairs.lam, band, UNFOLLOWED) & ~followed).any():
            return False
    return True


def _assembled(
    box: Box,
    grid: Interpolation,
    blocks: Sequence[ModeBlock],
    nodes: Sequence[NodeModes],
    mixings: Sequence[Mixing],
    reach: tuple[float, float],
) -> Patch:
    """The patch of blocks of modes that were followed over the nodes of a grid."""
    parts = [
        [gauged(b, i, node, mixed) for b in blocks]
        for i, (node, mixed) in enumerate(zip(nodes, mixings, strict=True))
    ]
    starts = np.cumsum([0, *(b.size for b in blocks)])
    return Patch(
        box=box,
        grid=grid,
        slices=tuple((int(s), b.size) for s, b in zip(starts, blocks, strict=False)),
        X=np.array([np.hstack([p.X for p in row]) for row in parts]),
        Y=np.array([np.hstack([p.Y for p in row]) for row in parts]),
        S=np.array([_flat([p.S for p in row]) for row in parts]),
        T=np.array([_flat([p.T for p in row]) for row in parts]),
        blocks=tuple(blocks),
        mixings=tuple(mixings),
        reach=reach,
    )


def _flat(matrices: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([a.ravel() for a in matrices])


def mixing_by_direction(grid: Interpolation, mixings: Sequence[Mixing]) -> np.ndarray:
    """How much modes mix per unit of each local coordinate (d,), by least squares over nodes."""
    amount = []
    for x in mixings:
        right = np.abs(x.right) / np.linalg.norm(x.right, axis=0)
        amount.append(float((1.0 - right.max(axis=0)).sum()))
    slope: np.ndarray = np.linalg.lstsq(np.abs(grid.nodes), np.array(amount), rcond=None)[0]
    return slope


class NodeModes(NamedTuple):
    """A node: all pairs in reduced coordinates and the damping matrix C (r, r)."""

    pairs: Eigenpairs
    C: np.ndarray


class Mixing(NamedTuple):
    """Modes of a node as combinations of those of the middle.

    Attributes
    ----------
    right : ndarray (m0, m)
        Participation of each right mode of the middle in each right mode of the node.
    left : ndarray (m, m0)
        The same for left modes.
    """

    right: np.ndarray
    left: np.ndarray


@dataclass(frozen=True)
class ModeBlock:
    """Modes that are followed together: indices at the middle, and at each node."""

    middle: np.ndarray
    at_nodes: tuple[np.ndarray, ...]

    @property
    def size(self) -> int:
        """Number of modes that the block follows together."""
        return len(self.middle)


def mixing(middle: NodeModes, node: NodeModes) -> Mixing:
    """Biorthogonal products in the state space of the companion form.

    A left state vector is [(lam + C)^H y; y], a right one [x; lam x].
    """
    lam0, X0, Y0 = middle.pairs
    lam, X, Y = node.pairs
    right = (Y0.conj().T @ X) * (lam0[:, None] + lam) + Y0.conj().T @ (middle.C @ X)
    left_product = (Y.conj().T @ X0) * (lam[:, None] + lam0) + Y.conj().T @ (node.C @ X0)
    return Mixing(right, left_product)


def find_blocks(mixings: Sequence[Mixing], threshold: float) -> list[ModeBlock]:
    """Groups of modes whose participations in each other exceed the threshold.

    Only groups with as many modes at every node as in the middle are returned: the modes of others
    do not continue each other.
    """
    m0 = len(mixings[0].right)
    starts = np.cumsum([m0, *(x.right.shape[1] for x in mixings)])
    rows, columns = [], []
    for x, start in zip(mixings, starts, strict=False):
        right = np.abs(x.right)
        left_mixing = np.abs(x.left).T
        linked = right > threshold * np.linalg.norm(right, axis=0)
        linked |= left_mixing > threshold * np.linalg.norm(left_mixing, axis=0)
        i, j = np.nonzero(linked)
        rows.append(i)
        columns.append(start + j)
    i, j = np.concatenate(rows), np.concatenate(columns)
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(starts[-1], starts[-1]))
    count, label = connected_components(graph, directed=False)
    parts = [label[a:b] for a, b in zip([0, *starts[:-1]], starts, strict=False)]
    members = [_members(part, count) for part in parts]
    blocks = []
    for group in range(count):
        sizes = {len(labels[group]) for labels in members}
        if len(sizes) == 1 and sizes != {0}:
            blocks.append(
                ModeBlock(members[0][group], tuple(labels[group] for labels in members[1:]))
            )
    return blocks


def _members(label: np.ndarray, count: int) -> list[np.ndarray]:
    """Indices of each group."""
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label, minlength=count))
    return [np.sort(part) for part in np.split(order, ends[:-1])]


class Subspace(NamedTuple):
    """A block at a node in the gauge of the middle: both bases (r, k) and both matrices (k, k)."""

    X: np.ndarray
    S: np.ndarray
    Y: np.ndarray
    T: np.ndarray


def gauged(block: ModeBlock, number: int, node: NodeModes, mixed: Mixing) -> Subspace:
    """The block's subspaces at a node, normalised by their products with the middle's modes.

    X S^2 + C X S + K X = 0 and T^2 Y^H + T Y^H C + Y^H K = 0.

    Raises
    ------
    LinAlgError
        Where the node's subspace is nearly orthogonal to the middle's, or one of them is so close
        to an exceptional point that its vectors do not span the subspace.
    """
    j = block.at_nodes[number]
    lam, X, Y = node.pairs.take(j)
    G, H = mixed.right[np.ix_(block.middle, j)], mixed.left[np.ix_(j, block.middle)]
    if max(_condition(G), _condition(H)) > WORST_CONDITION:
        raise np.linalg.LinAlgError("the gauge is singular")
    right = np.linalg.solve(G.T, np.vstack([X, G * lam]).T).T
    left_vectors = np.linalg.solve(H, np.hstack([Y.conj().T, lam[:, None] * H]))
    r = len(X)
    return Subspace(X=right[:r], S=right[r:], Y=left_vectors[:, :r].conj().T, T=left_vectors[:, r:])


def _condition(A: np.ndarray) -> float:
    """Condition number of a matrix, after its rows and columns have been scaled to unit length."""
    if len(A) == 1:
        return 1.0 if A[0, 0] else np.inf
    A = A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300)
    A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return float(np.linalg.cond(A))
