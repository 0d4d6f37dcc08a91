"""Stress stiffness of a meshed component, THEORY.md eq. (114)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from squealstudy.models.components.formulations import integration
from squealstudy.models.components.jacobians import jacobians
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_matrices import (
    STRAINS,
    ElementPart,
    NodeSums,
    chunks,
    inner_freedoms,
    material_axes,
    material_of,
    parts_of,
    strain_rows,
    used_materials,
)


def stress_stiffness(mesh: SolidMesh, u: np.ndarray) -> sp.csr_matrix:
    """Initial-stress matrix (3 n, 3 n) [N/m] of the stresses of a displacement.

    It is the integral of the sum of grad(u_i)^T sigma grad(u_i) over the three directions i, at the
    points of the stiffness. sigma is the stress of small strains; inner displacements of elements
    are in equilibrium. The matrix is symmetric and not definite. Translations have no energy. A
    rotation theta of the whole has the energy trace(theta^T sigma theta), because loads keep their
    direction.

    Parameters
    ----------
    mesh : SolidMesh
    u : ndarray (n, 3)
        Displacements of the nodes, m.

    Raises
    ------
    ModelError
        An element has no material, or a negative Jacobian.
    """
    parts = [p for name in used_materials(mesh) for p in parts_of(mesh, name)]
    sums = NodeSums(mesh, parts, 1)
    for part, rows, X in chunks(mesh, parts):
        sigma, weight, slopes = _stresses(mesh, part, rows, X, u)
        pulled = np.matmul(slopes, sigma) * weight[..., None, None]  # (e, q, k, 3)
        stiffness = np.einsum("eqni,eqmi->enm", pulled, slopes, optimize=True)
        sums.add(part, rows, ((stiffness + stiffness.transpose(0, 2, 1)) / 2)[..., None])
    return sp.kron(sums.matrix(), sp.eye(3), format="csr")


def _stresses(
    mesh: SolidMesh, part: ElementPart, rows: np.ndarray, X: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stresses (e, q, 3, 3) in x, y, z, weights (e, q), shape-function gradients (e, q, k, 3)."""
    kind = part.block.kind
    C = material_of(mesh, part.material).stiffness()
    N, dN = kind.shape.functions(integration(kind.stiffness).points)
    _, J = jacobians(mesh, part.start, rows, X, dN)
    B, weight = strain_rows(mesh, part, rows, X)
    element_motion = u[part.block.nodes[rows]].reshape(len(rows), -1)
    if kind.condensed:
        element_motion = inner_freedoms(B, weight, C, element_motion)
    six = np.einsum("ij,eqjm,em->eqi", C, B, element_motion, optimize=True)
    sigma = np.empty((*six.shape[:2], 3, 3))
    for row, (i, j) in enumerate(STRAINS):
        sigma[..., i, j] = sigma[..., j, i] = six[..., row]
    axes = material_axes(part, N, X)
    if axes is not None:
        sigma = np.matmul(axes.transpose(0, 1, 3, 2), np.matmul(sigma, axes))
    return sigma, weight, np.matmul(dN, np.linalg.inv(J))
