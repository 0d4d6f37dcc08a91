"""Modal systems with contact and friction, and the design points on them.

In coordinates that diagonalise the system at a reference working point, M = I
(THEORY.md eq. (62))::

    q'' + C q' + K q = load + N^T (A p(g) - rn_ref) + T1^T (t1 - t1_ref) + T2^T (t2 - t2_ref)
    g = gap + N q,    w = (speed f + T1 q', T2 q')
    K + N^T diag(k_ref) N = diag(omega2) + U^T diag(s) U,    C = diag(c) + D + U^T diag(d) U

where D is the damping between coordinates, f are the factors of the points' sliding speeds, and q
is the deviation from a base state (gap, rn_ref, t_ref). The base is the system's or a design
point's own, which makes q = 0 its steady sliding. Load, law, friction, speed, damping and base
belong to a design point; all of them may differ from the reference. `k_ref` is always the system's:
the tangent that is part of `omega2`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.kernels.laws import law_row
from squealstudy.kernels.newmark_layout import NO_CONTACT, POINT_LAW, POINT_SPEED, POINT_SPRING
from squealstudy.laws import ContactLaw, FrictionCurve, FrictionLaw, friction_curve
from squealstudy.laws.own_friction import (
    COEFFICIENT,
    NO_OWN_FRICTION,
    has_own,
    is_unmoved,
    own_values,
)
from squealstudy.laws.spring import N_SPRING, NO_SPRINGS, evaluate_points
from squealstudy.motion.growing_modes import GrowingModes
from squealstudy.motion.schedule import Schedule
from squealstudy.system.linearise import ContactStructure

if TYPE_CHECKING:
    from squealstudy.reduction.hybrid import HybridModel

STICK_LIMIT = 1e3  # largest stick number, a tenth of that at which steps failed on the medium brake
CONSTANT_CURVE = "exponential_fall"  # constant with a static ratio of 1
# closing number from which on steps of small models are halved; they fail from 100 on
CLOSING_LIMIT = 3.0


@dataclass(frozen=True)
class ModalSystem:
    """The modal system that design points share; arrays are checked once.

    Parameters
    ----------
    omega2 : ndarray (n,)
        Diagonal stiffness at the reference, contact tangent included, (rad/s)^2.
    N, T1, T2 : ndarray (nc, n)
        Gap, and displacements along and across the sliding direction, by the coordinates.
    area, frictional, radius : ndarray (nc,)
        Area of each point [m2]; factor on friction (1 or 0); arm of the torque [m].
    gap : ndarray (nc,)
        Gap at the reference, m.
    k_ref : ndarray (nc,)
        Contact tangent inside `omega2`, N/m.
    force : ndarray (nc, 3)
        Normal and friction forces of the reference state, N; zero where the loads of the design
        points have to balance them.
    shapes : ndarray (m, n)
        Rows U that design points damp (d) or stiffen (s).
    sensed : ndarray (ns,) of int
        Numbers (from 1) of the modes whose displacements and velocities are saved.
    speed_factor : ndarray (nc,)
        Sliding speed of each point over the imposed one; one by default.
    spring_points : ndarray (k, 5)
        Numbers of the last k points, which are springs instead of contact (laws/spring.py).
    own_friction : ndarray (nc, c)
        Numbers of points with a friction law of their own (laws/own_friction.py); c = 0 without.

    Raises
    ------
    ModelError
        Shapes that contradict each other, or values that are not finite.
    """

    omega2: np.ndarray
    N: np.ndarray
    T1: np.ndarray
    T2: np.ndarray
    area: np.ndarray
    frictional: np.ndarray
    radius: np.ndarray
    gap: np.ndarray
    k_ref: np.ndarray
    force: np.ndarray
    shapes: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    sensed: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    speed_factor: np.ndarray = field(default_factory=lambda: np.zeros(0))
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS)
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION)

    def __post_init__(self) -> None:
        nc, n = np.shape(self.N)
        if not self.speed_factor.size:
            object.__setattr__(self, "speed_factor", np.ones(nc))
        if not self.shapes.size:
            object.__setattr__(self, "shapes", np.zeros((0, n)))
        shapes_by_name = {"omega2": (n,), "T1": (nc, n), "T2": (nc, n), "force": (nc, 3)}
        points = ("area", "frictional", "radius", "gap", "k_ref", "speed_factor")
        shapes_by_name |= dict.fromkeys(points, (nc,))
        shapes_by_name |= {"shapes": (len(self.shapes), n), "sensed": (len(self.sensed),)}
        shapes_by_name |= {"spring_points": (len(self.spring_points), N_SPRING)}
        for name, shape in {"N": (nc, n), **shapes_by_name}.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise ModelError(f"modal system: '{name}' has shape {array.shape}, not {shape}")
            if not np.isfinite(array).all():
                raise ModelError(f"modal system: '{name}' has values that are not finite")
        if len(self.sensed) and not 1 <= self.sensed.min() <= self.sensed.max() <= n:
            raise ModelError(f"modal system: 'sensed' needs modes from 1 to {n}")

    @property
    def n(self) -> int:
        """Number of modal coordinates."""
        return int(self.N.shape[1])

    @property
    def touching(self) -> slice:
        """The rows of points that are contact, not springs."""
        return slice(len(self.area) - len(self.spring_points))

    @cached_property
    def tiles(self) -> dict[type[np.floating], np.ndarray]:
        """The observation matrix by precision; `arrays.observation` adds it when needed."""
        return {}

    @cached_property
    def structure(self) -> ContactStructure:
        """The linearised structure that all design points share; only their weights differ."""
        return ContactStructure(
            mass=None,
            elastic=None,
            stiffness=self.omega2,
            springs=None,
            N=self.N,
            T=self.T1,
            T_perp=self.T2,
            area=self.area,
            frictional=self.frictional,
            speed_factor=self.speed_factor,
            frequencies={},
            places={},
            shapes=self.shapes,
            own_friction=self.own_friction,
        )

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies of the modes (n,), rad/s; 0 where the stiffness is negative."""
        omega: np.ndarray = np.sqrt(np.maximum(self.omega2, 0.0))
        return omega


