"""Modal damping of an assembly: of its real modes without friction (THEORY.md eq. (18))."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import DesignState

Modes = tuple[np.ndarray, np.ndarray]  # squares of frequencies (n,) [(rad/s)^2], shapes (n, n)


def assembly_damping(
    K_sym: np.ndarray, state: DesignState, damped_to: float = np.inf
) -> tuple[np.ndarray | float, Modes | None]:
    """Modal damping (n, n) [rad/s] of a design point, and its real modes; 0 and None without any.

    Raises
    ------
    ParameterError
        Damping of an assembly mode that the basis does not have.
    """
    zeta = state.assembly_damping_ratios(len(K_sym))
    if not zeta.any():
        return 0.0, None
    modes = la.eigh(K_sym, driver="evd")  # of all modes: half the time of the default
    return modal_damping(modes, zeta, damped_to), modes


def modal_damping(modes: Modes, zeta: np.ndarray, damped_to: float = np.inf) -> np.ndarray:
    """Modal damping (n, n): sum of phi 2 zeta min(omega, damped_to) phi^T, zeta (n,).

    THEORY.md eq. (18) where the mass is the identity; modes are of the symmetric stiffness. Those
    beyond `damped_to` [rad/s] have the coefficient of a mode there.
    """
    omega, phi = np.sqrt(np.maximum(modes[0], 0.0)), modes[1]
    rates = 2.0 * zeta * np.minimum(omega, damped_to)
    if (rates < 0).any():
        return (phi * rates) @ phi.T
    half = phi * np.sqrt(rates)
    return half @ half.T  # half the work: BLAS sees that this is symmetric
