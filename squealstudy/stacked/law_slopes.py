"""Derivatives of contact laws and friction curves at the contact points of a batch.

`ContactLaw.slopes` and `OperatingPoint.friction_slopes` give the same for one design point. They
are exact where a law gives them, and central differences, exact to about 1e-9, where it does not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from squealstudy.laws.own_friction import NO_OWN_FRICTION, has_own, own_slopes
from squealstudy.laws.registry import DIFFERENCE_REL_STEP, at_points
from squealstudy.laws.spring import spring_slopes
from squealstudy.models.operating import FRICTION, SLIDING_SPEED
from squealstudy.stacked.operating import StackedOperating

Slope = tuple[np.ndarray, np.ndarray]  # derivatives of pressure and tangent


def point_slopes(operating: StackedOperating, gap: np.ndarray, springs: np.ndarray) -> list[Slope]:
    """`contact_slopes` at gaps (m, c), the last of which are those of springs (m or 1, ns, 5)."""
    first = gap.shape[1] - springs.shape[1]
    if first == gap.shape[1]:
        return contact_slopes(operating, gap)
    zeros = np.zeros(gap[:, first:].shape)
    by_gap, *others = contact_slopes(operating, gap[:, :first])
    pairs = [(by_gap, spring_slopes(gap[:, first:], springs))]
    pairs += [(slope, (zeros, zeros)) for slope in others]
    return [
        (np.concatenate([a[0], b[0]], axis=1), np.concatenate([a[1], b[1]], axis=1))
        for a, b in pairs
    ]


def contact_slopes(operating: StackedOperating, gap: np.ndarray) -> list[Slope]:
    """Derivatives (m, c) of pressure and tangent, first by the gap, then by each parameter."""
    law, values = operating.law, operating.law_values
    if law.slopes is None:
        size = np.abs(gap).max(axis=1, keepdims=True)
        pairs = [_central(lambda h: np.array(operating.contact(gap + h)), 0.0 * size, size)]
        for parameter, parameter_value in zip(law.parameters, values, strict=True):

            def moved(x: np.ndarray, name: str = parameter.name) -> np.ndarray:
                return np.array(operating.with_value(name, x[:, 0]).contact(gap))

            pairs.append(_central(moved, parameter_value))
        return [(dp, dkappa) for dp, dkappa in pairs]
    if law.in_package:
        slopes = law.slopes(gap, *values)
        return [(np.broadcast_to(a, gap.shape), np.broadcast_to(b, gap.shape)) for a, b in slopes]
    rows = [law.slopes(g, *(float(x[i, 0]) for x in values)) for i, g in enumerate(gap)]
    return [
        (np.array([row[k][0] for row in rows]), np.array([row[k][1] for row in rows]))
        for k in range(len(rows[0]))
    ]


def friction_slope(
    operating: StackedOperating,
    name: str,
    p: np.ndarray,
    speed_factor: np.ndarray,
    own_friction: np.ndarray = NO_OWN_FRICTION,
) -> np.ndarray:
    """Derivatives (3, m, c) of mu, dmu/ds and dmu/dp by a parameter of friction.

    It is the sliding speed, `friction` or a parameter of the curve. Pressures p (m, c) [Pa] are
    fixed; points have these factors (m or 1, c) of the speed;
    `own_friction` (m or 1, c, k) is that of points which do not follow the study's friction.
    """
    curve = operating.curve
    number = {SLIDING_SPEED.name: 0, FRICTION.name: 2}.get(name)
    if number is None:
        number = 3 + [parameter.name for parameter in curve.parameters].index(name)
    constant = curve.constant is not None and np.all(curve.constant(*operating.curve_values))
    if has_own(own_friction):
        slopes = _own_slope(operating, number, p, speed_factor, own_friction)
    elif constant and number in (0, 2):
        slopes = np.zeros((3, *p.shape))
        slopes[0] = 1.0 if number == 2 else 0.0
    else:
        slopes = _curve_slope(operating, number, p, speed_factor)
    return _signed(operating, slopes, number, p, speed_factor)


def friction_by_pressure(
    operating: StackedOperating,
    p: np.ndarray,
    speed_factor: np.ndarray,
    own_friction: np.ndarray = NO_OWN_FRICTION,
) -> np.ndarray:
    """Derivatives (3, m, c) of mu, dmu/ds and dmu/dp by the pressure of each point itself."""
    if has_own(own_friction):
        slopes = _own_slope(operating, 1, p, speed_factor, own_friction)
    else:
        slopes = _curve_slope(operating, 1, p, speed_factor)
    return _signed(operating, slopes, 1, p, speed_factor)


def _own_slope(
    operating: StackedOperating,
    number: int,
    p: np.ndarray,
    speed_factor: np.ndarray,
    own_friction: np.ndarray,
) -> np.ndarray:
    """Derivatives by one argument, where some points have friction of their own."""
    speeds = np.abs(operating.sliding_speed)[:, None] * speed_factor
    values = (operating.friction[:, None], operating.curve_values)
    slopes = own_slopes(operating.curve, values, own_friction, np.broadcast_to(speeds, p.shape), p)
    return slopes[number]


def _curve_slope(
    operating: StackedOperating, number: int, p: np.ndarray, speed_factor: np.ndarray
) -> np.ndarray:
    """Derivatives by one argument of the curve: speed, pressure, friction, its parameters."""
    curve = operating.curve
    speeds = np.abs(operating.sliding_speed)[:, None] * speed_factor
    pressures = p if curve.pressure_dependent else np.zeros((len(p), 1))
    arguments = [speeds, pressures, operating.friction[:, None], *operating.curve_values]
    if (slopes := curve.slopes) is not None:
        slope = at_points(lambda *x: slopes(*x)[number], 3, *arguments)
    else:
        argument = arguments[number]
        size = np.abs(argument).max(axis=1, keepdims=True)
        before, behind = arguments[:number], arguments[number + 1 :]

        def moved(h: np.ndarray) -> np.ndarray:
            return at_points(curve.mu, 3, *before, argument + h, *behind)

        slope = _central(moved, 0.0 * size, size)
    return np.broadcast_to(slope, (3, *p.shape)).copy()


def _signed(
    operating: StackedOperating,
    slopes: np.ndarray,
    number: int,
    p: np.ndarray,
    speed_factor: np.ndarray,
) -> np.ndarray:
    """Slopes with the sign of the imposed speed, and 0 where contact pulls."""
    if number == 0:
        slopes = slopes * speed_factor
    slopes = np.where(p < 0.0, 0.0, slopes)
    backwards = (operating.sliding_speed < 0)[:, None] & (speed_factor != 0.0)
    turned = [1] if number == 0 else [0, 2]
    slopes[turned] = np.where(backwards, -slopes[turned], slopes[turned])
    return slopes


def _central(
    function: Callable[[np.ndarray], np.ndarray], value: np.ndarray, size: np.ndarray | float = 0.0
) -> np.ndarray:
    """Derivatives of arrays (k, m, c) by numbers (m, 1), by central differences."""
    h = np.abs(value)
    h = np.where(h > 0, h, size)
    h = DIFFERENCE_REL_STEP * np.where(h > 0, h, 1.0)
    slope: np.ndarray = (function(value + h) - function(value - h)) / (2.0 * h)
    return slope
