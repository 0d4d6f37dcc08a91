"""A root after a finite change: the same mode, found again by shift and invert."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from squealstudy.linalg.nearest_roots import nearest_roots
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.modes.point import state_working_point
from squealstudy.modes.sensitivity.mode_family import OFFSET, ModeFamily
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.system.design_state import DesignState
from squealstudy.system.linearise import linearise

CANDIDATES = 8  # roots about the old one among which the mode is looked for


@dataclass(frozen=True)
class FiniteChange:
    """Change of a root [rad/s], and how surely it is the same mode.

    `match` is |y^H ((lambda + lambda') M + C) x'| beside |y^H Q'(lambda) x|, with the left vector
    y and the pencil of the unchanged mode and x' of unit mass norm: 1 for the mode itself, 0 for
    every other one of the unchanged system.
    """

    change: complex
    match: float


def followed_root(
    base: QuadraticPencil, family: ModeFamily, changed: QuadraticPencil
) -> FiniteChange:
    """The family's first mode in a changed pencil.

    Raises
    ------
    ConvergenceError
        Where ARPACK does not converge.
    """
    lam, y = family.lam[0], family.Y[:, 0]
    sigma = lam * (1.0 + OFFSET)
    factor = changed.factor(sigma)
    roots, X = nearest_roots(changed, factor, sigma, CANDIDATES, family.X[:, 0])
    X = X / np.sqrt(np.einsum("ij,ij->j", X.conj(), base.M @ X).real)
    seen = (lam + roots) * (y.conj() @ (base.M @ X)) + y.conj() @ (base.C @ X)
    match = np.abs(seen) / max(float(np.abs(family.norm[0])), 1e-300)
    best = int(np.argmax(match))
    return FiniteChange(complex(roots[best] - lam), float(match[best]))


def reduced_pencil(
    prepared: PreparedModel, state: DesignState, known_gap: np.ndarray | None
) -> QuadraticPencil:
    """The reduced system of a design state about its own working point.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    point = state_working_point(prepared, state, known_gap)
    system = linearise(prepared.model, point, state)
    one = sp.identity(prepared.model.n, format="csr")
    return QuadraticPencil(one, system.C, system.K)
