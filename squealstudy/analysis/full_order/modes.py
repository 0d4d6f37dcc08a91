"""Full-order complex modes: the reference that every reduced figure is held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.factor import factorise
from squealstudy.linalg.real_modes import real_modes
from squealstudy.linalg.root_error import root_errors
from squealstudy.linalg.sparse_qep import (
    DENSE_LIMIT,
    LowRankSum,
    WoodburyFactor,
    smallest_roots,
)
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.reduction.orthonormal import new_directions
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState, ModeKey
from squealstudy.system.linearise import SYMMETRIC, unreduced_structure
from squealstudy.system.parametric import DAMPING, ParametricSystem, Term, Weights

FIRST_ROOTS = 120  # asked for where their number is not known
MORE_ROOTS = 10  # than expected, at least: one must lie beyond the band
DEPENDENT = 1e-6  # static responses that add less to real modes, of the largest, are left out
LIGHT = 0.05  # |zeta| below: the modes that errors are stated for


@dataclass(frozen=True)
class FullOrderModes:
    """Roots [rad/s] in a band, full-order vectors, residuals, and estimated errors [rad/s].

    A residual is |Q psi| / |K psi|, of a family of matrices the normwise backward error.
    """

    lam: np.ndarray
    psi: np.ndarray
    residual: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class ReducedError:
    """Largest errors over the lightly damped modes of a band (|zeta| < 5 %).

    Attributes
    ----------
    frequency : float
        Relative error of |lambda|.
    damping : float
        Absolute error of the damping ratio.
    missed : int
        Full-order modes without a reduced mode within 5 % in the complex plane.
    """

    frequency: float
    damping: float
    missed: int


def full_order_modes(
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    point: WorkingPoint,
    state: DesignState,
    band_hz: tuple[float, float],
    damped_to_hz: float,
    expected: int | None = None,
) -> FullOrderModes:
    """Complex modes of the unreduced assembly at a working point (THEORY.md eq. (17), (19)).

    Changes of component modes enter as exact low-rank terms M phi (.) phi^T M; modal damping
    (THEORY.md eq. (18)) is put on the real modes up to `damped_to_hz`, those beyond have the
    coefficient 2 zeta omega of a mode there. `expected` is how many roots the band's top may have
    below it, conjugates included: all are found whatever it says, soonest where it is close.

    Raises
    ------
    ConvergenceError
        Where ARPACK does not converge.
    ParameterError
        Damping of an assembly mode beyond `damped_to_hz`.
    """
    system = full_order_system(assembly, modes, point, state, damped_to_hz)
    C_sum, K_sum = system.C, system.K
    low, high = (2 * np.pi * f for f in band_hz)
    for refined in (False, True):  # the solves, where the roots without are not accurate
        lam, psi = _roots_to(assembly, C_sum, K_sum, high, expected, refined)
        kept = np.abs(lam) >= low
        lam, psi = lam[kept], psi[:, kept]
        errors = root_errors(assembly.M, C_sum, K_sum, lam, psi)
        if errors.doubt(lam) <= 1.0:
            break
    told = errors.resolved(lam, high)
    lam, psi, error = lam[told], psi[:, told], errors.error[told]
    R = assembly.M @ (psi * lam**2) + C_sum @ (psi * lam) + K_sum @ psi
    size = np.linalg.norm(K_sum @ psi, axis=0)
    return FullOrderModes(lam, psi, np.linalg.norm(R, axis=0) / size, error)


@dataclass(frozen=True)
class FullOrderSystem:
    """Matrices of the unreduced assembly at a working point.

    Attributes
    ----------
    C, K : LowRankSum (n_dof, n_dof)
        Damping and non-symmetric stiffness.
    omega, phi : ndarray (m,), (n_dof, m)
        Real modes whose modal damping is their own, mass-normalised; none without it.
    """

    C: LowRankSum
    K: LowRankSum
    omega: np.ndarray
    phi: np.ndarray


def full_order_system(
    assembly: Assembly,
    modes: Mapping[str, ComponentModes],
    point: WorkingPoint,
    state: DesignState,
    damped_to_hz: float,
) -> FullOrderSystem:
    """The matrices that `full_order_modes` solves; parameters and errors are its own."""
    structure = unreduced_structure(assembly, modes, state)
    weights: Weights = structure.weights(point, state)
    terms, M = structure.system.terms, assembly.M
    omega, phi = np.zeros(0), np.zeros((assembly.n_dof, 0))
    if state.damping_ratio or any(state.assembly_damping.values()):
        omega, phi = _real_modes(M, structure.system.sparse_sum(weights, SYMMETRIC), damped_to_hz)
        dampers, beyond = 2.0 * state.assembly_damping_ratios(len(omega)) * omega, 0.0
        if len(omega) < assembly.n_dof:  # the others have one coefficient
            beyond = 4.0 * np.pi * state.damping_ratio * damped_to_hz
        rows = (M @ phi[:, dampers != beyond]).T
        terms = (*terms, Term(DAMPING, None, M), Term(DAMPING, rows, rows))
        weights = (*weights, beyond, (dampers - beyond)[dampers != beyond])
    _, C, K = ParametricSystem(assembly.n_dof, terms).sparse_matrices(weights)
    return FullOrderSystem(C, K, omega, phi)


def _real_modes(
    M: sp.csr_matrix, K_sym: LowRankSum, cutoff_hz: float
) -> tuple[np.ndarray, np.ndarray]:
    """Real modes (omega, phi) up to a cutoff.

    With a low-rank part U diag(d) U^T of the stiffness by Rayleigh-Ritz, on the modes without it
    and on its static responses K^-1 U.
    """
    omega, phi = real_modes(M, K_sym.sparse, cutoff_hz)
    if not len(K_sym.d):
        return omega, phi
    static = factorise(K_sym.sparse).solve(K_sym.U)
    static = static / np.sqrt(np.einsum("ij,ij->j", static, M @ static))
    X = np.hstack([phi, new_directions(M, phi, static, DEPENDENT)])
    w2, y = la.eigh(X.T @ (K_sym @ X))
    kept = w2 <= (2 * np.pi * cutoff_hz) ** 2
    return np.sqrt(np.maximum(w2[kept], 0.0)), X @ y[:, kept]


def mode_frequencies(modes: Mapping[str, ComponentModes]) -> dict[ModeKey, float]:
    """Free-free frequency [rad/s] of every component mode."""
    return {(name, j + 1): float(w) for name, m in modes.items() for j, w in enumerate(m.omega)}


def component_terms(
    assembly: Assembly, modes: Mapping[str, ComponentModes], values: Mapping[ModeKey, float]
) -> tuple[np.ndarray, np.ndarray]:
    """U = M phi and the diagonal of the changed component modes."""
    U = np.zeros((assembly.n_dof, len(values)))
    masses = {c.name: c.M for c in assembly.components}
    for column, (name, j) in enumerate(values):
        U[assembly.slices[name], column] = masses[name] @ modes[name].phi[:, j - 1]
    return U, np.array(list(values.values()), dtype=float)


def _roots_to(
    assembly: Assembly,
    C: LowRankSum,
    K: LowRankSum,
    limit: float,
    expected: int | None,
    refined: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """All roots up to `limit` [rad/s]: ask for more until one lies beyond."""
    most = 2 * assembly.n_dof if assembly.n_dof <= DENSE_LIMIT else 2 * assembly.n_dof - 2
    first = FIRST_ROOTS if expected is None else int(1.05 * expected) + MORE_ROOTS
    n_roots = min(first, most)
    factor = WoodburyFactor(K, refined) if assembly.n_dof > DENSE_LIMIT else None
    while True:
        lam, psi = smallest_roots(assembly.M, C, K, n_roots, limit / 2, factor)
        if np.abs(lam).max() > limit or n_roots >= most:
            kept = np.abs(lam) <= limit
            return lam[kept], psi[:, kept]
        growth = (limit / np.abs(lam).max()) ** 1.5
        n_roots = min(int(n_roots * growth) + 20, most)


def reference_error(lam: np.ndarray, reference: np.ndarray) -> ReducedError:
    """Errors of `lam` against full-order roots `reference` (both rad/s, imaginary part >= 0)."""
    zeta = -reference.real / np.abs(reference)
    light = reference[np.abs(zeta) < LIGHT]
    if not len(light):
        return ReducedError(0.0, 0.0, 0)
    if not len(lam):
        return ReducedError(np.inf, np.inf, len(light))
    nearest = lam[np.abs(light[:, None] - lam[None, :]).argmin(axis=1)]
    near = np.abs(nearest - light) < 0.05 * np.abs(light)
    size, size_r = np.abs(light[near]), np.abs(nearest[near])
    d_zeta = np.abs(nearest[near].real / size_r - light[near].real / size)
    d_freq = np.abs(size_r - size) / size
    return ReducedError(
        float(d_freq.max(initial=0.0)), float(d_zeta.max(initial=0.0)), int((~near).sum())
    )
