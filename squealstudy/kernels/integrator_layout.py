"""What the integrators beside Newmark add to the arrays of newmark_layout."""

from __future__ import annotations

from typing import NamedTuple

from squealstudy.kernels import newmark_layout as layout

# row of Work.point: change of gap in the accepted state
X_START = layout.N_POINT
N_POINT = X_START + 1
# column of Work.real: energy that the initial state, contact and loads may set free, J
SCALE = layout.N_REAL
N_REAL = SCALE + 1

# rows of an exponential step's coefficients: propagator of (q, v), then what forces constant,
# linear and quadratic over the step add to q and v
E_QQ, E_QV, E_VQ, E_VV, P1_Q, P1_V, P2_Q, P2_V, P3_Q, P3_V = range(10)
N_COEFFICIENT = 10


class Scheme(NamedTuple):
    """A member of the generalised-alpha family (Chung & Hulbert 1993)."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    gradient: bool  # contact forces by difference quotients of their potential
