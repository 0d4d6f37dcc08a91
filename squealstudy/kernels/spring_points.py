"""Pressures and energies of contact points, some of which are springs (laws/spring.py)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import fast_kernel, hot_kernel, kernel
from squealstudy.kernels.law_text import compiled
from squealstudy.kernels.laws import contact_at, potential
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


@hot_kernel
def damper_forces(points: np.ndarray, point: np.ndarray, first: int, last: int) -> None:
    """Row OUT_T1 of the points first to last - 1 that damp by the third power, at OUT_W1."""
    for i in range(first, last):
        if points[at.POINT_SPRING_DAMPING, i] != 0.0:
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


@hot_kernel
def spring_regimes(points: np.ndarray, point: np.ndarray, nc: int) -> None:
    """Row OUT_REGIME of springs: which of the straight parts about their gap they are on."""
    for i in range(nc):
        if points[at.POINT_SPRING, i] != 0.0:
            gap, side = points[at.POINT_SPRING_GAP, i], points[at.POINT_SPRING_SIDE, i]
            if gap == 0.0 and side == 0.0:  # it has no corner
                point[at.OUT_REGIME, i] = at.SLIPS
                continue
            d = deflection(points[at.POINT_GAP, i] + point[at.OUT_X, i], gap, side)
            part = at.STICKS if d > 0.0 else at.SLIPS
            point[at.OUT_REGIME, i] = part if d != 0.0 else at.IS_OPEN
