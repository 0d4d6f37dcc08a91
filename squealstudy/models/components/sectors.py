"""Makes a whole body from one sector that repeats about an axis, such as of a vented disc.

Nodes of neighbouring sectors at the same place become one node. Where the two sides of a sector are
meshed differently, slave nodes of a cyclic tie follow master faces of the next sector.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.models.components.constraints import Constraint, Coupling, Relation, Tie
from squealstudy.models.components.discrete import Discrete
from squealstudy.models.components.faces import boundary, facet_groups
from squealstudy.models.components.materials import Orientation, Orthotropic
from squealstudy.models.components.mesh import ElementBlock, PassedOver, SolidMesh

MAX_SECTORS = 1000  # sectors of a body
# largest distance of nodes that become one, over the shortest edge: files give some six digits
MERGE_DISTANCE_OVER_EDGE = 1e-3
SIDES_APART = "its sides do not meet; expected axis, point and count of its repetition"
OPPOSITE = -0.99  # largest cosine between normals of facets that face each other
OVERLAP_DISTANCE_OVER_FACET = 0.6  # largest distance of the middles of facets that overlap
TOUCHING_DISTANCE_OVER_FACET = 0.02  # largest distance across facets that lie on each other


@dataclass(frozen=True)
class Repetition:
    """How a sector repeats.

    Attributes
    ----------
    point, axis : ndarray (3,)
        A point and the direction of the axis.
    count : int
        Sectors of the whole body.
    """

    point: np.ndarray
    axis: np.ndarray
    count: int

    def turn(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Rotation matrix and shift from sector 0 to sector k: x moves to turn x + shift."""
        from scipy.spatial.transform import Rotation  # heavy: only sectors need it

        along = self.axis / np.linalg.norm(self.axis)
        R: np.ndarray = Rotation.from_rotvec(2 * np.pi * k / self.count * along).as_matrix()
        return R, self.point - R @ self.point


def repeated(mesh: SolidMesh, repetition: Repetition) -> SolidMesh:
    """The mesh of the whole body whose sector is given.

    A set or surface of the whole body is that of all sectors together, without faces between
    sectors. Cyclic ties hold sides together that are meshed differently.

    Raises
    ------
    ModelError
        The sides do not meet, or are meshed differently without a cyclic tie. Masses or springs lie
        on a side.
    """
    turns = [repetition.turn(k) for k in range(repetition.count)]
    nodes_of_copies = np.vstack([mesh.nodes @ R.T + shift for R, shift in turns])
    node_at = _merged_nodes(mesh, nodes_of_copies, repetition.count)
    copies = _Copies(mesh, turns, node_at)
    full_mesh = copies.mesh(nodes_of_copies)
    cyclic = [c for c in mesh.constraints if isinstance(c, Tie) and c.cyclic]
    ties = [tie for c in cyclic for tie in copies.cyclic(c)]
    if not cyclic:
        _check_sides(mesh, full_mesh, repetition)
    joined = len(nodes_of_copies) - len(full_mesh.nodes)
    why = f"one of {repetition.count}: the whole body is made of it, "
    why += f"{joined} nodes on sides are merged"
    note = PassedOver("sector", mesh.origin, 0, why)
    return replace(
        full_mesh,
        constraints=(*full_mesh.constraints, *ties),
        passed_over=(*full_mesh.passed_over, note),
    )