@dataclass(frozen=True)
class MotionPoint:
    """One design point on a modal or a hybrid system: laws, base state, damping, start.

    Parameters
    ----------
    contact : ContactLaw
    friction : FrictionLaw
    speed : float
        Imposed sliding velocity along T1, m/s; a contact point has its own share of it.
    c : ndarray (n,)
        Damping of each coordinate by itself, 1/s; on a hybrid system (m,) that of its real modes.
    load : ndarray (n,) or None
        Modal load beyond that of the reference state.
    d, s : ndarray (m,) or None
        Damping [1/s] and stiffness [1/s2] of the system's shapes.
    gap : ndarray (nc,) or None
        Gap at the design's own base state, m; None for the system's.
    force : ndarray (nc, 3) or None
        Normal and friction forces that the base balances, N; None for the system's.
    open_share : float
        Share of the contact area that is open in steady sliding (`WorkingPoint`).
    q0, v0 : ndarray (n,) or None
        Initial deviation from the base state and initial velocity; None for zero.
    continued : bool
        Whether the start is the end of an earlier run; if not its energy is a perturbation's.
    damping_between : ndarray (n, n) or None
        Damping between coordinates, the symmetric part, and gyroscopic terms, the skew-symmetric
        part, with zeros on the diagonal, 1/s; None without.
    beta : float
        Stiffness-proportional damping of a hybrid system's motion beyond its real modes, s.
    static_torque : float
        Torque in the base state, N m.
    growing : GrowingModes
        Complex modes of the system linearised at the base state, through which runs are watched.
    schedule : Schedule or None
        Speed and pressure over time; None where they stay those of the design point.
    """

    contact: ContactLaw
    friction: FrictionLaw
    speed: float
    c: np.ndarray
    load: np.ndarray | None = None
    d: np.ndarray | None = None
    s: np.ndarray | None = None
    gap: np.ndarray | None = None
    force: np.ndarray | None = None
    open_share: float = 0.0
    q0: np.ndarray | None = None
    v0: np.ndarray | None = None
    continued: bool = False
    damping_between: np.ndarray | None = None
    beta: float = 0.0
    static_torque: float = 0.0
    growing: GrowingModes = field(default_factory=GrowingModes)
    schedule: Schedule | None = None

    def start(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Initial deviation and velocity (n,).

        Raises
        ------
        ModelError
            An initial state of another size, or not finite.
        """
        start_state = [
            np.zeros(n) if x is None else np.asarray(x, dtype=float) for x in (self.q0, self.v0)
        ]
        if any(x.shape != (n,) or not np.isfinite(x).all() for x in start_state):
            raise ModelError(f"an initial state needs {n} finite values")
        return start_state[0], start_state[1]

    def base(self, system: ModalSystem | HybridModel) -> tuple[np.ndarray, np.ndarray]:
        """Gap (nc,) and forces (nc, 3) of the base state.

        Raises
        ------
        ModelError
            A gap or force of the wrong shape, or not finite.
        """
        gap = system.gap if self.gap is None else np.asarray(self.gap, dtype=float)
        force = system.force if self.force is None else np.asarray(self.force, dtype=float)
        if gap.shape != system.gap.shape or force.shape != system.force.shape:
            raise ModelError(f"design point: 'gap', 'force' need {len(system.gap)} points")
        if not (np.isfinite(gap).all() and np.isfinite(force).all()):
            raise ModelError("design point: 'gap' or 'force' has values that are not finite")
        return gap, force

    def tangents(self, system: ModalSystem | HybridModel) -> np.ndarray:
        """Contact tangents (nc,) of the base state, N/m."""
        gap, _ = self.base(system)
        springs = getattr(system, "spring_points", NO_SPRINGS)
        tangents: np.ndarray = system.area * evaluate_points(self.contact, springs, gap)[1]
        return tangents

    @property
    def first_speed(self) -> float:
        """Imposed sliding velocity along T1 at the start of its run, m/s."""
        share = 1.0 if self.schedule is None else float(self.schedule.speed_at(0.0))
        return share * self.speed

    def points(self, system: ModalSystem | HybridModel) -> np.ndarray:
        """Contact points (N_POINT_ROWS, nc) for the kernels, at the base state."""
        gap, force = self.base(system)
        arm = system.radius * np.copysign(1.0, self.speed)  # torque brakes either way
        columns = (gap, system.area, system.frictional, arm, system.k_ref)
        speed = self.speed * system.speed_factor
        rows = np.vstack([*columns, force.T, speed, np.zeros((2 + N_SPRING, len(gap)))])
        rows[POINT_LAW] = self.laws(system)[1]
        if len(springs := getattr(system, "spring_points", NO_SPRINGS)):
            rows[POINT_SPRING, -len(springs) :] = 1.0
            rows[POINT_SPRING + 1 : POINT_LAW, -len(springs) :] = springs.T
            rows[POINT_LAW, -len(springs) :] = NO_CONTACT
            rows[POINT_SPEED, -len(springs) :] = 0.0  # dampers do not slide with the belt
        return np.ascontiguousarray(rows, dtype=np.float64)

    def laws(self, system: ModalSystem | HybridModel) -> tuple[np.ndarray, np.ndarray]:
        """Laws for the kernels, one after the other, and where that of each point begins (nc,)."""
        first = law_row(self.contact, self.friction)
        own_friction = getattr(system, "own_friction", NO_OWN_FRICTION)
        if not has_own(own_friction):
            return first, np.zeros(len(system.area))
        rows, begins, law_numbers = [first], {}, np.zeros(len(own_friction))
        for i, unmoved in enumerate(is_unmoved(own_friction, system.speed_factor)):
            if not (unmoved or np.isfinite(own_friction[i, COEFFICIENT:]).any()):
                continue
            key = (bool(unmoved), own_friction[i, COEFFICIENT:].tobytes())
            if key not in begins:
                begins[key] = sum(map(len, rows))
                rows.append(law_row(self.contact, self._own_law(own_friction[i], bool(unmoved))))
            law_numbers[i] = begins[key]
        return np.concatenate(rows), law_numbers

    def _own_law(self, own_friction: np.ndarray, unmoved: bool) -> FrictionLaw:
        """Friction of a point with a law of its own; a constant if no sliding is imposed on it."""
        law = self.friction
        values = own_values(own_friction, law.friction, law.curve.parameters)
        friction, *parameters = (float(number) for number in values)
        curve = FrictionCurve(law.curve.kind, tuple(parameters))
        if unmoved:
            curve = friction_curve(CONSTANT_CURVE, static_ratio=1.0)
        return replace(law, friction=friction, curve=curve)


def stick_number(system: ModalSystem, design: MotionPoint, step: float) -> float:
    """Stick number h k_t |T|^2 / 2 with all points sticking, where h is the step.

    Beyond 1 a fixed Jacobian without tangential damping cannot converge; `simulate` is made for
    numbers up to `STICK_LIMIT`. The largest step for a number x is ``step * x / stick_number(..)``.
    """
    weight = np.sqrt(design.friction.k_t * system.area * (system.frictional > 0))
    T = np.concatenate([weight[:, None] * system.T1, weight[:, None] * system.T2])
    small = T @ T.T if len(T) < system.n else T.T @ T
    return float(0.5 * step * max(np.linalg.eigvalsh(small)[-1], 0.0)) if small.size else 0.0


def closing_number(contact: ContactLaw, velocity: float, step: float) -> float:
    """Closing number h v r, where r is the law's closing rate, v `velocity` [m/s] and h the step.

    In each step a contact that closes at v stiffens by a factor of exp(h v r). Impacts beyond
    `CLOSING_LIMIT` are not resolved in time. 0 for laws without such a rate.
    """
    return contact.closing_rate * step * velocity
