"""Modes of a patch of design points in blocks that are followed as invariant subspaces.

At every node of the patch the modes are expressed through the left and right modes of its middle.
Modes that mix there, by veering, lock-in or coalescence, belong to one block; of a block only its
subspace is followed, which is analytic where single modes are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from squealstudy.linalg.companion import Eigenpairs

WORST_CONDITION = 1e7  # of a block's gauge: half the digits, of which Ritz values keep all


class Solved(NamedTuple):
    """A node: all pairs in reduced coordinates and the damping matrix C (r, r)."""

    pairs: Eigenpairs
    C: np.ndarray


class Mixing(NamedTuple):
    """How the modes of a node are made of those of the middle.

    Attributes
    ----------
    right : ndarray (m0, m)
        Participation of each middle mode in each right mode of the node.
    left : ndarray (m, m0)
        The same of left modes.
    """

    right: np.ndarray
    left: np.ndarray


@dataclass(frozen=True)
class Block:
    """Modes that are followed together: indices at the middle, and at each node."""

    middle: np.ndarray
    at_nodes: tuple[np.ndarray, ...]

    @property
    def size(self) -> int:
        """Number of modes."""
        return len(self.middle)


def mixing(middle: Solved, node: Solved) -> Mixing:
    """Biorthogonal products in the state space of the companion form.

    A left state vector is [(lam + C)^H y; y], a right one [x; lam x].
    """
    lam0, X0, Y0 = middle.pairs
    lam, X, Y = node.pairs
    right = (Y0.conj().T @ X) * (lam0[:, None] + lam) + Y0.conj().T @ (middle.C @ X)
    left = (Y.conj().T @ X0) * (lam[:, None] + lam0) + Y.conj().T @ (node.C @ X0)
    return Mixing(right, left)


def find_blocks(mixings: Sequence[Mixing], threshold: float) -> list[Block]:
    """Groups of modes whose participations in each other exceed the threshold.

    Returns only groups of as many modes at every node as in the middle; the others are no
    continuation of each other within the set of modes given.
    """
    m0 = len(mixings[0].right)
    starts = np.cumsum([m0, *(x.right.shape[1] for x in mixings)])
    rows, columns = [], []
    for x, start in zip(mixings, starts, strict=False):
        right = np.abs(x.right)
        left = np.abs(x.left).T
        linked = right > threshold * np.linalg.norm(right, axis=0)
        linked |= left > threshold * np.linalg.norm(left, axis=0)
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
        sizes = {len(at[group]) for at in members}
        if len(sizes) == 1 and sizes != {0}:
            blocks.append(Block(members[0][group], tuple(at[group] for at in members[1:])))
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


def gauged(block: Block, number: int, node: Solved, mixed: Mixing) -> Subspace:
    """The block's subspaces at a node, normalised by their products with the middle's modes.

    X S^2 + C X S + K X = 0 and T^2 Y^H + T Y^H C + Y^H K = 0.

    Raises
    ------
    LinAlgError
        Where the node's subspace has hardly anything of the middle's, or where one of both lies so
        close to an exceptional point that its vectors do not span the subspace.
    """
    j = block.at_nodes[number]
    lam, X, Y = node.pairs.take(j)
    G, H = mixed.right[np.ix_(block.middle, j)], mixed.left[np.ix_(j, block.middle)]
    if max(_condition(G), _condition(H)) > WORST_CONDITION:
        raise np.linalg.LinAlgError("the gauge is singular")
    right = np.linalg.solve(G.T, np.vstack([X, G * lam]).T).T
    left = np.linalg.solve(H, np.hstack([Y.conj().T, lam[:, None] * H]))
    r = len(X)
    return Subspace(X=right[:r], S=right[r:], Y=left[:, :r].conj().T, T=left[:, r:])


def _condition(A: np.ndarray) -> float:
    """Condition number, whatever the lengths of rows and columns."""
    if len(A) == 1:
        return 1.0 if A[0, 0] else np.inf
    A = A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300)
    A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return float(np.linalg.cond(A))
