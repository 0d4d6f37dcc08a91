"""Contact forces as difference quotients of their potential, at the midpoint of a step.

Between the gaps g0 and g1 the pressure is -(U(g1) - U(g0)) / (g1 - g0), so that its work is what
the potential U loses, whatever the step (Gonzalez 1996, discrete gradients); the limit for
g1 -> g0 is p(g0). The forms here have no cancellation.
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.contact_laws import law_at
from squealstudy.kernels.contact_point import (
    OUT_P,
    OUT_W1,
    OUT_X,
    beyond_base,
    frictions,
    pressures,
)
from squealstudy.kernels.exponential import exponential
from squealstudy.kernels.integrator_layout import X_START
from squealstudy.kernels.jit import exact_kernel, fast_kernel
from squealstudy.kernels.newmark_layout import FORCE, Q_TRIAL, V_TRIAL, Modal, Work
from squealstudy.kernels.newmark_pass import give_forces, take_points
from squealstudy.kernels.newmark_vector import fill
from squealstudy.kernels.tile import POINTS, observe_one, spread_one

NEAR = 1e-3  # change of gap over gap below which a power law is expanded


@exact_kernel
def sinh_over(z: float) -> float:
    """sinh(z) / z; 1 at 0."""
    s = z * z
    tail = 1.0 + s / 156.0 * (1.0 + s / 210.0 * (1.0 + s / 272.0))
    near = 1.0 + s / 42.0 * (1.0 + s / 72.0 * (1.0 + s / 110.0 * tail))
    near = 1.0 + s / 6.0 * (1.0 + s / 20.0 * near)
    e = exponential(abs(z))
    return near if s < 1.0 else 0.5 * (e - 1.0 / e) / abs(z)


@fast_kernel
def quotient(code: int, a: float, b: float, g: float, d: float) -> float:
    """Mean pressure [Pa] over the gaps g - d/2 to g + d/2 of any law but the exponential one."""
    m0, m1 = min(g - 0.5 * d, 0.0), min(g + 0.5 * d, 0.0)
    if code == 3 or (code == 1 and m0 < 0.0 and m1 < 0.0):
        return -a * g
    if m0 == 0.0 and m1 == 0.0:
        return 0.0
    if code == 1:
        return -0.5 * a * (m0 + m1) * (m1 - m0) / d
    if abs(d) < NEAR * abs(g):
        p, _ = law_at(code, a, b, g)
        return p * (1.0 + b * (b - 1.0) * d * d / (24.0 * g * g))
    U0, U1 = a * (-m0) ** (b + 1.0), a * (-m1) ** (b + 1.0)
    return (U0 - U1) / ((b + 1.0) * d)


@fast_kernel
def mean_pressures(
    law: np.ndarray, points: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """Mean pressure of the points first to last - 1 over the step into the row OUT_P.

    OUT_X holds the change of gap at the midpoint, X_START that at the beginning.
    """
    code, a, b = int(law[0]), law[1], law[2]
    gap, x, x0, p = points[0], point[OUT_X], point[X_START], point[OUT_P]
    if code == 0:
        pressures(law, points, point, first, last)
        for i in range(first, last):
            p[i] *= sinh_over(b * (x[i] - x0[i]))
    else:
        for i in range(first, last):
            p[i] = quotient(code, a, b, gap[i] + x[i], 2.0 * (x[i] - x0[i]))


@fast_kernel
def gradient_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """As contact_point.point_forces with the mean pressure over the step."""
    speed, w1 = law[8], point[OUT_W1]
    for i in range(first, last):
        w1[i] += speed
    mean_pressures(law, points, point, first, last)
    frictions(law, points, point, first, last)
    beyond_base(points, point, first, last)


@fast_kernel
def pass_gradient(B: np.ndarray, modal: Modal, work: Work) -> None:
    """As newmark_pass.pass_one for design 0 with a midpoint in the trial rows."""
    x, point, tiles = work.x[0], work.point[0], work.tiles
    points, law, F = modal.points[0], modal.laws[0], work.x[0, FORCE]
    fill(F, 0.0)
    step = tiles.shape[0]
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        first = t * POINTS
        for i in range(panel.shape[0]):
            observe_one(panel[i], x[Q_TRIAL], x[V_TRIAL], tiles[i, 0])
            take_points(tiles[i, 0], point, first + i * POINTS)
        gradient_forces(points, law, point, first, first + panel.shape[0] * POINTS)
        for i in range(panel.shape[0]):
            give_forces(point, tiles[i, 0], first + i * POINTS)
            spread_one(panel[i], tiles[i, 0], F)
