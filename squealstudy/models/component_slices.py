"""Degrees of freedom of components in an assembly that is not there yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

if TYPE_CHECKING:  # scikit-fem is slow to load
    pass


class Sized(Protocol):
    """An object with a name and a number of degrees of freedom."""

    @property
    def name(self) -> str:
        """Name of the component."""
        ...

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        ...


def component_slices(components: Sequence[Sized]) -> tuple[dict[str, slice], int]:
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
