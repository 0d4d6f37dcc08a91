"""Displacements of all nodes of a component from its degrees of freedom.

Without ties and couplings these are the same. A slave node of a tie has the displacement of its
place on the master (node to surface, as in CalculiX); nodes of a rigid coupling have that of their
reference node and its turn; the reference node of a distributing one follows the nodes' mean
motion. What follows is eliminated: u = E q, K and M become E^T K E and E^T M E.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from squealstudy.errors import ModelError
from squealstudy.kernels.facets import MOST, feet
from squealstudy.models.components.constraints import Constraint, Coupling, Relation, Tie
from squealstudy.models.components.faces import facet_groups
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.mean_motions import ON_A_LINE, mean_motion, mean_turn
from squealstudy.models.components.mesh import PassedOver, SolidMesh

TOLERANCE = 0.05  # of the master's mean facet: how far a tied node may be off, as in Abaqus
APART = 1e-6  # of a facet: distance that strains nothing in a rigid turn
COARSER = 1.3  # times as many nodes of the master as are tied to it: the slave is the coarser one
DEEPEST = 20  # what follows what follows ...
GAUSS = 3  # points a side of a facet, by whose areas nodes of faces count


@dataclass(frozen=True, eq=False)
class Expansion:
    """u = E q.

    Attributes
    ----------
    E : csr_matrix (3 n_nodes, n)
        Displacements 3 * node + axis from degrees of freedom.
    places : ndarray (n,) of int
        Which 3 * node + axis a degree of freedom is; -1 for turns and modal coordinates.
    turns : csr_matrix (3 n_nodes, n)
        Turns 3 * node + axis from degrees of freedom; rows of nodes that have none are empty.
    """

    E: sp.csr_matrix
    places: np.ndarray
    turns: sp.csr_matrix = field(default_factory=lambda: sp.csr_matrix((0, 0)))

    def __post_init__(self) -> None:
        if self.turns.shape != self.E.shape:
            object.__setattr__(self, "turns", sp.csr_matrix(self.E.shape))

    @property
    def turning(self) -> np.ndarray:
        """Nodes (n_nodes,) of bool that have turns."""
        return np.asarray((np.diff(self.turns.indptr) > 0).reshape(-1, 3).any(axis=1))

    @property
    def plain(self) -> bool:
        """Whether each degree of freedom moves one node alone, and no node follows others."""
        return bool((self.places >= 0).all()) and self.E.nnz == len(self.places)

    @property
    def lacking(self) -> np.ndarray:
        """Displacements (3 n_nodes,) of bool that no degree of freedom moves."""
        return np.diff(self.E.indptr) == 0

    def restricted(self, A: sp.csr_matrix) -> sp.csr_matrix:
        """E^T A E of a matrix (3 n_nodes, 3 n_nodes)."""
        return A if self.E.shape[0] == self.E.shape[1] and self.plain else self.E.T @ A @ self.E

    def freedoms(self, moved: np.ndarray, turned: np.ndarray | None = None) -> np.ndarray:
        """Degrees of freedom (n, k) of displacements (3 n_nodes, k) that they can have.

        And of turns of nodes, where they are given. Those that move no node are zero.
        """
        q = np.zeros((self.E.shape[1], moved.shape[1]))
        of_nodes = self.places >= 0
        q[of_nodes] = moved[self.places[of_nodes]]
        E, left = self.E, moved - self.E @ q
        if turned is not None and self.turns.nnz:
            there = np.flatnonzero(np.diff(self.turns.indptr))
            E = sp.vstack([E, self.turns[there]], format="csr")
            left = np.vstack([left, turned[there] - self.turns[there] @ q])
        rest = np.flatnonzero(~of_nodes & (np.diff(E.tocsc().indptr) > 0))
        if len(rest):
            R = E[:, rest]
            q[rest] = splu((R.T @ R).tocsc()).solve(R.T @ left)
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
    whole = 3 * n + 3 * len(turning)
    owner: dict[int, str] = {}
    entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for name, rows, columns, values in _relations(mesh, {r: i for i, r in enumerate(turning)}):
        for row in np.unique(rows):
            other = owner.setdefault(int(row), name)
            if other != name:
                place = row // 3 if row < 3 * n else turning[(row - 3 * n) // 3]
                raise mesh.error(
                    f"{mesh.nodes_named(np.array([place]))} follows others by {other} and by "
                    f"{name}: expected one of them"
                )
        entries.append((rows, columns, values))
    dependent = np.zeros(whole, dtype=bool)
    dependent[list(owner)] = True
    free = np.flatnonzero(~dependent)
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    S = sp.csr_matrix(
        (
            np.concatenate([values, np.ones(len(free))]),
            (np.concatenate([rows, free]), np.concatenate([columns, free])),
        ),
        (whole, whole),
    )
    E, depth = S, 0
    while abs(E[:, np.flatnonzero(dependent)]).sum() > 0:
        depth += 1
        if depth > DEEPEST:
            raise mesh.error("ties and couplings follow each other in a circle")
        E = E @ S
    E, turns = E[: 3 * n], E[3 * n :]
    moves = np.diff(E.tocsc().indptr)  # a reference node without structure moves itself alone
    alone = np.zeros(whole, dtype=bool)
    bare = mesh.bare
    bare[mesh.weighed] = False
    alone[: 3 * n] = np.repeat(bare, 3)
    kept = free[moves[free] > alone[free]]
    E = E[:, kept].tocsr()
    E.eliminate_zeros()
    T = _turns(mesh, turning, turns[:, kept].tocsr(), E)
    return mesh, Expansion(E, np.where(kept < 3 * n, kept, -1), T)


def _turns(
    mesh: SolidMesh, turning: list[int], of_rigid: sp.csr_matrix, E: sp.csr_matrix
) -> sp.csr_matrix:
    """Turns (3 n, ...) of the reference nodes of couplings."""
    at = (3 * np.array(turning, dtype=np.int64)[:, None] + np.arange(3)).ravel()
    rows = (np.ones(len(at)), (at, np.arange(len(at))))
    T = sp.csr_matrix(rows, (3 * len(mesh.nodes), len(at))) @ of_rigid
    wanted = {int(node) for d in mesh.discrete if d.turns for node in d.nodes} - set(turning)
    for c in _couplings(mesh):
        if c.kind == "distributing" and c.reference in wanted:
            T = T + _mean_turn(mesh, c) @ E
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
            yield (c.name, *_rigid(mesh, c, 3 * n + 3 * turning[c.reference]))
            own = np.array([turning[k] for k in c.nodes.tolist() if k in turning and c.turning])
            if len(own):  # reference nodes of others turn with this one
                rows = (3 * n + 3 * own[:, None] + np.arange(3)).ravel()
                columns = np.tile(3 * n + 3 * turning[c.reference] + np.arange(3), len(own))
                yield c.name, rows, columns, np.ones(len(rows))
        else:
            yield (c.name, *_mean(mesh, c))
    yield from _equations(mesh)


def _equations(mesh: SolidMesh) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """What follows by relations: those of one node together, which may turn its directions."""
    of: dict[int, list[Relation]] = {}
    for c in mesh.constraints:
        if isinstance(c, Relation):
            of.setdefault(int(c.nodes[0]), []).append(c)
    for node, own in of.items():
        A = np.array([c.vectors[0] for c in own])
        chosen = _pivots(A)
        if chosen is None:
            names = " and ".join(c.name for c in own)
            raise mesh.error(
                f"{mesh.nodes_named(np.array([node]))} is to follow by {names}, which do not say "
                "three displacements or fewer of it: write another of their nodes first"
            )
        others = np.setdiff1d(np.arange(3), chosen)
        columns = [3 * np.full(len(others), node) + others]
        columns += [(3 * c.nodes[1:, None] + np.arange(3)).ravel() for c in own]
        values = np.zeros((len(own), sum(map(len, columns))))
        values[:, : len(others)] = A[:, others]
        at = len(others)
        for row, c in enumerate(own):
            values[row, at : at + 3 * (len(c.nodes) - 1)] = c.vectors[1:].ravel()
            at += 3 * (len(c.nodes) - 1)
        follows = -np.linalg.solve(A[:, chosen], values)
        column = np.concatenate(columns)
        at_row, k = np.nonzero(follows)
        none = np.zeros(len(own))  # of one that follows nothing: it does not move
        rows = np.append(3 * node + chosen[at_row], 3 * node + chosen)
        columns_of = np.append(column[k], 3 * node + chosen)
        yield own[0].name, rows, columns_of, np.append(follows[at_row, k], none)


def _pivots(A: np.ndarray) -> np.ndarray | None:
    """Columns by which rows (m, 3) can be solved, the largest first; None where there are none."""
    if len(A) > 3:
        return None
    left, found = A.astype(float).copy(), []
    for row in range(len(A)):
        k = int(np.abs(left[row]).argmax())
        if not abs(left[row, k]) > ON_A_LINE * np.abs(A[row]).max():
            return None
        found.append(k)
        left -= np.outer(left[:, k] / left[row, k], left[row]) * (np.arange(len(A)) > row)[:, None]
    return np.array(found)


# -- couplings -----------------------------------------------------------------------------------
def _rigid(mesh: SolidMesh, c: Coupling, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """U = u_reference + turn x (x - x_reference) in the directions of the coupling."""
    arm = mesh.nodes[c.nodes] - mesh.nodes[c.reference]
    if _on_a_line(arm):
        raise mesh.error(
            f"{c.name}: its nodes lie on a line with the reference node, about which it could turn "
            "freely: expected nodes of a face"
        )
    rows, columns, values = [], [], []
    for direction in c.directions:
        axis = direction - 1
        own = 3 * c.nodes + axis
        for column, value in (
            (3 * c.reference + axis, np.ones(len(own))),
            (turns + (axis + 1) % 3, arm[:, (axis + 2) % 3]),
            (turns + (axis + 2) % 3, -arm[:, (axis + 1) % 3]),
        ):
            rows.append(own)
            columns.append(np.full(len(own), column))
            values.append(value)
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def _on_a_line(arm: np.ndarray) -> bool:
    moments = np.linalg.eigvalsh(np.sum(arm**2) * np.eye(3) - arm.T @ arm)
    return not moments[0] > ON_A_LINE * moments[-1]


def _mean(mesh: SolidMesh, c: Coupling) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The reference node by the mean motion of the nodes."""
    points, weight, shape = _weighted(mesh, c)
    try:
        follows = mean_motion(points, weight, mesh.nodes[c.reference])
    except ModelError as error:
        raise mesh.error(f"{c.name}: {error}") from error
    rows, columns, values = [], [], []
    follows[[axis for axis in range(3) if axis + 1 not in c.directions]] = 0.0
    for axis in range(3):
        A = sp.coo_matrix(sp.csr_matrix(follows[:, :, axis]) @ shape)
        rows.append(3 * c.reference + A.row)
        columns.append(3 * A.col + axis)
        values.append(A.data)
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def _mean_turn(mesh: SolidMesh, c: Coupling) -> sp.csr_matrix:
    """Turn of the reference node (3 n, 3 n), in its rows, by the displacements of the nodes."""
    points, weight, shape = _weighted(mesh, c)
    n = len(mesh.nodes)
    total = sp.csr_matrix((3 * n, 3 * n))
    there = sp.csr_matrix((np.ones(3), (3 * c.reference + np.arange(3), np.arange(3))), (3 * n, 3))
    follows = mean_turn(points, weight)
    for axis in range(3):
        A = sp.coo_matrix(sp.csr_matrix(follows[:, :, axis]) @ shape)
        own = sp.csr_matrix((A.data, (A.row, 3 * A.col + axis)), (3, 3 * n))
        total = total + there @ own
    return total


