"""One basis of displacements over a range of materials and springs (THEORY.md eq. (28a)).

Reductions at a few places of the range contribute component modes, traces of assembly modes,
responses to friction and static responses of the contact. Together these span the motions that a
reduction at any other place needs. That reduction then starts from matrices of some thousand rows
instead of the larger ones of the meshes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly
from squealstudy.reduction.contact_space import ContactRows, ContactSpace, contact_space
from squealstudy.reduction.orthonormal import GRAM_RESOLUTION, new_directions, outside
from squealstudy.reduction.projected import ProjectedAssembly

MIN_NEW_TRACE = 1e-4  # directions with a larger relative singular value join the basis
# root of the elastic energy of a new static direction, over the largest of a static response, from
# which it joins
MIN_NEW_STATIC = 1e-3
# largest relative error of roots at a test place, whose reduction has not joined the basis yet
TOLERANCE = 1e-5
# the same where that reduction, which has an error too, changes the roots by TOLERANCE at most
AGREEMENT = 1e-4


@dataclass(frozen=True)
class SharedBasis:
    """A basis of displacements for all structures of a range.

    Attributes
    ----------
    blocks : tuple of ndarray (n_component, k)
        M-orthonormal displacements of each component.
    k_c : float or ndarray (nc,)
        Contact stiffness per area [Pa/m] with which its static responses were computed.
    rows : ContactRows
        Rows of the contact over the coordinates of the basis.
    contact : str
        Hash of the contact's rows.
    reductions : int
        Number of reductions that the basis is made of.
    lacking : float
        Largest relative change of a root at the last test places when their reductions joined.
    error : float
        Largest relative difference of a root there from the same root of the place's reduction,
        before that joined. Both are infinite where there were too few tests.
    """

    blocks: tuple[np.ndarray, ...] = field(repr=False)
    k_c: float | np.ndarray
    rows: ContactRows = field(repr=False)
    contact: str
    reductions: int
    lacking: float
    error: float

    @property
    def is_accurate(self) -> bool:
        """Whether the last tests were passed."""
        return is_accurate(self.lacking, self.error)

    def serves(self, assembly: Assembly) -> bool:
        """Whether the basis is accurate and was made for the contact of this assembly."""
        return self.is_accurate and self.contact == contact_hash(assembly)

    def space(self, small: ProjectedAssembly, shapes: np.ndarray) -> ContactSpace:
        """Contact space of an assembly projected on the basis, with shapes U (n, m)."""
        return contact_space(small, self.k_c, shapes, self.rows)


def is_accurate(lacking: float, error: float) -> bool:
    """Whether roots agree with those of the reductions at the test places (`SharedBasis`).

    Where the roots no longer change as these reductions join the basis, AGREEMENT is enough, as
    the reductions have errors too, which are larger for damped modes.
    """
    return error <= TOLERANCE or (lacking <= TOLERANCE and error <= AGREEMENT)


def contact_hash(assembly: Assembly) -> str:
    """Hash of the contact's rows N, T and T_perp over the degrees of freedom."""
    digest = hashlib.sha256()
    for A in (assembly.contact.N, assembly.contact.T, assembly.contact.T_perp):
        for part in (np.array(A.shape), A.indptr, A.indices, A.data):
            digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


class Snapshot:
    """Directions that one reduction contributes to a shared basis.

    Parameters
    ----------
    assembly : Assembly
        The assembly that was reduced.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self.blocks: tuple[np.ndarray, ...] = ()  # the reduction's basis, by component
        self._static: list[list[np.ndarray]] = [[] for _ in assembly.components]

    def add(self, X: np.ndarray) -> None:
        """Add directions of static responses (n_dof, k) whose elastic energy is no round-off."""
        for part, directions in zip(self._assembly.components, self._static, strict=True):
            component_motion = X[self._assembly.slices[part.name]]
            energy, y = la.eigh(component_motion.T @ (part.K @ component_motion))
            is_significant = energy > (GRAM_RESOLUTION**2) * energy.max(initial=0.0)
            directions.append(component_motion @ y[:, is_significant])

    @property
    def static(self) -> list[np.ndarray]:
        """Static responses (n_component, k) of each component."""
        return [np.hstack(directions) for directions in self._static]


def with_snapshot(
    assembly: Assembly, blocks: Sequence[np.ndarray], snapshot: Snapshot
) -> tuple[np.ndarray, ...]:
    """Add to blocks of a basis the directions of a snapshot that they do not span.

    Parameters
    ----------
    assembly : Assembly
        The same one for all snapshots: new directions are measured by its mass and elastic energy.
    blocks : sequence of ndarray (n_component, k)
        Empty for the first snapshot.
    snapshot : Snapshot
    """
    parts, static = assembly.components, snapshot.static
    joined_blocks = []
    for index, part in enumerate(parts):
        V = snapshot.blocks[index]
        if blocks:
            block = blocks[index]
            V = np.hstack([block, new_directions(part.M, block, V, MIN_NEW_TRACE)])
        joined_blocks.append(V)
    largest_energies = [
        _energies(p.K, X).max(initial=0.0) for p, X in zip(parts, static, strict=True)
    ]
    min_energy = MIN_NEW_STATIC**2 * max(largest_energies)
    for index, part in enumerate(parts):
        X, energy = outside(part.M, part.K, joined_blocks[index], static[index])
        X = X[:, energy > min_energy]
        X = X / np.sqrt(np.einsum("ij,ij->j", X, part.M @ X))
        new_parts = new_directions(part.M, joined_blocks[index], X, GRAM_RESOLUTION)
        joined_blocks[index] = np.ascontiguousarray(np.hstack([joined_blocks[index], new_parts]))
    return tuple(joined_blocks)


def _energies(K: sp.csr_matrix, X: np.ndarray) -> np.ndarray:
    energies: np.ndarray = np.einsum("ij,ij->j", X, K @ X)
    return energies


def shared_basis(
    assembly: Assembly,
    blocks: Sequence[np.ndarray],
    k_c: float | np.ndarray,
    reductions: int,
    lacking: float = np.inf,
    error: float = np.inf,
) -> SharedBasis:
    """Make the basis of these blocks; `assembly` may be any one of the range."""
    rows, n = ContactRows.of(assembly.contact), assembly.n_dof
    normal = sp.csr_matrix((len(rows.Z), n)).tolil()
    normal[:, rows.normal] = rows.Z
    sliding = sp.identity(n, format="csr")[rows.sliding]
    component_blocks = [*zip(assembly.component_names, blocks, strict=True)]
    Z, Z_T = (
        np.hstack([A[:, assembly.slices[name]] @ V for name, V in component_blocks])
        for A in (normal.tocsr(), sliding)
    )
    return SharedBasis(
        blocks=tuple(blocks),
        k_c=k_c,
        rows=replace(rows, normal=np.arange(Z.shape[1]), Z=Z, sliding=Z_T),
        contact=contact_hash(assembly),
        reductions=reductions,
        lacking=lacking,
        error=error,
    )
