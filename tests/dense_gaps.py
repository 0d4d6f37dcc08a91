"""Newton in the gaps as THEORY.md (13), (14) have it: dense, a new matrix each step."""

from __future__ import annotations

import numpy as np

from squealstudy.reduction.gap_equations import GapEquations


def compliances(space):
    """H_NN and H_NT (nc, nc), H_Nf (nc, 2)."""
    H_NN = space.S_N @ space.C_NN @ space.S_N.T
    H_NT = (space.S_T @ (space.S_N @ space.C_TN.T).T).T
    return H_NN, H_NT, space.S_N @ space.C_Nf


def jacobian(space, operating, p, kappa):
    """dF/dg (nc, nc)."""
    H_NN, H_NT, _ = compliances(space)
    grip = space.frictional * operating.friction_at(p, space.speed_factor).following(p)
    J = H_NN * (space.area * (kappa - space.k_c)) - H_NT * (space.area * grip * kappa)
    return np.eye(len(J)) + J


def newton(space, operating, g, steps=60):
    """Gaps (nc,) by Newton's method whose steps close no point by more than three gap scales."""
    equations = GapEquations(space, [operating])
    for _ in range(steps):
        (F,), (p,), (kappa,) = equations.imbalance(g[None])
        step = np.linalg.solve(jacobian(space, operating, p, kappa), -F)
        level = np.abs(space.area @ p) / space.area.sum()
        closing = (np.minimum(g, operating.law.gap_at(level)) - g - step).max()
        share = min(1.0, 3.0 * operating.law.gap_scale(level) / max(closing, 1e-300))
        g = g + share * step
        if share == 1.0 and np.abs(step).max() <= 1e-13 * np.abs(g).max():
            break
    return g
