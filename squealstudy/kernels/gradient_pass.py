"""Contact forces as difference quotients of their potential, at the midpoint of a step.

Between the gaps g0 and g1 the pressure is -(U(g1) - U(g0)) / (g1 - g0), so that its work is what
the potential U loses, whatever the step (Gonzalez 1996, discrete gradients); the limit for
g1 -> g0 is p(g0).
"""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.contact_point import begin_points, slide
from squealstudy.kernels.integrator_layout import X_START
from squealstudy.kernels.jit import fast_kernel
from squealstudy.kernels.laws import mean_pressures
from squealstudy.kernels.newmark_layout import Modal, Work
from squealstudy.kernels.newmark_pass import observe_panel, spread_panel
from squealstudy.kernels.newmark_vector import fill
from squealstudy.kernels.tile import POINTS


@fast_kernel
def gradient_forces(
    points: np.ndarray, law: np.ndarray, point: np.ndarray, first: int, last: int
) -> None:
    """As contact_point.point_forces with the mean pressure over the step.

    OUT_X holds the change of gap at the midpoint, X_START that at the beginning.
    """
    begin_points(law, point, first, last)
    gap, x, x0 = points[at.POINT_GAP], point[at.OUT_X], point[X_START]
    mean_pressures(law, gap, x, x0, point[at.OUT_P], first, last)
    slide(points, law, point, first, last)


@fast_kernel
def pass_gradient(B: np.ndarray, modal: Modal, work: Work) -> None:
    """As newmark_pass.pass_one for design 0 with a midpoint in the trial rows."""
    fill(work.x[0, at.FORCE], 0.0)
    step = work.tiles.shape[0]
    for t in range(0, B.shape[0], step):
        panel = B[t : min(t + step, B.shape[0])]
        first, last = t * POINTS, (t + panel.shape[0]) * POINTS
        observe_panel(panel, first, work, 0)
        gradient_forces(modal.points[0], modal.laws[0], work.point[0], first, last)
        spread_panel(panel, first, work, 0)
