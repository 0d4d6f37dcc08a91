"""The component-mode basis with more directions: the next larger model of the same assembly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as la

from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import Basis, ComponentModes, ReducedModel, project
from squealstudy.reduction.orthonormal import new_directions

TOLERANCE = 1e-6  # of the singular values of the added directions, a component each: their Gram
# matrix tells no smaller ones from round-off


def extended_basis(
    assembly: Assembly, modes: Mapping[str, ComponentModes], basis: Basis, added: np.ndarray
) -> tuple[ReducedModel, Basis]:
    """The basis and the model with what `added` has outside of it, component by component.

    Parameters
    ----------
    assembly : Assembly
    modes : mapping of component name -> ComponentModes
        The first coordinates of each component, which stay what they are.
    basis : Basis
    added : ndarray (n_dof, k)
        Displacements of the assembly.
    """
    blocks, diagonals = [], []
    for component, block in zip(assembly.components, basis.blocks, strict=True):
        count = modes[component.name].phi.shape[1]
        phi, own = block[:, :count], added[assembly.slices[component.name]]
        more = new_directions(component.M, block, own, TOLERANCE)
        rest = np.hstack([block[:, count:], more])
        k_rest, y = la.eigh(rest.T @ (component.K @ rest))
        k_phi = np.einsum("ij,ij->j", phi, component.K @ phi)
        blocks.append(np.ascontiguousarray(np.hstack([phi, rest @ y])))
        diagonals.append(np.concatenate([k_phi, k_rest]))
    larger = Basis(tuple(blocks), basis.omega, basis.phi)
    return project(assembly, larger, diagonals, modes), larger
