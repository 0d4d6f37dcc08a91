"""Working points over a box of design points: interpolated, polished in batches, checked.

Gaps are polynomials of the box coordinates (pressure in its logarithm, where a gap of the
exponential law is nearly linear); a few simplified Newton steps with the inverse Jacobian of the
nearest anchor take them to the tolerance (THEORY.md eq. (13), (14)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.working_point import (
    GapEquations,
    WorkingPoint,
    working_point_result,
)

TOLERANCE = 1e-10  # relative gap imbalance; studies promise 1e-8
MOST_STEPS = 25
Changes = Mapping[int, float]  # column of U -> change of modal stiffness
Cardinals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Anchor:
    """A design point theta (d,) and the inverse Jacobian (nc, nc) of its gap equations."""

    theta: np.ndarray
    inverse: np.ndarray


def anchor_at(
    theta: np.ndarray, space: ContactSpace, operating: OperatingPoint, point: WorkingPoint
) -> Anchor:
    """An anchor at a working point; `space` is that of its component changes."""
    J = GapEquations(space, operating).jacobian(point.pressure, point.tangent)
    return Anchor(theta, la.inv(J, overwrite_a=True, check_finite=False))


@dataclass(frozen=True)
class WorkingPointField:
    """Gaps interpolated between nodes.

    Attributes
    ----------
    space : ContactSpace
        Without component changes.
    node_gaps : ndarray (q, nc)
    cardinals : callable
        theta (b, d) -> (b, q).
    anchors : tuple of Anchor
    """

    space: ContactSpace
    node_gaps: np.ndarray
    cardinals: Cardinals
    anchors: tuple[Anchor, ...]

    def gaps(self, theta: np.ndarray) -> np.ndarray:
        """Interpolated gaps (b, nc) at theta (b, d), not polished."""
        found: np.ndarray = self.cardinals(theta) @ self.node_gaps
        return found

    def solve(
        self,
        theta: np.ndarray,
        operating: Sequence[OperatingPoint],
        changes: Sequence[Changes],
    ) -> list[WorkingPoint | None]:
        """Polished working points at theta (b, d); None where the residual stays too large."""
        found: list[WorkingPoint | None] = [None] * len(theta)
        places = np.array([anchor.theta for anchor in self.anchors])
        nearest = ((theta[:, None] - places[None]) ** 2).sum(axis=2).argmin(axis=1)
        start = self.gaps(theta)
        for number in np.unique(nearest):
            rows = [int(i) for i in np.flatnonzero(nearest == number)]
            batch = BatchEquations(
                self.space, [operating[i] for i in rows], [changes[i] for i in rows]
            )
            solved = _polish(batch, start[rows], self.anchors[number].inverse)
            for i, point in zip(rows, solved, strict=True):
                found[i] = point
        return found


def _polish(
    equations: BatchEquations, g: np.ndarray, inverse: np.ndarray
) -> list[WorkingPoint | None]:
    """Simplified Newton from gaps g (b, nc)."""
    with np.errstate(over="ignore", invalid="ignore"):
        F, p, kappa = equations.imbalance(g)
        residual = equations.relative(F, g)
        steps = 0
        while steps < MOST_STEPS and (open_ := ~(residual < TOLERANCE)).any():
            steps += 1
            g = np.where(open_[:, None], g - F @ inverse.T, g)
            F, p, kappa = equations.imbalance(g)
            residual = equations.relative(F, g)
    area = equations.space.area
    return [
        working_point_result(area, g[i], p[i], kappa[i], steps, float(residual[i]), F[i])
        if residual[i] < TOLERANCE
        else None
        for i in range(len(g))
    ]


class BatchEquations:
    """Imbalance of the gaps at several operating points at once (working_point.GapEquations).

    Component changes enter by Woodbury's identity, never as changed compliances.
    """

    def __init__(
        self,
        space: ContactSpace,
        operating: Sequence[OperatingPoint],
        changes: Sequence[Changes],
    ) -> None:
        self.space, self._operating = space, operating
        self._columns = sorted({j for c in changes for j, dk in c.items() if dk})
        self._cores = [self._core(c) for c in changes]
        self._load = np.array([[o.pressure, 1.0] for o in operating])
        still = np.zeros((len(operating), len(space.area)))
        self._fixed = space.gap0 + self._movement(still, still)
        self._size = np.abs(self._fixed - space.gap0).max(axis=1)

    def _core(self, changes: Changes) -> np.ndarray:
        j = self._columns
        D = np.diag([changes.get(column, 0.0) for column in j])
        return np.linalg.solve(np.eye(len(j)) + D @ self.space.H_UU[np.ix_(j, j)], D)

    def _movement(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """N K^-1 (N^T s - T^T t + loads) (b, nc) of the changed structures."""
        space, j = self.space, self._columns
        moved = s @ space.H_NN - t @ space.H_NT.T + self._load @ space.H_Nf.T
        if j:
            seen = s @ space.H_NU[:, j] - t @ space.H_TU[:, j] + self._load @ space.H_fU[:, j]
            lost = np.array([core @ x for core, x in zip(self._cores, seen, strict=True)])
            moved -= lost @ space.H_NU[:, j].T
        return moved

    def imbalance(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F(g) [m], pressure [Pa] and tangent [Pa/m], each (b, nc)."""
        space = self.space
        pairs = [o.law.evaluate(row) for o, row in zip(self._operating, g, strict=True)]
        p, kappa = (np.array(part) for part in zip(*pairs, strict=True))
        drag = np.array([o.traction(row) for o, row in zip(self._operating, p, strict=True)])
        s = space.area * (p + space.k_c * (g - space.gap0))
        F = g - space.gap0 - self._movement(s, space.area * space.frictional * drag)
        return F, p, kappa

    def relative(self, F: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Largest imbalance relative to the movement under the load and to the gaps, (b,)."""
        size: np.ndarray = self._size + np.abs(g).max(axis=1) + 1e-300
        return np.abs(F).max(axis=1) / size
