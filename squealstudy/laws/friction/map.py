"""Friction by points over sliding speed and contact pressure, monotone between them both ways.

mu = friction r(s, p). At each pressure of the map r is the curve of `table` over the speeds.
Between pressures it is such a curve through what these are at the speed: no higher and no lower
than its two neighbours, constant and flat before the first pressure and behind the last. Both
slopes are those of this one function (THEORY.md eq. (9b)).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from squealstudy.laws.friction.table import interpolated, knot_slope
from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.registry import register
from squealstudy.parameter import Parameter

SPEEDS, PRESSURES = 6, 4  # points that a map can have
SPEED_NAMES = tuple(f"friction_law.map_speed_{k}" for k in range(1, SPEEDS + 1))
PRESSURE_NAMES = tuple(f"friction_law.map_pressure_{j}" for j in range(1, PRESSURES + 1))
MAP_RATIOS = tuple(
    f"friction_law.map_ratio_{k}_{j}" for j in range(1, PRESSURES + 1) for k in range(1, SPEEDS + 1)
)
# the first of each series, and those after it
SERIES = {names[0]: names[1:] for names in (SPEED_NAMES, PRESSURE_NAMES, MAP_RATIOS)}


def _knot(name: str, unit: str, quantity: str) -> Parameter:
    number = int(name.rpartition("_")[2])
    unused = "" if number == 1 else "; 0: no such point"
    text = f"map: {quantity} {number}, above those before it{unused}"
    return Parameter(name, 0.0, unit, text, minimum=0.0)


def _ratio(name: str) -> Parameter:
    speed, pressure = name.split("_")[-2:]
    text = f"map: coefficient at map_speed_{speed} and map_pressure_{pressure} over friction"
    return Parameter(name, 1.0, "", text, minimum=0.0)


def slope_change(
    k: int, last: int, at: Sequence[float], y: Sequence[float], dy: Sequence[float]
) -> float:
    """Derivative of `knot_slope` of values y that change by dy."""
    slope = knot_slope(k, last, at, y, 0)
    if slope == 0.0:
        return 0.0
    h0, h1 = at[k] - at[k - 1], at[k + 1] - at[k]
    before, after = (y[k] - y[k - 1]) / h0, (y[k + 1] - y[k]) / h1
    w0, w1 = h0 + 2.0 * h1, 2.0 * h0 + h1
    of_before, of_behind = slope / before, slope / after
    change = w0 * of_before * of_before * (dy[k] - dy[k - 1]) / h0
    change += w1 * of_behind * of_behind * (dy[k + 1] - dy[k]) / h1
    return change / (w0 + w1)


def mu(s: float, p: float, friction: float, *values: float) -> tuple[float, float, float]:
    """Coefficient and its slopes by speed and pressure; NaN where `refusal` says why."""
    speeds, at, ratios = values[:6], values[6:10], values[10:]
    last = 0
    while last + 1 < 4 and at[last + 1] > at[last]:
        last += 1
    for number in range(last + 1, 4):
        if at[number] != 0.0:
            return nan, nan, nan
    r1, t1 = interpolated(s, speeds, ratios, 0)
    r2, t2 = interpolated(s, speeds, ratios, 6)
    r3, t3 = interpolated(s, speeds, ratios, 12)
    r4, t4 = interpolated(s, speeds, ratios, 18)
    r, t = (r1, r2, r3, r4), (t1, t2, t3, t4)
    if p <= at[0]:
        return friction * r[0], friction * t[0], 0.0
    if p >= at[last]:
        return friction * r[last], friction * t[last], 0.0
    k = 0
    while p >= at[k + 1]:
        k += 1
    h = at[k + 1] - at[k]
    x = (p - at[k]) / h
    rise, turn = r[k + 1] - r[k], t[k + 1] - t[k]
    d0, d1 = h * knot_slope(k, last, at, r, 0), h * knot_slope(k + 1, last, at, r, 0)
    e0, e1 = h * slope_change(k, last, at, r, t), h * slope_change(k + 1, last, at, r, t)
    second, third = 3.0 * rise - 2.0 * d0 - d1, d0 + d1 - 2.0 * rise
    ratio = r[k] + x * (d0 + x * (second + x * third))
    by_pressure = (d0 + x * (2.0 * second + 3.0 * x * third)) / h
    by_speed = t[k] + x * (e0 + x * (3.0 * turn - 2.0 * e0 - e1 + x * (e0 + e1 - 2.0 * turn)))
    return friction * ratio, friction * by_speed, friction * by_pressure


def refusal(values: Sequence[float]) -> str:
    """Fault of a map's speeds, pressures and ratios; empty for a valid map."""
    speeds, pressures, ratios = values[:SPEEDS], values[SPEEDS:][:PRESSURES], values[-24:]
    used = []
    for names, knots, unit in (
        (SPEED_NAMES, speeds, "m/s"),
        (PRESSURE_NAMES, pressures, "Pa"),
    ):
        count = 1
        for k in range(1, len(knots)):
            if knots[k] == 0.0:
                continue
            if count < k or knots[k] <= knots[k - 1]:
                before = f"{knots[k - 1]:g} {unit}" if count == k else "which is not given"
                more = f"expected more than {names[k - 1]}, {before}"
                return f"{names[k]} is {knots[k]:g} {unit}: {more}"
            count = k + 1
        used.append(count)
    for number, (name, ratio) in enumerate(zip(MAP_RATIOS, ratios, strict=True)):
        pressure, speed = divmod(number, SPEEDS)
        if ratio != 1.0 and (speed >= used[0] or pressure >= used[1]):
            lacking = SPEED_NAMES[speed] if speed >= used[0] else PRESSURE_NAMES[pressure]
            return f"{name} needs a {lacking} above that before it"
    return ""


MAP = register(
    FrictionCurveDefinition(
        name="map",
        description=f"by up to {SPEEDS} speeds and {PRESSURES} contact pressures, monotone between",
        parameters=(
            *(_knot(name, "m/s", "sliding speed") for name in SPEED_NAMES),
            *(_knot(name, "Pa", "contact pressure") for name in PRESSURE_NAMES),
            *map(_ratio, MAP_RATIOS),
        ),
        mu=mu,
        refuses=refusal,
        by_address=True,
    )
)
