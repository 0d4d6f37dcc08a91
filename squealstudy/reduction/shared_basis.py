"""One basis of displacements over a range of materials and springs (THEORY.md eq. (28a)).

Reductions at a few places of the range leave what they are made of: component modes, traces of
assembly modes, responses to friction, and the static responses of the contact. All of it together
spans what a reduction at any other place needs, which is then made of matrices of some thousand
rows instead of the meshes'.
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

TRACES = 1e-4  # smallest direction that another reduction adds, in M, of unit shapes
STATIC = 1e-3  # and of static responses, of the square root of the largest elastic energy
TOLERANCE = 1e-5  # of roots at a place that is not spanned yet, relative to a basis that spans it
AGREEMENT = 1e-4  # of these with a reduction there, whose own error is part of the difference


@dataclass(frozen=True)
class SharedBasis:
    """A basis that serves all structures of a range.

    Attributes
    ----------
    blocks : tuple of ndarray (n_component, k)
        M-orthonormal displacements of each component.
    k_c : float
        Contact stiffness per area [Pa/m] that its static responses are those of.
    rows : ContactRows
        Of the contact, over its coordinates.
    contact : str
        Hash of the contact's rows.
    reductions : int
        How many it is made of.
    lacking : float
        Largest relative change of a root in the last tests by what was tested, as it joined.
    error : float
        Largest relative distance of a root there, before, from that of a reduction of its own. Both
        are infinite where there were too few tests.
    """

    blocks: tuple[np.ndarray, ...] = field(repr=False)
    k_c: float | np.ndarray
    rows: ContactRows = field(repr=False)
    contact: str
    reductions: int
    lacking: float
    error: float

    @property
    def within(self) -> bool:
        """Whether the last tests were passed."""
        return within(self.lacking, self.error)

    def serves(self, assembly: Assembly) -> bool:
        """Whether it is within its tolerance, and made for the contact of an assembly."""
        return self.within and self.contact == contact_hash(assembly)

    def space(self, small: ProjectedAssembly, shapes: np.ndarray) -> ContactSpace:
        """Contact compliances of an assembly that is projected on it, and shapes U (n, m)."""
        return contact_space(small, self.k_c, shapes, self.rows)


def within(lacking: float, error: float) -> bool:
    """Whether tests were passed: roots agree with reductions, or change no more and come near them.

    Reductions differ from each other, of damped modes more than of light ones.
    """
    return error <= TOLERANCE or (lacking <= TOLERANCE and error <= AGREEMENT)


def contact_hash(assembly: Assembly) -> str:
    """Hash of the contact's rows over the degrees of freedom."""
    digest = hashlib.sha256()
    for A in (assembly.contact.N, assembly.contact.T, assembly.contact.T_perp):
        for part in (np.array(A.shape), A.indptr, A.indices, A.data):
            digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


class Snapshot:
    """What one reduction leaves for a shared basis.

    Parameters
    ----------
    assembly : Assembly
        The one that is reduced.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self.blocks: tuple[np.ndarray, ...] = ()  # of the reduction's own basis
        self._static: list[list[np.ndarray]] = [[] for _ in assembly.components]

    def add(self, X: np.ndarray) -> None:
        """Keep the leading directions of static responses (n_dof, k), by their elastic energies."""
        for part, directions in zip(self._assembly.components, self._static, strict=True):
            component_motion = X[self._assembly.slices[part.name]]
            energy, y = la.eigh(component_motion.T @ (part.K @ component_motion))
            is_significant = energy > (GRAM_RESOLUTION**2) * energy.max(initial=0.0)
            directions.append(component_motion @ y[:, is_significant])

    @property
    def static(self) -> list[np.ndarray]:
        """Static responses (n_component, k) of each component."""
        return [np.hstack(directions) for directions in self._static]


def joined(
    assembly: Assembly, blocks: Sequence[np.ndarray], snapshot: Snapshot
) -> tuple[np.ndarray, ...]:
    """Blocks with what a snapshot has outside of them; no blocks for a first one.

    Parameters
    ----------
    assembly : Assembly
        Whose masses and elastic energies measure what is kept, the same for all snapshots.
    blocks : sequence of ndarray (n_component, k)
    snapshot : Snapshot
    """
    parts, static = assembly.components, snapshot.static
    joined_blocks = []
    for number, part in enumerate(parts):
        V = snapshot.blocks[number]
        if blocks:
            block = blocks[number]
            V = np.hstack([block, new_directions(part.M, block, V, TRACES)])
        joined_blocks.append(V)
    sizes = [_energies(p.K, X).max(initial=0.0) for p, X in zip(parts, static, strict=True)]
    least = STATIC**2 * max(sizes)
    for number, part in enumerate(parts):
        X, energy = outside(part.M, part.K, joined_blocks[number], static[number])
        X = X[:, energy > least]
        X = X / np.sqrt(np.einsum("ij,ij->j", X, part.M @ X))
        more = new_directions(part.M, joined_blocks[number], X, GRAM_RESOLUTION)
        joined_blocks[number] = np.ascontiguousarray(np.hstack([joined_blocks[number], more]))
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
    """The basis of some blocks, ready for the assemblies of a range, of which one is given."""
    rows, n = ContactRows.of(assembly.contact), assembly.n_dof
    normal = sp.csr_matrix((len(rows.Z), n)).tolil()
    normal[:, rows.normal] = rows.Z
    sliding = sp.identity(n, format="csr")[rows.sliding]
    named = [*zip(assembly.component_names, blocks, strict=True)]
    Z, Z_T = (
        np.hstack([A[:, assembly.slices[name]] @ V for name, V in named])
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
