"""Ranges of the degrees of freedom of each component, needed before an assembly exists."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError


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
    """Slice of the degrees of freedom of each component, by name, and their total number."""
    ends = np.cumsum([0, *(c.n_dof for c in components)])
    spans = {c.name: slice(a, b) for c, a, b in zip(components, ends, ends[1:], strict=False)}
    return spans, int(ends[-1])


def expand_rows(
    parts: Sequence[tuple[str, sp.spmatrix]], spans: dict[str, slice], n_dof: int
) -> sp.csr_matrix:
    """Sum of observation rows (n_rows, n_dof); each part is a component and rows over it.

    ModelError without any part.
    """
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
