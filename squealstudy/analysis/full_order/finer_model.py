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

from squealstudy.analysis.design_state import DesignState
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

DIRECTIONS = 40  # static responses
FINER = 0.003  # smallest direction of the finer model, in the largest; of its square in energy
ENRICHING = 0.05  # and of what enriches a basis
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
        The nominal one first; residual loads are taken there, and without friction.
    top_hz : float
        Modes up to here leave loads.
    damped_to_hz : float
        Real modes up to here carry the modal damping of the unreduced assembly, and of the finer
        model: that a reduced one damps all of its modes is part of its error.
    """

    assembly: Assembly
    modes: Mapping[str, ComponentModes]
    points: tuple[OperatingPoint, ...]
    top_hz: float
    damped_to_hz: float


def with_finer_model(prepared: PreparedModel, basis: Basis, made: Reduction) -> PreparedModel:
    """A prepared model, of this basis, with its finer model.

    Without a working point whose modes can be found there is no finer model: None.
    """
    larger = _extended(prepared, basis, made, FINER)
    if larger is None:
        return replace(prepared, finer=None)
    return replace(prepared, finer=replace(larger[0], damped_to=2 * np.pi * made.damped_to_hz))


def enriched(prepared: PreparedModel, basis: Basis, made: Reduction) -> tuple[PreparedModel, Basis]:
    """The prepared model with the leading directions of its finer one in its basis, and that.

    It has no finer model yet. Where there would be none, it is the same.
    """
    larger = _extended(prepared, basis, made, ENRICHING)
    if larger is None:
        return prepared, basis
    model, basis = larger
    phi, sensors = shape_basis(made.assembly, model, basis, prepared.nominal_tangent)
    return replace(prepared, model=model, shape_basis=phi, sensor_shapes=sensors, finer=None), basis


def _extended(
    prepared: PreparedModel, basis: Basis, made: Reduction, share: float
) -> tuple[ReducedModel, Basis] | None:
    loads = residual_loads(prepared, basis, made)
    if loads is None:
        return None
    responses = _responses(prepared, made.assembly, loads)
    try:
        return extended_basis(made.assembly, made.modes, basis, responses, share)
    except np.linalg.LinAlgError:  # an error that is not known is better than no study
        return None


def residual_loads(prepared: PreparedModel, basis: Basis, made: Reduction) -> np.ndarray | None:
    """Random sums (n_dof, DIRECTIONS) of what reduced modes leave in the unreduced equations.

    Points without a working point or modes are left out; None where no other is left.
    """
    rng = np.random.default_rng(0)  # the same structure has the same finer model
    states = map(DesignState, [*made.points, replace(made.points[0], friction=0.0)])
    found = []
    for state in states:
        with contextlib.suppress(ConvergenceError, np.linalg.LinAlgError):
            found.append(_loads_at(prepared, basis, made, state, rng))
    return sum(found[1:], found[0]) if found else None


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
    full = full_order_system(assembly, {}, point, state, made.top_hz)
    C, K = full.C.sparse, full.K.sparse
    sides = [(small.C, small.K, C, K)]
    if state.operating.mu_steady:
        sides.append((small.C.T, small.K.T, C.T, K.T))  # left vectors, conjugate
    total = np.zeros((assembly.n_dof, DIRECTIONS))
    for C_r, K_r, C_f, K_f in sides:
        lam, psi = dense_roots(C_r, K_r, (LOWEST * top, top))
        psi = basis.expand(psi / np.abs(lam))  # M-orthonormal coordinates
        load = assembly.M @ (psi * lam**2) + C_f @ (psi * lam) + K_f @ psi
        mixed = rng.standard_normal((2 * len(lam), DIRECTIONS))
        total += load.real @ mixed[: len(lam)] + load.imag @ mixed[len(lam) :]
    return total


def _responses(prepared: PreparedModel, assembly: Assembly, loads: np.ndarray) -> np.ndarray:
    """K0^-1 of loads, K0 the symmetric stiffness of the nominal working point."""
    c = assembly.contact
    normal = sp.diags(c.area * prepared.nominal_tangent)
    K0 = assembly.K_el + assembly.K_springs() + c.N.T @ normal @ c.N
    return factorise(K0.tocsr()).solve_once(loads)


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
