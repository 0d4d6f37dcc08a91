"""Springs and masses of a deck that are of no solid: matrices of a few nodes, added to the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.constraints import Kept


@dataclass(frozen=True)
class Discrete:
    """A spring or a mass.

    Attributes
    ----------
    name : str
        For messages.
    nodes : ndarray (k,) of int
        Places of its nodes in the mesh.
    K, M : ndarray (3 k, 3 k)
        Of their displacements, 3 * node + axis.
    """

    name: str
    nodes: np.ndarray
    K: np.ndarray
    M: np.ndarray

    def scaled(self, stiffness: float, mass: float) -> Discrete:
        """The same in other units."""
        return replace(self, K=stiffness * self.K, M=mass * self.M)

    def moved(self, turn: np.ndarray) -> Discrete:
        """The same of a turned mesh."""
        T = np.kron(np.eye(len(self.nodes)), turn)
        return replace(self, K=T @ self.K @ T.T, M=T @ self.M @ T.T)

    def kept(self, kept: Kept) -> Discrete | None:
        """The same in a part of the mesh; None where that has nothing of it."""
        there = kept.nodes[self.nodes]
        if not there.any():
            return None
        if not there.all():
            raise ModelError(
                f"{self.name} joins this part to others: read all of them as one component"
            )
        return replace(self, nodes=kept.node_at[self.nodes])


def point_mass(name: str, node: int, mass: float) -> Discrete:
    """A mass at a node."""
    return Discrete(name, np.array([node]), np.zeros((3, 3)), mass * np.eye(3))


def spring(name: str, ends: Sequence[tuple[int, np.ndarray]], stiffness: float) -> Discrete:
    """A spring of the elongation, the sum of direction . u over its ends, one or two."""
    along = np.concatenate([direction for _, direction in ends])
    K = stiffness * np.outer(along, along)
    return Discrete(name, np.array([node for node, _ in ends]), K, np.zeros_like(K))


def matrices(found: Sequence[Discrete], n: int) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M (3 n, 3 n) of springs and masses."""
    empty = sp.csr_matrix((3 * n, 3 * n))
    if not found:
        return empty, empty
    at = [(3 * d.nodes[:, None] + np.arange(3)).ravel() for d in found]
    rows = np.concatenate([np.repeat(own, len(own)) for own in at])
    columns = np.concatenate([np.tile(own, len(own)) for own in at])
    K, M = (
        sp.csr_matrix(
            (np.concatenate([getattr(d, name).ravel() for d in found]), (rows, columns)),
            shape=empty.shape,
        )
        for name in ("K", "M")
    )
    return K, M
