"""Jacobians of elements, which must be positive, and volumes."""

from __future__ import annotations

import numpy as np

from squealstudy.models.components.formulations import integration
from squealstudy.models.components.mesh import SolidMesh

CHUNK = 256  # elements at a time


def jacobians(
    mesh: SolidMesh, start: int, rows: np.ndarray, X: np.ndarray, dN: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Determinants and Jacobians of elements at integration points.

    Parameters
    ----------
    mesh : SolidMesh
    start : int
        Index in the mesh of the first element of their block.
    rows : ndarray (e,) of int
        Indices of the elements in the block.
    X : ndarray (e, k, 3)
        Coordinates of their nodes.
    dN : ndarray (q, k, 3)
        Derivatives of the shape functions by the reference coordinates.

    Returns
    -------
    det : ndarray (e, q)
        Positive.
    J : ndarray (e, q, 3, 3)
        Derivative of coordinate i by reference coordinate j at [.., i, j].

    Raises
    ------
    ModelError
        A determinant is not positive; the message names the elements.
    """
    J = np.matmul(X.transpose(0, 2, 1)[:, None], dN)
    det = np.linalg.det(J)
    wrong = ~(det > 0).all(axis=1)
    if wrong.any():
        raise mesh.error(
            f"{mesh.elements_named(start + rows[wrong])}: a negative Jacobian at an "
            "integration point; the order of its nodes is not that of Abaqus, or it is folded"
        )
    return det, J


def volumes(mesh: SolidMesh) -> np.ndarray:
    """Volumes of all elements (n_elements,); ModelError about a negative Jacobian."""
    block_volumes = []
    for block, start in zip(mesh.blocks, mesh.starts, strict=False):
        rule = integration(block.kind.mass)
        _, dN = block.kind.shape.functions(rule.points)
        rows = np.arange(len(block.labels))
        det, _ = jacobians(mesh, int(start), rows, mesh.nodes[block.nodes], dN)
        block_volumes.append(det @ rule.weights)
    return np.concatenate([np.zeros(0), *block_volumes])
