"""The hybrid model (THEORY.md eq. (80)): sparse matrices with a dense border, and their real modes.

Its state is the deviation from steady sliding at a reference working point, whose contact tangent
is part of `K`. The simpler modal representation is checked against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws.own_friction import NO_OWN_FRICTION, has_own
from squealstudy.linalg.factor import factorise
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import GYROSCOPIC, ModeKey, OperatingPoint
from squealstudy.reduction.cmt import ComponentModes, momenta
from squealstudy.reduction.orthonormal import MODE_TOLERANCE, complete_basis
from squealstudy.reduction.working_point import WorkingPoint

# relative change of contact tangents up to which a model at other tangents is the same
SAME_TANGENT_REL_CHANGE = 1e-9
STATIC_SHARE = 0.1  # norm of the scaled static state over that of the matrix of assembly modes


@dataclass(frozen=True)
class HybridSettings:
    """Cutoffs and layers by which a hybrid model is made.

    Attributes
    ----------
    trace_cutoff : float
        Assembly modes up to here [Hz] give the traces.
    damping_cutoff : float
        Real modes of the hybrid model up to here [Hz] can be damped one by one.
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
        Maps coordinates to displacements and back.
    M, K : csr_matrix (n, n)
        Mass and stiffness, symmetric; K includes the contact tangent of the reference,
        N^T diag(k_ref) N.
    N, T, T_perp : csr_matrix (nc, n)
        Contact observation (models.assembly.ContactInterface).
    area, frictional, radius, speed_factor, gap, k_ref : ndarray (nc,)
        As in ContactInterface; `gap` [m] and the contact tangent `k_ref` [N/m] are those of the
        reference.
    force : ndarray (nc, 3)
        Normal force of the reference state, and its friction along T and T_perp, N.
    omega : ndarray (m,)
        Frequencies [rad/s] of the real modes of this model up to `damping_cutoff`; up to the cutoff
        of the traces they are those of the assembly.
    phi : ndarray (n, m)
        Mass-normalised shapes of these modes.
    damping_cutoff : float
        Frequency [Hz] up to which real modes are computed, so that designs can damp them.
    shapes : csr_matrix (k, n)
        Rows phi_c^T M of the component modes that designs may damp.
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
    speed_factor: np.ndarray
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
    def own_friction(self) -> np.ndarray:
        """No point has friction of its own."""
        return NO_OWN_FRICTION

    @property
    def sensors(self) -> np.ndarray:
        """Rows phi^T M (m, n), whose products with q are modal amplitudes (THEORY.md eq. (85))."""
        rows: np.ndarray = (self.M @ self.phi).T
        return rows


def hybrid_model_at(model: HybridModel, tangents: np.ndarray) -> HybridModel:
    """The model with the contact tangents of another working point, and the real modes there.

    Modal damping of a design acts on these modes (THEORY.md eq. (18)). Coordinates stay the same.

    Parameters
    ----------
    model : HybridModel
    tangents : ndarray (nc,)
        Contact tangents of the other working point, N/m.
    """
    change = tangents - model.k_ref
    if np.abs(change).max(initial=0.0) <= SAME_TANGENT_REL_CHANGE * np.abs(model.k_ref).max(
        initial=0.0
    ):
        return model
    K = (model.K + model.N.T @ sp.diags(change) @ model.N).tocsr()
    omega, phi = real_modes(model.M, K, model.damping_cutoff)
    return replace(model, K=K, k_ref=tangents, omega=omega, phi=phi)


def assembly_stiffness(assembly: Assembly, point: WorkingPoint) -> sp.csr_matrix:
    """Stiffness (n_dof, n_dof) [N/m] of components, springs and contact, for the real modes."""
    return assembly.K_el + assembly.K_springs() + assembly.K_contact(point.tangent)


