"""A patch: a box of design points in which blocks of modes are interpolated between few nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.modes.reanalysis.blocks import (
    Block,
    Mixing,
    Solved,
    find_blocks,
    gauged,
    mixing,
)
from squealstudy.modes.reanalysis.polynomials import Interpolation, spread_points

THRESHOLDS = (0.15, 0.3, 0.5)  # participation from which two modes mix
MOST_MODES = 24  # in one block: beyond it a patch is better divided
MARGIN = 1.02  # of the band: modes that come this near are followed
UNFOLLOWED = 1.25  # others stay that far from it at nodes: between nodes they may come nearer


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
        """Its centre (d,)."""
        middle: np.ndarray = (self.low + self.high) / 2
        return middle

    def local(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates (b, d) in [-1, 1] of design points in the box."""
        half = (self.high - self.low) / 2
        scaled: np.ndarray = (theta - self.middle) / np.where(half > 0, half, 1.0)
        return scaled

    def place(self, xi: np.ndarray) -> np.ndarray:
        """Design points (b, d) of local coordinates."""
        there: np.ndarray = self.middle + xi * (self.high - self.low) / 2
        return there

    def halves(self, axis: int) -> tuple[Box, Box]:
        """Both halves along a direction."""
        cut_low, cut_high = self.high.copy(), self.low.copy()
        cut_low[axis] = cut_high[axis] = self.middle[axis]
        return Box(self.low, cut_low), Box(cut_high, self.high)

    def holds(self, theta: np.ndarray) -> np.ndarray:
        """Which points (b, d) lie in the box, faces included."""
        return np.asarray(((theta >= self.low) & (theta <= self.high)).all(axis=1))


@dataclass(frozen=True)
class Patch:
    """Blocks of modes over a box.

    Attributes
    ----------
    box : Box
    grid : Interpolation
    slices : tuple of (first column, size)
        Of each block among the columns of X and Y.
    X, Y : ndarray (q, r, m) complex
        Gauged right and left bases at the nodes.
    S, T : ndarray (q, sum of k^2) complex
        Gauged matrices of each block, flattened one after another.
    blocks : tuple of Block
    mixings : tuple of Mixing
        Of each node with the middle.
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
    blocks: tuple[Block, ...]
    mixings: tuple[Mixing, ...]
    reach: tuple[float, float]

    @property
    def m(self) -> int:
        """Number of modes followed."""
        return int(self.X.shape[2])

    def cardinals(self, theta: np.ndarray) -> np.ndarray:
        """Weights (b, q) of the nodes at design points."""
        return self.grid.cardinals(self.box.local(theta))


def make_patch(
    box: Box,
    grid: Interpolation,
    middle: Solved,
    nodes: Sequence[Solved],
    band: tuple[float, float],
) -> Patch | np.ndarray:
    """A patch, or where modes cannot be followed how much they mix along each direction (d,).

    `middle` and `nodes` hold all pairs of the small problem, conjugates too: no mode then enters or
    leaves the set where a root turns real or its damping grows.
    """
    mixings = [mixing(middle, node) for node in nodes]
    for threshold in THRESHOLDS:
        blocks = find_blocks(mixings, threshold)
        if not _all_followed(blocks, middle, nodes, band):
            continue
        kept = _within_reach(blocks, grid, nodes, band)
        if not kept or max(b.size for b in kept) > MOST_MODES:
            continue
        try:
            return _assembled(box, grid, kept, nodes, mixings, _reach(band))
        except np.linalg.LinAlgError:
            continue
    return mixing_by_direction(grid, mixings)


def _within_reach(
    blocks: Sequence[Block],
    grid: Interpolation,
    nodes: Sequence[Solved],
    band: tuple[float, float],
) -> list[Block]:
    """Blocks of which a mode is in the band anywhere in the box, not at the nodes alone.

    The mean root of a block is interpolated over the box; its roots keep the distance from their
    mean that they have at some node. Where no mode is in the band, the nearest block is taken: such
    points are served too, with no mode.
    """
    if not blocks:
        return []
    roots = [[node.pairs.lam[b.at_nodes[i]] for b in blocks] for i, node in enumerate(nodes)]
    mean = np.array([[lam.mean() for lam in row] for row in roots])
    spread = np.array([[np.abs(lam - lam.mean()).max() for lam in row] for row in roots])
    size = np.abs(grid.cardinals(spread_points(grid.nodes.shape[1])) @ mean)
    low, high = _reach(band)
    away = spread.max(axis=0)
    meets = ((size + away >= low) & (size - away <= high)).any(axis=0)
    above = np.array([[(lam.imag >= 0).any() for lam in row] for row in roots]).any(axis=0)
    chosen = meets & above
    if not chosen.any():
        beyond = np.maximum(low - size - away, size - away - high).min(axis=0)
        chosen[np.where(above, beyond, np.inf).argmin()] = True
    return [b for b, kept in zip(blocks, chosen, strict=True) if kept]


def _reach(band: tuple[float, float]) -> tuple[float, float]:
    return band[0] / MARGIN, band[1] * MARGIN


def _wanted(lam: np.ndarray, band: tuple[float, float], margin: float) -> np.ndarray:
    size = np.abs(lam)
    inside: np.ndarray = (size >= band[0] / margin) & (size <= band[1] * margin)
    return inside & (lam.imag >= 0)


def _all_followed(
    blocks: Sequence[Block],
    middle: Solved,
    nodes: Sequence[Solved],
    band: tuple[float, float],
) -> bool:
    """Whether every mode in the band or near it, at the middle and at every node, is in a block."""
    for number, solved in enumerate([middle, *nodes]):
        followed = np.zeros(len(solved.pairs.lam), dtype=bool)
        for block in blocks:
            followed[block.middle if number == 0 else block.at_nodes[number - 1]] = True
        if (_wanted(solved.pairs.lam, band, UNFOLLOWED) & ~followed).any():
            return False
    return True


def _assembled(
    box: Box,
    grid: Interpolation,
    blocks: Sequence[Block],
    nodes: Sequence[Solved],
    mixings: Sequence[Mixing],
    reach: tuple[float, float],
) -> Patch:
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
