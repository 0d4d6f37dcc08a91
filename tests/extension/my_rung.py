"""A rung that interpolates: roots on a line between two exact solutions, with the error of that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from squealstudy.modes.rung import Rung

SAFETY = 1.5  # roots are no parabolas


class Linear(Rung):
    """Between the ends of a box of one parameter, in which as many modes are to lie everywhere."""

    name = "linear"
    description = "roots interpolated linearly over a part of the sweep"
    keeps_tolerance = False
    shares_work = True

    def refusal(self, scope):
        return "" if scope.varied == 1 else f"linear serves one parameter, {scope.varied} vary"

    def solve(self, problem, points, box):
        low, middle, high = (
            problem.exact(problem.point_at(theta)) for theta in (box.low, box.middle, box.high)
        )
        curved = np.abs(middle.lam - (low.lam + high.lam) / 2)  # of a parabola, at its middle
        for i, theta in enumerate(problem.theta(points)):
            share = float((box.local(theta)[0] + 1) / 2)
            lam = (1 - share) * low.lam + share * high.lam
            error = SAFETY * 4 * share * (1 - share) * curved + low.error_rung
            yield i, replace(low, lam=lam, error_rung=error, method=self.name)

    def relative_cost(self, points, varied):
        return 3 / max(points, 3)


RUNG = Linear()
