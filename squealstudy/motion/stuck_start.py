"""Starts at which friction holds all contact: nothing slides but by a start velocity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.laws.own_friction import has_own
from squealstudy.laws.spring import evaluate_points
from squealstudy.motion.point import at_rest
from squealstudy.motion.system import ModalSystem, MotionPoint

MAX_REL_SPEED_LEFT = 1e-6  # largest speed of a point that sticks, over the sliding speed
MAX_HOLDS = 50  # most guesses of the set of points that friction holds
HOLD_TOLERANCE = 1e-6  # a creep holds if it changes by less, over its largest speed
N_HALVINGS = 8  # of the share of the pull that friction can hold, where it cannot hold all
MIN_REL_HOLD = 1e-8  # what holds a direction, over the largest: below, it has no creep


def stuck(system: ModalSystem, point: MotionPoint) -> MotionPoint:
    """The point with a start at which nothing slides, but by its own start velocity.

    To that velocity the one of least kinetic energy is added whose contact velocities along and
    across are opposite to the imposed sliding; and the creep at which the friction of points that
    stick, k_t times its speed, holds them (`_creep`). Without it friction would begin at zero and
    rise within 1 / (k_t A T^2), less than a step, which no method resolves.

    Raises
    ------
    ParameterError
        Where the modes cannot bring every point with friction to rest.
    """
    q0, v0 = point.start(system.n)
    has_friction = system.frictional > 0
    T = np.vstack([system.T1[has_friction], system.T2[has_friction]])
    if not len(T):
        return replace(point, q0=q0, v0=v0)
    speed = np.concatenate([system.speed_factor[has_friction], np.zeros(int(has_friction.sum()))])
    at_unit_speed = np.linalg.lstsq(T, -speed, rcond=None)[0]
    v = point.first_speed * at_unit_speed
    lacking = float(np.abs(T @ v + point.first_speed * speed).max(initial=0.0))
    if lacking > MAX_REL_SPEED_LEFT * abs(point.speed):
        raise ParameterError(
            "transient.start",
            f"these modes cannot bring all contact points to rest: {lacking:.2g} m/s of sliding "
            f"are left of {abs(point.speed):.3g} m/s",
        )
    push = _pull_without_friction(system, point, q0, v) - _first_rise(point) * at_unit_speed
    return replace(point, q0=q0, v0=v0 + v + _creep(system, point, T, q0, push))


def _first_rise(point: MotionPoint) -> float:
    """Acceleration [m/s2] of the imposed sliding at the start."""
    if point.schedule is None:
        return 0.0
    later = point.schedule.times[point.schedule.times > 0.0]
    if not len(later):
        return 0.0
    return (float(point.schedule.speed_at(later[0])) * point.speed - point.first_speed) / later[0]


def _pull_without_friction(
    system: ModalSystem, point: MotionPoint, q: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """All forces but friction on the modes (n,) at displacements and velocities, N/sqrt(kg)."""
    gap, force = point.base(system)
    p, _ = evaluate_points(point.contact, system.spring_points, gap + system.N @ q)
    normal = system.area * p - force[:, 0] + system.k_ref * (system.N @ q)
    pull = system.N.T @ normal - system.T1.T @ force[:, 1] - system.T2.T @ force[:, 2]
    pull -= system.omega2 * q + point.c * v
    if point.load is not None:
        pull += point.load
    U = system.shapes
    for coefficients, x in ((point.s, q), (point.d, v)):
        if coefficients is not None:
            pull -= U.T @ (coefficients * (U @ x))
    if point.damping_between is not None:
        pull -= point.damping_between @ v
    if (over_time := point.schedule) is None:
        return np.asarray(pull)
    if over_time.pressing is not None:
        pull += (float(over_time.pressure_at(0.0)) - 1.0) * over_time.pressing
    if over_time.turning is not None:
        pull -= (float(over_time.speed_at(0.0)) - 1.0) * (over_time.turning @ v)
    return np.asarray(pull)


def _creep(
    system: ModalSystem, point: MotionPoint, T: np.ndarray, q0: np.ndarray, push: np.ndarray
) -> np.ndarray:
    """Velocity (n,) at which friction takes from the pull all that would accelerate the contact.

    Where its bounds cannot hold the contact, friction begins with the share that they can hold.
    """
    law, rubbing = point.friction, system.frictional > 0
    gap, _ = point.base(system)
    p = np.maximum(
        evaluate_points(point.contact, system.spring_points, gap + system.N @ q0)[0], 0.0
    )
    mu = law.curve.at_rest(law.friction, p)
    if has_own(system.own_friction):
        mu = at_rest(law, system.own_friction, system.speed_factor, p)
    bound = (system.frictional * mu * p)[rubbing]
    _, size, rows = np.linalg.svd(T, full_matrices=False)
    basis = rows[size > size.max(initial=0.0) * len(T) * np.finfo(float).eps].T
    along, pull = T @ basis, basis.T @ push
    damping = basis.T * point.c @ basis
    creep, share, step = np.zeros(len(pull)), 1.0, 0.5
    for _ in range(1 + N_HALVINGS):
        holding = _holding_creep(along, damping, system.area[rubbing], bound, law.k_t, share * pull)
        if holding is not None:
            creep = holding
            if share == 1.0:
                break
        share += step if holding is not None else -step
        step *= 0.5
    return np.asarray(basis @ creep)


def _holding_creep(
    along: np.ndarray,
    other_damping: np.ndarray,
    area: np.ndarray,
    bound: np.ndarray,
    k_t: float,
    pull: np.ndarray,
) -> np.ndarray | None:
    """Creep along the columns of `along` at which friction holds a pull; None where it cannot.

    `other_damping` (k, k) is that without friction. Points at their bound have the slope from zero
    to it; which ones are is found by trying.
    """
    slopes, velocity = np.where(bound > 0.0, k_t, 0.0), np.zeros(len(along))
    for _ in range(MAX_HOLDS):
        before = velocity
        damping = other_damping + along.T * np.tile(area * slopes, 2) @ along
        creep = np.asarray(np.linalg.lstsq(damping, pull, rcond=MIN_REL_HOLD)[0])
        velocity = along @ creep
        w = np.hypot(*velocity.reshape(2, len(area)))
        slopes = np.minimum(bound / np.maximum(w, np.finfo(float).tiny), k_t)
        if np.abs(velocity - before).max() <= HOLD_TOLERANCE * w.max():
            return creep if k_t * w[bound > 0.0].max(initial=0.0) <= bound.max() else None
    return None
