"""Checks for faults of a mesh that would otherwise give wrong matrices without an error."""

from __future__ import annotations

import numpy as np

from squealstudy.models.components.faces import boundary, shared_too_often
from squealstudy.models.components.formulations import integration
from squealstudy.models.components.jacobians import CHUNK, jacobians
from squealstudy.models.components.mesh import CONTACT_NOT_READ, SolidMesh

DOUBLED = "DOUBLED NODES"  # the name by which `pass_over` allows them
MERGED = 1e-4  # nodes closer than this, over the shortest edge, are one node written twice


def check_mesh(mesh: SolidMesh, doubled: bool = False, points: bool = False) -> None:
    """Raise ModelError about the first fault of a mesh.

    Parameters
    ----------
    mesh : SolidMesh
    doubled : bool
        Allow doubled nodes on the boundary.
    points : bool
        Allow nodes that belong to no element.

    Raises
    ------
    ModelError
        A coordinate is no finite number; an element names a node twice; a face belongs to more
        than two elements, as with doubled elements; a Jacobian is negative; a node belongs to no
        element; nodes on the boundary are doubled, so that elements touch and are not connected.
        Two bodies of a deck with contact may touch.
    """
    check_places(mesh)
    for block, start in zip(mesh.blocks, mesh.starts, strict=False):
        in_order = np.sort(block.nodes, axis=1)
        twice = np.flatnonzero((np.diff(in_order, axis=1) == 0).any(axis=1))
        if len(twice):
            raise mesh.error(
                f"{mesh.elements_named(start + twice)}: a node is named twice; write a collapsed "
                "element as the wedge or tetrahedron that it is"
            )
    if len(often := shared_too_often(mesh)):
        raise mesh.error(
            f"{mesh.elements_named(often)}: a face belongs to more than two elements; is one of "
            "them there twice?"
        )
    _check_jacobians(mesh)
    unused = np.ones(len(mesh.nodes), dtype=bool)
    for block in mesh.blocks:
        unused[block.nodes] = False
    unused[mesh.used_without_element] = False
    if unused.any() and not points:
        raise mesh.error(f"{mesh.nodes_named(np.flatnonzero(unused))}: no element has this node")
    if not doubled and mesh.blocks:
        _check_doubled(mesh)


def check_places(mesh: SolidMesh) -> None:
    """Raise ModelError about nodes whose coordinates are not finite."""
    wrong = ~np.isfinite(mesh.nodes).all(axis=1)
    if wrong.any():
        named = mesh.nodes_named(np.flatnonzero(wrong))
        raise mesh.error(f"{named}: coordinates that are no finite numbers")


def _check_jacobians(mesh: SolidMesh) -> None:
    for block, start in zip(mesh.blocks, mesh.starts, strict=False):
        for rule in sorted({block.kind.stiffness, block.kind.mass}):
            _, dN = block.kind.shape.functions(integration(rule).points)
            for first_element in range(0, len(block.labels), CHUNK):
                rows = np.arange(first_element, min(first_element + CHUNK, len(block.labels)))
                jacobians(mesh, int(start), rows, mesh.nodes[block.nodes[rows]], dN)


def _check_doubled(mesh: SolidMesh) -> None:
    from scipy.spatial import cKDTree  # heavy: only what reads meshes needs it

    faces = boundary(mesh)
    outer, shortest = [], np.inf
    for block, start, end in zip(mesh.blocks, mesh.starts, mesh.starts[1:], strict=False):
        shape = block.kind.shape
        for a, b in shape.edges:
            edge = mesh.nodes[block.nodes[:, a]] - mesh.nodes[block.nodes[:, b]]
            shortest = min(shortest, float(np.linalg.norm(edge, axis=1).min()))
        block_faces = faces[(faces[:, 0] >= start) & (faces[:, 0] < end)]
        for k, face in enumerate(shape.faces):
            rows = block_faces[block_faces[:, 1] == k + 1, 0] - start
            nodes = block.nodes[rows][:, list(face)]
            owner = np.repeat(rows + start, len(face))
            outer.append(np.column_stack([nodes.ravel(), owner]))
    outer_faces = np.vstack(outer)
    outer_faces = outer_faces[~np.isin(outer_faces[:, 0], mesh.may_coincide)]
    nodes, first = np.unique(outer_faces[:, 0], return_index=True)
    pairs = cKDTree(mesh.nodes[nodes]).query_pairs(MERGED * shortest, output_type="ndarray")
    if len(pairs):
        owners = mesh.body_of[outer_faces[first, 1]]
        of_two_bodies = owners[pairs[:, 0]] != owners[pairs[:, 1]]
        if of_two_bodies.all() and any(note.why == CONTACT_NOT_READ for note in mesh.passed_over):
            return  # bodies in contact
        pairs = pairs[np.argsort(of_two_bodies, kind="stable")]
        a, b = nodes[pairs[0]]
        elements = outer_faces[first[pairs[0]], 1]
        raise mesh.error(
            f"nodes {mesh.numbers[a]} and {mesh.numbers[b]} lie at one place"
            f"{f', as do {len(pairs) - 1} other pairs' if len(pairs) > 1 else ''}: "
            f"{mesh.elements_named(elements)} are not connected there; merge the nodes"
            + (
                ", or read each of two bodies by itself, part = 'BODY1'"
                if of_two_bodies.all()
                else ""
            )
            + f'; where they are meant to be apart: pass_over = ["{DOUBLED}"]'
        )
