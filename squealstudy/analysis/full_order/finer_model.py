"""The next larger component-mode model: how far a reduced model is from the full-order one.

At a few working points the reduced right and left modes leave loads r = Q(lam) T psi in the
unreduced equations. The static responses K0^-1 r to random sums of them, each mode of unit energy,
span what the basis lacks (a randomised range finder: Halko, Martinsson, Tropp 2011). With them it
is a finer model, whose roots are nearer to those of the full-order model by orders of magnitude:
the distance of the roots of both models is the error of the smaller one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.analysis.design_state import DesignState, ModeKey
from squealstudy.analysis.full_order.modes import full_order_system
from squealstudy.analysis.linearise import linearise
from squealstudy.analysis.point import solve_point, state_working_point
from squealstudy.analysis.quadratic import dense_roots
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import factorise
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import Basis, ComponentModes, ReducedModel
from squealstudy.reduction.extended_basis import extended_basis
from squealstudy.reduction.prepared import PreparedModel, shape_basis

DIRECTIONS = 160  # static responses: with fewer some of what moves a root is left out
FINER = 0.003  # smallest direction of the finer model, in the largest; of its square in energy
ENRICHING = 0.012  # and of what enriches a basis
STRONG = 0.7  # least friction of the loads: they grow with it, and hold those of weaker friction
EDGE = 0.02  # of the band: how far beyond it the finer model is looked at
LOWEST = 0.02  # of the band's top: below it lies motion of nearly free bodies


@dataclass(frozen=True)
class Reduction:
    """What a prepared model was made from.

    Attributes
    ----------
    assembly : Assembly
    modes : mapping of component name -> ComponentModes
    points : tuple of OperatingPoint
        Residual loads are taken there, at strong friction and at none.
    scales : tuple of mapping of (component, mode) -> float
        And at the first of them, at strong friction, with component frequencies times these.
    top_hz : float
        Modes up to here leave loads.
    damped_to_hz : float
        Real modes of the unreduced assembly up to here have modal damping of their own, and those
        of the finer model: that a reduced one has it of all its modes is part of its error.
    """

    assembly: Assembly
    modes: Mapping[str, ComponentModes]
    points: tuple[OperatingPoint, ...]
    top_hz: float
    damped_to_hz: float
    scales: tuple[Mapping[ModeKey, float], ...] = ()

    @property
    def states(self) -> list[DesignState]:
        """Where residual loads are taken."""
        strong = [replace(p, friction=max(p.friction, STRONG)) for p in self.points]
        none = [replace(p, friction=0.0) for p in self.points]
        changed = [DesignState(strong[0], scale) for scale in self.scales]
        return [*map(DesignState, [*strong, *none]), *changed]


def with_finer_model(
    prepared: PreparedModel, basis: Basis, made: Reduction, rounds: int = 0
) -> tuple[PreparedModel, Basis]:
    """A prepared model, of this basis or of one that is enriched, with its finer model.

    Parameters
    ----------
    prepared : PreparedModel
    basis : Basis
    made : Reduction
    rounds : int
        0: the basis stays. 1: the leading static responses, which cover most of its error, join it,
        all of them make the finer model. 2: first all of them join, then the leading ones of what
        that basis lacks.

    Returns
    -------
    PreparedModel, Basis
        Without a finer model (None) where no working point has modes to be found.
    """
    try:
        if rounds > 1:
            responses = _responses(prepared, basis, made)
            model, basis = extended_basis(made.assembly, made.modes, basis, responses, FINER)
            prepared = _in_basis(prepared, model, basis, made)
        responses = _responses(prepared, basis, made)
        finer, _ = extended_basis(made.assembly, made.modes, basis, responses, FINER)
        if rounds > 0:
            model, basis = extended_basis(made.assembly, made.modes, basis, responses, ENRICHING)
            prepared = _in_basis(prepared, model, basis, made)
    except np.linalg.LinAlgError:  # an error that is not known is better than no study
        return replace(prepared, finer=None), basis
    finer = replace(finer, damped_to=2 * np.pi * made.damped_to_hz)
    return replace(prepared, finer=finer), basis


def _in_basis(
    prepared: PreparedModel, model: ReducedModel, basis: Basis, made: Reduction
) -> PreparedModel:
    """The same structure in another basis."""
    phi, sensors = shape_basis(made.assembly, model, basis, prepared.nominal_tangent)
    return replace(prepared, model=model, shape_basis=phi, sensor_shapes=sensors, finer=None)


def _responses(prepared: PreparedModel, basis: Basis, made: Reduction) -> np.ndarray:
    """K0^-1 of residual loads, K0 the symmetric stiffness of the nominal working point."""
    loads = residual_loads(prepared, basis, made)
    c = made.assembly.contact
    normal = sp.diags(c.area * prepared.nominal_tangent)
    K0 = made.assembly.K_el + made.assembly.K_springs() + c.N.T @ normal @ c.N
    return factorise(K0.tocsr()).solve_once(loads)


def residual_loads(prepared: PreparedModel, basis: Basis, made: Reduction) -> np.ndarray:
    """Random sums (n_dof, DIRECTIONS) of what reduced modes leave in the unreduced equations.

    Points without a working point or modes are left out; LinAlgError where no other is left.
    """
    rng = np.random.default_rng(0)  # the same structure has the same finer model
    found = []
    for state in made.states:
        with contextlib.suppress(ConvergenceError, np.linalg.LinAlgError):
            found.append(_loads_at(prepared, basis, made, state, rng))
    if not found:
        raise np.linalg.LinAlgError("no point has modes")
    return sum(found[1:], found[0])


def _loads_at(
    prepared: PreparedModel,
    basis: Basis,
    made: Reduction,
    state: DesignState,
    rng: np.random.Generator,
) -> np.ndarray:
    """The same of one design point, of right and left modes.

    Modes have unit energy |lam|^2 psi^H M psi, so that a load counts as much as it moves the root
    relatively.
    """
    point = state_working_point(prepared, state)
    small = linearise(prepared.model, point, state)
    assembly, top = made.assembly, 2 * np.pi * made.top_hz
    full = full_order_system(assembly, made.modes, point, state, made.top_hz)
    sides = [(small.C, small.K, full.C, full.K)]
    if state.operating.mu_steady:  # left vectors, conjugate
        sides.append((small.C.T, small.K.T, full.C.transpose(), full.K.transpose()))
    total = np.zeros((assembly.n_dof, DIRECTIONS))
    for C_r, K_r, C_f, K_f in sides:
        lam, psi = dense_roots(C_r, K_r, (LOWEST * top, top))
        psi = basis.expand(psi / np.abs(lam))  # M-orthonormal coordinates
        load = assembly.M @ (psi * lam**2) + C_f @ (psi * lam) + K_f @ psi
        mixed = rng.standard_normal((2 * len(lam), DIRECTIONS))
        total += load.real @ mixed[: len(lam)] + load.imag @ mixed[len(lam) :]
    return total


def reduction_errors(
    prepared: PreparedModel, state: DesignState, band_hz: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Roots (m,) of a design point in the reduced model, and how far those of the finer one are.

    Both are solved exactly; the errors (m,) are in rad/s. The finer model is looked at a little
    beyond the band, where a root of its edge may have its partner.

    Raises
    ------
    ConvergenceError
        Where there is no working point, or no finer model.
    """
    if prepared.finer is None:
        raise ConvergenceError("failed", "there is no finer model of this structure")
    found = solve_point(prepared, state, band_hz)
    n = prepared.finer.n
    larger = replace(prepared, model=prepared.finer, shape_basis=np.zeros((n, 1)))
    low, high = band_hz
    margin = (low * (1.0 - EDGE), high * (1.0 + EDGE))
    finer = solve_point(larger, state, margin, found.working_point.gap)
    return found.lam, partner_distances(found.lam, finer.lam)


def partner_distances(lam: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distance (m,) of each root to its partner among others, no two with the same partner.

    Infinite where there is none.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import, and workers alone need it

    distance = np.abs(lam[:, None] - others[None, :])
    found = np.full(len(lam), np.inf)
    rows, columns = linear_sum_assignment(distance)
    found[rows] = distance[rows, columns]
    return found
