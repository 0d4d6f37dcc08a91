"""Coordinates of a lumped model as its parts need them, of masses or of matrices."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from squealstudy.models.lumped.matrix_tables import AnyFile
from squealstudy.models.lumped.numbers import Values


class Structure(NamedTuple):
    """Masses, stiffness and damping of the components alone, at values of parameters.

    Attributes
    ----------
    components : tuple of str
    offsets : list of int
        First coordinate of each component, then n.
    M, K : ndarray (m or 1, n, n)
        kg and N/m, or what belongs to turns.
    C, G : ndarray (m or 1, n, n) or None
        Damping, symmetric, and gyroscopic terms, skew-symmetric, N s/m.
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
        """The file that they are of."""
        ...

    @property
    def n(self) -> int:
        """Number of coordinates."""
        ...

    def structure(self, values: Values) -> Structure:
        """The components; PlacedError where a number cannot be what it is."""
        ...

    def elongation(self, kind: str, i: int, values: Values) -> np.ndarray:
        """Motion (m or 1, n) of the first end of a spring or damper over the second."""
        ...

    def contact_rows(self, i: int, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and T_perp (m or 1, n) of a contact; zeros without friction."""
        ...

    def load_row(self, i: int, values: Values) -> np.ndarray:
        """Motion (m or 1, n) that a load does work along."""
        ...
