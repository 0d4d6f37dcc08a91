"""Contact surroundings kept explicitly, the rest on traces of modes (THEORY.md eq. (80))."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.linalg.factor import factorise
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.orthonormal import MODE_TOLERANCE, complete_basis
from squealstudy.reduction.working_point import WorkingPoint

STATIC_SHARE = 0.1  # size of the static state beside all assembly modes together


@dataclass(frozen=True)
class Superelement:
    """Degrees of freedom that one set of traces reduces.

    Attributes
    ----------
    dofs : ndarray (n_i,)
        Of the assembly.
    V : ndarray (n_i, r)
        Orthonormal in their own mass.
    MV : ndarray (n_i, r)
        Their mass times V: what projects a state.
    """

    dofs: np.ndarray
    V: np.ndarray
    MV: np.ndarray


@dataclass(frozen=True)
class HybridBasis:
    """Coordinates q = (explicit degrees of freedom, those of each superelement in order).

    Attributes
    ----------
    n_dof : int
        Of the assembly.
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
        at = len(self.explicit)
        u[self.explicit] = q[:at]
        for s in self.superelements:
            u[s.dofs] = s.V @ q[at : at + s.V.shape[1]]
            at += s.V.shape[1]
        return u

    def restrict(self, u: np.ndarray) -> np.ndarray:
        """Coordinates (n, ...) of assembly displacements u (n_dof, ...).

        Explicit degrees of freedom are copied, the others projected in their own mass.
        """
        return np.concatenate([u[self.explicit], *(s.MV.T @ u[s.dofs] for s in self.superelements)])

    def project(self, A: sp.spmatrix) -> sp.csr_matrix:
        """T^T A T of a sparse symmetric matrix of the assembly (n, n): a dense border."""
        A = A.tocsr()
        e, parts = self.explicit, self.superelements
        rows = [A[s.dofs] for s in parts]
        border = [sp.csr_matrix((row[:, e].T @ s.V).T) for row, s in zip(rows, parts, strict=True)]
        blocks = [[A[e][:, e], *(b.T for b in border)]]
        for row, s, beside in zip(rows, parts, border, strict=True):
            corner = [sp.csr_matrix(s.V.T @ (row[:, t.dofs] @ t.V)) for t in parts]
            blocks.append([beside, *corner])
        whole = sp.bmat(blocks, format="csr")
        return _cleaned((whole + whole.T) / 2)

    def observe(self, rows: sp.spmatrix) -> sp.csr_matrix:
        """Observation rows (m, n) from rows of the assembly (m, n_dof)."""
        rows = rows.tocsc()
        parts = [sp.csr_matrix(rows[:, s.dofs] @ s.V) for s in self.superelements]
        return sp.hstack([rows[:, self.explicit], *parts], format="csr")


def _cleaned(A: sp.csr_matrix) -> sp.csr_matrix:
    """Without the entries that rounding left beside its diagonal."""
    size = np.sqrt(np.abs(A.diagonal()))
    coo = A.tocoo()
    kept = np.abs(coo.data) > 1e-15 * size[coo.row] * size[coo.col]
    return sp.csr_matrix((coo.data[kept], (coo.row[kept], coo.col[kept])), shape=A.shape)


def explicit_dofs(assembly: Assembly, layers: int) -> np.ndarray:
    """Degrees of freedom of the contact surfaces and of `layers` element layers about them.

    Layers are found by adjacency in mass and stiffness of the components.

    Raises
    ------
    ModelError
        A negative number of layers.
    """
    if layers < 0:
        raise ModelError(f"the number of explicit layers must not be negative, got {layers}")
    c = assembly.contact
    mask = np.zeros(assembly.n_dof, dtype=bool)
    for rows in (c.N, c.T, c.T_perp):
        mask[rows.indices[rows.data != 0]] = True
    beside = (abs(assembly.M) + abs(assembly.K_el)).tocsr()
    for _ in range(layers):
        mask |= beside @ mask.astype(float) > 0
    return np.flatnonzero(mask)


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
        Stiffness that `phi` was computed with.
    phi : ndarray (n_dof, m)
        Assembly modes.
    static : ndarray (n_dof,)
        Static state; it is scaled.
    layers : int
    by_component : bool
        Traces by component; False: over all components together (THEORY.md eq. (80)).
    """
    explicit = explicit_dofs(assembly, layers)
    inside = np.ones(assembly.n_dof, dtype=bool)
    inside[explicit] = False
    spans = list(assembly.slices.values()) if by_component else [slice(0, assembly.n_dof)]
    size = np.linalg.norm(static)
    scale = STATIC_SHARE * np.linalg.norm(phi) / size if size > 0 else 0.0
    shapes = np.column_stack([phi, scale * static])
    parts = []
    for span in spans:
        dofs = np.arange(assembly.n_dof)[span][inside[span]]
        if len(dofs):
            M = assembly.M[dofs][:, dofs]
            empty = np.zeros((len(dofs), 0))
            V, _ = complete_basis(M, K[dofs][:, dofs], empty, [(shapes[dofs], MODE_TOLERANCE)])
            parts.append(Superelement(dofs, V, M @ V))
    return HybridBasis(assembly.n_dof, explicit, tuple(parts))


def static_state(assembly: Assembly, point: WorkingPoint, operating: OperatingPoint) -> np.ndarray:
    """Displacements (n_dof,) of a working point [m], at which its gaps are observed.

    K_static q = load + N^T A p - T^T mu A p, solved with the contact tangent on both sides.

    Raises
    ------
    ConvergenceError
        ``singular``, where some motion is free.
    """
    c = assembly.contact
    k_n = c.area * point.tangent
    normal = c.area * point.pressure
    K = assembly.K_el + assembly.K_springs(static=True) + c.N.T @ sp.diags(k_n) @ c.N
    force = operating.pressure * assembly.load + assembly.constant_load
    force = force + c.N.T @ (normal + k_n * (point.gap - c.gap0))
    force = force - c.T.T @ (c.area * c.frictional * operating.traction(point.pressure))
    q: np.ndarray = factorise(K.tocsr()).solve(force)
    return q
