"""What gyroscopic terms of a turning disc do to modes of a design point, to first order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import DesignState
from squealstudy.modes.point import linearised_point
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.root_pairs import LIGHT_DAMPING

MOST_MODES = 6  # those of fastest growth
OFF_ROOT = 1e-8  # relative: where Q is factored
CONDITION_LIMIT = 100.0  # of an eigenvalue, beyond which first order means nothing


@dataclass(frozen=True)
class TurningEffect:
    """First-order changes of the lightly damped modes that grow fastest.

    Attributes
    ----------
    growth : float
        Largest change of a growth rate, 1/s.
    frequency : float
        Largest relative change of a frequency.
    decided : int
        Modes whose growth has another sign with gyroscopic terms than without.
    """

    growth: float
    frequency: float
    decided: int


def turning_effect(
    prepared: PreparedModel, state: DesignState, lam: np.ndarray, gap: np.ndarray | None = None
) -> TurningEffect | None:
    """What whole gyroscopic terms do to modes with known roots; None of a structure without any.

    Parameters
    ----------
    prepared : PreparedModel
    state : DesignState
        With a part of these terms, or none.
    lam : ndarray (m,) complex
        Roots of the state, rad/s.
    gap : ndarray (nc,) or None
        Gaps of its working point, where they are known.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    G = prepared.model.turning
    if G is None:
        return None
    _, system = linearised_point(prepared, state, gap)
    light = lam[(lam.imag > 0) & (np.abs(lam.real) < LIGHT_DAMPING * np.abs(lam))]
    light = light[np.argsort(-light.real)][:MOST_MODES]
    factor = state.operating.gyroscopic
    without, with_all = [np.zeros(0, complex)], [np.zeros(0, complex)]
    for root in light:
        x, y = _vectors(system.C, system.K, root)
        slope = 2.0 * root * np.vdot(y, x) + np.vdot(y, system.C @ x)
        size = np.abs(root) * la.norm(x) * la.norm(y)
        if size > CONDITION_LIMIT * np.abs(slope):
            continue
        whole = -state.operating.sliding_speed * root * np.vdot(y, G @ x) / slope
        without.append(np.array([root - factor * whole]))
        with_all.append(np.array([root + (1.0 - factor) * whole]))
    a, b = np.concatenate(without), np.concatenate(with_all)
    return TurningEffect(
        growth=float(np.abs(b.real - a.real).max(initial=0.0)),
        frequency=float(np.abs(np.abs(b) / np.abs(a) - 1.0).max(initial=0.0)),
        decided=int(((a.real > 0) != (b.real > 0)).sum()),
    )


def _vectors(C: np.ndarray, K: np.ndarray, root: complex) -> tuple[np.ndarray, np.ndarray]:
    """Right and left vectors (n,) of a root, by inverse iteration."""
    at = root * (1.0 + OFF_ROOT)
    Q = at * C + K
    Q[np.diag_indices_from(Q)] += at * at
    factors = la.lu_factor(Q, overwrite_a=True, check_finite=False)
    x = y = np.random.default_rng(0).standard_normal(len(K)) + 0j
    for _ in range(2):
        x, y = la.lu_solve(factors, x), la.lu_solve(factors, y, trans=2)
        x, y = x / la.norm(x), y / la.norm(y)
    return x, y