def _weighted(mesh: SolidMesh, c: Coupling) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Points of a distributing coupling, their weights, their displacements by the nodes'."""
    if len(c.faces):
        surface, _ = facets_of(mesh, c.faces, c.name).gauss_points(GAUSS)
        return surface.points, surface.area, surface.shape
    weight = np.ones(len(c.nodes))
    at = (np.arange(len(c.nodes)), c.nodes)
    shape = sp.csr_matrix((weight, at), (len(c.nodes), len(mesh.nodes)))
    return mesh.nodes[c.nodes], weight, shape


# -- ties ----------------------------------------------------------------------------------------
def facets_of(mesh: SolidMesh, faces: np.ndarray, name: str) -> Facets:
    """Facets of faces (p, 2)."""
    return Facets(mesh.nodes, tuple(g.nodes for g in facet_groups(mesh, faces)), name)


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
        if not c.adjusted and off.max() > APART * size:
            raise mesh.error(
                f"{c.name}: {mesh.nodes_named(tied[off > APART * size])} lie off the master and "
                "are not to be moved (ADJUST=NO): turns of the component would strain it"
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
    far = tie.tolerance
    if far is None:
        far = TOLERANCE * 2 * float(master.radii.mean())
    reach = far + 1.2 * float(master.radii.max())
    lists = cKDTree(master.centres).query_ball_point(mesh.nodes[nodes], reach)
    start = np.cumsum([0, *map(len, lists)])
    candidates = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.sort, lists)])
    facet = np.zeros(len(nodes), dtype=np.int64)
    distance, values = np.zeros(len(nodes)), np.zeros((len(nodes), MOST))
    feet(
        np.ascontiguousarray(mesh.nodes[nodes]),
        start,
        candidates.astype(np.int64),
        master.kinds,
        master.nodes,
        far,
        facet,
        distance,
        values,
    )
    found = facet >= 0
    return nodes[found], values[found], master.table[facet[found]], distance[found]
