"""Products y^H Q_theta x of a mode and its neighbours under a change of the contact weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.analysis.sensitivity.contact_change import ContactChange
from squealstudy.analysis.sensitivity.mode_family import ModeFamily


@dataclass(frozen=True)
class Products:
    """Products of the first mode with the k modes of its family, under one change of Q.

    Attributes
    ----------
    right : ndarray (k,) complex
        y_1^H Q_theta(lambda_j) x_j.
    left : ndarray (k,) complex
        y_j^H Q_theta(lambda_1) x_1.
    """

    right: np.ndarray
    left: np.ndarray

    def __add__(self, other: Products) -> Products:
        return Products(self.right + other.right, self.left + other.left)


class ContactGradient:
    """A family of modes seen at the contact points.

    Parameters
    ----------
    family : ModeFamily
    N, T, T_perp : matrix (nc, n)
        Contact observation in the family's coordinates.
    stiffness_damping : float
        Rayleigh's beta, s.
    """

    def __init__(
        self, family: ModeFamily, N: Any, T: Any, T_perp: Any, stiffness_damping: float
    ) -> None:
        self._lam, self._beta = family.lam, stiffness_damping
        self._right = [np.asarray(A @ family.X) for A in (N, T, T_perp)]
        self._left = [np.asarray(A @ family.Y).conj() for A in (N, T, T_perp)]

    def products(self, change: ContactChange) -> Products:
        """With the four weights changed; modal damping stays as it is."""
        right = [R[:, 0] for R in self._right]
        left = [L[:, 0] for L in self._left]
        return Products(
            self._sum(change, left, self._right, self._lam),
            self._sum(change, right, self._left, self._lam[:1], transpose=True),
        )

    def _sum(
        self,
        change: ContactChange,
        one: list[np.ndarray],
        many: list[np.ndarray],
        lam: np.ndarray,
        transpose: bool = False,
    ) -> np.ndarray:
        """Terms summed over the points; `transpose` where `many` are left vectors."""
        N, T, P = range(3)
        rows, columns = (N, T) if transpose else (T, N)  # of T^T (.) N
        total = (1.0 + self._beta * lam) * ((one[N] * change.normal) @ many[N])
        total = total - (one[rows] * change.coupling) @ many[columns]
        total = total + lam * ((one[P] * change.across) @ many[P])
        along: np.ndarray = total + lam * ((one[T] * change.along) @ many[T])
        return along
