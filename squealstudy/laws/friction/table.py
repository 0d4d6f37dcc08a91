"""Friction by points over sliding speed, with a monotone curve between.

mu = friction r(s), with r a cubic piece by piece through the ratios given (Fritsch & Butland 1984):
no higher and no lower than its two points, with one slope where pieces meet. It is constant before
the first point and behind the last, and flat there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

POINTS = 8  # points that a table can have
RATIOS = tuple(f"friction_law.ratio_{k}" for k in range(1, POINTS + 1))


def _point(number: int) -> tuple[Parameter, Parameter]:
    """Speed and ratio of a point of the table."""
    unused = "" if number == 1 else "; 0: no such point"
    return (
        Parameter(
            f"friction_law.speed_{number}",
            0.0,
            "m/s",
            f"table curve: sliding speed of point {number}, above those before it{unused}",
            minimum=0.0,
        ),
        Parameter(
            f"friction_law.ratio_{number}",
            1.0,
            "",
            f"table curve: coefficient at speed_{number} over friction",
            minimum=0.0,
        ),
    )


def interpolated(
    s: float, speeds: Sequence[float], ratios: Sequence[float], first: int
) -> tuple[float, float]:
    """Ratio at a speed and its slope [s/m], of ratios from the first on; NaN as `refusal` says."""
    last = 0
    while last + 1 < len(speeds) and speeds[last + 1] > speeds[last]:
        last += 1
    for number in range(last + 1, len(speeds)):
        if speeds[number] != 0.0 or ratios[first + number] != 1.0:
            return nan, nan
    if s <= speeds[0]:
        return ratios[first], 0.0
    if s >= speeds[last]:
        return ratios[first + last], 0.0
    k = 0
    while s >= speeds[k + 1]:
        k += 1
    h, rise = speeds[k + 1] - speeds[k], ratios[first + k + 1] - ratios[first + k]
    d0 = h * knot_slope(k, last, speeds, ratios, first)
    d1 = h * knot_slope(k + 1, last, speeds, ratios, first)
    x = (s - speeds[k]) / h
    second, third = 3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise
    ratio = ratios[first + k] + x * (d0 + x * (second + x * third))
    return ratio, (d0 + x * (2.0 * second + 3.0 * x * third)) / h


def knot_slope(
    k: int, last: int, speeds: Sequence[float], ratios: Sequence[float], first: int
) -> float:
    """Slope [s/m] at a point: a harmonic mean of both sides, 0 at the ends and at extremes."""
    if k <= 0 or k >= last:
        return 0.0
    h0, h1 = speeds[k] - speeds[k - 1], speeds[k + 1] - speeds[k]
    ratio = ratios[first + k]
    before, after = (ratio - ratios[first + k - 1]) / h0, (ratios[first + k + 1] - ratio) / h1
    if before * after <= 0.0:
        return 0.0
    w0, w1 = h0 + 2.0 * h1, 2.0 * h0 + h1
    return (w0 + w1) / (w0 / before + w1 / after)


def mu(
    s: float,
    p: float,  # noqa: ARG001 - the arguments of every curve
    friction: float,
    speed_1: float,
    ratio_1: float,
    speed_2: float,
    ratio_2: float,
    speed_3: float,
    ratio_3: float,
    speed_4: float,
    ratio_4: float,
    speed_5: float,
    ratio_5: float,
    speed_6: float,
    ratio_6: float,
    speed_7: float,
    ratio_7: float,
    speed_8: float,
    ratio_8: float,
) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure."""
    speeds = (speed_1, speed_2, speed_3, speed_4, speed_5, speed_6, speed_7, speed_8)
    ratios = (ratio_1, ratio_2, ratio_3, ratio_4, ratio_5, ratio_6, ratio_7, ratio_8)
    ratio, slope = interpolated(s, speeds, ratios, 0)
    return friction * ratio, friction * slope, 0.0


def refusal(values: Sequence[float]) -> str:
    """Fault of a table's speeds and ratios, in turns; empty for a valid table."""
    speeds, ratios = values[::2], values[1::2]
    for number in range(1, POINTS):
        before, speed, name = speeds[number - 1], speeds[number], f"friction_law.speed_{number + 1}"
        if speed == 0.0 and ratios[number] != 1.0:
            return f"friction_law.ratio_{number + 1} needs a {name} above {before:g} m/s"
        unused_before = number > 1 and before == 0.0
        if speed != 0.0 and (unused_before or speed <= before):
            return (
                f"{name} is {speed:g} m/s: expected more than friction_law.speed_{number}, "
                f"{'which is not given' if unused_before else f'{before:g} m/s'}"
            )
    return ""


TABLE = register(
    FrictionCurveDefinition(
        name="table",
        description=f"by up to {POINTS} points over sliding speed, monotone between them",
        parameters=tuple(part for k in range(1, POINTS + 1) for part in _point(k)),
        mu=mu,
        pressure_dependent=False,
        refuses=refusal,
        by_address=True,
    )
)
