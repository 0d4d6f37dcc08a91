"""Products y^H Q_theta x of a complex mode and its neighbours, from which derivatives follow.

Modal damping changes a root by the matrices it is made from (THEORY.md eq. (58)):
C_d = sum of M phi (2 zeta omega) phi^T M is a function of K_sym and M. In the coordinates of the
real modes phi its derivative is (Daleckii-Krein, with the mass)

    dC_ij = F_ij (phi_i^T dK phi_j) + H_ij (phi_i^T dM phi_j),   d_i = 2 zeta_i omega_i,
    F_ij = (d_i - d_j) / (omega_i^2 - omega_j^2),
    H_ij = (d_i + d_j - (omega_i^2 + omega_j^2) F_ij) / 2:

for one zeta, F = 2 zeta/(omega_i + omega_j) and H = omega_i omega_j F. Where contact has given way
omega_i^2 is below zero and d_i = 0. Single damped modes of equal frequency have no derivative; the
part of F from their difference is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from squealstudy.modes.sensitivity.mode_family import ModeNeighbourhood
from squealstudy.system.linearise import ContactStructure, StructureWeights
from squealstudy.system.parametric import DAMPING, Columns, ParametricSystem, Term

EQUAL = 1e-9  # relative distance of frequencies that count as equal


@dataclass(frozen=True, eq=False)
class RealModes:
    """Real modes that have modal damping.

    Attributes
    ----------
    w2 : ndarray (m,)
        Squares of frequencies [(rad/s)^2]; below zero for modes without damping where contact has
        given way.
    phi : ndarray (n, m)
        Mass-normalised modes.
    momenta : ndarray (n, m)
        Products M phi.
    zeta : ndarray (m,)
        Damping ratios of the modes.
    N : matrix (nc, n)
        Contact normals.
    """

    w2: np.ndarray
    phi: np.ndarray
    momenta: np.ndarray
    zeta: np.ndarray
    N: Any

    @property
    def omega(self) -> np.ndarray:
        """Frequencies (m,), rad/s; 0 where `w2` is negative."""
        return np.sqrt(np.maximum(self.w2, 0.0))

    @cached_property
    def contact(self) -> np.ndarray:
        """N phi (nc, m)."""
        return np.asarray(self.N @ self.phi)

    @cached_property
    def factors(self) -> tuple[np.ndarray, np.ndarray]:
        """F and H (m, m) of the module's formula."""
        return damping_factors(self.w2, self.zeta)


class ModeGradient:
    """Products of the vectors of a mode and its neighbours with the terms of their structure.

    Parameters
    ----------
    family : ModeNeighbourhood
    structure : ContactStructure
        The structure, in the coordinates of the family.
    real : RealModes or None
        Needed with modal damping, and for derivatives by damping ratios of the assembly.

    Attributes
    ----------
    damping : DampingGradient or None
        None without modal damping.
    """

    def __init__(
        self, family: ModeNeighbourhood, structure: ContactStructure, real: RealModes | None
    ) -> None:
        self.family, self._real = family, real
        self._X, self._Y = Columns(family.X), Columns(family.Y)
        terms = structure.system.terms
        self.damping = None
        if real is not None:
            rows = real.momenta.T
            terms = (*terms, Term(DAMPING, rows, rows))
            if real.zeta.any():
                left_rows, right = rows @ family.Y[:, 0].conj(), rows @ family.X[:, 0]
                self.damping = DampingGradient(real, complex(family.lam[0]), left_rows, right)
        self._system = ParametricSystem(structure.n, terms)

    def products(self, by: StructureWeights, ratios: np.ndarray | None = None) -> np.ndarray:
        """y_i^H Q_theta(lambda_j) x_j (k, k) under changes of weights and damping ratios (m,).

        The change of modal damping with the stiffness enters the first mode's own product only;
        between different modes it is of second order beside the stiffness itself.
        """
        weights: tuple[Any, ...] = by
        if self._real is not None:
            weights = (*by, 0.0 if ratios is None else 2.0 * self._real.omega * ratios)
        forms = self._system.forms(weights, self.family.lam, self._X, self._Y)
        if self.damping is not None:
            if np.ndim(by.normal):
                forms[0, 0] += self._by_normal @ by.normal
            if np.ndim(by.elastic):
                forms[0, 0] += self._by_elastic(np.asarray(by.elastic))
        return forms

    @cached_property
    def _by_normal(self) -> np.ndarray:
        """Derivatives of modal damping by the normal contact weights (nc,)."""
        assert self.damping is not None
        assert self._real is not None
        return self.damping.by_rows(self._real.contact)

    def _by_elastic(self, change: np.ndarray) -> complex:
        """Derivatives of modal damping by a change of the elastic diagonal (n,), mostly zero."""
        assert self.damping is not None
        assert self._real is not None
        changed_rows = np.flatnonzero(change)
        return complex(self.damping.by_rows(self._real.phi[changed_rows]) @ change[changed_rows])


