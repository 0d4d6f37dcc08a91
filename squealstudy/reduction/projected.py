"""An assembly projected on a basis, from which reductions are made as from an assembly.

A structural parameter with many values would need a reduction of the large meshes for each. The
projected assembly has far fewer degrees of freedom and dense matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.component_slices import component_slices
from squealstudy.models.linear_interfaces import StressStiffness
from squealstudy.models.turning import Rotors


@dataclass(frozen=True, eq=False)
class ProjectedComponent:
    """Matrices of a component in coordinates of its block of the basis.

    Attributes
    ----------
    name : str
    M, K : ndarray (k, k)
    C : ndarray (k, k) or None
        Damping of the component; None where it has none.
    turning : ndarray (k, k) or None
        Gyroscopic terms at 1 rad/s, as in `models.assembly.Component`.
    """

    name: str
    M: np.ndarray
    K: np.ndarray
    C: np.ndarray | None
    turning: np.ndarray | None = None

    @property
    def n_dof(self) -> int:
        """Number of coordinates."""
        return len(self.M)


@dataclass(frozen=True, eq=False)
class ProjectedAssembly:
    """An `Assembly` in coordinates of a basis, as reductions need it (THEORY.md eq. (28a)).

    Attributes
    ----------
    components : tuple of ProjectedComponent
    contact : ContactInterface
        As in `Assembly`, but N, T and T_perp are dense.
    springs : (ndarray (n, n), ndarray (n, n))
        Stiffness of the linear interfaces in vibration, and in the static state.
    load, constant_load : ndarray (n,)
        Loads of a unit brake pressure and constant loads, on the coordinates.
    correspondence : csr_matrix (s, n)
        As in `Assembly`, for the coordinates of the basis.
    rotors : Rotors or None
        As in `Assembly`.
    """

    components: tuple[ProjectedComponent, ...]
    contact: ContactInterface
    springs: tuple[np.ndarray, np.ndarray] = field(repr=False)
    load: np.ndarray = field(repr=False)
    constant_load: np.ndarray = field(repr=False)
    correspondence: sp.csr_matrix = field(repr=False)
    rotors: Rotors | None = None

    @property
    def component_names(self) -> tuple[str, ...]:
        """Component names in the order of the coordinates."""
        return tuple(c.name for c in self.components)

    @property
    def n_dof(self) -> int:
        """Number of coordinates."""
        return len(self.load)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Range of the coordinates of each component."""
        return component_slices(self.components)[0]

    @cached_property
    def M(self) -> np.ndarray:
        """Mass (n, n)."""
        return _block_diagonal([c.M for c in self.components])

    @cached_property
    def K_el(self) -> np.ndarray:
        """Elastic stiffness (n, n) of the components."""
        return _block_diagonal([c.K for c in self.components])

    @cached_property
    def C_el(self) -> np.ndarray | None:
        """The components' own damping (n, n); None where no component has any."""
        if all(c.C is None for c in self.components):
            return None
        return _block_diagonal([0 * c.K if c.C is None else c.C for c in self.components])

    @cached_property
    def turning(self) -> np.ndarray | None:
        """Gyroscopic terms (n, n) of rotors at 1 m/s of sliding; None where there are none."""
        if self.rotors is None or self.rotors.radius is None:
            return None
        if all(c.turning is None for c in self.components):
            return None
        blocks = [0 * c.K if c.turning is None else c.turning for c in self.components]
        return _block_diagonal(blocks) / self.rotors.radius

    def K_springs(self, static: bool = False) -> np.ndarray:
        """Stiffness (n, n) of the linear interfaces; if `static`, of those in the static state."""
        return self.springs[int(static)]

    def K_contact(self, tangent: float | np.ndarray) -> np.ndarray:
        """Stiffness (n, n) of the contact with tangents (nc,) [Pa/m]."""
        c = self.contact
        K: np.ndarray = c.N.T @ ((c.area * tangent)[:, None] * c.N)
        return K

    def sparse(self) -> Assembly:
        """An `Assembly` of sparse matrices without nodes, for solvers of unreduced models."""
        in_vibration, static = self.springs
        return Assembly(
            components=tuple(
                Component(
                    c.name,
                    sp.csr_matrix(c.M),
                    sp.csr_matrix(c.K),
                    C=None if c.C is None else sp.csr_matrix(c.C),
                    turning=None if c.turning is None else sp.csr_matrix(c.turning),
                )
                for c in self.components
            ),
            contact=replace(
                self.contact,
                **{n: sp.csr_matrix(getattr(self.contact, n)) for n in ("N", "T", "T_perp")},
            ),
            springs=(
                StressStiffness(sp.csr_matrix(static), "springs", in_static=True),
                StressStiffness(sp.csr_matrix(in_vibration - static), "springs_in_vibration"),
            ),
            load=self.load,
            constant_load=self.constant_load,
            rotors=self.rotors,
        )


