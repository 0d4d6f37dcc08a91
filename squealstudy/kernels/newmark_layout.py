"""What the integrators of modal systems read and write: named tuples of arrays, their columns.

They serve all one-step methods whose end is affine in the forces there: average acceleration and
exact free motion differ in Modal.steps alone.

n modes (rounded up to whole vector registers, the rest zero), nc contact points (in `points` and
`point` rounded up to whole tiles), nt tiles of points, nb design points, m shapes, ns sensors,
L halvings. Every array of a design has the design first, so that its part is contiguous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# status of a design
RUNNING, DONE, NOT_CONVERGED, NOT_FINITE, SINGULAR, BLOWN_UP = 0, 1, 2, 3, 4, 5

START, FIXED, NEWTON = 0, 1, 2  # what the next evaluation of a design serves

# columns of Work.counts
STATUS, MODE, STEP, POSITION, HALVING, ITERATION = 0, 1, 2, 3, 4, 5
STEP_PASSES, PASSES, MAX_PASSES, HALVINGS, NEWTON_STEPS, SAVED = 6, 7, 8, 9, 10, 11
PAUSE = 12  # the step after which the kernel returns; it must be later before the next call
CUTS = 13  # sub-steps made again because a contact point met a corner of its law in them
EQUAL = 14  # accepted sub-steps of the present length, one after the other
N_COUNT = 15

# columns of Work.real: sub-step and the one before s; Aitken factor; squared residual of the
# iteration before; square of the smallest force that means anything; Newton's damping; largest
# contraction factor; work of the loads and of the belt, dissipation by friction and damping,
# stored energy at the start and at the end, J
SUBSTEP, SUBSTEP_OLD, OMEGA, E2_OLD, FLOOR2, STEP_LENGTH = 0, 1, 2, 3, 4, 5
CONTRACTION, W_LOAD, W_BELT, D_FRICTION, D_DAMPING = 6, 7, 8, 9, 10
STORED_START, STORED_END = 11, 12
N_REAL = 13

HISTORY = (
    "time",  # s
    "torque",  # N m, positive when it brakes
    "normal_force",  # N, of the points with friction
    "stick",  # shares of their area
    "slip",
    "open",
    "work_load",  # J, since the start
    "work_belt",
    "dissipated_friction",
    "dissipated_damping",
    "stored",  # J, from the reference state, loads of the reference included
    "modal_energy",  # J, (v^2 + w^2 q^2) / 2 of all modes
    "creep",  # largest speed of a point that sticks over its imposed one; 0 where none does
    # over all steps since the row before, not at the row; NaN where an integrator has no such sums
    "torque_mean",  # N m
    "torque_variance",  # N2 m2, about that mean
    "torque_min",  # N m
    "torque_max",
    "stick_mean",
    "stick_max",
    "open_mean",
    "open_max",
    "creep_max",
    "modal_energy_mean",  # J
)
# their places in a row; WORK is the first of four: of loads, belt, friction, damping
TIME, TORQUE, NORMAL_FORCE, STICK, SLIP, OPEN = 0, 1, 2, 3, 4, 5
WORK, STORED, MODAL_ENERGY, CREEP = 6, 10, 11, 12
TORQUE_MEAN, TORQUE_VARIANCE, TORQUE_MIN, TORQUE_MAX = 13, 14, 15, 16
STICK_MEAN, STICK_MAX, OPEN_MEAN, OPEN_MAX, CREEP_MAX, ENERGY_MEAN = 17, 18, 19, 20, 21, 22

# columns of Work.sums since the last saved row: time s; integrals of torque and its square, both
# less its value at that row, of shares and energy; extremes; then values at the end of the last
# sub-step
SUM_TIME, SUM_TORQUE, SUM_SQUARE, SUM_STICK, SUM_OPEN, SUM_ENERGY = 0, 1, 2, 3, 4, 5
LEAST_TORQUE, MOST_TORQUE, MOST_STICK, MOST_OPEN, MOST_CREEP = 6, 7, 8, 9, 10
ROW_TORQUE, NOW_TORQUE, NOW_STICK, NOW_OPEN = 11, 12, 13, 14
N_SUM = 15

# points: base gap m, area m2, factor on friction, arm of the torque m (negative where the
# sliding is), contact stiffness N/m inside the diagonal stiffness, base forces N, sliding velocity
# m/s of the base state; 1 of a spring, 0 of contact, then the five numbers of a spring; where in
# the row of laws that of the point begins: 0, the study's, NO_CONTACT for springs
POINT_GAP, POINT_AREA, POINT_FRICTION, POINT_RADIUS = 0, 1, 2, 3
POINT_STIFFNESS, POINT_NORMAL, POINT_T1, POINT_T2, POINT_SPEED = 4, 5, 6, 7, 8
POINT_SPRING, POINT_SPRING_STIFFNESS, POINT_SPRING_CUBIC = 9, 10, 11
POINT_SPRING_GAP, POINT_SPRING_SIDE, POINT_SPRING_DAMPING = 12, 13, 14
POINT_LAW = 15
N_POINT_ROWS = 16
NO_CONTACT = -1.0
# point: change of gap m, sliding velocity m/s, pressure Pa, friction force N; generalised forces N
OUT_X, OUT_W1, OUT_W2, OUT_P, OUT_T1, OUT_T2 = 0, 1, 2, 3, 4, 5
R_N, R_1, R_2 = 6, 7, 8
# places in a design's row of laws: codes of contact law, curve (CONSTANT for none) and
# regularisation, OUTSIDE for those that are not of the package; slope of friction at zero sliding,
# N s/m3; the constant coefficient, of others a typical large one; addresses of the functions of
# laws from outside (kernels/outside.py), zero elsewhere; then values of the contact law's
# parameters, then friction and those of its curve; those of laws from outside come last
LAW_CONTACT, LAW_CURVE, LAW_REGULARISATION, LAW_SLOPE, LAW_MU = 0, 1, 2, 3, 4
LAW_CONTACT_AT, LAW_POTENTIAL, LAW_PRESSURES, LAW_MEAN_PRESSURES = 5, 6, 7, 8
LAW_MU_AT, LAW_RESISTANCE, LAW_STICK_SLOPE, LAW_PARTIALS, LAW_FRICTIONS = 9, 10, 11, 12, 13
LAW_FIRST = 14
CONSTANT, OUTSIDE = -1, 1000

# rows of Modal.modes
W2, C, LOAD = 0, 1, 2
# rows of Schedule.ratios; of its loads: what stays, and that of the brake pressure
SPEED_RATIO, PRESSURE_RATIO = 0, 1
STAYING, PRESSING = 0, 1
# rows of Modal.steps: propagator of (q, v); answers in q and v to the pull at the start and at the
# end of a sub-step
QQ, QV, VQ, VV, FIRST_Q, FIRST_V, LAST_Q, LAST_V = 0, 1, 2, 3, 4, 5, 6, 7
N_STEP = 8
# rows of Work.x: accepted state, its acceleration (of methods that need it), its pull: all forces
# but those of the diagonal system, loads included; that of the state before; q and v of the new
# time without the part of the new pull; trial state; B^T r there; residual, then correction;
# correction before; room; velocity at the last evaluation and D times it (newmark_between), and the
# same of the accepted state
Q, V, A, PULL, PULL_OLD, Q_BASE, V_BASE = 0, 1, 2, 3, 4, 5, 6
Q_TRIAL, V_TRIAL, PULL_TRIAL, FORCE, DELTA, DELTA_OLD, ROOM = 7, 8, 9, 10, 11, 12, 13
V_SEEN, RESISTED, V_SEEN_OLD, RESISTED_OLD = 14, 15, 16, 17
SUM_QQ, SUM_VV = 18, 19  # integrals of q^2 and v^2 since the last saved row
N_ROWS = 20
# rows of Work.point after OUT_* and R_* of the trial state: w1, w2, t1, t2 accepted last; t1, t2 of
# the iteration before; their change a second over the last sub-step
OLD_W1, OLD_W2, OLD_T1, OLD_T2, GUESS_1, GUESS_2, RATE_1, RATE_2 = 9, 10, 11, 12, 13, 14, 15, 16
REGIME, OUT_REGIME = 17, 18  # of the accepted and of the evaluated state
N_POINT = 19
SLIPS, STICKS, IS_OPEN = 0, 1, 2  # regimes

# of the integrators beside Newmark, and of hybrid runs
# row of Work.point: change of gap in the accepted state
X_START = N_POINT
N_POINT_GAP = X_START + 1
# column of Work.real: energy that the initial state, contact and loads may set free, J
SCALE = N_REAL

# rows of an exponential step's coefficients: propagator of (q, v), then what forces constant,
# linear and quadratic over the step add to q and v
E_QQ, E_QV, E_VQ, E_VV, P1_Q, P1_V, P2_Q, P2_V, P3_Q, P3_V = range(10)
N_COEFFICIENT = 10


class ModalArrays(NamedTuple):
    """The design points; see motion.system for units. W2 contains N^T k_ref N."""

    points: np.ndarray  # (nb, N_POINT_ROWS, nc) rows POINT_*
    laws: np.ndarray  # (nb, N_LAW or more) laws.law_row, then those of points with their own
    modes: np.ndarray  # (nb, 3, n) rows W2, C, LOAD
    steps: np.ndarray  # (nb, L + 1, N_STEP, n) coefficients of a sub-step by halving level
    shapes: np.ndarray  # (m, n) rows u: C += u d u^T, K += u s u^T
    component_terms: np.ndarray  # (nb, 2, m) d, s
    between: np.ndarray  # (.., n, n) f4, dampings D between coordinates, diagonal zero, 1/s
    between_of: np.ndarray  # (nb,) int, the place of each design's D; -1 where it has none
    turning: np.ndarray  # (.., n, n) f4, gyroscopic matrices G, skew-symmetric, 1/s
    turning_of: np.ndarray  # (nb,) int, the place of each design's G; -1 where it has none
    fixed: np.ndarray  # (nb, 2, nc) in the Jacobian: N/m beyond k_ref, tangential N s/m
    sensors: np.ndarray  # (nb, ns, n) zeros where a design has fewer
    tangential: np.ndarray  # (2 nc, n) T1 and T2 of each point
    compliance: np.ndarray  # (2 nc, 2 nc) T diag(LAST_V) T^T of the first design's whole step
    self_compliance: np.ndarray  # (nc,) larger of each point's two diagonal entries of compliance


class StepSettings(NamedTuple):
    """How to integrate."""

    h: float
    n_steps: int
    save_every: int  # 0: nothing is saved
    tolerance: float  # force balance, relative
    tolerance_t: float  # change of the friction forces between iterations, relative
    max_iterations: int
    max_halvings: int  # of a sub-step that fails
    corner_halvings: int  # of one in which a point meets a corner of its law; 0: it is not cut
    levels: int  # the larger of both: halvings for which there are coefficients
    newton: bool  # the reference method: a fresh Jacobian at every iteration
    aitken: bool
    dense: bool  # the fixed Jacobian is not diagonal
    extrapolate: bool  # forces of the last two steps predict the next ones; else the last alone
    changes: float  # share of the products of changes in works, see newmark_output.add_work


class WorkArrays(NamedTuple):
    """State of the iteration; rows Q, V at the end are the final state."""

    x: np.ndarray  # (nb, N_ROWS, n)
    point: np.ndarray  # (nb, N_POINT, nc)
    lu: np.ndarray  # (nb (L + 1) + 1, n, n) factors by design and halving level; Newton's last
    pivots: np.ndarray  # (nb (L + 1) + 1, n)
    counts: np.ndarray  # (nb, N_COUNT) int
    real: np.ndarray  # (nb, N_REAL)
    sums: np.ndarray  # (nb, N_SUM)
    now: np.ndarray  # (nb, len(HISTORY)) of the accepted state, what sums need of it
    tiles: np.ndarray  # (panel, LANES, ROWS) observed in a panel by each design, then the forces
    lanes: np.ndarray  # (3, n, LANES) q, v and F of the designs in one batched pass
    wide: np.ndarray  # (panel, n, ROWS) a panel of tiles stored in single precision; else (0, ..)
    row: np.ndarray  # (3, n) [N; T1; T2] of one contact point, or room
    running: np.ndarray  # (nb,) int, the designs that run
    listed: np.ndarray  # (nc,) int, stiff points of the design at hand
    stiff: np.ndarray  # (nc, 4) newmark_stiff: state of each
    free: np.ndarray  # (2 nc,) sliding velocities of each
    small: np.ndarray  # (4 nc^2,) their compliance


class SavedArrays(NamedTuple):
    """Decimated histories; as many rows as were saved are filled."""

    history: np.ndarray  # (nb, rows, len(HISTORY))
    sensed: np.ndarray  # (nb, rows, 2, ns) sensors @ q, sensors @ v
    squares: np.ndarray  # (nb, rows, 2, modes) means of q^2 and v^2 since the row before
    q: np.ndarray  # (nb, rows or 0, n)


class ScheduleArrays(NamedTuple):
    """Imposed speed and pressure over time, as ratios of those of the design points."""

    times: np.ndarray  # (m,) s; none where nothing changes
    ratios: np.ndarray  # (nb, 2, m) rows SPEED_RATIO, PRESSURE_RATIO
    speeds: np.ndarray  # (nb, nc) row POINT_SPEED of the points
    loads: np.ndarray  # (nb, 2, n or 0) rows STAYING, PRESSING; none where no pressure changes
    turning: np.ndarray  # (.., n, n) f4, part of Modal.turning that does not depend on speed
    terms_by_speed: np.ndarray  # (.., n, n) f4, part proportional to speed, at the base speed


class Scheme(NamedTuple):
    """A member of the generalised-alpha family (Chung & Hulbert 1993)."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    gradient: bool  # contact forces by difference quotients of their potential
