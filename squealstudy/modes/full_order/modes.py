"""Full-order complex modes of a brake or of a family of matrices, the reference of reductions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.band_roots import (
    BandRoots,
    judged_roots,
    pair_residuals,
    roots_in_band,
)
from squealstudy.linalg.factor import RefinedFactor, factorise
from squealstudy.linalg.quadratic_pencil import QuadraticPencil, squared
from squealstudy.linalg.real_modes import real_modes
from squealstudy.linalg.root_error import Matrix
from squealstudy.linalg.sparse_qep import (
    DENSE_LIMIT,
    LowRankSum,
    WoodburyFactor,
    roots_below,
)
from squealstudy.models.assembly import Assembly
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.operating import DesignState
from squealstudy.modes.full_order.contact_factor import ContactFactor, HeldStiffness
from squealstudy.modes.point import PointModes, oscillating_first, state_working_point
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.reduction.orthonormal import new_directions
from squealstudy.reduction.prepared import (
    PreparedFamily,
    PreparedModel,
    unit_shapes,
)
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.root_pairs import angular_band
from squealstudy.system.energies import energy_shares
from squealstudy.system.linearise import (
    SYMMETRIC_STIFFNESS_FIELDS,
    ContactStructure,
    StructureWeights,
    unreduced_structure,
)
from squealstudy.system.parametric import DAMPING, ParametricSystem, Term, Weights

FULL = "full"
DEPENDENT = (
    1e-6  # new part of a static response beside real modes, over the largest, left out below
)
CHECK_SHIFT = 0.013  # shift of the factorisation that checks, over the band's top
UNDEFINED = "undefined"  # status of a point where a coefficient has no value


@dataclass(frozen=True)
class FullOrderSystem:
    """The unreduced assembly of a design point, linearised about its working point.

    Attributes
    ----------
    assembly : Assembly
    state : DesignState
    point : WorkingPoint
    structure : ContactStructure
        The linearised structure; its shapes are component modes that the state changes or damps.
    weights : StructureWeights
    C, K : LowRankSum (n_dof, n_dof)
        Damping, modal damping included, and non-symmetric stiffness.
    omega, phi : ndarray (m,), (n_dof, m)
        Frequencies [rad/s] and mass-normalised real modes with modal damping; none without it.
    factor : RefinedFactor or None
        Factor of the sparse part of K, if it has been made.
    """

    assembly: Assembly
    state: DesignState
    point: WorkingPoint
    structure: ContactStructure
    weights: StructureWeights
    C: LowRankSum
    K: LowRankSum
    omega: np.ndarray
    phi: np.ndarray
    factor: RefinedFactor | None = None

    @property
    def pencil(self) -> QuadraticPencil:
        """M, C and K."""
        return QuadraticPencil(self.assembly.M, self.C, self.K)

    @property
    def w2(self) -> np.ndarray:
        """Squares (m,) of omega [(rad/s)^2]; below zero where contact has given way."""
        K_sym = self.structure.system.sparse_sum(self.weights, SYMMETRIC_STIFFNESS_FIELDS)
        energies = np.einsum("im,im->m", self.phi, K_sym @ self.phi)
        return np.where(self.omega > 0.0, self.omega**2, np.minimum(energies, 0.0))


def full_order_system(
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    point: WorkingPoint,
    state: DesignState,
    damped_to_hz: float,
    held_stiffness: HeldStiffness | None = None,
) -> FullOrderSystem:
    """The unreduced assembly about a working point (THEORY.md eq. (17), (19)).

    Changes of component modes enter as exact low-rank terms M phi (.) phi^T M. Modal damping
    (THEORY.md eq. (18)) is that of the real modes up to `damped_to_hz`; modes beyond have the
    coefficient 2 zeta omega of a mode at that frequency.

    Parameters
    ----------
    modes : mapping of component -> ComponentModes
        Modes of the components whose modes the state changes or damps.
    held_stiffness : HeldStiffness or None
        Factored stiffness of the assembly, to use in place of factors for this design point.

    Raises
    ------
    ParameterError
        Damping of an assembly mode beyond `damped_to_hz`.
    """
    structure = unreduced_structure(assembly, modes, state)
    named = structure.weights(point, state)
    weights: Weights = named
    terms, M = structure.system.terms, assembly.M
    omega, phi = np.zeros(0), np.zeros((assembly.n_dof, 0))
    if state.damping_ratio or any(state.assembly_damping.values()):
        K_sym = structure.system.sparse_sum(named, SYMMETRIC_STIFFNESS_FIELDS)
        omega, phi = _real_modes(M, K_sym, damped_to_hz, _factor(held_stiffness, K_sym, named, 0.0))
        dampers, beyond = 2.0 * state.assembly_damping_ratios(len(omega)) * omega, 0.0
        if len(omega) < assembly.n_dof:  # the others have one coefficient
            beyond = 4.0 * np.pi * state.damping_ratio * damped_to_hz
        rows = (M @ phi[:, dampers != beyond]).T
        terms = (*terms, Term(DAMPING, None, M), Term(DAMPING, rows, rows))
        weights = (*named, beyond, (dampers - beyond)[dampers != beyond])
    _, C, K = ParametricSystem(assembly.n_dof, terms).sparse_matrices(weights)
    return FullOrderSystem(
        assembly=assembly,
        state=state,
        point=point,
        structure=structure,
        weights=named,
        C=C,
        K=K,
        omega=omega,
        phi=phi,
        factor=_factor(held_stiffness, K, named, 1.0),
    )


def _factor(
    held_stiffness: HeldStiffness | None, K: LowRankSum, weights: StructureWeights, friction: float
) -> RefinedFactor | None:
    """A factor of the sparse part of a stiffness with or without friction (1 or 0)."""
    if held_stiffness is None:
        return None
    return ContactFactor(held_stiffness, K.sparse, weights.normal, friction * weights.coupling)


def _real_modes(
    M: sp.csr_matrix, K_sym: LowRankSum, cutoff_hz: float, factor: RefinedFactor | None
) -> tuple[np.ndarray, np.ndarray]:
    """Real modes (omega, phi) up to a cutoff; the factor, if any, is that of the sparse stiffness.

    If the stiffness has a low-rank part U diag(d) U^T they follow by Rayleigh-Ritz on the modes
    without that part and on its static responses K^-1 U.
    """
    shift = None if factor is None else 0.0
    omega, phi = real_modes(M, K_sym.sparse, cutoff_hz, factor, shift)
    if not len(K_sym.d):
        return omega, phi
    static = (factor or factorise(K_sym.sparse)).solve(K_sym.U)
    static = static / np.sqrt(np.einsum("ij,ij->j", static, M @ static))
    X = np.hstack([phi, new_directions(M, phi, static, DEPENDENT)])
    w2, y = la.eigh(X.T @ (K_sym @ X))
    within = w2 <= (2 * np.pi * cutoff_hz) ** 2
    return np.sqrt(np.maximum(w2[within], 0.0)), X @ y[:, within]


def full_order_roots(system: FullOrderSystem, band: tuple[float, float]) -> BandRoots:
    """All roots of the unreduced equations in a band (low, high), rad/s."""
    M, C, K = system.assembly.M, system.C, system.K
    for refined in (False, True):  # refined solves only if roots are not accurate without
        large = system.assembly.n_dof > DENSE_LIMIT
        factor = WoodburyFactor(K, refined, system.factor) if large else None
        band_roots, doubt = judged_roots(M, C, K, *roots_below(M, C, K, band[1], factor), band)
        if doubt <= 1.0:
            break
    return band_roots


def full_order_modes(
    prepared: PreparedModel,
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    state: DesignState,
    band_hz: tuple[float, float],
    damped_to_hz: float,
    held_stiffness: HeldStiffness | None = None,
) -> PointModes:
    """Complex modes of the unreduced assembly in a band, in the form of those of reduced rungs.

    Shapes are least-squares coordinates on the prepared model's shape basis, from motions at its
    sensors. The error is that of the eigenproblem (`root_errors`), the residual |Q psi| / |K psi|.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    ParameterError
        Damping of an assembly mode beyond `damped_to_hz`.
    """
    point = state_working_point(prepared, state)
    system = full_order_system(assembly, modes, point, state, damped_to_hz, held_stiffness)
    roots = full_order_roots(system, angular_band(band_hz))
    order = oscillating_first(roots.lam)
    lam, psi = roots.lam[order], roots.psi[:, order]
    sensor_motion = (
        assembly.correspondence @ psi
    )  # which may have no column: LAPACK alone refuses that
    shapes = np.linalg.lstsq(prepared.sensor_shapes, sensor_motion, rcond=None)[0]
    return PointModes(
        lam=lam,
        residual=stiffness_residuals(system, lam, psi),
        energies=_energies(system, psi),
        shapes=unit_shapes(shapes),
        working_point=point,
        error_rung=roots.error[order],
        method=FULL,
    )


def stiffness_residuals(system: FullOrderSystem, lam: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Residual |Q psi| / |K psi| (m,) of roots lam (m,) [rad/s] with vectors psi (n_dof, m)."""
    restoring = system.K @ psi
    R = system.assembly.M @ (psi * lam**2) + system.C @ (psi * lam) + restoring
    residual: np.ndarray = la.norm(R, axis=0) / la.norm(restoring, axis=0)
    return residual


