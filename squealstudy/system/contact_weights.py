"""Weights of contact and friction in a system linearised about steady sliding; derivatives.

At a contact point of area A, pressure p and tangent kappa = -dp/dg, which slides at speed s with
the friction coefficient mu(s, p), the forces A p and mu A p change with gap and sliding by

    stiffness  N^T (A kappa) N  +  T^T (-(mu + p dmu/dp) A kappa) N
    damping    T_perp^T (mu A p / s) T_perp  +  T^T (dmu/ds A p) T

with the velocity s of the point itself, and mu of the sign of s. These four weights, a figure a
contact point each, are formed here alone, whatever the coordinates; mu is multiplied by the factor
`frictional` of the point. In time the same signs are those of the traction and its slope in
`kernels/laws.py` and, for loops over points, `kernels/law_text.py`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from squealstudy.models.contact_points import ContactPoints
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.working_point import WorkingPoint


class ContactWeights(NamedTuple):
    """Weights (nc,) of the four terms of contact and friction, or their derivatives.

    Attributes
    ----------
    normal : ndarray
        Of N^T (.) N in the stiffness, N/m.
    coupling : ndarray
        Of T^T (.) N in the stiffness, N/m: negative, friction follows the pressure.
    across : ndarray
        Of T_perp^T (.) T_perp in the damping, N s/m: friction turns with the sliding direction.
    along : ndarray or float
        Of T^T (.) T in the damping, N s/m: negative where friction falls with speed, the number 0
        where it does not depend on it.
    """

    normal: np.ndarray
    coupling: np.ndarray
    across: np.ndarray
    along: Any


def contact_weights(
    contact: ContactPoints, point: WorkingPoint, operating: OperatingPoint
) -> ContactWeights:
    """Weights of contact and friction at a working point."""
    p = point.contact_pressure
    friction = operating.friction_at(p, contact.speed_factor, contact.own_friction)
    k_n = contact.area * point.tangent
    rubbing = contact.area * p * contact.frictional
    return ContactWeights(
        normal=k_n,
        coupling=-friction.following(p) * contact.frictional * k_n,
        across=over_speed(friction.mu * rubbing, operating.sliding_speed * contact.speed_factor),
        along=friction.by_speed * rubbing if np.any(friction.by_speed) else 0.0,
    )


def over_speed(drag: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Friction over the sliding velocity; 0 where no sliding is imposed: nothing turns there."""
    return np.divide(drag, speed, out=np.zeros(np.shape(drag)), where=speed != 0.0)


class ContactChange(NamedTuple):
    """Derivatives by one parameter of what the weights depend on, numbers or ndarray (nc,).

    All are total: those of the contact laws hold what the moving working point adds.

    Attributes
    ----------
    pressure, tangent : ndarray or float
        Of p [Pa] and kappa [Pa/m].
    area : ndarray or float
        m2.
    frictional : ndarray or float
        Of the factor of each point on the friction coefficient.
    speed : float or ndarray
        Of the sliding velocities along T, m/s.
    mu, by_speed, by_pressure : float or ndarray
        Of mu, dmu/ds [s/m] and dmu/dp [1/Pa].
    """

    pressure: Any = 0.0
    tangent: Any = 0.0
    area: Any = 0.0
    frictional: Any = 0.0
    speed: Any = 0.0
    mu: Any = 0.0
    by_speed: Any = 0.0
    by_pressure: Any = 0.0


def contact_weights_change(
    contact: ContactPoints, point: WorkingPoint, operating: OperatingPoint, by: ContactChange
) -> ContactWeights:
    """Derivatives of `contact_weights` by one parameter: the product rule on its four lines."""
    p = point.contact_pressure
    friction = operating.friction_at(p, contact.speed_factor, contact.own_friction)
    speed = operating.sliding_speed * contact.speed_factor
    return changed_weights(contact.area, contact.frictional, p, point.tangent, friction, speed, by)


def changed_weights(
    area: np.ndarray,
    frictional: np.ndarray,
    p: np.ndarray,
    tangent: np.ndarray,
    friction: Any,
    speed: np.ndarray,
    by: ContactChange,
) -> ContactWeights:
    """Changed weights from arrays (nc,), or (m, nc) with a row a design point.

    Parameters
    ----------
    area, frictional : ndarray
        m2; share of the friction coefficient.
    p, tangent : ndarray
        Pa, Pa/m.
    friction : Friction or StackedFriction
        At these pressures.
    speed : ndarray
        Sliding velocities along T, m/s.
    by : ContactChange
    """
    k_n, force = area * tangent, area * p
    d_k_n = area * by.tangent + by.area * tangent
    d_force = area * by.pressure + by.area * p
    following = friction.following(p)
    d_following = by.mu + p * by.by_pressure + by.pressure * friction.by_pressure
    d_drag = (
        by.mu - over_speed(friction.mu * by.speed + 0.0 * speed, speed)
    ) * force + friction.mu * d_force
    d_along = by.by_speed * force + friction.by_speed * d_force
    more = by.frictional
    return ContactWeights(
        normal=d_k_n,
        coupling=-frictional * (d_following * k_n + following * d_k_n) - more * following * k_n,
        across=over_speed(frictional * d_drag + more * friction.mu * force, speed),
        along=frictional * d_along + more * friction.by_speed * force,
    )
