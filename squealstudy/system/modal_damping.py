"""Modal damping of an assembly: damping of its real modes without friction (THEORY.md (18))."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import DesignState

Modes = tuple[np.ndarray, np.ndarray]  # squares of frequencies (n,) [(rad/s)^2], shapes (n, n)


def assembly_damping(
    K_sym: np.ndarray, state: DesignState, damped_to: float = np.inf
) -> tuple[np.ndarray | float, Modes | None]:
    """Modal damping (n, n) [rad/s] of a design point, and its real modes.

    They are 0 and None where the design state damps no assembly mode.

    `damped_to` [rad/s] is explained in `modal_damping`.

    Raises
    ------
    ParameterError
        The state damps an assembly mode that the basis does not have.
    """
    zeta = state.assembly_damping_ratios(len(K_sym))
    if not zeta.any():
        return 0.0, None
    modes = la.eigh(K_sym, driver="evd")  # half the time of the default, for all modes
    return modal_damping(modes, zeta, damped_to), modes


def modal_damping(modes: Modes, zeta: np.ndarray, damped_to: float = np.inf) -> np.ndarray:
    """Modal damping (n, n) [rad/s]: the sum over modes of phi 2 zeta min(omega, damped_to) phi^T.

    This is THEORY.md eq. (18) where the mass is the identity. `modes` are those of the symmetric
    stiffness, `zeta` (n,) their damping ratios. Modes above `damped_to` [rad/s] are damped as if
    their frequency were `damped_to`.
    """
    omega, phi = np.sqrt(np.maximum(modes[0], 0.0)), modes[1]
    rates = 2.0 * zeta * np.minimum(omega, damped_to)
    if (rates < 0).any():
        return (phi * rates) @ phi.T
    damped_modes = phi * np.sqrt(rates)
    return damped_modes @ damped_modes.T  # half the work: NumPy computes one triangle of X X^T only
