"""The protocol of coordinates of a lumped model, which may be of masses or of matrices."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from squealstudy.models.lumped.matrix_tables import AnyFile
from squealstudy.models.lumped.numbers import Values


class Structure(NamedTuple):
    """Matrices of the components alone, without springs, dampers and contact.

    Attributes
    ----------
    components : tuple of str
    offsets : list of int
        First coordinate of each component, then n.
    M, K : ndarray (m or 1, n, n)
        kg and N/m; for rotations kg m2 and N m.
    C, G : ndarray (m or 1, n, n) or None
        Symmetric damping and skew-symmetric gyroscopic terms, N s/m; for rotations N m s.
    """

    components: tuple[str, ...]
    offsets: list[int]
    M: np.ndarray
    K: np.ndarray
    C: np.ndarray | None = None
    G: np.ndarray | None = None


class Space(Protocol):
    """Coordinates of a model, and rows of motions over them."""

    @property
    def file(self) -> AnyFile:
        """The file of the model."""
        ...

    @property
    def n(self) -> int:
        """Number of coordinates."""
        ...

    def structure(self, values: Values) -> Structure:
        """Matrices of the components; PlacedError where a number is not possible."""
        ...

    def elongation(self, kind: str, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n): motion of the first end of a spring or damper relative to the second."""
        ...

    def contact_rows(self, i: int, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and T_perp, each (m or 1, n), of a contact; T and T_perp are 0 without friction."""
        ...

    def load_row(self, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n): the motion along which a load does work."""
        ...
