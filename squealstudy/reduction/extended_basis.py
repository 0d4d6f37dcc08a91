"""The component-mode basis with more directions: the next larger model of the same assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import Basis, ComponentModes, ReducedModel, project
from squealstudy.reduction.orthonormal import new_directions

ROUND_OFF = 1e-6  # of singular values: Gram matrices tell no smaller ones from round-off


def extended_basis(
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    basis: Basis,
    added: np.ndarray,
    share: float,
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
    share : float
        Directions are kept whose elastic energy is more than share^2 of the largest one's, of all
        components together: a component that hardly deforms gets few.
    """
    spans = [assembly.slices[name] for name in assembly.component_names]
    found = [
        _outside(component.M, component.K, block, added[span])
        for component, block, span in zip(assembly.components, basis.blocks, spans, strict=True)
    ]
    least = share**2 * max(energy.max(initial=0.0) for _, energy in found)
    blocks, diagonals = [], []
    for component, block, (X, energy) in zip(assembly.components, basis.blocks, found, strict=True):
        count = modes[component.name].phi.shape[1]
        phi, chosen = block[:, :count], X[:, energy > least]
        size = np.sqrt(np.einsum("ij,ij->j", chosen, component.M @ chosen))
        more = new_directions(component.M, block, chosen / size, ROUND_OFF)
        rest = np.hstack([block[:, count:], more])
        k_rest, y = la.eigh(rest.T @ (component.K @ rest))
        k_phi = np.einsum("ij,ij->j", phi, component.K @ phi)
        blocks.append(np.ascontiguousarray(np.hstack([phi, rest @ y])))
        diagonals.append(np.concatenate([k_phi, k_rest]))
    larger = replace(basis, blocks=tuple(blocks))
    return project(assembly, larger, diagonals, modes), larger


def _outside(
    M: sp.spmatrix, K: sp.spmatrix, block: np.ndarray, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What a component's displacements have outside of its block, and twice its elastic energies.

    Directions (n, k) are orthogonal in K, those of round-off left out.
    """
    M_block = M @ block
    largest = la.norm(own, axis=0).max(initial=0.0)
    X = own - block @ (M_block.T @ own)
    X = X - block @ (M_block.T @ X)
    energy, y = la.eigh(X.T @ (K @ X))
    X = X @ y
    told = la.norm(X, axis=0) > ROUND_OFF * largest
    return X[:, told], energy[told]