def _merged_nodes(mesh: SolidMesh, nodes_of_copies: np.ndarray, count: int) -> np.ndarray:
    """Indices (count, n) in the whole body of the nodes of all sectors.

    ModelError where no node of the sector meets the next one, and there is no cyclic tie.
    """
    from scipy.sparse.csgraph import connected_components

    n, total = len(mesh.nodes), len(nodes_of_copies)
    tolerance = MERGE_DISTANCE_OVER_EDGE * _shortest_edge(mesh)
    # nodes that meet between the first two sectors meet between all; pairs of nodes of one body
    # come first, as nodes of two bodies in contact may be at the same place
    body = _bodies(mesh)[:, None] * 10 * np.ptp(nodes_of_copies, axis=0).max()
    a, b = _pairs(
        np.hstack([nodes_of_copies[:n], body]),
        np.hstack([nodes_of_copies[n : 2 * n], body]),
        tolerance,
    )
    rest_a, rest_b = np.setdiff1d(np.arange(n), a), np.setdiff1d(np.arange(n), b)
    if len(rest_a) and len(rest_b):
        more = _pairs(nodes_of_copies[rest_a], nodes_of_copies[n + rest_b], tolerance)
        a, b = np.append(a, rest_a[more[0]]), np.append(b, rest_b[more[1]])
    cyclic = any(isinstance(c, Tie) and c.cyclic for c in mesh.constraints)
    if not len(a) and not cyclic:
        raise mesh.error(
            f"a turn by 360/{count} degrees brings no node of the sector onto another one: "
            f"{SIDES_APART}"
        )
    k = np.arange(count)[:, None]
    nodes, next_nodes = (k * n + a).ravel(), ((k + 1) % count * n + b).ravel()
    graph = sp.coo_matrix((np.ones(len(nodes)), (nodes, next_nodes)), (total, total))
    _, label = connected_components(graph, directed=False)
    _, first, merged_index = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))  # in the order in which nodes first occur
    return rank[merged_index].reshape(count, n)


