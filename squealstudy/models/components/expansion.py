"""Displacements of all nodes of a component from its degrees of freedom.

Without ties and couplings these are the same. A slave node of a tie has the displacement of its
point on the master (node to surface, as in CalculiX). Nodes of a rigid coupling move rigidly with
their reference node. The reference node of a distributing coupling follows the nodes' mean motion.
Displacements that follow others are eliminated: u = E q, and K and M become E^T K E and E^T M E.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from squealstudy.kernels.facets import MAX_FACET_NODES, feet
from squealstudy.models.components.constraints import Constraint, Coupling, Relation, Tie
from squealstudy.models.components.coupled_rows import (
    facets_of,
    mean,
    rigid,
    solved,
    turn_of_mean,
)
from squealstudy.models.components.mesh import PassedOver, SolidMesh

TOLERANCE = 0.05  # largest offset of a tied node over the master's mean facet, as in Abaqus
MAX_TIE_OFFSET_OVER_FACET = 1e-6  # offset over a facet that strains nothing in a rigid turn
COARSER = 1.3  # a slave is coarser if there are more master nodes, over tied slave nodes
MAX_FOLLOW_DEPTH = 20  # longest chain of nodes that follow each other


@dataclass(frozen=True, eq=False)
class Expansion:
    """The map u = E q from degrees of freedom q to displacements u of all nodes.

    Attributes
    ----------
    E : csr_matrix (3 n_nodes, n)
        Displacements 3 * node + axis from degrees of freedom.
    places : ndarray (n,) of int
        3 * node + axis of each degree of freedom; -1 for rotations and modal coordinates.
    turns : csr_matrix (3 n_nodes, n)
        Rotations 3 * node + axis from degrees of freedom; rows of nodes without them are empty.
    axes : ndarray (3, 3) or None
        Rotation matrix of the component by which its degrees of freedom are turned from the axes in
        `places`; None where they are not.
    """

    E: sp.csr_matrix
    places: np.ndarray
    turns: sp.csr_matrix = field(default_factory=lambda: sp.csr_matrix((0, 0)))
    axes: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.turns.shape != self.E.shape:
            object.__setattr__(self, "turns", sp.csr_matrix(self.E.shape))

    @property
    def turning(self) -> np.ndarray:
        """Whether each node (n_nodes,) has rotations."""
        return np.asarray((np.diff(self.turns.indptr) > 0).reshape(-1, 3).any(axis=1))

    @property
    def plain(self) -> bool:
        """Whether each degree of freedom moves one node alone, and no node follows others."""
        one_each = bool((self.places >= 0).all()) and self.E.nnz == len(self.places)
        return one_each and self.axes is None

    def turned(self, axes: np.ndarray) -> Expansion:
        """Expansion of the component turned by a matrix (3, 3), with its degrees of freedom."""
        nodes = sp.kron(sp.identity(self.E.shape[0] // 3), axes, format="csr")
        turned = (nodes @ self.E).tocsr(), (nodes @ self.turns).tocsr()
        return replace(self, E=turned[0], turns=turned[1], axes=axes)

    @property
    def lacking(self) -> np.ndarray:
        """Whether each displacement (3 n_nodes,) is moved by no degree of freedom."""
        return np.diff(self.E.indptr) == 0

    def restricted(self, A: sp.csr_matrix) -> sp.csr_matrix:
        """E^T A E of a matrix (3 n_nodes, 3 n_nodes)."""
        return A if self.E.shape[0] == self.E.shape[1] and self.plain else self.E.T @ A @ self.E

    def freedoms(self, displacements: np.ndarray, turned: np.ndarray | None = None) -> np.ndarray:
        """Degrees of freedom (n, k) of displacements (3 n_nodes, k) that they can have.

        And of turns of nodes, where they are given. Those that move no node are zero.
        """
        if self.axes is not None:
            to_local = sp.kron(sp.identity(len(displacements) // 3), self.axes.T, format="csr")
            before = replace(self.turned(self.axes.T), axes=None)
            return before.freedoms(
                to_local @ displacements, None if turned is None else to_local @ turned
            )
        q = np.zeros((self.E.shape[1], displacements.shape[1]))
        of_nodes = self.places >= 0
        q[of_nodes] = displacements[self.places[of_nodes]]
        E, residual = self.E, displacements - self.E @ q
        if turned is not None and self.turns.nnz:
            turning_nodes = np.flatnonzero(np.diff(self.turns.indptr))
            E = sp.vstack([E, self.turns[turning_nodes]], format="csr")
            residual = np.vstack([residual, turned[turning_nodes] - self.turns[turning_nodes] @ q])
        others = np.flatnonzero(~of_nodes & (np.diff(E.tocsc().indptr) > 0))
        if len(others):
            R = E[:, others]
            q[others] = splu((R.T @ R).tocsc()).solve(R.T @ residual)
        return q


def expanded(mesh: SolidMesh) -> tuple[SolidMesh, Expansion]:
    """The mesh with tied nodes moved onto their masters, and its expansion.

    Raises
    ------
    ModelError
        About what cannot be tied or coupled: with its name.
    """
    n = len(mesh.nodes)
    mesh = _adjusted(mesh)
    if not mesh.constraints:  # all nodes are of elements, or have masses
        return mesh, Expansion(sp.identity(3 * n, format="csr"), np.arange(3 * n))
    turning = sorted({c.reference for c in _couplings(mesh) if c.kind == "rigid"})
    n_full = 3 * n + 3 * len(turning)
    owner: dict[int, str] = {}
    entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for name, rows, columns, values in _relations(mesh, {r: i for i, r in enumerate(turning)}):
        for row in np.unique(rows):
            other = owner.setdefault(int(row), name)
            if other != name:
                node = row // 3 if row < 3 * n else turning[(row - 3 * n) // 3]
                raise mesh.error(
                    f"{mesh.nodes_named(np.array([node]))} follows others by {other} and by "
                    f"{name}: expected one of them"
                )
        entries.append((rows, columns, values))
    dependent = np.zeros(n_full, dtype=bool)
    dependent[list(owner)] = True
    free = np.flatnonzero(~dependent)
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    S = sp.csr_matrix(
        (
            np.concatenate([values, np.ones(len(free))]),
            (np.concatenate([rows, free]), np.concatenate([columns, free])),
        ),
        (n_full, n_full),
    )
    E, depth = S, 0
    while abs(E[:, np.flatnonzero(dependent)]).sum() > 0:
        depth += 1
        if depth > MAX_FOLLOW_DEPTH:
            raise mesh.error("ties and couplings follow each other in a circle")
        E = E @ S
    E, turns = E[: 3 * n], E[3 * n :]
    moves = np.diff(E.tocsc().indptr)  # a reference node without structure moves itself alone
    is_single = np.zeros(n_full, dtype=bool)
    bare = mesh.bare
    bare[mesh.mass_nodes] = False
    is_single[: 3 * n] = np.repeat(bare, 3)
    independent = free[moves[free] > is_single[free]]
    E = E[:, independent].tocsr()
    E.eliminate_zeros()
    T = _turns(mesh, turning, turns[:, independent].tocsr(), E)
    return mesh, Expansion(E, np.where(independent < 3 * n, independent, -1), T)


def _turns(
    mesh: SolidMesh, turning: list[int], of_rigid: sp.csr_matrix, E: sp.csr_matrix
) -> sp.csr_matrix:
    """Turns (3 n, ...) of the reference nodes of couplings."""
    turn_rows = (3 * np.array(turning, dtype=np.int64)[:, None] + np.arange(3)).ravel()
    rows = (np.ones(len(turn_rows)), (turn_rows, np.arange(len(turn_rows))))
    T = sp.csr_matrix(rows, (3 * len(mesh.nodes), len(turn_rows))) @ of_rigid
    turned_nodes = {int(node) for d in mesh.discrete if d.turns for node in d.nodes} - set(turning)
    for c in _couplings(mesh):
        if c.kind == "distributing" and c.reference in turned_nodes:
            T = T + turn_of_mean(mesh, c) @ E
    T = T.tocsr()
    T.eliminate_zeros()
    return T


def _couplings(mesh: SolidMesh) -> Iterator[Coupling]:
    return (c for c in mesh.constraints if isinstance(c, Coupling))


def _relations(
    mesh: SolidMesh, turning: dict[int, int]
) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, and rows, columns, values of what follows, of each tie and coupling."""
    n = len(mesh.nodes)
    for c in mesh.constraints:
        if isinstance(c, Tie):
            nodes, values, masters, _ = _feet(mesh, c)
            row, k = np.nonzero(values)
            for axis in range(3):
                rows = 3 * nodes[row] + axis
                yield c.name, rows, 3 * masters[row, k] + axis, values[row, k]
        elif isinstance(c, Relation):
            continue
        elif c.kind == "rigid":
            yield (c.name, *rigid(mesh, c, 3 * n + 3 * turning[c.reference]))
            turn_numbers = np.array(
                [turning[k] for k in c.nodes.tolist() if k in turning and c.turning]
            )
            if len(turn_numbers):  # reference nodes of others turn with this one
                rows = (3 * n + 3 * turn_numbers[:, None] + np.arange(3)).ravel()
                columns = np.tile(
                    3 * n + 3 * turning[c.reference] + np.arange(3), len(turn_numbers)
                )
                yield c.name, rows, columns, np.ones(len(rows))
        else:
            yield (c.name, *mean(mesh, c))
    yield from _equations(mesh)


