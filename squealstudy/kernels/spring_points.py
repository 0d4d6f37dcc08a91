"""Contact points that are springs (laws/spring.py), or have friction laws of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, kernel
from squealstudy.kernels.law_text import compiled
from squealstudy.kernels.laws import contact_at, friction_at, mu_at, potential
from squealstudy.laws import spring

_KERNELS: dict[Callable[..., Any], Any] = {}
spring_pressure = compiled(spring.spring_pressure, _KERNELS)
spring_potential = compiled(spring.spring_potential, _KERNELS)
mean_spring_pressure = compiled(spring.mean_spring_pressure, _KERNELS)
deflection = compiled(spring.deflection, _KERNELS)
damper_force = compiled(spring.damper_force, _KERNELS)


@hot_kernel
def spring_pressures(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Row OUT_P of those of the points first to last - 1 that are springs, at the row OUT_X."""
    for i in range(first, last):
        if points[at.POINT_SPRING, i] != 0.0:
            p, _ = spring_pressure(
                points[at.POINT_GAP, i] + point[at.OUT_X, i],
                points[at.POINT_SPRING_STIFFNESS, i],
                points[at.POINT_SPRING_CUBIC, i],
                points[at.POINT_SPRING_GAP, i],
                points[at.POINT_SPRING_SIDE, i],
            )
            point[at.OUT_P, i] = p


@fast_kernel
def mean_spring_pressures(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """The same over a step that began at the row X_START, with its midpoint in OUT_X."""
    for i in range(first, last):
        if points[at.POINT_SPRING, i] != 0.0:
            point[at.OUT_P, i] = mean_spring_pressure(
                points[at.POINT_GAP, i] + point[at.OUT_X, i],
                2.0 * (point[at.OUT_X, i] - point[at.X_START, i]),
                points[at.POINT_SPRING_STIFFNESS, i],
                points[at.POINT_SPRING_CUBIC, i],
                points[at.POINT_SPRING_GAP, i],
                points[at.POINT_SPRING_SIDE, i],
            )


@fast_kernel
def law_begin(points: np.ndarray, i: int) -> int:
    """Where in the row of laws that of point i begins; of springs the study's."""
    return max(int(points[at.POINT_LAW, i]), 0)


@fast_kernel
def coefficient_of(
    law: np.ndarray, points: np.ndarray, i: int, s: float, p: float
) -> tuple[float, float, float]:
    """Friction coefficient of point i, dmu/ds [s/m] and dmu/dp [1/Pa]."""
    return mu_at(law[law_begin(points, i) :], s, p)


@fast_kernel
def typical_mu(law: np.ndarray, points: np.ndarray, i: int) -> float:
    """LAW_MU of point i."""
    return law[law_begin(points, i) + at.LAW_MU]


@fast_kernel
def own_friction(points: np.ndarray, law: np.ndarray, point: np.ndarray, i: int) -> None:
    """Rows OUT_T1, OUT_T2 of point i, which has a friction law of its own."""
    w1, w2, p = point[at.OUT_W1, i], point[at.OUT_W2, i], point[at.OUT_P, i]
    point_law, area = law[law_begin(points, i) :], points[at.POINT_AREA, i]
    t1, t2, _ = friction_at(point_law, points[at.POINT_FRICTION, i], p, w1, w2)
    point[at.OUT_T1, i], point[at.OUT_T2, i] = area * t1, area * t2


@hot_kernel
def other_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """Rows OUT_T1, OUT_T2 of those points first to last - 1 that have not the study's friction.

    Those that damp by the third power, at OUT_W1, and those with a friction law of their own.
    """
    for i in range(first, last):
        if points[at.POINT_LAW, i] == 0.0:
            continue
        if points[at.POINT_LAW, i] > 0.0:
            own_friction(points, law, point, i)
        elif points[at.POINT_SPRING_DAMPING, i] != 0.0:
            t, _ = damper_force(point[at.OUT_W1, i], points[at.POINT_SPRING_DAMPING, i])
            point[at.OUT_T1, i] = t


@kernel
def pressure_of(law: np.ndarray, points: np.ndarray, i: int, x: float) -> tuple[float, float]:
    """Pressure [Pa] and tangent [Pa/m] of point i at a change x of its gap."""
    g = points[at.POINT_GAP, i] + x
    if points[at.POINT_SPRING, i] == 0.0:
        return contact_at(law, g)
    return spring_pressure(
        g,
        points[at.POINT_SPRING_STIFFNESS, i],
        points[at.POINT_SPRING_CUBIC, i],
        points[at.POINT_SPRING_GAP, i],
        points[at.POINT_SPRING_SIDE, i],
    )


@fast_kernel
def energy_of(law: np.ndarray, points: np.ndarray, i: int, x: float) -> float:
    """Stored energy per area [J/m2] of point i at a change x of its gap."""
    g = points[at.POINT_GAP, i] + x
    if points[at.POINT_SPRING, i] == 0.0:
        return potential(law, g)
    return spring_potential(
        g,
        points[at.POINT_SPRING_STIFFNESS, i],
        points[at.POINT_SPRING_CUBIC, i],
        points[at.POINT_SPRING_GAP, i],
        points[at.POINT_SPRING_SIDE, i],
    )


@fast_kernel
def regime(law: np.ndarray, factor: float, mu: float, p: float, s: float) -> int:
    """SLIPS, STICKS below the corner of its friction, or IS_OPEN, of a point that slides by s.

    `factor` is that on the point's friction coefficient mu, p its pressure [Pa].
    """
    if p <= 0.0:
        return at.IS_OPEN
    return at.STICKS if law[at.LAW_SLOPE] * s < factor * mu * p else at.SLIPS


@fast_kernel
def own_regime(points: np.ndarray, law: np.ndarray, point: np.ndarray, i: int) -> None:
    """Row OUT_REGIME of point i, which has a friction law of its own."""
    w1, w2, p = point[at.OUT_W1, i], point[at.OUT_W2, i], point[at.OUT_P, i]
    point_law, s = law[law_begin(points, i) :], (w1 * w1 + w2 * w2) ** 0.5
    mu, _, _ = mu_at(point_law, s, p)
    point[at.OUT_REGIME, i] = regime(point_law, points[at.POINT_FRICTION, i], mu, p, s)


@hot_kernel
def other_regimes(points: np.ndarray, law: np.ndarray, point: np.ndarray, nc: int) -> None:
    """Row OUT_REGIME of points with a friction law of their own, and of springs.

    Of these it says which of the straight parts about their gap they are on.
    """
    for i in range(nc):
        if points[at.POINT_LAW, i] > 0.0:
            own_regime(points, law, point, i)
        elif points[at.POINT_LAW, i] < 0.0:
            gap, side = points[at.POINT_SPRING_GAP, i], points[at.POINT_SPRING_SIDE, i]
            if gap == 0.0 and side == 0.0:  # it has no corner
                point[at.OUT_REGIME, i] = at.SLIPS
                continue
            d = deflection(points[at.POINT_GAP, i] + point[at.OUT_X, i], gap, side)
            part = at.STICKS if d > 0.0 else at.SLIPS
            point[at.OUT_REGIME, i] = part if d != 0.0 else at.IS_OPEN
