"""One design point of a transient study on shared reference modes: base state, laws, forecast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laws import FrictionLaw
from squealstudy.laws.own_friction import (
    NOT_IN_TIME,
    has_own,
    is_unmoved,
    own_mu,
    own_values,
    starts_in_time,
)
from squealstudy.models.contact_points import ContactPoints
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.motion.growing_modes import GrowingModes, growing_modes
from squealstudy.motion.integrator import KernelIntegrator
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.motion.step_roots import LinearMotions, integrated_roots
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.contact_weights import ContactWeights, contact_weights, over_speed
from squealstudy.system.linearise import StructureWeights, structure_weights

LEAST_FRICTION = 1e-3  # for smaller friction coefficients the slope is not reduced further
LEAST_PRESSURE = 1e-300  # Pa; keeps the slope positive


def friction_law(
    contact: ContactPoints,
    state: DesignState,
    point: WorkingPoint,
    slope: float,
    saturation: float,
    kind: str,
) -> FrictionLaw:
    """Friction of a design point, regularised at zero sliding.

    Parameters
    ----------
    contact : ContactPoints
    state : DesignState
    point : WorkingPoint
        Working point of `state`.
    slope : float
        Slope k_t of friction at zero sliding, N s/m3; 0 for `automatic_slope`.
    saturation : float
        Sliding speed [m/s] for `automatic_slope`; not used with a slope.
    kind : str
        Kind of regularisation, ``regularised`` or ``smooth``.

    Raises
    ------
    ParameterError
        A slope so small that friction does not saturate at the sliding speed.
    ModelError
        Friction of single points that runs in time cannot start with.
    """
    own_friction = contact.own_friction
    if not starts_in_time(own_friction, contact.speed_factor):
        raise ModelError(NOT_IN_TIME)
    operating, automatic = state.operating, slope <= 0
    k_t = automatic_slope(contact, state, point, saturation) if automatic else slope
    friction = FrictionLaw(
        friction=operating.friction, k_t=k_t, curve=operating.curve, regularisation=kind
    )
    traction = operating.traction(point.contact_pressure, contact.speed_factor, own_friction)
    speeds = operating.sliding_speed * contact.speed_factor
    # slopes that have reached the bound at each point's sliding speed
    slopes = friction.saturation * over_speed(contact.frictional * traction, speeds)
    critical = int(np.argmax(slopes))
    least, speed = float(slopes[critical]), abs(float(speeds[critical]))
    if k_t >= least:
        return friction
    if automatic:
        raise ParameterError(
            "contact.regularisation_speed",
            f"friction must saturate at the sliding speed of {speed:g} m/s: at most "
            f"{saturation * k_t / least:.3g} m/s is allowed, got {saturation:.3g}",
        )
    raise ParameterError(
        "contact.kt",
        f"friction must saturate at the sliding speed: at least {least:.3g} N s/m3 is needed, "
        f"got {k_t:.3g}",
    )


def automatic_slope(
    contact: ContactPoints, state: DesignState, point: WorkingPoint, speed: float
) -> float:
    """Slope k_t of friction at zero sliding [N s/m3] that saturates at a sliding speed [m/s].

    The slope is that of the point with the largest bound of friction, with its static friction
    coefficient. That need not be the point of highest pressure: friction may fall with pressure.
    """
    operating, p = state.operating, np.maximum(point.contact_pressure, LEAST_PRESSURE)
    mu = operating.curve.at_rest(operating.friction, p)
    if has_own(contact.own_friction):
        mu = at_rest(operating, contact.own_friction, contact.speed_factor, p)
    mu = np.maximum(mu, LEAST_FRICTION)
    rubbing = contact.frictional > 0
    return float((contact.frictional * mu * p)[rubbing].max(initial=LEAST_PRESSURE) / speed)


def at_rest(
    operating: OperatingPoint | FrictionLaw,
    own_friction: np.ndarray,
    speed_factor: np.ndarray,
    p: np.ndarray,
) -> np.ndarray:
    """Static friction coefficients (nc,) at pressures p; some points have a law of their own."""
    values = (operating.friction, operating.curve.parameters)
    slow = np.where(is_unmoved(own_friction, speed_factor), 0.0, np.finfo(float).tiny)
    mu: np.ndarray = own_mu(operating.curve.definition, values, own_friction, slow, p)[0]
    stuck = own_values(own_friction, *values)[0]
    return np.where(slow == 0.0, stuck, mu)


def motion_point(
    reference: SharedModes,
    point: WorkingPoint,
    state: DesignState,
    friction: FrictionLaw,
    band_hz: tuple[float, float] | None,
    tolerance: float,
    settings: MotionSettings | None = None,
) -> MotionPoint:
    """The design point in the reference's modes, whose observation matrix it shares.

    Its base state, q = 0, is its own steady sliding; it starts there.

    Parameters
    ----------
    reference : SharedModes
        Made with all component modes that the state changes.
    point : WorkingPoint
        Working point of `state`.
    state : DesignState
    friction : FrictionLaw
    band_hz : (low, high) or None
        Band in which unstable modes are followed; None to follow none.
    tolerance : float
        A mode counts as unstable where its damping ratio is below minus this.
    settings : MotionSettings or None
        Settings of the run, for the roots of followed modes at its step (`step_roots`); None to
        leave these out.

    Raises
    ------
    ParameterError
        Damping of an assembly mode that the reference does not have.
    """
    motion_start = unwatched_point(reference, point, state, friction)
    if band_hz is None:
        return motion_start
    system = reference.system
    return watched_point(system, motion_start, point, state, band_hz, tolerance, settings)


def watched_point(
    system: ModalSystem,
    motion_start: MotionPoint,
    point: WorkingPoint,
    state: DesignState,
    band_hz: tuple[float, float],
    tolerance: float,
    settings: MotionSettings | None,
) -> MotionPoint:
    """An `unwatched_point` with its growing modes; arguments are those of `motion_point`."""
    C, K = tangent(system, motion_start, point, state)
    modes = growing_modes(C, K, system.omega2, band_hz, tolerance)
    motions = LinearMotions(C[None], K[None], system.omega2, motion_start.c[None])
    (growing,) = with_step_roots([modes], motions, settings)
    return replace(motion_start, growing=growing)


def unwatched_point(
    reference: SharedModes, point: WorkingPoint, state: DesignState, friction: FrictionLaw
) -> MotionPoint:
    """The motion point without the complex modes that a run is watched through."""
    system, operating = reference.system, state.operating
    d, s = shape_terms(reference, state)
    c, between = reference.damping.at(state, system.area * point.tangent, s)
    force = point.forces(system, operating)
    return MotionPoint(
        contact=operating.law,
        friction=friction,
        speed=operating.sliding_speed,
        c=c,
        damping_between=between,
        d=d,
        s=s,
        gap=point.gap,
        force=force,
        open_share=point.open_share,
        static_torque=float(-operating.direction * (system.radius @ force[:, 1])),
    )


def with_step_roots(
    modes: Sequence[GrowingModes], motions: LinearMotions, settings: MotionSettings | None
) -> list[GrowingModes]:
    """Modes of design points with their roots at the step of a run (`step_roots`).

    They are unchanged without settings, or where the integrator is not one of the kernel.
    """
    method = None if settings is None else settings.integrator
    counts = [len(point_modes.lam) for point_modes in modes]
    if settings is None or not (any(counts) and isinstance(method, KernelIntegrator)):
        return list(modes)
    owner = np.repeat(np.arange(len(modes)), counts)
    lam = np.concatenate([point_modes.lam for point_modes in modes])
    right = np.concatenate([point_modes.right.T for point_modes in modes])
    roots = integrated_roots(motions, owner, lam, right, method, settings.step)
    parts = np.split(roots, np.cumsum(counts)[:-1], axis=1)
    return [
        replace(point_modes, integrated=part)
        for point_modes, part in zip(modes, parts, strict=True)
    ]


def shape_terms(reference: SharedModes, state: DesignState) -> tuple[np.ndarray, np.ndarray]:
    """Damping [rad/s] and stiffness change [(rad/s)^2] of the system's shapes (m,)."""
    omega, keys = reference.component_frequencies, reference.component_modes
    dampers, changes = state.modal_dampers(omega), state.stiffness_changes(omega)
    d = np.array([dampers.get(key, 0.0) for key in keys])
    return d, np.array([changes.get(key, 0.0) for key in keys])


