"""The static brake seen from its contact points: compliances from one factorisation.

With K0 = K_static + k_c N^T A N factored once, the working point at any pressure, friction and
law is a dense problem in the gaps (THEORY.md eq. (13)). Facets have more contact points than their
nodes have freedoms. So N = S_N Z_N, where S_N are independent columns of N, and compliances are
computed for the rows of Z_N alone. A change of component modes is a low-rank change of K0, made
exactly by Woodbury's identity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from squealstudy.errors import ConvergenceError
from squealstudy.laws.own_friction import NO_OWN_FRICTION
from squealstudy.laws.spring import NO_SPRINGS
from squealstudy.linalg.factor import RefinedFactor, factorise
from squealstudy.models.assembly import ContactInterface
from squealstudy.reduction.free_motions import free_motion
from squealstudy.reduction.projected import AnyAssembly

# a column of N is dependent if its part outside the span of the others is less than this, over the
# largest such part
INDEPENDENCE_TOLERANCE = 1e-13
MAX_RIGHT_HAND_SIDES = 512  # columns of one solve
MAX_ENTRIES_PER_SOLVE = (
    64_000_000  # of the right-hand sides, and again of the solutions: 512 MB each
)
MAX_POINTS_DENSE = 16  # most contact points for which dense S_N and S_T are faster
# relative residual of a check solve from which K0 is singular: 1e-9 with very soft supports, 1
# without any
UNSUPPORTED_REL_ERROR = 1e-4


@dataclass(frozen=True)
class ContactSpace:
    """Compliances of K0 between contact, loads and shapes.

    N = S_N Z_N and T = S_T Z_T are the contact's normal and sliding rows (ContactInterface).

    Attributes
    ----------
    k_c : float or ndarray (nc,)
        Contact stiffness per area in K0, Pa/m; one for each point where some points are springs.
    area, gap0, frictional, speed_factor : ndarray (nc,)
        As in ContactInterface.
    S_N : csr_matrix (nc, r)
        Independent columns of N: gaps are gap0 + S_N x.
    S_T : csr_matrix (nc, t)
        Columns of T that are not zero.
    C_NN : ndarray (r, r)
        Z_N K0^-1 Z_N^T, m/N.
    C_TN : ndarray (t, r)
        Z_T K0^-1 Z_N^T, m/N.
    C_Nf : ndarray (r, 2)
        Z_N K0^-1 [load, constant_load].
    load_travel : ndarray (nc, 2)
        |S_N| |Z_N| |K0^-1 [load, constant_load]|: sizes of the terms of openings, m/Pa and m.
    C_NU, C_TU : ndarray (r, m), (t, m)
        Z_N K0^-1 U and Z_T K0^-1 U for the shapes U = M phi of component modes.
    C_fU : ndarray (2, m)
        [load, constant_load]^T K0^-1 U.
    C_UU : ndarray (m, m)
        U^T K0^-1 U.
    spring_points : ndarray (ns, 5)
    own_friction : ndarray (nc, k)
        As in ContactInterface.
    """

    k_c: float | np.ndarray
    area: np.ndarray
    gap0: np.ndarray
    frictional: np.ndarray
    speed_factor: np.ndarray
    S_N: sp.csr_matrix
    S_T: sp.csr_matrix
    C_NN: np.ndarray
    C_TN: np.ndarray
    C_Nf: np.ndarray
    load_travel: np.ndarray
    C_NU: np.ndarray
    C_TU: np.ndarray
    C_fU: np.ndarray
    C_UU: np.ndarray
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS)
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION)

    @property
    def touching(self) -> slice:
        """The contact points that are not springs."""
        return slice(len(self.area) - len(self.spring_points))

    @cached_property
    def by_point(self) -> tuple[np.ndarray, np.ndarray]:
        """N K0^-1 Z_N^T and T K0^-1 Z_N^T (nc, r), m/N."""
        return np.asarray(self.S_N @ self.C_NN), np.asarray(self.S_T @ self.C_TN)

    @cached_property
    def opened_by_unit_pressure(self) -> float:
        """Volume by which a pressure of 1 Pa opens all contact but springs (gap by area), m3/Pa."""
        force = np.zeros_like(self.area)
        force[self.touching] = self.area[self.touching]
        return float(force @ self.opening(force, np.zeros_like(force)))

    def round_off_size(self, pressure: float, gap: np.ndarray) -> float:
        """Largest of the terms [m] whose sums are gaps (nc,) at a brake pressure [Pa]."""
        travel = self.load_travel @ np.array([abs(pressure), 1.0])
        return float(sum(np.abs(x).max(initial=0.0) for x in (travel, self.gap0, gap)))

    def opening(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Changes of the gaps (..., nc) [m] by normal forces s and friction t (..., nc) [N].

        They are N K0^-1 (N^T s - T^T t).
        """
        return self.gaps(self.coordinates(s, t))

    @cached_property
    def _maps(self) -> tuple[Any, Any, Any]:
        """S_N, S_N^T and S_T^T, dense for up to MAX_POINTS_DENSE contact points."""
        maps = (self.S_N, self.S_N.T, self.S_T.T)
        return tuple(m.toarray() for m in maps) if self.S_N.shape[0] <= MAX_POINTS_DENSE else maps

    def gaps(self, x: np.ndarray) -> np.ndarray:
        """Changes S_N x of the gaps (..., nc) [m] from coordinates x (..., r)."""
        gap_changes: np.ndarray = (self._maps[0] @ x.T).T
        return gap_changes

    def normal_components(self, s: np.ndarray) -> np.ndarray:
        """S_N^T s (..., r) of normal forces s (..., nc) [N]."""
        products: np.ndarray = (self._maps[1] @ s.T).T
        return products

    def sliding_components(self, t: np.ndarray) -> np.ndarray:
        """S_T^T t (..., t) of friction forces t (..., nc) [N]."""
        products: np.ndarray = (self._maps[2] @ t.T).T
        return products

    def coordinates(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Coordinates (..., r) that `gaps` takes, for forces s, t (..., nc) [N] of `opening`."""
        displacement: np.ndarray = (
            self.normal_components(s) @ self.C_NN - self.sliding_components(t) @ self.C_TN
        )
        return displacement

    def changed(self, dk: Mapping[int, float]) -> ContactSpace:
        """The space of K0 + U diag(dk) U^T. It has no shapes U and cannot be changed again.

        Without any change it is this space itself.

        Parameters
        ----------
        dk : mapping of column of U -> float
            Change of a component mode's modal stiffness omega^2, (rad/s)^2.
        """
        if not any(dk.values()):
            return self
        j = np.fromiter(dk.keys(), dtype=int)
        D = np.diag(np.fromiter(dk.values(), dtype=float))
        core = la.solve(np.eye(len(j)) + D @ self.C_UU[np.ix_(j, j)], D)
        left_part = self.C_NU[:, j] @ core  # core is symmetric
        return replace(
            self,
            C_NN=self.C_NN - left_part @ self.C_NU[:, j].T,
            C_TN=self.C_TN - self.C_TU[:, j] @ left_part.T,
            C_Nf=self.C_Nf - left_part @ self.C_fU[:, j].T,
            C_NU=self.C_NU[:, :0],
            C_TU=self.C_TU[:, :0],
            C_fU=self.C_fU[:, :0],
            C_UU=self.C_UU[:0, :0],
        )


@dataclass(frozen=True)
class ContactRows:
    """N = S_N Z_N and T = S_T Z_T over some coordinates.

    Attributes
    ----------
    S_N, S_T : csr_matrix (nc, r), (nc, t)
        As in ContactSpace.
    normal : ndarray (k,) of int
        Numbers of the coordinates in which Z_N is not zero.
    Z : ndarray (r, k)
        The columns of Z_N at these coordinates.
    sliding : ndarray (t,) of int, or (t, n)
        Numbers of the coordinates that Z_T selects, or Z_T itself.
    """

    S_N: sp.csr_matrix
    S_T: sp.csr_matrix
    normal: np.ndarray
    Z: np.ndarray
    sliding: np.ndarray

    @staticmethod
    def of(contact: ContactInterface) -> ContactRows:
        """Rows of a contact interface over the degrees of freedom of an unreduced assembly."""
        normal, independent, Z = independent_columns(contact.N)
        sliding = np.unique(contact.T.indices)
        S_N, S_T = contact.N[:, normal[independent]], contact.T[:, sliding]
        return ContactRows(S_N, S_T, normal, Z, sliding)

    def sliding_rows_times(self, X: np.ndarray) -> np.ndarray:
        """Z_T X (t, ...) of vectors X (n, ...)."""
        products: np.ndarray = X[self.sliding] if self.sliding.ndim == 1 else self.sliding @ X
        return products


def contact_space(
    assembly: AnyAssembly,
    k_c: float | np.ndarray,
    shapes: np.ndarray | Callable[[], np.ndarray],
    rows: ContactRows | None = None,
    on_responses: Callable[[np.ndarray], None] = lambda X: None,
) -> ContactSpace:
    """Factor K0 and solve for the independent contact rows, loads and shapes.

    Parameters
    ----------
    assembly : Assembly or ProjectedAssembly
    k_c : float or ndarray (nc,)
        Contact stiffness per area, Pa/m, best near that of the working points to come.
    shapes : ndarray (n_dof, m), or callable
        U = M phi of component modes that may change; m may be 0. A callable returns U and is called
        last, so that another thread can compute it meanwhile.
    rows : ContactRows or None
        The contact rows over the assembly's coordinates, if computed before.
    on_responses : callable
        Called with the static responses (n_dof, k) to unit contact forces, some columns at a time,
        and to the shapes.

    Raises
    ------
    ConvergenceError
        ``singular`` where some motion is held neither by springs nor by contact.
    """
    c = assembly.contact
    K0 = assembly.K_el + assembly.K_springs(static=True) + assembly.K_contact(k_c)
    solve = _checked_factor(assembly, K0).lean()
    loads = np.column_stack([assembly.load, assembly.constant_load])
    rows = rows or ContactRows.of(c)
    load_products: list[np.ndarray] = []

    def record_responses(X: np.ndarray) -> None:
        on_responses(X)
        load_products.append(X.T @ loads)

    C_NN, C_TN = contact_compliances(rows, solve, assembly.n_dof, record_responses)
    shapes = shapes() if callable(shapes) else shapes
    X_U = solve(shapes) if shapes.shape[1] else shapes
    on_responses(X_U)
    S = rows.S_N
    sizes = sp.csr_matrix((np.abs(S.data), S.indices, S.indptr), S.shape)
    travel = sizes @ (np.abs(rows.Z) @ np.abs(solve(loads)[rows.normal]))
    return ContactSpace(
        k_c=k_c,
        area=c.area,
        gap0=c.gap0,
        frictional=c.frictional,
        speed_factor=c.speed_factor,
        S_N=rows.S_N,
        S_T=rows.S_T,
        C_NN=C_NN,
        C_TN=C_TN,
        C_Nf=np.vstack(load_products),
        load_travel=travel,
        C_NU=rows.Z @ X_U[rows.normal],
        C_TU=rows.sliding_rows_times(X_U),
        C_fU=loads.T @ X_U,
        C_UU=shapes.T @ X_U,
        spring_points=c.spring_points,
        own_friction=c.own_friction,
    )


def contact_compliances(
    rows: ContactRows,
    solve: Callable[[np.ndarray], np.ndarray],
    n_dof: int,
    on_responses: Callable[[np.ndarray], None] = lambda X: None,
) -> tuple[np.ndarray, np.ndarray]:
    """Z_N A^-1 Z_N^T (r, r) and Z_T A^-1 Z_N^T (t, r) of a symmetric A.

    `solve` returns A^-1 times a block of columns. `on_responses` is called with A^-1 Z_N^T
    (n_dof, k), some columns at a time.
    """
    normal, Z, r = rows.normal, rows.Z, len(rows.Z)
    C_NN, C_TN = np.empty((r, r)), np.empty((len(rows.sliding), r))
    columns_per_solve = max(min(MAX_RIGHT_HAND_SIDES, MAX_ENTRIES_PER_SOLVE // n_dof), 1)
    for i in range(0, r, columns_per_solve):
        part = slice(i, min(i + columns_per_solve, r))
        forces = np.zeros((n_dof, part.stop - i))
        forces[normal] = Z[part].T
        X = solve(forces)
        on_responses(X)
        C_NN[:, part], C_TN[:, part] = Z @ X[normal], rows.sliding_rows_times(X)
    return (C_NN + C_NN.T) / 2, C_TN


def independent_columns(N: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers `columns` (k,) of the non-zero columns of N (m, n), `independent` (r,), and Z (r, k).

    N[:, columns] = N[:, columns[independent]] Z, where r is the rank of N to round-off. The rows
    and columns fall into sets that share no entry; each is treated by QR with column pivoting
    (Golub 1965).
    """
    columns = np.unique(N.indices)
    entries = N[:, columns].tocoo()
    m, k = entries.shape
    graph = sp.coo_matrix(
        (np.ones(entries.nnz), (entries.row, m + entries.col)), shape=(m + k, m + k)
    )
    count, label = connected_components(graph, directed=False)
    dense, chosen, parts = entries.tocsr(), [], []
    for number in range(count):
        rows = np.flatnonzero(label[:m] == number)
        among = np.flatnonzero(label[m:] == number)
        if not len(rows) or not len(among):
            continue
        R, order = la.qr(dense[rows][:, among].toarray(), mode="r", pivoting=True)
        size = np.abs(np.diag(R))
        rank = int((size > INDEPENDENCE_TOLERANCE * size.max(initial=0.0)).sum())
        others = la.solve_triangular(R[:rank, :rank], R[:rank, rank:])
        part = np.zeros((rank, k))
        part[np.arange(rank), among[order[:rank]]] = 1.0
        part[:, among[order[rank:]]] = others
        chosen.append(among[order[:rank]])
        parts.append(part)
    return columns, np.concatenate(chosen), np.vstack(parts)


def _checked_factor(assembly: AnyAssembly, K0: sp.csr_matrix) -> RefinedFactor:
    """The factor of K0, checked with a random load, as factorising may miss that K0 is singular."""
    try:
        factor = factorise(K0, definite=True)
    except ConvergenceError as error:
        raise free_motion(assembly, K0) from error
    b = np.random.default_rng(0).standard_normal(factor.A.shape[0])
    if not np.linalg.norm(factor.A @ factor.solve(b) - b) < UNSUPPORTED_REL_ERROR * np.linalg.norm(
        b
    ):
        raise free_motion(assembly, K0)
    return factor
