"""How modal damping changes a root, by the matrices it is made from (THEORY.md eq. (58)).

C_d = sum of M phi (2 zeta omega) phi^T M is a function of K_sym and M. In the coordinates of the
real modes phi its derivative is (Daleckii-Krein, with the mass)

    dC_ij = F_ij (phi_i^T dK phi_j) + H_ij (phi_i^T dM phi_j),   d_i = 2 zeta_i omega_i,
    F_ij = (d_i - d_j) / (omega_i^2 - omega_j^2),
    H_ij = (d_i + d_j - (omega_i^2 + omega_j^2) F_ij) / 2:

for one zeta, F = 2 zeta/(omega_i + omega_j) and H = omega_i omega_j F. Single damped modes of equal
frequency have no derivative; the part of F from their difference is left out.
"""

from __future__ import annotations

import numpy as np

EQUAL = 1e-9  # relative distance of frequencies that count as equal


class DampingGradient:
    """Derivative of y^H lambda C_d x by K_sym and M, for one pair of vectors.

    Parameters
    ----------
    omega : ndarray (m,)
        Real modes, rad/s.
    zeta : ndarray (m,)
        Their damping ratios.
    lam : complex
    left, right : ndarray (m,) complex
        phi^T M conj(y) and phi^T M x.
    """

    def __init__(
        self,
        omega: np.ndarray,
        zeta: np.ndarray,
        lam: complex,
        left: np.ndarray,
        right: np.ndarray,
    ) -> None:
        self._pairs = lam * np.outer(left, right)
        self._F, self._H = damping_factors(omega, zeta)

    def by_stiffness(self, dK: np.ndarray) -> complex:
        """By phi^T dK_sym phi (m, m)."""
        return complex((self._pairs * self._F * dK).sum())

    def by_mass(self, dM: np.ndarray) -> complex:
        """By phi^T dM phi (m, m)."""
        return complex((self._pairs * self._H * dM).sum())

    def by_rows(self, rows: np.ndarray) -> np.ndarray:
        """By the weights w (r,) of a stiffness R^T diag(w) R, rows = R phi (r, m)."""
        G = self._pairs * self._F
        by_weight: np.ndarray = np.einsum("ri,ri->r", rows @ G, rows)
        return by_weight


def damping_factors(omega: np.ndarray, zeta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and H (m, m) of the module's formula."""
    total = omega[:, None] + omega[None, :]
    apart = omega[:, None] - omega[None, :]
    unequal = np.abs(apart) > EQUAL * total
    ratio = np.where(unequal, total / np.where(unequal, apart, 1.0), 0.0)
    F = (zeta[:, None] + zeta[None, :]) + (zeta[:, None] - zeta[None, :]) * ratio
    F = F / np.maximum(total, 1e-300)
    d = 2.0 * zeta * omega
    squares = omega[:, None] ** 2 + omega[None, :] ** 2
    return F, (d[:, None] + d[None, :] - squares * F) / 2.0
