"""Faces of elements: the boundary of a mesh, and the facets of surfaces and node sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.set_names import has_name


@dataclass(frozen=True)
class FacetGroup:
    """Facets with the same number of nodes.

    Attributes
    ----------
    nodes : ndarray (p, k) of int
        Places of their nodes in `SolidMesh.nodes`, k = 3, 4, 6 or 8: corners counterclockwise as
        seen from outside, then the middle nodes of the sides corner 1 to 2, ..., last to 1.
    faces : ndarray (p, 2) of int
        Element (its place in the mesh) and number of its face from 1.
    """

    nodes: np.ndarray
    faces: np.ndarray


def facets(mesh: SolidMesh, name: str) -> tuple[FacetGroup, ...]:
    """The facets of a surface, or those of the boundary with all nodes in a node set.

    Where a surface and a node set have the same name, it is the surface. Outward normals follow
    from the order of the corners, as long as no element has a negative Jacobian (`check_mesh`).

    Returns
    -------
    tuple of FacetGroup
        One for each number of nodes, ascending.

    Raises
    ------
    ModelError
        Neither a surface nor a node set has the name; nodes of the set belong to no such facet;
        faces of the surface lie inside the body.
    """
    outer = boundary(mesh)
    if has_name(mesh.surfaces, name):
        faces = mesh.find("surfaces", name)
        inside = faces[~_among(faces, outer)]
        if len(inside):
            named = mesh.elements_named(inside[:, 0])
            raise mesh.error(
                f"surface '{name}': {len(inside)} of its {len(faces)} faces lie between elements, "
                f"not on the boundary, such as of {named}"
            )
        return facet_groups(mesh, faces)
    chosen = np.zeros(len(mesh.nodes), dtype=bool)
    members = mesh.node_set(name)
    chosen[members] = True
    groups = [(g, chosen[g.nodes].all(axis=1)) for g in facet_groups(mesh, outer)]
    chosen_groups = tuple(FacetGroup(g.nodes[k], g.faces[k]) for g, k in groups if k.any())
    if not chosen_groups:
        raise mesh.error(f"no facet of the boundary has all its nodes in the node set '{name}'")
    spare = np.setdiff1d(members, np.concatenate([g.nodes.ravel() for g in chosen_groups]))
    if len(spare):
        are = "are" if len(spare) > 1 else "is"
        raise mesh.error(
            f"node set '{name}' is no face: of its {len(members)} nodes {mesh.nodes_named(spare)} "
            f"{are} in no facet of the boundary that has all its nodes in the set"
        )
    return chosen_groups


def faces_among(mesh: SolidMesh, nodes: np.ndarray) -> np.ndarray:
    """Faces (p, 2) of the boundary with all their nodes among those of these indices."""
    chosen = np.zeros(len(mesh.nodes), dtype=bool)
    chosen[nodes] = True
    groups = facet_groups(mesh, boundary(mesh))
    faces = [g.faces[chosen[g.nodes].all(axis=1)] for g in groups]
    return np.vstack([np.zeros((0, 2), dtype=np.int64), *faces])


def boundary(mesh: SolidMesh) -> np.ndarray:
    """Faces (p, 2) that belong to one element only: its index and the face's number from 1.

    They are in ascending order.
    """
    faces, corners = _all_faces(mesh)
    outer = faces[_times(corners) == 1]
    return outer[np.lexsort(outer.T[::-1])]


def shared_too_often(mesh: SolidMesh) -> np.ndarray:
    """Indices of elements with a face that belongs to more than two elements."""
    faces, corners = _all_faces(mesh)
    return np.unique(faces[_times(corners) > 2, 0])


def faces_with_corners(mesh: SolidMesh, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find faces of the boundary by their corners.

    Parameters
    ----------
    corners : ndarray (p, 4) of int
        Nodes in any order; -1 for the fourth of a triangle.

    Returns
    -------
    faces : ndarray (m, 2) of int
        In the order of the mesh, each once.
    found : ndarray (p,) of bool
        Whether the corners are those of a face of the boundary.
    """
    faces, of_mesh = _all_faces(mesh)
    outer = _times(of_mesh) == 1
    faces, of_mesh = faces[outer], of_mesh[outer]
    rows = np.vstack([of_mesh, np.sort(corners, axis=1)])
    _, number = np.unique(rows, axis=0, return_inverse=True)
    number = number.ravel()
    is_given = np.isin(number[: len(faces)], number[len(faces) :])
    return faces[is_given], np.isin(number[len(faces) :], number[: len(faces)])


def _all_faces(mesh: SolidMesh) -> tuple[np.ndarray, np.ndarray]:
    """All faces (p, 2) of all elements, and their corners (p, 4), ascending; -1 for no fourth."""
    faces, corners = [np.zeros((0, 2), dtype=np.int64)], [np.zeros((0, 4), dtype=np.int64)]
    for block, start in zip(mesh.blocks, mesh.starts, strict=False):
        shape, n = block.kind.shape, len(block.labels)
        for k, face in enumerate(shape.faces):
            face_corners = [i for i in face if shape.is_corner(i)]
            nodes = np.full((n, 4), -1)
            nodes[:, : len(face_corners)] = block.nodes[:, face_corners]
            corners.append(np.sort(nodes, axis=1))
            faces.append(np.column_stack([start + np.arange(n), np.full(n, k + 1)]))
    return np.vstack(faces), np.vstack(corners)


def _times(rows: np.ndarray) -> np.ndarray:
    """How often each row occurs among all rows: (p,)."""
    if not len(rows):
        return np.zeros(0, dtype=int)
    order = np.lexsort(rows.T)
    new = np.append(True, (rows[order[1:]] != rows[order[:-1]]).any(axis=1))
    group = np.cumsum(new) - 1
    times = np.empty(len(rows), dtype=int)
    times[order] = np.bincount(group)[group]
    return times


def _among(faces: np.ndarray, wanted_faces: np.ndarray) -> np.ndarray:
    """Whether faces (p, 2) are among others: (p,)."""
    return np.isin(8 * faces[:, 0] + faces[:, 1], 8 * wanted_faces[:, 0] + wanted_faces[:, 1])


def facet_groups(mesh: SolidMesh, faces: np.ndarray) -> tuple[FacetGroup, ...]:
    """The facets of faces (p, 2), grouped by their number of nodes, ascending."""
    parts: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for block, start, end in zip(mesh.blocks, mesh.starts, mesh.starts[1:], strict=False):
        block_faces = faces[(faces[:, 0] >= start) & (faces[:, 0] < end)]
        for k, face in enumerate(block.kind.shape.faces):
            same_number = block_faces[block_faces[:, 1] == k + 1]
            if len(same_number):
                nodes = block.nodes[same_number[:, 0] - start][:, list(face)]
                parts.setdefault(len(face), []).append((nodes, same_number))
    return tuple(
        FacetGroup(np.vstack([n for n, _ in pieces]), np.vstack([f for _, f in pieces]))
        for _, pieces in sorted(parts.items())
    )