def hybrid_model(
    assembly: Assembly,
    point: WorkingPoint,
    operating: OperatingPoint,
    settings: HybridSettings,
    damped: Mapping[ModeKey, ComponentModes] | None = None,
    modes: tuple[np.ndarray, np.ndarray] | None = None,
) -> HybridModel:
    """Reduce an assembly about a working point.

    Parameters
    ----------
    assembly : Assembly
    point : WorkingPoint
        The reference, at `operating`.
    operating : OperatingPoint
    settings : HybridSettings
    damped : mapping of (component, mode from 1) -> ComponentModes of that component, or None
        Component modes that designs may damp; `shapes` has a row for each, in this order.
    modes : (omega, phi) or None
        Assembly modes at the working point up to the cutoff of the traces, if computed before.

    Raises
    ------
    ConvergenceError
        ``singular``, where the static state is not determined.
    ModelError
        A component mode that does not exist; or what the hybrid model cannot represent: damping of
        components or dampers, gyroscopic terms, springs that are contact points, and contact with
        friction of its own.
    """
    if assembly.C_el is not None:
        raise ModelError("the hybrid representation has no damping of components of their own")
    if operating.gyroscopic:
        raise ModelError(
            f"the hybrid representation has no gyroscopic terms: expected {GYROSCOPIC.name} = 0"
        )
    if len(assembly.contact.spring_points):
        raise ModelError("the hybrid representation has no springs with a gap or a third power")
    if has_own(assembly.contact.own_friction):
        raise ModelError("the hybrid representation has no contact with friction of its own")
    c = assembly.contact
    K = assembly_stiffness(assembly, point)
    if modes is None:
        modes = real_modes(assembly.M, K, settings.trace_cutoff)
    static = static_state(assembly, point, operating)
    basis = hybrid_basis(assembly, K, modes[1], static, settings.layers, settings.by_component)
    M_h, K_h = basis.project(assembly.M), basis.project(K)
    omega, phi = real_modes(M_h, K_h, settings.damping_cutoff)
    component_modes = {
        name: modes_of_component for (name, _), modes_of_component in (damped or {}).items()
    }
    rows = momenta(assembly, component_modes, damped or ())
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
        speed_factor=c.speed_factor,
        gap=point.gap,
        k_ref=c.area * point.tangent,
        force=point.forces(c, operating),
        omega=omega,
        phi=phi,
        damping_cutoff=settings.damping_cutoff,
        shapes=basis.observe(sp.csr_matrix(rows)),
    )


@dataclass(frozen=True)
class Superelement:
    """A set of degrees of freedom that is reduced to one basis of mode traces.

    Attributes
    ----------
    dofs : ndarray (n_i,)
        Their numbers in the assembly.
    V : ndarray (n_i, r)
        Basis, orthonormal in the mass M of these degrees of freedom.
    MV : ndarray (n_i, r)
        M V: its transpose takes displacements to coordinates.
    """

    dofs: np.ndarray
    V: np.ndarray
    MV: np.ndarray


