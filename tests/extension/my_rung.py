"""A rung that interpolates: roots on a line between two exact solutions, with the error of that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from scipy.optimize import linear_sum_assignment

from squealstudy.errors import ConvergenceError
from squealstudy.modes.point import PointModes
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.rung import Rung, Scope
from squealstudy.modes.rungs import register_rung

SAFETY = 1.5  # roots are no parabolas
LEAST_MAC = 0.5  # of shapes of one mode at two points
Ends = tuple[PointModes, PointModes, np.ndarray]  # at low, at high, distance from the line (k,)


def taken(modes: PointModes, order: np.ndarray) -> PointModes:
    """Modes in another order."""
    names = ("lam", "residual", "shapes", "error_rung")
    parts = {name: getattr(modes, name)[order] for name in names}
    return replace(modes, energies=modes.energies[:, order], **parts)


def paired(modes: PointModes, others: PointModes) -> PointModes:
    """`modes` in the order of `others`, by shapes: their own order is that of the frequencies."""
    mac = np.abs(others.shapes.conj() @ modes.shapes.T) ** 2
    rows, order = linear_sum_assignment(-mac)
    if len(order) < max(mac.shape) or (mac[rows, order] < LEAST_MAC).any():
        raise ConvergenceError("not_converged", "modes cannot be paired within the box")
    return taken(modes, order)


class Linear(Rung):
    """Between the ends of a box of one parameter, in which as many modes are to lie everywhere."""

    name = "linear"
    description = "roots interpolated linearly over a part of the sweep"
    keeps_tolerance = False
    shares_work = True

    def __init__(self) -> None:
        self._ends_of_boxes: WeakKeyDictionary[Problem, dict[tuple[float, ...], Ends]] = (
            WeakKeyDictionary()  # what a box costs, for points that are asked for later
        )

    def refusal(self, scope: Scope) -> str:
        return "" if scope.varied == 1 else f"linear serves one parameter, {scope.varied} vary"

    def solve(
        self, problem: Problem, points: Sequence[Point], box: Box
    ) -> Iterator[tuple[int, PointModes | ConvergenceError]]:
        low, high, curved = self._ends(problem, box)
        theta = problem.theta(points)
        for i, (at, own) in enumerate(zip(theta, problem.swept.samples(theta), strict=True)):
            if isinstance(own, ConvergenceError):  # no working point: none by any rung
                yield i, own
                continue
            share = float((box.local(at)[0] + 1) / 2)
            near = low if share < 0.5 else high
            yield (
                i,
                replace(
                    near,  # its shapes
                    lam=(1 - share) * low.lam + share * high.lam,
                    error_rung=SAFETY * 4 * share * (1 - share) * curved + near.error_rung,
                    residual=np.full(len(near.lam), np.nan),  # none was computed
                    energies=(1 - share) * low.energies + share * high.energies,
                    working_point=own.working_point or near.working_point,
                    method=self.name,
                ),
            )

    @property
    def setup_solves(self) -> int:
        return 3  # the nodes

    def relative_cost(self, points: int, varied: int) -> float:
        return 0.05  # of a point between them

    def _ends(self, problem: Problem, box: Box) -> Ends:
        """Modes at both ends, and how far roots lie off the line in the middle; once a box."""
        boxes = self._ends_of_boxes.setdefault(problem, {})
        key = (*box.low, *box.high)
        if key not in boxes:
            low, middle, high = (
                problem.exact(problem.point_at(theta)) for theta in (box.low, box.middle, box.high)
            )
            middle, high = paired(middle, low), paired(high, low)
            boxes[key] = low, high, np.abs(middle.lam - (low.lam + high.lam) / 2)
        return boxes[key]


register_rung(Linear())
