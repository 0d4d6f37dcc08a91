"""The hybrid model (THEORY.md eq. (80)): sparse, with a dense border, and its own real modes.

It is the reference that judges the modal representation. Its state is the deviation from steady
sliding at a reference working point, whose contact tangent is inside `K`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import ComponentModes
from squealstudy.reduction.hybrid_basis import HybridBasis, hybrid_basis, static_state
from squealstudy.reduction.working_point import WorkingPoint


@dataclass(frozen=True)
class HybridSettings:
    """What a hybrid model keeps.

    Attributes
    ----------
    trace_cutoff : float
        Assembly modes up to here [Hz] give the traces.
    damping_cutoff : float
        The model's own modes up to here [Hz] can be damped one by one.
    layers : int
        Element layers kept about the contact surfaces.
    by_component : bool
        Traces by component; False: over all components together (THEORY.md eq. (80)).
    """

    trace_cutoff: float
    damping_cutoff: float
    layers: int = 1
    by_component: bool = True

    def __post_init__(self) -> None:
        if not (self.trace_cutoff > 0 and self.damping_cutoff > 0):
            raise ModelError("hybrid model: both cutoffs must be positive")


@dataclass(frozen=True)
class HybridModel:
    """Sparse reduced assembly about a reference working point.

    Attributes
    ----------
    basis : HybridBasis
        Coordinates to displacements and back.
    M, K : csr_matrix (n, n)
        Symmetric; K holds the contact tangent of the reference, N^T diag(k_ref) N.
    N, T, T_perp : csr_matrix (nc, n)
        Contact observation (models.interface.ContactInterface).
    area, frictional, radius, gap, k_ref : ndarray (nc,)
        gap [m] and contact tangent [N/m] are those of the reference.
    force : ndarray (nc, 3)
        Normal and friction forces of the reference state, N.
    omega : ndarray (m,)
        Real modes of this model [rad/s] up to `damping_cutoff`; up to the cutoff of the traces
        they are those of the assembly.
    phi : ndarray (n, m)
        Mass-normalised.
    damping_cutoff : float
        Hz.
    shapes : csr_matrix (k, n)
        Rows phi_c^T M of component modes that designs may damp.
    """

    basis: HybridBasis = field(repr=False)
    M: sp.csr_matrix
    K: sp.csr_matrix
    N: sp.csr_matrix
    T: sp.csr_matrix
    T_perp: sp.csr_matrix
    area: np.ndarray
    frictional: np.ndarray
    radius: np.ndarray
    gap: np.ndarray
    k_ref: np.ndarray
    force: np.ndarray
    omega: np.ndarray
    phi: np.ndarray = field(repr=False)
    damping_cutoff: float
    shapes: sp.csr_matrix

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.M.shape[0])

    @property
    def sensors(self) -> np.ndarray:
        """Rows phi^T M (m, n), whose products with q are modal amplitudes (THEORY.md eq. (85))."""
        rows: np.ndarray = (self.M @ self.phi).T
        return rows


def assembly_stiffness(assembly: Assembly, point: WorkingPoint) -> sp.csr_matrix:
    """Elastic, springs and contact tangent (n_dof, n_dof), N/m: that of the assembly's modes."""
    c = assembly.contact
    tangent = c.N.T @ sp.diags(c.area * point.tangent) @ c.N
    return (assembly.K_el + assembly.K_springs() + tangent).tocsr()


def hybrid_model(
    assembly: Assembly,
    point: WorkingPoint,
    operating: OperatingPoint,
    settings: HybridSettings,
    damped: Mapping[tuple[str, int], ComponentModes] | None = None,
    modes: tuple[np.ndarray, np.ndarray] | None = None,
) -> HybridModel:
    """Reduce an assembly about a working point.

    Parameters
    ----------
    assembly : Assembly
    point : WorkingPoint
        Of `operating`.
    operating : OperatingPoint
    settings : HybridSettings
    damped : mapping of (component, mode from 1) -> ComponentModes of that component, or None
        Component modes that designs may damp, in the order of the rows of `shapes`.
    modes : (omega, phi) or None
        Assembly modes at the working point up to the cutoff of the traces, where they are known.

    Raises
    ------
    ConvergenceError
        ``singular``, where the static state is not determined.
    ModelError
        A component mode that is not there.
    """
    c = assembly.contact
    K = assembly_stiffness(assembly, point)
    if modes is None:
        modes = real_modes(assembly.M, K, settings.trace_cutoff)
    static = static_state(assembly, point, operating)
    basis = hybrid_basis(assembly, K, modes[1], static, settings.layers, settings.by_component)
    M_h, K_h = basis.project(assembly.M), basis.project(K)
    omega, phi = real_modes(M_h, K_h, settings.damping_cutoff)
    normal = c.area * point.pressure
    drag = -c.area * c.frictional * operating.traction(point.pressure)
    return HybridModel(
        basis=basis,
        M=M_h,
        K=K_h,
        N=basis.observe(c.N),
        T=basis.observe(c.T),
        T_perp=basis.observe(c.T_perp),
        area=c.area,
        frictional=c.frictional,
        radius=c.radius,
        gap=point.gap,
        k_ref=c.area * point.tangent,
        force=np.column_stack([normal, drag, np.zeros_like(normal)]),
        omega=omega,
        phi=phi,
        damping_cutoff=settings.damping_cutoff,
        shapes=basis.observe(_mode_rows(assembly, damped or {})),
    )


def _mode_rows(
    assembly: Assembly, damped: Mapping[tuple[str, int], ComponentModes]
) -> sp.csr_matrix:
    """Rows phi_c^T M of component modes over the assembly (k, n_dof)."""
    components = {c.name: c for c in assembly.components}
    rows = np.zeros((len(damped), assembly.n_dof))
    for row, ((name, mode), modes) in zip(rows, damped.items(), strict=True):
        if name not in components or not 1 <= mode <= modes.phi.shape[1]:
            raise ModelError(f"hybrid model: component '{name}' has no mode {mode} here")
        row[assembly.slices[name]] = components[name].M @ modes.phi[:, mode - 1]
    return sp.csr_matrix(rows)