def weights_in_time(
    system: ModalSystem, design: MotionPoint, point: WorkingPoint, state: DesignState
) -> ContactWeights:
    """Weights of contact and friction at steady sliding, as a run in time has them.

    Points without imposed sliding are at rest, where friction has its slope k_t.
    """
    contact = contact_weights(system, point, state.operating)
    unmoved = is_unmoved(system.own_friction, system.speed_factor)
    if not unmoved.any():
        return contact
    mu = at_rest(state.operating, system.own_friction, system.speed_factor, point.contact_pressure)
    holds = unmoved & (system.frictional * mu * point.contact_pressure > 0.0)
    slope = np.where(holds, system.area * design.friction.k_t, 0.0)
    return contact._replace(across=contact.across + slope, along=contact.along + slope)


def tangent(
    system: ModalSystem, design: MotionPoint, point: WorkingPoint, state: DesignState
) -> tuple[np.ndarray, np.ndarray]:
    """Damping and stiffness of the system linearised at the design's steady sliding (n, n)."""
    contact = weights_in_time(system, design, point, state)
    shapes = (0.0, 0.0) if design.d is None or design.s is None else (design.s, design.d)
    weights = structure_weights(
        (system.omega2, 0.0, shapes[0]),
        contact._replace(normal=contact.normal - system.k_ref),  # k_ref is in omega2 already
        (design.c, shapes[1]),
    )
    structure = system.structure
    structure.system.expect_computable(weights, StructureWeights._fields)
    _, C, K = structure.system.matrices(weights)
    return (C if design.damping_between is None else C + design.damping_between), K


