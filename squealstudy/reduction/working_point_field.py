"""Gaps of steady sliding over a box of design points: interpolated, then polished by Newton.

Gaps are interpolated by polynomials of the box coordinates; pressure enters by its logarithm, of
which a gap of the exponential law is a nearly linear function. A few simplified Newton steps with
the Jacobian of the nearest anchor bring them to the tolerance (THEORY.md eq. (13), (14)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.gap_equations import Changes, GapEquations, GapJacobian
from squealstudy.reduction.working_point import (
    WorkingPoint,
    corner_text,
    mean_pressure,
    working_point_result,
)

POLISHED = 1e-10  # relative gap imbalance at which Newton ends; studies promise 1e-8
MOST_STEPS = 25  # simplified Newton steps
Cardinals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class NewtonAnchor:
    """A design point theta (d,) and the Jacobian of its gap equations."""

    theta: np.ndarray
    jacobian: GapJacobian


def anchor_at(
    theta: np.ndarray, space: ContactSpace, operating: OperatingPoint, point: WorkingPoint
) -> NewtonAnchor:
    """Anchor at a working point; the component changes there are made in `space`."""
    jacobian = GapJacobian(space, operating, point.contact_pressure, point.tangent)
    return NewtonAnchor(theta, jacobian)


@dataclass(frozen=True)
class WorkingPointField:
    """Gaps of working points interpolated over a box of design points.

    Attributes
    ----------
    space : ContactSpace
        Contact space without component changes.
    node_gaps : ndarray (q, nc)
        Gaps at the interpolation nodes, m.
    cardinals : callable
        Interpolation weights (b, q) of the nodes at theta (b, d).
    anchors : tuple of NewtonAnchor
    """

    space: ContactSpace
    node_gaps: np.ndarray
    cardinals: Cardinals
    anchors: tuple[NewtonAnchor, ...]

    def gaps(self, theta: np.ndarray) -> np.ndarray:
        """Interpolated gaps (b, nc) at theta (b, d), not polished."""
        gaps_between: np.ndarray = self.cardinals(theta) @ self.node_gaps
        return gaps_between

    def solve(
        self,
        theta: np.ndarray,
        operating: Sequence[OperatingPoint],
        changes: Sequence[Changes],
    ) -> list[WorkingPoint | None]:
        """Working points at theta (b, d) after Newton steps.

        None where the imbalance stays too large, or a point is at a corner of its law.
        """
        working_points: list[WorkingPoint | None] = [None] * len(theta)
        thetas = np.array([anchor.theta for anchor in self.anchors])
        nearest = ((theta[:, None] - thetas[None]) ** 2).sum(axis=2).argmin(axis=1)
        start = self.gaps(theta)
        for number in np.unique(nearest):
            rows = [int(i) for i in np.flatnonzero(nearest == number)]
            batch = GapEquations(
                self.space, [operating[i] for i in rows], [changes[i] for i in rows]
            )
            solved = _polish(batch, start[rows], self.anchors[number].jacobian)
            for i, point in zip(rows, solved, strict=True):
                working_points[i] = point
        return working_points


def _polish(
    equations: GapEquations, g: np.ndarray, jacobian: GapJacobian
) -> list[WorkingPoint | None]:
    """Working points by simplified Newton from gaps g (b, nc), with None as in `solve`."""
    with np.errstate(over="ignore", invalid="ignore"):
        F, p, kappa = equations.imbalance(g)
        residual = equations.relative(F, g)
        steps = 0
        while steps < MOST_STEPS and (unbalanced := ~(residual < POLISHED)).any():
            steps += 1
            g = np.where(unbalanced[:, None], g - jacobian.solve(F), g)
            F, p, kappa = equations.imbalance(g)
            residual = equations.relative(F, g)
    space = equations.space
    mean_pressures = [mean_pressure(space, point) for point in equations.operating]
    return [
        working_point_result(
            space.area,
            g[i],
            p[i],
            kappa[i],
            steps,
            float(residual[i]),
            F[i],
            mean_pressures[i],
            space.spring_points,
        )
        if residual[i] < POLISHED and corner_text(space, equations.operating[i], g[i]) is None
        else None
        for i in range(len(g))
    ]