def _pairs(
    points: np.ndarray, other_points: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of two lists of points where a point of one is at the place of a point of the other."""
    from scipy.spatial import cKDTree  # heavy: only what reads meshes needs it

    distance, partner = cKDTree(other_points).query(points, distance_upper_bound=tolerance)
    rows = np.flatnonzero(np.isfinite(distance))
    return rows, partner[rows]


def _bodies(mesh: SolidMesh) -> np.ndarray:
    """Number of the body of each node (n,); only elements connect nodes."""
    from scipy.sparse.csgraph import connected_components

    ends = [b.nodes[:, [0, k]] for b in mesh.blocks for k in range(1, b.nodes.shape[1])]
    nodes, neighbours = np.vstack(ends).T
    n = len(mesh.nodes)
    graph = sp.coo_matrix((np.ones(len(nodes)), (nodes, neighbours)), (n, n))
    body_of: np.ndarray = connected_components(graph, directed=False)[1]
    return body_of


def _shortest_edge(mesh: SolidMesh) -> float:
    """Length of the shortest edge of an element, m."""
    shortest = np.inf
    for block in mesh.blocks:
        for a, b in block.kind.shape.edges:
            edge = mesh.nodes[block.nodes[:, a]] - mesh.nodes[block.nodes[:, b]]
            shortest = min(shortest, float(np.linalg.norm(edge, axis=1).min()))
    return shortest


class _Copies:
    """Copies of a sector's parts in all sectors."""

    def __init__(
        self, mesh: SolidMesh, turns: list[tuple[np.ndarray, np.ndarray]], node_at: np.ndarray
    ) -> None:
        self._sector, self._turns, self._node_at = mesh, turns, node_at
        self._count = len(turns)
        counts = np.diff(mesh.starts)
        new_starts = self._count * mesh.starts
        block_of = np.repeat(np.arange(len(counts)), counts)
        first = new_starts[block_of] + np.arange(mesh.n_elements) - mesh.starts[block_of]
        self._element_at = first + np.arange(self._count)[:, None] * counts[block_of]  # (count, e)

    def mesh(self, nodes_of_copies: np.ndarray) -> SolidMesh:
        """The whole body, without cyclic ties."""
        m, count, flat = self._sector, self._count, self._node_at.ravel()
        size = flat.max() + 1
        first = np.full(size, -1)
        first[flat[::-1]] = np.arange(len(flat))[::-1]
        k, node = np.divmod(first, len(m.nodes))
        numbers = m.numbers[node] + k * _number_step(m.numbers)
        blocks = tuple(
            ElementBlock(
                b.formulation,
                self._node_at[:, b.nodes].reshape(-1, b.nodes.shape[1]),
                (b.labels + np.arange(count)[:, None] * _number_step(m.labels)).ravel(),
            )
            for b in m.blocks
        )
        order = np.argsort(numbers, kind="stable")
        orientations, orientation = self._orientations()
        positions = np.argsort(order)  # numbers are ascending, as in meshes of files
        self._node_at = positions[self._node_at]
        full_mesh = replace(
            m,
            nodes=nodes_of_copies[first][order],
            numbers=numbers[order],
            blocks=tuple(replace(b, nodes=positions[b.nodes]) for b in blocks),
            node_sets={s: np.unique(self._node_at[:, v]) for s, v in m.node_sets.items()},
            element_sets={s: np.unique(self._element_at[:, v]) for s, v in m.element_sets.items()},
            surfaces={},
            material=self._of_elements(m.material),
            added_density=self._of_elements(m.added_density).astype(float),
            constraints=tuple(c for k in range(count) for c in self._constraints(k)),
            discrete=tuple(d for k in range(count) for d in self._discrete(k)),
            orientations=orientations,
            orientation=orientation,
        )
        return replace(full_mesh, surfaces=self._surfaces(full_mesh))

    def _of_elements(self, values: np.ndarray) -> np.ndarray:
        """Values of the elements of the whole body, from those of the sector."""
        repeated = np.empty(values.size * self._count, dtype=object)
        repeated[self._element_at] = values
        return repeated

    def _orientations(self) -> tuple[dict[str, Orientation], np.ndarray]:
        """Material axes by name, turned with each sector, and the name for each element.

        A material with directions may have global axes: they turn with the sectors, too.
        """
        m = self._sector
        names = m.orientation.astype(object)
        axes_by_name: dict[str, Orientation] = dict(m.orientations)
        directional = [name for name, e in m.materials.items() if isinstance(e, Orthotropic)]
        directional += list(m.unfinished)
        has_global_axes = (names == "") & np.isin(m.material, directional)
        if has_global_axes.any():
            axes_by_name["SECTOR"] = Orientation("rectangular", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
            names = np.where(has_global_axes, "SECTOR", names)
        turned_axes: dict[str, Orientation] = {}
        orientation_of = np.empty(names.size * self._count, dtype=object)
        for k, (R, shift) in enumerate(self._turns):
            orientation_of[self._element_at[k]] = [
                f"{name}@{k + 1}" if name else "" for name in names
            ]
            turned_axes |= {
                f"{name}@{k + 1}": o.moved(R, shift) for name, o in axes_by_name.items()
            }
        return turned_axes, orientation_of

    def _faces(self, faces: np.ndarray, k: int) -> np.ndarray:
        """Faces (element, side) of sector k, from those of the first sector."""
        return np.column_stack([self._element_at[k][faces[:, 0]], faces[:, 1]])

    def _surfaces(self, full_mesh: SolidMesh) -> dict[str, np.ndarray]:
        """Surfaces of all sectors, without faces that now lie between sectors."""
        sector_faces, full_faces = (
            {tuple(f) for f in boundary(mesh).tolist()} for mesh in (self._sector, full_mesh)
        )
        surfaces = {}
        for name, faces in self._sector.surfaces.items():
            copies = [self._faces(faces, k) for k in range(self._count)]
            was_outer = np.array([tuple(f) in sector_faces for f in faces.tolist()] * self._count)
            is_outer = np.array([tuple(f) in full_faces for f in np.vstack(copies).tolist()])
            outer_faces = np.vstack(copies)[is_outer | ~was_outer]
            if len(outer_faces):
                surfaces[name] = np.unique(outer_faces, axis=0)
        return surfaces

    def _constraints(self, k: int) -> Iterator[Constraint]:
        """Constraints of sector k but cyclic ties."""
        new_index = self._node_at[k]
        for c in self._sector.constraints:
            if isinstance(c, Tie):
                if not c.cyclic:
                    yield replace(c, nodes=new_index[c.nodes], faces=self._faces(c.faces, k))
            elif isinstance(c, Relation):
                yield replace(c.moved(*self._turns[k]), nodes=new_index[c.nodes])
            else:
                yield self._coupling(c, k)

    def _coupling(self, c: Coupling, k: int) -> Coupling:
        """A coupling of sector k."""
        new_index, c = self._node_at[k], c.moved(*self._turns[k])
        return replace(
            c,
            reference=int(new_index[c.reference]),
            nodes=new_index[c.nodes],
            faces=self._faces(c.faces, k),
        )

    def _discrete(self, k: int) -> Iterator[Discrete]:
        """Masses and springs of sector k; ModelError for one on a side."""
        new_index = self._node_at
        for d in self._sector.discrete:
            if (np.bincount(new_index.ravel())[new_index[0][d.nodes]] > 1).any():
                raise self._sector.error(
                    f"{d.name} is on a side of the sector, where two sectors have it"
                )
            yield replace(d.moved(self._turns[k][0]), nodes=new_index[k][d.nodes])

    def cyclic(self, tie: Tie) -> Iterator[Tie]:
        """A cyclic tie in all sectors, for slave nodes that are not merged with the next sector."""
        m = self._sector
        times = np.bincount(self._node_at.ravel())
        slaves = tie.nodes[times[self._node_at[0][tie.nodes]] == 1]
        if not len(slaves):
            return
        if not len(tie.faces):
            raise m.error(
                f"{tie.name}: {m.nodes_named(slaves)} of the slave lie on no node of the master, "
                "which has no faces: expected a surface of elements"
            )
        masters = np.unique(np.concatenate([g.nodes.ravel() for g in facet_groups(m, tie.faces)]))
        gaps = {}
        for step in (1, -1):
            R, shift = self._turns[step % self._count]
            turned_masters = m.nodes[masters] @ R.T + shift
            distances = np.linalg.norm(m.nodes[slaves][:, None] - turned_masters[None], axis=2)
            gaps[step] = float(distances.min(axis=1).sum())
        step = min(gaps, key=lambda s: gaps[s])
        for k in range(self._count):
            faces = self._faces(tie.faces, (k + step) % self._count)
            yield replace(tie, nodes=self._node_at[k][slaves], faces=faces, cyclic=False)


def _number_step(numbers: np.ndarray) -> int:
    """What is added to node or element numbers from sector to sector: a power of ten."""
    return 10 ** len(str(int(numbers.max())))


def _check_sides(mesh: SolidMesh, full_mesh: SolidMesh, repetition: Repetition) -> None:
    """Raise ModelError where sectors do not meet, or facets of sides are not connected."""
    from scipy.spatial import cKDTree

    outer = {tuple(f) for f in boundary(full_mesh).tolist()}
    n_elements = mesh.n_elements
    # numbers of the first sector's elements in the whole body, where they come first in each block
    starts, size = full_mesh.starts[:-1], np.diff(mesh.starts)
    first = np.concatenate([s + np.arange(n) for s, n in zip(starts, size, strict=True)])
    element = dict(zip(range(n_elements), first.tolist(), strict=True))
    free_faces = np.array([f for f in boundary(mesh).tolist() if (element[f[0]], f[1]) in outer])
    if not len(free_faces):
        return
    middles, normals, sizes = [], [], []
    for group in facet_groups(mesh, free_faces.reshape(-1, 2)):
        corners = 4 if group.nodes.shape[1] in (4, 8) else 3
        x = mesh.nodes[group.nodes[:, :corners]]
        across = np.cross(x[:, 1] - x[:, 0], x[:, -1] - x[:, 0])
        area = np.linalg.norm(across, axis=1)
        middles.append(x.mean(axis=1))
        normals.append(across / area[:, None])
        sizes.append(np.sqrt(area))
    c, n, h = np.vstack(middles), np.vstack(normals), np.concatenate(sizes)
    R, shift = repetition.turn(1)
    turned, across = c @ R.T + shift, n @ R.T
    tree = cKDTree(turned)
    facing = 0
    for i, nearby in enumerate(tree.query_ball_point(c, OVERLAP_DISTANCE_OVER_FACET * h)):
        j = np.array(nearby, dtype=int)
        opposite = across[j] @ n[i] < OPPOSITE
        facing += bool(
            (
                opposite & (abs((turned[j] - c[i]) @ n[i]) < TOUCHING_DISTANCE_OVER_FACET * h[i])
            ).any()
        )
    if facing:
        raise mesh.error(
            f"{facing} facets of a side of the sector lie on those of the next sector, but have "
            "other nodes: mesh both sides alike"
        )
    if len(free_faces) == len(boundary(mesh)):  # only nodes on the axis coincide
        raise mesh.error(
            f"a turn by 360/{repetition.count} degrees brings no facet of the sector onto another: "
            f"{SIDES_APART}"
        )