def perturbed(
    system: ModalSystem,
    point: MotionPoint,
    velocity: float,
    modes: Sequence[int] = (),
) -> MotionPoint:
    """The point with a start whose largest velocity at a contact point is `velocity` [m/s].

    The start is the sum of motions along the followed complex modes, each with the same contact
    velocity; or along the real modes `modes` (numbers from 1), with a velocity and no displacement.
    Their signs follow from `contact_sign`, not from what an eigenvalue solver happens to give.
    """
    q0, v0 = np.zeros(system.n), np.zeros(system.n)
    if velocity == 0.0:
        return replace(point, q0=q0, v0=v0)
    if modes:
        for mode in modes:
            unit_row = np.eye(1, system.n, mode - 1)[0]
            v0[mode - 1] = contact_sign(system, unit_row) / contact_speed(system, unit_row)
    else:
        for lam, right in zip(point.growing.lam, point.growing.right.T, strict=True):
            # at this phase the velocity is largest, and the displacement small
            x = right * np.exp(-0.5j * np.angle(np.sum((lam * right) ** 2)))
            size = contact_sign(system, (lam * x).real) * contact_speed(system, lam * x)
            q0 += x.real / size
            v0 += (lam * x).real / size
    factor = velocity / contact_speed(system, v0)
    return replace(point, q0=factor * q0, v0=factor * v0)


def contact_speed(system: ModalSystem, v: np.ndarray) -> float:
    """Largest relative velocity at a contact point [m/s] by modal velocities v (n,); 1 if zero."""
    contacts = system.touching
    parts = [np.abs(rows[contacts] @ v) ** 2 for rows in (system.N, system.T1, system.T2)]
    return float(np.sqrt(np.max(sum(parts), initial=0.0))) or 1.0


def contact_sign(system: ModalSystem, v: np.ndarray) -> float:
    """Sign of the first relative velocity at a contact point above half of the largest, 1 or -1.

    Gaps first, then sliding along and across: the same in any basis of the same modes.
    """
    contacts = system.touching
    y = np.concatenate([rows[contacts] @ v for rows in (system.N, system.T1, system.T2)])
    size = np.abs(y)
    first = int(np.argmax(size >= 0.5 * size.max(initial=0.0))) if len(size) else 0
    return -1.0 if len(y) and y[first] < 0 else 1.0
