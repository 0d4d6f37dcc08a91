"""What the hybrid Newmark kernels read and write.

n coordinates, nc contact points, m modes, k damped shapes. The rows of B (3 nc + k, n) are
N, T1, T2 of each contact point in turn, then the shapes; forces r and observed velocities y have
the same order.

The motion is split, q = q_s + phi (alpha - alpha_s). The sparse part q_s has stiffness-
proportional damping alone and costs a forward/back solve a step; alpha are the modal amplitudes
with the damping they should have and alpha_s those of q_s. All three see the same contact forces
and keep Newmark's scheme, so that the sum is the step of the damped system to round-off, and no
dense damping matrix is ever multiplied with or factored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# rows of State.vectors (n,): displacement and velocity of the sparse part, K times both, change
# of velocity in this step, right-hand side
Q, V, KQ, KV, DV, RHS = 0, 1, 2, 3, 4, 5
N_VECTORS = 6
# rows of State.modes (m,): amplitude and velocity, the same of the sparse part, at the start of the
# step; both velocities at its end
ALPHA, RATE, ALPHA_S, RATE_S, RATE_END, RATE_S_END = 0, 1, 2, 3, 4, 5
N_MODES = 6
# rows of State.rows (3 nc + k,): forces that the last step leaves to the next; forces of this step
# as the state holds them, as predicted and as found; velocities B v at the start and at the end;
# forces found at the last MOST_TIMES times, youngest first
LEFT, R, R_GUESS, FOUND, Y, Y_END, PAST = 0, 1, 2, 3, 4, 5, 6
MOST_TIMES = 5
N_ROWS = PAST + MOST_TIMES
# State.work: work of the loads and of the belt, dissipation by friction and damping, J
W_LOAD, W_BELT, D_FRICTION, D_DAMPING = 0, 1, 2, 3


class Sparse(NamedTuple):
    """A sparse matrix in compressed rows, for kernels."""

    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


class HybridArrays(NamedTuple):
    """Constants of a run."""

    K: Sparse  # (n, n)
    B: Sparse  # (3 nc + k, n)
    B_modes: np.ndarray  # (3 nc + k, m) B phi
    points: np.ndarray  # (nc, N_POINT_ROWS) columns newmark_layout.POINT_*
    law: np.ndarray  # (N_LAW,) laws.law_row
    omega2: np.ndarray  # (m,)
    c: np.ndarray  # (m,) modal damping, rad/s
    beta: float  # s, stiffness-proportional damping of the sparse part
    d: np.ndarray  # (k,) damping of the shapes, rad/s


class StepSize(NamedTuple):
    """What belongs to one size of step."""

    h: float
    G: np.ndarray  # (3 nc, 3 nc) change of y_end a newton, shapes eliminated
    G_shapes: np.ndarray  # (3 nc + k, k) the same of a shape's force, before elimination
    X: np.ndarray  # (3 nc + k, n) J^-1 B^T
    shape_inverse: np.ndarray  # (k, k) (1 / d + G of the shapes)^-1
    fill: int  # entries of the triangular factors: multiplications of a solve
    floor2: float  # squared force metric that rounding leaves


class HybridState(NamedTuple):
    """State of a run."""

    vectors: np.ndarray  # (N_VECTORS, n)
    modes: np.ndarray  # (N_MODES, m)
    rows: np.ndarray  # (N_ROWS, 3 nc + k)
    point: np.ndarray  # (nc, N_POINT_GAP) columns of newmark_layout: OUT_*, OLD_*, X_START
    work: np.ndarray  # (4,) J


class Contact(NamedTuple):
    """The contact points in the iteration of a step, which changes y, r and trial."""

    points: np.ndarray  # (nc, N_POINT_ROWS) columns newmark_layout.POINT_*
    law: np.ndarray  # (N_LAW,)
    half: float  # s, by which velocities move the gaps
    x_base: np.ndarray  # (nc,) changes of gap without these velocities
    y: np.ndarray  # (3 nc,) velocities at the end of the step
    r: np.ndarray  # (3 nc,) forces there
    trial: np.ndarray  # (nc, N_POINT_GAP) its columns newmark_layout.OUT_*


class Limits(NamedTuple):
    """When a step is balanced."""

    tolerance: float  # of forces, relative to those of contact and inertia
    tolerance_t: float  # of friction forces, relative to their bounds
    max_iterations: int
