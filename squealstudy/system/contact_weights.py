"""Stiffness and damping of contact points, for matrices linearised about steady sliding.

The module also gives their derivatives by parameters, for sensitivities.

At a contact point of area A, pressure p and tangent kappa = -dp/dg, which slides at speed s with
the friction coefficient mu(s, p), the forces A p and mu A p change with gap and sliding by

    stiffness  N^T (A kappa) N  +  T^T (-(mu + p dmu/dp) A kappa) N
    damping    T_perp^T (mu A p / s) T_perp  +  T^T (dmu/ds A p) T

where s is the sliding velocity of that point along T, and mu has the sign of s. The four bracketed
weights have one value for each contact point, and mu is multiplied by the point's factor
`frictional`. All linearised matrices take them from here. Runs in time have the same signs, in the
traction and its slope in `kernels/laws.py` and, for loops over points, in `kernels/law_text.py`.
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
        Stiffness in N^T (.) N, N/m.
    coupling : ndarray
        Stiffness in T^T (.) N, N/m, as friction follows the pressure: negative for sliding along
        T, positive for sliding against it.
    across : ndarray
        Damping in T_perp^T (.) T_perp, N s/m, as friction turns with the sliding direction.
    along : ndarray or float
        Damping in T^T (.) T, N s/m: negative where friction falls with speed; the float 0 where no
        point's friction depends on speed.
    """

    normal: np.ndarray
    coupling: np.ndarray
    across: np.ndarray
    along: Any


def contact_weights(
    contact: ContactPoints, point: WorkingPoint, operating: OperatingPoint
) -> ContactWeights:
    """Weights of contact and friction at a working point, by the formulas above."""
    p = point.contact_pressure
    friction = operating.friction_at(p, contact.speed_factor, contact.own_friction)
    k_n = contact.area * point.tangent
    loaded_area = contact.area * p * contact.frictional
    return ContactWeights(
        normal=k_n,
        coupling=-friction.following(p) * contact.frictional * k_n,
        across=over_speed(
            friction.mu * loaded_area, operating.sliding_speed * contact.speed_factor
        ),
        along=friction.by_speed * loaded_area if np.any(friction.by_speed) else 0.0,
    )


def over_speed(drag: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Friction force over sliding velocity (nc,), N s/m; 0 where no sliding is imposed."""
    return np.divide(drag, speed, out=np.zeros(np.shape(drag)), where=speed != 0.0)


class ContactChange(NamedTuple):
    """Derivatives, by one parameter, of the quantities that the weights depend on.

    Each is a float, or ndarray (nc,). They are total derivatives: the working point moves with the
    parameter, and its pressures change the tangent and friction too.

    Attributes
    ----------
    pressure, tangent : ndarray or float
        Derivatives of p [Pa] and kappa [Pa/m].
    area : ndarray or float
        Derivative of the areas, m2.
    frictional : ndarray or float
        Derivative of each point's factor on the friction coefficient.
    speed : float or ndarray
        Derivative of the sliding velocities along T, m/s.
    mu, by_speed, by_pressure : float or ndarray
        Derivatives of mu, dmu/ds [s/m] and dmu/dp [1/Pa].
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
    """Derivatives of `contact_weights` by one parameter, for sensitivities at one design point."""
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
    """Derivatives of the weights by one parameter, by the product rule.

    Arrays are (nc,), or (m, nc) with a row for each design point of a batch.

    Parameters
    ----------
    area, frictional : ndarray
        Areas, m2, and factors on the friction coefficient.
    p, tangent : ndarray
        Contact pressures [Pa] and their tangents -dp/dg [Pa/m].
    friction : Friction or StackedFriction
        Friction at these pressures and speeds.
    speed : ndarray
        Sliding velocities along T, m/s.
    by : ContactChange
        Derivatives of the quantities above by the parameter.
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
    d_factor = by.frictional
    return ContactWeights(
        normal=d_k_n,
        coupling=-frictional * (d_following * k_n + following * d_k_n) - d_factor * following * k_n,
        across=over_speed(frictional * d_drag + d_factor * friction.mu * force, speed),
        along=frictional * d_along + d_factor * friction.by_speed * force,
    )