AnyAssembly = Assembly | ProjectedAssembly
AnyComponent = Component | ProjectedComponent


def projected(assembly: Assembly, blocks: Sequence[np.ndarray]) -> ProjectedAssembly:
    """Project an assembly on a basis with one block (n_component, k) for each component."""
    spans = [assembly.slices[name] for name in assembly.component_names]

    def project_columns(A: sp.csr_matrix) -> np.ndarray:
        return np.hstack([A[:, s] @ V for s, V in zip(spans, blocks, strict=True)])

    def project_force(f: np.ndarray) -> np.ndarray:
        return np.concatenate([V.T @ f[s] for s, V in zip(spans, blocks, strict=True)])

    c = assembly.contact
    correspondences = [
        part.observer @ V for part, V in zip(assembly.components, blocks, strict=True)
    ]
    return ProjectedAssembly(
        components=tuple(
            ProjectedComponent(
                part.name,
                _project_symmetric(part.M, V),
                _without_negative_diagonal(_project_symmetric(part.K, V)),
                None if part.C is None else _project_symmetric(part.C, V),
                None if part.turning is None else _project_skew(part.turning, V),
            )
            for part, V in zip(assembly.components, blocks, strict=True)
        ),
        contact=replace(
            c, N=project_columns(c.N), T=project_columns(c.T), T_perp=project_columns(c.T_perp)
        ),
        springs=(
            _project_sparse_rows(assembly.K_springs(), spans, blocks),
            _project_sparse_rows(assembly.K_springs(static=True), spans, blocks),
        ),
        load=project_force(assembly.load),
        constant_load=project_force(assembly.constant_load),
        correspondence=sp.block_diag(correspondences, format="csr"),
        rotors=assembly.rotors,
    )


def _project_sparse_rows(
    A: sp.csr_matrix, spans: Sequence[slice], blocks: Sequence[np.ndarray]
) -> np.ndarray:
    """Project a symmetric matrix (n_dof, n_dof) with few non-zero rows on the basis."""
    block_rows = []
    for span, V in zip(spans, blocks, strict=True):
        span_rows = A[span]
        rows = np.flatnonzero(np.diff(span_rows.indptr))
        parts = [span_rows[rows][:, columns] for columns in spans]
        block_rows.append(
            [
                V[rows].T @ (part @ W) if part.nnz else np.zeros((V.shape[1], W.shape[1]))
                for part, W in zip(parts, blocks, strict=True)
            ]
        )
    return _symmetric(np.block(block_rows))


def _project_symmetric(A: sp.csr_matrix, V: np.ndarray) -> np.ndarray:
    """Projection V^T A V (k, k) of a symmetric matrix."""
    return _symmetric(V.T @ (A @ V))


def _project_skew(A: sp.csr_matrix, V: np.ndarray) -> np.ndarray:
    """Projection V^T A V (k, k) of a skew-symmetric matrix."""
    B = V.T @ (A @ V)
    half: np.ndarray = (B - B.T) / 2
    return half


def _symmetric(A: np.ndarray) -> np.ndarray:
    half: np.ndarray = (A + A.T) / 2
    return half


def _without_negative_diagonal(K: np.ndarray) -> np.ndarray:
    """Set negative diagonal entries to 0, in place: round-off makes them for rigid motions."""
    np.fill_diagonal(K, np.maximum(np.diag(K), 0.0))
    return K


def _block_diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    assembled: np.ndarray = la.block_diag(*blocks)
    return assembled
