"""Springs and masses of a deck beside its solids, as matrices of a few nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.constraints import MeshSelection


@dataclass(frozen=True)
class Discrete:
    """A spring or a mass between a few nodes.

    Attributes
    ----------
    name : str
        Name for messages.
    nodes : ndarray (k,) of int
        Places of its nodes in the mesh.
    K, M : ndarray (3 k, 3 k) or (6 k, 6 k)
        Stiffness and mass over the displacements 3 * node + axis; with `turns` over three
        displacements and three rotations of each node.
    turns : bool
        Whether the matrices include rotations.
    """

    name: str
    nodes: np.ndarray
    K: np.ndarray
    M: np.ndarray
    turns: bool = False

    def scaled(self, stiffness: float, mass: float, length: float) -> Discrete:
        """The element in other units, of stiffness between displacements, of mass and of length."""
        D = np.ones(len(self.K))
        if self.turns:
            D = np.tile([1.0] * 3 + [length] * 3, len(self.nodes))
        return replace(
            self, K=stiffness * np.outer(D, D) * self.K, M=mass * np.outer(D, D) * self.M
        )

    def moved(self, turn: np.ndarray) -> Discrete:
        """The element of a turned mesh."""
        T = np.kron(np.eye(len(self.K) // 3), turn)
        return replace(self, K=T @ self.K @ T.T, M=T @ self.M @ T.T)

    def kept(self, selection: MeshSelection) -> Discrete | None:
        """The element in a part of the mesh; None where the part has none of its nodes."""
        is_selected = selection.nodes[self.nodes]
        if not is_selected.any():
            return None
        if not is_selected.all():
            raise ModelError(
                f"{self.name} joins this part to others: read all of them as one component"
            )
        return replace(self, nodes=selection.node_at[self.nodes])


def point_mass(name: str, node: int, mass: float) -> Discrete:
    """A mass at a node."""
    return Discrete(name, np.array([node]), np.zeros((3, 3)), mass * np.eye(3))


def rigid_mass(
    name: str, node: int, mass: float, offset: np.ndarray, inertia: np.ndarray
) -> Discrete:
    """A mass off a node that turns, with its inertia (3, 3) about its own centre.

    Raises
    ------
    ModelError
        An inertia that no mass has.
    """
    if np.linalg.eigvalsh(inertia)[0] < -INERTIA_REL_ROUND_OFF * abs(inertia).max():
        raise ModelError(f"{name}: its moments of inertia are not those of a mass")
    x, y, z = offset
    G = np.hstack([np.eye(3), np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])])  # u at the centre
    M = mass * G.T @ G
    M[3:, 3:] += inertia
    return Discrete(name, np.array([node]), np.zeros((6, 6)), M, turns=True)


def spring(name: str, ends: Sequence[tuple[int, np.ndarray]], stiffness: float) -> Discrete:
    """A spring of the elongation, the sum of direction . u over its ends, one or two.

    Directions have three entries, or six where turns count.
    """
    along = np.concatenate([direction for _, direction in ends])
    K = stiffness * np.outer(along, along)
    turns = len(along) == 6 * len(ends)
    return Discrete(name, np.array([node for node, _ in ends]), K, np.zeros_like(K), turns)


INERTIA_REL_ROUND_OFF = 1e-9  # round-off over the largest moment of inertia


def matrices(parts: Sequence[Discrete], n: int) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M of springs and masses over all displacements and all turns of n nodes.

    Rows 3 * node + axis are displacements, those from 3 n on turns: (6 n, 6 n).
    """
    empty = sp.csr_matrix((6 * n, 6 * n))
    if not parts:
        return empty, empty
    at = []
    for d in parts:
        freedoms = 3 * d.nodes[:, None] + np.arange(3)
        at.append((np.hstack([freedoms, 3 * n + freedoms]) if d.turns else freedoms).ravel())
    rows = np.concatenate([np.repeat(freedoms, len(freedoms)) for freedoms in at])
    columns = np.concatenate([np.tile(freedoms, len(freedoms)) for freedoms in at])
    K, M = (
        sp.csr_matrix(
            (np.concatenate([getattr(d, name).ravel() for d in parts]), (rows, columns)),
            shape=empty.shape,
        )
        for name in ("K", "M")
    )
    return K, M
