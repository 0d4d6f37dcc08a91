"""An assembly: disjoint components, the interfaces between them, and loads (THEORY.md eq. (23))."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.component import Component
from squealstudy.models.interface import ContactInterface, SpringInterface


@dataclass(frozen=True)
class Assembly:
    """Components, interfaces and loads over one numbering: components in order, then their DOFs.

    Attributes
    ----------
    components : tuple of Component
        Unique names.
    contact : ContactInterface
        All contact points.
    springs : tuple of SpringInterface
        Linear interfaces.
    load : ndarray (n_dof,)
        Nodal forces of a unit brake pressure, N/Pa.
    constant_load : ndarray (n_dof,)
        Nodal forces that are always there, N.

    Raises
    ------
    ModelError
        Arrays that do not fit together.
    """

    components: tuple[Component, ...]
    contact: ContactInterface
    springs: tuple[SpringInterface, ...]
    load: np.ndarray
    constant_load: np.ndarray

    def __post_init__(self) -> None:
        names = self.component_names
        if len(set(names)) != len(names) or not names:
            raise ModelError(f"component names must be unique, got {names}")
        for spring in self.springs:
            if spring.B.shape[1] != self.n_dof:
                raise ModelError(f"interface '{spring.name}' does not have {self.n_dof} columns")
        if self.contact.N.shape[1] != self.n_dof:
            raise ModelError(f"contact interface does not have {self.n_dof} columns")
        for name in ("load", "constant_load"):
            value = getattr(self, name)
            if value.shape != (self.n_dof,) or not np.isfinite(value).all():
                raise ModelError(f"assembly: '{name}' needs {self.n_dof} finite values")

    @property
    def component_names(self) -> tuple[str, ...]:
        """Names in the order of the numbering."""
        return tuple(c.name for c in self.components)

    @property
    def n_dof(self) -> int:
        """Total number of degrees of freedom."""
        return sum(c.n_dof for c in self.components)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Degrees of freedom of each component."""
        ends = np.cumsum([0, *(c.n_dof for c in self.components)])
        return {
            c.name: slice(a, b) for c, a, b in zip(self.components, ends, ends[1:], strict=False)
        }

    @cached_property
    def M(self) -> sp.csr_matrix:
        """Mass (n_dof, n_dof), kg."""
        return sp.block_diag([c.M for c in self.components], format="csr")

    @cached_property
    def K_el(self) -> sp.csr_matrix:
        """Elastic stiffness (n_dof, n_dof) of the components, N/m: block diagonal."""
        return sp.block_diag([c.K for c in self.components], format="csr")

    @cached_property
    def correspondence(self) -> sp.csr_matrix:
        """Component.seen of all components, block by block: (rows, n_dof)."""
        return sp.block_diag([c.seen for c in self.components], format="csr")

    def K_springs(self, static: bool = False) -> sp.csr_matrix:
        """Stiffness of the linear interfaces; `static` leaves out those absent at rest."""
        kept = [s.matrix() for s in self.springs if s.in_static or not static]
        return sum(kept, sp.csr_matrix((self.n_dof, self.n_dof)))

    def expand(self, parts: Sequence[tuple[str, sp.spmatrix]]) -> sp.csr_matrix:
        """Rows over the whole assembly from rows over single components."""
        return expand_rows(parts, self.slices, self.n_dof)


def component_slices(components: Sequence[Component]) -> tuple[dict[str, slice], int]:
    """Degrees of freedom of each component, and their total, before an Assembly exists."""
    ends = np.cumsum([0, *(c.n_dof for c in components)])
    spans = {c.name: slice(a, b) for c, a, b in zip(components, ends, ends[1:], strict=False)}
    return spans, int(ends[-1])


def expand_rows(
    parts: Sequence[tuple[str, sp.spmatrix]], spans: dict[str, slice], n_dof: int
) -> sp.csr_matrix:
    """Sum of observation rows, each given on one component: (n_rows, n_dof)."""
    total = None
    for name, rows in parts:
        coo = rows.tocoo()
        part = sp.csr_matrix(
            (coo.data, (coo.row, coo.col + spans[name].start)), shape=(rows.shape[0], n_dof)
        )
        total = part if total is None else total + part
    if total is None:
        raise ModelError("observation rows need at least one component")
    return total.tocsr()