class DampingGradient:
    """Derivative of y^H lambda C_d x by K_sym and M, for one pair of vectors.

    Parameters
    ----------
    real : RealModes
    lam : complex
    left_projection, right_projection : ndarray (m,) complex
        phi^T M conj(y) and phi^T M x.
    """

    def __init__(
        self,
        real: RealModes,
        lam: complex,
        left_projection: np.ndarray,
        right_projection: np.ndarray,
    ) -> None:
        self._lam, self._left, self._right = lam, left_projection, right_projection
        self._F, self._H = real.factors

    @cached_property
    def _pairs(self) -> np.ndarray:
        return self._lam * np.outer(self._left, self._right)

    def by_stiffness(self, dK: np.ndarray) -> complex:
        """Change of y^H lambda C_d x by a change of stiffness, given as phi^T dK phi (m, m)."""
        return complex((self._pairs * self._F * dK).sum())

    def by_mass(self, dM: np.ndarray) -> complex:
        """Change of y^H lambda C_d x by a change of mass, given as phi^T dM phi (m, m)."""
        return complex((self._pairs * self._H * dM).sum())

    def by_rows(self, rows: np.ndarray) -> np.ndarray:
        """Derivatives by the weights w (r,) of a stiffness R^T diag(w) R; rows = R phi (r, m)."""
        both = np.vstack([rows * self._left.real, rows * self._left.imag]) @ self._F
        real, imag = both[: len(rows)], both[len(rows) :]
        right = rows * self._right
        by_weight: np.ndarray = ((real + 1j * imag) * right).sum(axis=1) * self._lam
        return by_weight


def damping_factors(w2: np.ndarray, zeta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and H (..., m, m) of the module's formula, by squares of frequencies w2 (..., m)."""
    omega = np.sqrt(np.maximum(w2, 0.0))
    rows, columns = (..., slice(None), None), (..., None, slice(None))
    total = omega[rows] + omega[columns]
    differences = w2[rows] - w2[columns]
    unequal = np.abs(differences) > EQUAL * np.maximum(np.abs(w2[rows]), np.abs(w2[columns]))
    # (omega_i + omega_j) / (w2_i - w2_j), then (omega_i - omega_j) / (w2_i - w2_j)
    ratio = np.where(unequal, total / np.where(unequal, differences, 1.0), 0.0)
    vibrate = np.minimum(w2[rows], w2[columns]) > 0.0
    slope = np.where(vibrate, 1.0 / np.where(vibrate, total, 1.0), np.abs(ratio))
    F = (zeta[rows] + zeta[columns]) * slope + (zeta[rows] - zeta[columns]) * ratio
    d = 2.0 * zeta * omega
    squares = w2[rows] + w2[columns]
    return F, (d[rows] + d[columns] - squares * F) / 2.0