def _equations(mesh: SolidMesh) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Equations by relations; those of one node stand together, which may turn its directions."""
    relations_of: dict[int, list[Relation]] = {}
    for c in mesh.constraints:
        if isinstance(c, Relation):
            relations_of.setdefault(int(c.nodes[0]), []).append(c)
    for node, relations in relations_of.items():
        A = np.array([c.vectors[0] for c in relations])
        columns = [(3 * c.nodes[1:, None] + np.arange(3)).ravel() for c in relations]
        values = np.zeros((len(relations), sum(map(len, columns))))
        at = 0
        for row, c in enumerate(relations):
            values[row, at : at + len(columns[row])] = c.vectors[1:].ravel()
            at += len(columns[row])
        equations = solved(node, A, np.concatenate(columns), values)
        if equations is None:
            names = " and ".join(c.name for c in relations)
            raise mesh.error(
                f"{mesh.nodes_named(np.array([node]))} is to follow by {names}, which do not say "
                "three displacements or fewer of it: write another of their nodes first"
            )
        yield (relations[0].name, *equations)


# -- ties ----------------------------------------------------------------------------------------
def _adjusted(mesh: SolidMesh) -> SolidMesh:
    """Tied nodes on their masters; those that are too far off are reported, and tied no more."""
    constraints: list[Constraint] = []
    for c in mesh.constraints:
        if not isinstance(c, Tie):
            constraints.append(c)
            continue
        tied, values, masters, off = _feet(mesh, c)
        if not len(tied):
            raise mesh.error(f"{c.name}: no node of its slave lies on its master")
        free = len(c.nodes) - len(tied)
        if free:
            why = f"{free} of {len(c.nodes)} nodes of the slave are not on the master, and free"
            note = PassedOver(c.name, mesh.origin, 0, why)
            mesh = replace(mesh, passed_over=(*mesh.passed_over, note))
        size = 2 * facets_of(mesh, c.faces, c.name).radii.mean()
        if not c.adjusted and off.max() > MAX_TIE_OFFSET_OVER_FACET * size:
            far_nodes = mesh.nodes_named(tied[off > MAX_TIE_OFFSET_OVER_FACET * size])
            raise mesh.error(
                f"{c.name}: {far_nodes} lie off the master and are not to be moved "
                "(ADJUST=NO): turns of the component would strain it"
            )
        nodes = mesh.nodes.copy()
        nodes[tied] = np.einsum("ik,ikj->ij", values, mesh.nodes[masters])
        mesh = replace(mesh, nodes=nodes)
        beneath = len(np.unique(masters))
        constraints.append(
            replace(c, nodes=tied, coarse=beneath > COARSER * len(tied), beside=free)
        )
    return replace(mesh, constraints=tuple(constraints))


def _feet(mesh: SolidMesh, tie: Tie) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Tied nodes (m,), master functions (m, 9) of their nodes (m, 9), distances (m,)."""
    from scipy.spatial import cKDTree

    master = facets_of(mesh, tie.faces, tie.name)
    nodes = np.setdiff1d(tie.nodes, master.table)
    max_distance = tie.tolerance
    if max_distance is None:
        max_distance = TOLERANCE * 2 * float(master.radii.mean())
    reach = max_distance + 1.2 * float(master.radii.max())
    lists = cKDTree(master.centres).query_ball_point(mesh.nodes[nodes], reach)
    start = np.cumsum([0, *map(len, lists)])
    candidates = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.sort, lists)])
    facet = np.zeros(len(nodes), dtype=np.int64)
    distance, values = np.zeros(len(nodes)), np.zeros((len(nodes), MAX_FACET_NODES))
    feet(
        np.ascontiguousarray(mesh.nodes[nodes]),
        start,
        candidates.astype(np.int64),
        master.kinds,
        master.nodes,
        max_distance,
        facet,
        distance,
        values,
    )
    has_facet = facet >= 0
    return nodes[has_facet], values[has_facet], master.table[facet[has_facet]], distance[has_facet]
