"""Computes the gaps that sliding wears into a contact, by Archard's law."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from squealstudy.errors import ConvergenceError
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.gap_equations import GapJacobian
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.reduction.working_point import WorkingPoint, working_point

# error of depth in a step, over the gap scale of the law: the change of gap that changes the
# contact pressure by its own size
GAP_ERROR = 1e-3
# relative tolerance of a step, so small that the absolute one decides: wear may be many scales
REL_TOLERANCE = 1e-12
MIN_MEAN_PRESSURE = 1.0  # Pa: lower bound of the pressure at which the gap scale is taken


@dataclass(frozen=True)
class Wear:
    """The sliding that has worn a contact.

    Attributes
    ----------
    operating : OperatingPoint
        Brake pressure, friction, speed and laws during wear.
    distance : float
        Distance slid at the imposed speed, m; a point slides by this times its `speed_factor`.
    rate : float
        Worn depth per pressure and distance, 1/Pa (Archard's coefficient over the hardness).
    """

    operating: OperatingPoint
    distance: float
    rate: float


def worn_depth(assembly: Assembly, wear: Wear) -> np.ndarray:
    """Depth (n_points,) [m] that is worn off the contact points with friction.

    It solves dh/ds = rate p(gap0 + h) speed_factor, where p are the pressures of steady sliding on
    the worn faces (THEORY.md eq. (117)). After long wear, pressure times speed is equal everywhere.

    Raises
    ------
    ConvergenceError
        ``wear``, where there is no steady sliding at some distance; the status of the working
        point where there is none on unworn faces.
    """
    contact = assembly.contact
    rubbing = contact.frictional > 0
    if wear.distance == 0.0 or not rubbing.any():
        return np.zeros(contact.n_points)
    law, no_shapes = wear.operating.law, np.zeros((assembly.n_dof, 0))
    space = contact_space(assembly, mean_contact_stiffness(assembly, wear.operating), no_shapes)
    faces = _WearingFaces(space, wear, np.where(rubbing, wear.rate * contact.speed_factor, 0.0))
    unworn = np.zeros(contact.n_points)
    pressures = np.maximum(faces.at(unworn).contact_pressure, 0.0)
    mean_pressure = float(np.average(pressures[rubbing], weights=contact.area[rubbing]))
    error = GAP_ERROR * law.gap_scale(max(mean_pressure, MIN_MEAN_PRESSURE))
    fastest = float(faces.slope(0.0, unworn).max())
    solution = solve_ivp(
        faces.slope,
        (0.0, wear.distance),
        unworn,
        method="BDF",  # neighbours that stand out wear off thousands of times faster than the face
        jac=faces.jacobian,
        rtol=REL_TOLERANCE,
        atol=error,
        first_step=min(wear.distance, error / fastest) if fastest > 0 else None,
    )
    if not solution.success:
        text = f"it ends {solution.t[-1]:.3g} m of {wear.distance:g} m on the way"
        raise ConvergenceError("wear", text)
    depth: np.ndarray = solution.y[:, -1]
    return depth


class _WearingFaces:
    """Rates of wear and their derivatives, at steady sliding on worn faces.

    Parameters
    ----------
    space : ContactSpace
        Contact space of the unworn faces.
    wear : Wear
    rates : ndarray (nc,)
        Worn depth per pressure and imposed distance, 1/Pa; 0 at points without friction.
    """

    def __init__(self, space: ContactSpace, wear: Wear, rates: np.ndarray) -> None:
        self._space, self._operating, self._rates = space, wear.operating, rates
        self._depth = np.zeros(0)
        self._last: WorkingPoint | None = None
        self._jacobian = np.zeros((len(rates), len(rates)))

    def at(self, depth: np.ndarray) -> WorkingPoint:
        """Steady sliding on faces worn by a depth (nc,) [m]; Newton starts from the last gaps."""
        if self._last is None or not np.array_equal(depth, self._depth):
            start = None if self._last is None else self._last.gap + depth - self._depth
            self._last = self._solved(depth, start)
            self._depth = depth.copy()
        return self._last

    def _worn(self, depth: np.ndarray) -> ContactSpace:
        return replace(self._space, gap0=self._space.gap0 + depth)

    def _solved(self, depth: np.ndarray, start: np.ndarray | None) -> WorkingPoint:
        try:
            return working_point(self._worn(depth), self._operating, start=start)
        except ConvergenceError:
            if start is None:
                raise
            return working_point(self._worn(depth), self._operating)

    def slope(self, _: float, depth: np.ndarray) -> np.ndarray:
        """dh/ds (nc,); NaN at depths without steady sliding: the step was too long."""
        try:
            pressure = self.at(depth).contact_pressure
        except ConvergenceError:
            return np.full_like(depth, np.nan)
        rates: np.ndarray = self._rates * np.maximum(pressure, 0.0)
        return rates

    def jacobian(self, _: float, depth: np.ndarray) -> np.ndarray:
        """d(dh/ds)/dh (nc, nc) [1/m]: worn points open their gaps and press less.

        Where there is no steady sliding at this depth, the last Jacobian is returned.
        """
        try:
            point = self.at(depth)
        except ConvergenceError:
            return self._jacobian
        space = self._space
        p, kappa = point.contact_pressure, point.tangent
        contact_stiffness = np.diag(space.area * space.k_c)
        opened = np.eye(len(p)) - space.opening(contact_stiffness, np.zeros_like(contact_stiffness))
        gaps = GapJacobian(space, self._operating, p, kappa).solve(opened).T
        self._jacobian = -(self._rates * np.where(p > 0, kappa, 0.0))[:, None] * gaps
        return self._jacobian