def _energies(system: FullOrderSystem, psi: np.ndarray) -> np.ndarray:
    """Shares of the components, then of the interfaces, in the elastic energy (c + 1, m)."""
    structure, assembly = system.structure, system.assembly
    dk = np.broadcast_to(system.weights.shapes, len(structure.places))
    changed = dk[:, None] * squared(np.asarray(structure.shapes @ psi))
    components = []
    for component in assembly.components:
        component_motion = psi[assembly.slices[component.name]]
        energy = np.einsum("im,im->m", component_motion.conj(), component.K @ component_motion).real
        rows = [row for (name, _), row in structure.places.items() if name == component.name]
        components.append(energy + changed[rows].sum(axis=0))
    springs, N = structure.springs, structure.N
    return energy_shares(np.array(components), springs, N, system.weights, psi)


def family_system(family: MatrixFamily) -> ParametricSystem:
    """The family as a parametric system; its weights are `MatrixFamily.weights`."""
    return ParametricSystem(
        family.n, tuple(Term(term.order, None, term.matrix) for term in family.terms)
    )


def solve_family_point(
    prepared: PreparedFamily,
    values: Mapping[str, float],
    band_hz: tuple[float, float],
    check: bool = False,
) -> PointModes:
    """Complex modes with |lambda|/2 pi in `band_hz` at parameter values.

    They have no energies (the array has no rows) and no working point; the residual of a pair is
    its normwise backward error. With `check` the modes are computed by another factorisation, about
    a positive real shift: roots that Arnoldi's method misses or spoils in one space differ in the
    other.

    Raises
    ------
    ConvergenceError
        Where a coefficient has no value (``undefined``), or the solver does not converge.
    """
    M, C, K = family_matrices(prepared.model, values, dense=prepared.model.n <= DENSE_LIMIT)
    roots = family_roots(prepared, (M, C, K), band_hz, check)
    lam, psi = roots.lam, roots.psi
    return PointModes(
        lam=lam,
        residual=pair_residuals(M, C, K, lam, psi),
        energies=np.zeros((0, len(lam))),
        shapes=unit_shapes(prepared.shape_rows @ psi),
        working_point=None,
        error_rung=roots.error,
        method=FULL,
    )


def family_roots(
    prepared: PreparedFamily,
    matrices: tuple[Matrix, Matrix, Matrix],
    band_hz: tuple[float, float],
    check: bool = False,
) -> BandRoots:
    """Roots of M, C, K in a band, oscillating ones first; arguments of `solve_family_point`."""
    band = angular_band(band_hz)
    shift = CHECK_SHIFT * band[1] if check else 0.0
    roots = roots_in_band(*matrices, band, prepared.n_roots, shift)
    order = oscillating_first(roots.lam)
    return replace(roots, lam=roots.lam[order], psi=roots.psi[:, order], error=roots.error[order])


def family_matrices(
    family: MatrixFamily, values: Mapping[str, float], dense: bool = False
) -> tuple[Matrix, Matrix, Matrix]:
    """M, C, K of a family, sparse or dense; ConvergenceError ``undefined`` without a value."""
    try:
        return family.dense(values) if dense else family.matrices(values)
    except ExpressionError as error:
        raise ConvergenceError(UNDEFINED, str(error)) from error
