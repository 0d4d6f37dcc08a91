"""Vectors that a basis has beside component modes and traces: load responses (THEORY.md (26))."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sp

from squealstudy.laws.own_friction import sticks_in_time
from squealstudy.linalg.real_modes import real_modes
from squealstudy.reduction.projected import AnyAssembly
from squealstudy.reduction.working_point import WorkingPoint


def load_responses(
    assembly: AnyAssembly,
    solve: Callable[[np.ndarray], np.ndarray],
    nominal: WorkingPoint,
    others: Sequence[WorkingPoint],
    phi: np.ndarray,
) -> np.ndarray:
    """Static responses (n_dof, k) to contact loads that the modes `phi` (n_dof, m) make.

    These are the loads of friction damping, of friction that follows the pressure, and of the
    change of contact stiffness at each of the `others`. Without the first two the basis has an
    error floor for complex modes (THEORY.md eq. (26)); the last serve design points at other
    pressures than the nominal one. `solve` applies the inverse of a stiffness.
    """
    if not phi.shape[1]:
        return np.zeros((assembly.n_dof, 0))
    c = assembly.contact
    k_n = c.area * nominal.tangent
    drag = c.area * c.frictional * nominal.contact_pressure
    drag = drag / np.where(c.speed_factor == 0.0, 1.0, c.speed_factor)
    normal = c.N @ phi
    loads = [
        c.T_perp.T @ (drag[:, None] * (c.T_perp @ phi)),
        c.T.T @ ((c.frictional * k_n)[:, None] * normal),
        *(c.N.T @ ((c.area * w.tangent - k_n)[:, None] * normal) for w in others),
    ]
    return np.hstack([_match_size(solve(load), phi) for load in loads])


def sticking_modes(
    assembly: AnyAssembly, K: sp.csr_matrix, k_c: np.ndarray, cutoff: float
) -> np.ndarray:
    """Modes (n_dof, m) up to a cutoff [Hz] with those points held whose own friction can stick.

    In runs in time these points stick, and the modes of the stiffness K let them slide.
    """
    c = assembly.contact
    sticks = sticks_in_time(c.own_friction)
    if not sticks.any():
        return np.zeros((assembly.n_dof, 0))
    k_stuck = sp.diags(np.where(sticks, k_c.max() * c.area, 0.0))
    K_stuck = K + c.T.T @ k_stuck @ c.T + c.T_perp.T @ k_stuck @ c.T_perp
    return real_modes(assembly.M, K_stuck, cutoff)[1]


def _match_size(X: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Scale load responses as a block to the norm of the modes; a block of zeros is dropped."""
    size = np.linalg.norm(X)
    return X * (np.linalg.norm(phi) / size) if size > 0 else X[:, :0]
