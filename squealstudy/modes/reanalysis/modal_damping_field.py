"""Modal damping of the assembly over a box: few fixed matrices with interpolated weights.

One damping ratio zeta of all real modes is C = 2 zeta K_sym^(1/2) where the mass is the identity.
The root is a smooth function of the design point: polynomials through nodes, truncated by SVD.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.system.linearise import modal_damping

TRUNCATION = 1e-6  # singular values of the roots, relative to the largest, that are dropped
Cardinals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class ModalDampingField:
    """K_sym^(1/2) at theta as sum of weights(theta)_j matrices_j.

    Attributes
    ----------
    matrices : ndarray (q, n, n)
        Symmetric, rad/s.
    at_nodes : ndarray (p, q)
        Weights at the nodes.
    cardinals : callable
        theta (b, d) -> (b, p).
    """

    matrices: np.ndarray
    at_nodes: np.ndarray
    cardinals: Cardinals

    def weights(self, theta: np.ndarray) -> np.ndarray:
        """Weights (b, q) at theta (b, d)."""
        found: np.ndarray = self.cardinals(theta) @ self.at_nodes
        return found

    def error(self, theta: np.ndarray, K_sym: np.ndarray, top: float) -> float:
        """Largest relative error of the damping of the real modes up to `top` rad/s at theta (d,).

        K_sym (n, n) is the symmetric stiffness there.
        """
        w2, phi = la.eigh(K_sym, subset_by_value=(0.0, top**2))
        S = np.tensordot(self.weights(theta[None])[0], self.matrices, 1)
        omega = np.sqrt(w2)
        damping = np.einsum("ij,ij->j", phi, S @ phi)
        return float((np.abs(damping - omega) / omega).max(initial=0.0))


def modal_damping_field(K_sym: Sequence[np.ndarray], cardinals: Cardinals) -> ModalDampingField:
    """The field through nodes with symmetric stiffnesses K_sym (p of (n, n))."""
    n = len(K_sym[0])
    roots = np.array([modal_damping(K, np.full(n, 0.5)).ravel() for K in K_sym])
    values, vectors = la.eigh(roots @ roots.T)
    s = np.sqrt(np.maximum(values[::-1], 0.0))
    U = vectors[:, ::-1][:, s > TRUNCATION * s[0]]
    return ModalDampingField((U.T @ roots).reshape(-1, n, n), U, cardinals)