@dataclass(frozen=True)
class HybridBasis:
    """Coordinates q: the explicit degrees of freedom, then those of each superelement in order.

    Attributes
    ----------
    n_dof : int
        Number of degrees of freedom of the assembly.
    explicit : ndarray (n_e,)
        Degrees of freedom of the assembly that are coordinates.
    superelements : tuple of Superelement
    """

    n_dof: int
    explicit: np.ndarray
    superelements: tuple[Superelement, ...] = field(repr=False)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.explicit) + sum(s.V.shape[1] for s in self.superelements)

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Assembly displacements (n_dof, ...) from coordinates q (n, ...)."""
        u = np.zeros((self.n_dof, *q.shape[1:]))
        start = len(self.explicit)
        u[self.explicit] = q[:start]
        for s in self.superelements:
            u[s.dofs] = s.V @ q[start : start + s.V.shape[1]]
            start += s.V.shape[1]
        return u

    def restrict(self, u: np.ndarray) -> np.ndarray:
        """Coordinates (n, ...) of assembly displacements u (n_dof, ...).

        Explicit degrees of freedom are copied, those of superelements projected by mass.
        """
        return np.concatenate([u[self.explicit], *(s.MV.T @ u[s.dofs] for s in self.superelements)])

    def project(self, A: sp.spmatrix) -> sp.csr_matrix:
        """Project a symmetric matrix (n_dof, n_dof): sparse (n, n) with a dense border."""
        A = A.tocsr()
        e, parts = self.explicit, self.superelements
        rows = [A[s.dofs] for s in parts]
        border = [sp.csr_matrix((row[:, e].T @ s.V).T) for row, s in zip(rows, parts, strict=True)]
        blocks = [[A[e][:, e], *(b.T for b in border)]]
        for row, s, border_block in zip(rows, parts, border, strict=True):
            corner = [sp.csr_matrix(s.V.T @ (row[:, t.dofs] @ t.V)) for t in parts]
            blocks.append([border_block, *corner])
        projected = sp.bmat(blocks, format="csr")
        return _cleaned((projected + projected.T) / 2)

    def observe(self, rows: sp.spmatrix) -> sp.csr_matrix:
        """Rows (m, n) over the coordinates from rows (m, n_dof) over the assembly."""
        rows = rows.tocsc()
        parts = [sp.csr_matrix(rows[:, s.dofs] @ s.V) for s in self.superelements]
        return sp.hstack([rows[:, self.explicit], *parts], format="csr")


def _cleaned(A: sp.csr_matrix) -> sp.csr_matrix:
    """The matrix without off-diagonal entries that are round-off."""
    size = np.sqrt(np.abs(A.diagonal()))
    coo = A.tocoo()
    is_significant = np.abs(coo.data) > 1e-15 * size[coo.row] * size[coo.col]
    return sp.csr_matrix(
        (coo.data[is_significant], (coo.row[is_significant], coo.col[is_significant])),
        shape=A.shape,
    )


def explicit_dofs(assembly: Assembly, layers: int) -> np.ndarray:
    """Degrees of freedom of the contact surfaces and of `layers` element layers about them.

    Degrees of freedom are neighbours where the components' mass or stiffness couples them.

    Raises
    ------
    ModelError
        A negative number of layers.
    """
    if layers < 0:
        raise ModelError(f"the number of explicit layers must not be negative, got {layers}")
    c = assembly.contact
    is_explicit = np.zeros(assembly.n_dof, dtype=bool)
    for rows in (c.N, c.T, c.T_perp):
        is_explicit[rows.indices[rows.data != 0]] = True
    adjacency = (abs(assembly.M) + abs(assembly.K_el)).tocsr()
    for _ in range(layers):
        is_explicit |= adjacency @ is_explicit.astype(float) > 0
    return np.flatnonzero(is_explicit)


def hybrid_basis(
    assembly: Assembly,
    K: sp.csr_matrix,
    phi: np.ndarray,
    static: np.ndarray,
    layers: int,
    by_component: bool,
) -> HybridBasis:
    """Basis from assembly modes and the static state.

    Parameters
    ----------
    K : sparse (n_dof, n_dof)
        Stiffness with which `phi` was computed.
    phi : ndarray (n_dof, m)
        Assembly modes.
    static : ndarray (n_dof,)
        Static state, m; it is scaled to a share of the modes.
    layers : int
        Element layers kept about the contact surfaces.
    by_component : bool
        Traces by component; False: over all components together (THEORY.md eq. (80)).
    """
    explicit = explicit_dofs(assembly, layers)
    is_reduced = np.ones(assembly.n_dof, dtype=bool)
    is_reduced[explicit] = False
    spans = list(assembly.slices.values()) if by_component else [slice(0, assembly.n_dof)]
    size = np.linalg.norm(static)
    scale = STATIC_SHARE * np.linalg.norm(phi) / size if size > 0 else 0.0
    shapes = np.column_stack([phi, scale * static])
    parts = []
    for span in spans:
        dofs = np.arange(assembly.n_dof)[span][is_reduced[span]]
        if len(dofs):
            M = assembly.M[dofs][:, dofs]
            empty = np.zeros((len(dofs), 0))
            V, _ = complete_basis(M, K[dofs][:, dofs], empty, [(shapes[dofs], MODE_TOLERANCE)])
            parts.append(Superelement(dofs, V, M @ V))
    return HybridBasis(assembly.n_dof, explicit, tuple(parts))


def static_state(assembly: Assembly, point: WorkingPoint, operating: OperatingPoint) -> np.ndarray:
    """Displacements (n_dof,) [m] of a working point, which reproduce its gaps.

    They solve K_static q = load + N^T A p - T^T mu A p. The contact tangent is added on both sides.

    Raises
    ------
    ConvergenceError
        ``singular``, where some motion is free.
    """
    c = assembly.contact
    k_n = c.area * point.tangent
    normal = c.area * point.contact_pressure
    K = assembly.K_el + assembly.K_springs(static=True) + c.N.T @ sp.diags(k_n) @ c.N
    force = operating.brake_pressure * assembly.load + assembly.constant_load
    force = force + c.N.T @ (normal + k_n * (point.gap - c.gap0))
    drag = operating.traction(point.contact_pressure, c.speed_factor)
    force = force - c.T.T @ (c.area * c.frictional * drag)
    q: np.ndarray = factorise(K.tocsr()).solve(force)
    return q
