"""Left-handed elements, as in mirrored half models, put into the right-handed order of nodes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from squealstudy.models.components.formulations import integration
from squealstudy.models.components.jacobians import CHUNK
from squealstudy.models.components.mesh import PassedOver, SolidMesh
from squealstudy.models.element_shapes import SHAPES


def righted(mesh: SolidMesh) -> SolidMesh:
    """The mesh with the nodes of left-handed elements in the mirrored order.

    An element is left-handed if its Jacobian is negative at all integration points. The mirrored
    order describes the same element. Surfaces keep their faces, and `passed_over` gets a note.
    """
    blocks = list(mesh.blocks)
    surfaces = {name: faces.copy() for name, faces in mesh.surfaces.items()}
    turned_elements = []
    for b, start in enumerate(mesh.starts[:-1]):
        block = blocks[b]
        left_handed = _left_handed(mesh, b)
        if not left_handed.any():
            continue
        order, faces = _mirrored(block.kind.shape.name)
        nodes = block.nodes.copy()
        nodes[left_handed] = nodes[left_handed][:, order]
        blocks[b] = replace(block, nodes=nodes)
        turned_elements.append(start + np.flatnonzero(left_handed))
        for faces_of_set in surfaces.values():
            in_block = (faces_of_set[:, 0] >= start) & (faces_of_set[:, 0] < mesh.starts[b + 1])
            in_block[in_block] = left_handed[faces_of_set[in_block, 0] - start]
            faces_of_set[in_block, 1] = faces[faces_of_set[in_block, 1] - 1]
    if not turned_elements:
        return mesh
    elements = np.concatenate(turned_elements)
    why = (
        f"{len(elements)} of {mesh.n_elements} elements, {mesh.elements_named(elements)}, are "
        "left-handed, as those of a mirrored part: read in the mirrored order of their nodes"
    )
    ordered = {
        name: faces_of_set[np.lexsort((faces_of_set[:, 1], faces_of_set[:, 0]))]
        for name, faces_of_set in surfaces.items()
    }
    note = PassedOver("order of nodes", mesh.origin, 0, why)
    return replace(
        mesh,
        blocks=tuple(blocks),
        surfaces=ordered,
        passed_over=(*mesh.passed_over, note),
    )


def _left_handed(mesh: SolidMesh, b: int) -> np.ndarray:
    """Whether elements of a block are left-handed: (n,)."""
    block = mesh.blocks[b]
    _, dN = block.kind.shape.functions(integration(block.kind.stiffness).points)
    is_left_handed = np.zeros(len(block.labels), dtype=bool)
    for start in range(0, len(is_left_handed), CHUNK):
        X = mesh.nodes[block.nodes[start : start + CHUNK]]
        J = np.matmul(X.transpose(0, 2, 1)[:, None], dN)
        is_left_handed[start : start + CHUNK] = (np.linalg.det(J) < 0).all(axis=1)
    return is_left_handed


@cache
def _mirrored(shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Order of the nodes with the first two reference coordinates exchanged, and the new faces.

    The new number of each face counts from 1.
    """
    local, faces = SHAPES[shape].places, SHAPES[shape].faces
    exchanged = local[:, [1, 0, 2]]
    order = np.abs(local[None] - exchanged[:, None]).max(axis=2).argmin(axis=1)
    sets = [{int(order[i]) for i in face} for face in faces]
    return order, np.array([sets.index(set(face)) + 1 for face in faces])
