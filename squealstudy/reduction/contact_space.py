"""The static brake seen from its contact points: compliances from one factorisation.

With K0 = K_static + k_c N^T A N factored once, any working point of any pressure, friction and
law is a dense problem in the gaps (THEORY.md eq. (13)). A change of component modes is a
low-rank change of K0, taken exactly by Woodbury's identity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import SINGULAR, RefinedFactor, factorise
from squealstudy.models.assembly import Assembly

INDEPENDENT = 1e-13  # of contact rows: what one has outside the others' span
WIDE = 512  # right-hand sides held at once: n_dof of them each
HELD = 1e-4  # error of a check solve: 1e-9 for very soft supports, 1 without any


@dataclass(frozen=True)
class ContactSpace:
    """Compliances of K0 between contact normals (N), sliding directions (T), loads and shapes.

    Attributes
    ----------
    k_c : float
        Contact stiffness per area in K0, Pa/m.
    area, gap0, frictional, speed_factor : ndarray (nc,)
        Of the contact points.
    H_NN : ndarray (nc, nc)
        N K0^-1 N^T, m/N.
    H_NT : ndarray (nc, nc)
        N K0^-1 T^T, m/N.
    H_Nf : ndarray (nc, 2)
        N K0^-1 [load, constant_load].
    H_NU, H_TU : ndarray (nc, m)
        N K0^-1 U and T K0^-1 U for the shapes U = M phi of component modes.
    H_fU : ndarray (2, m)
        [load, constant_load]^T K0^-1 U.
    H_UU : ndarray (m, m)
        U^T K0^-1 U.
    """

    k_c: float
    area: np.ndarray
    gap0: np.ndarray
    frictional: np.ndarray
    speed_factor: np.ndarray
    H_NN: np.ndarray
    H_NT: np.ndarray
    H_Nf: np.ndarray
    H_NU: np.ndarray
    H_TU: np.ndarray
    H_fU: np.ndarray
    H_UU: np.ndarray

    def changed(self, dk: Mapping[int, float]) -> ContactSpace:
        """The same with K0 + U diag(dk) U^T; it cannot be changed again.

        Parameters
        ----------
        dk : mapping of column of U -> float
            Change of a component mode's modal stiffness omega^2, (rad/s)^2.
        """
        if not any(dk.values()):
            return self
        j = np.fromiter(dk.keys(), dtype=int)
        D = np.diag(np.fromiter(dk.values(), dtype=float))
        core = la.solve(np.eye(len(j)) + D @ self.H_UU[np.ix_(j, j)], D)
        left, right_T, right_f = self.H_NU[:, j] @ core, self.H_TU[:, j], self.H_fU[:, j]
        empty = self.H_UU[:0, :0]
        return replace(
            self,
            H_NN=self.H_NN - left @ self.H_NU[:, j].T,
            H_NT=self.H_NT - left @ right_T.T,
            H_Nf=self.H_Nf - left @ right_f.T,
            H_NU=self.H_NU[:, :0],
            H_TU=self.H_TU[:, :0],
            H_fU=self.H_fU[:, :0],
            H_UU=empty,
        )


def contact_space(
    assembly: Assembly, k_c: float, shapes: np.ndarray | Callable[[], np.ndarray]
) -> ContactSpace:
    """Factor K0 once and back-solve the contact columns once.

    Of the contact's rows only as many are solved for as are independent: facets have more contact
    points than nodes.

    Parameters
    ----------
    assembly : Assembly
    k_c : float
        Contact stiffness per area, Pa/m: about that of the working points to come.
    shapes : ndarray (n_dof, m)
        U = M phi of component modes that may change; m may be 0. Or what gives them, asked last:
        they may be found meanwhile.

    Raises
    ------
    ConvergenceError
        ``singular`` where neither springs nor contact hold some motion: no steady state.
    """
    c = assembly.contact
    K0 = assembly.K_el + assembly.K_springs(static=True)
    K0 = (K0 + k_c * (c.N.T @ sp.diags(c.area) @ c.N)).tocsr()
    factor = factorise(K0, definite=True)
    _check_held(factor)
    solve = factor.lean()
    loads = np.column_stack([assembly.load, assembly.constant_load])
    observed = sp.vstack([c.N, c.T, sp.csr_matrix(loads.T)]).tocsr()
    columns, own, R = independent_rows(c.N)
    X_Q = np.empty((observed.shape[0], own.shape[1]))  # of K0^-1 Q only what is observed
    for i in range(0, own.shape[1], WIDE):
        part = np.zeros((assembly.n_dof, min(WIDE, own.shape[1] - i)))
        part[columns] = own[:, i : i + WIDE]
        X_Q[:, i : i + WIDE] = observed @ solve(part)
    NX, TX, fX = np.split(X_Q, [len(c.area), 2 * len(c.area)])
    shapes = shapes() if callable(shapes) else shapes
    X_U = solve(shapes) if shapes.shape[1] else shapes
    H_NN = NX @ R
    return ContactSpace(
        k_c=k_c,
        area=c.area,
        gap0=c.gap0,
        frictional=c.frictional,
        speed_factor=c.speed_factor,
        H_NN=(H_NN + H_NN.T) / 2,
        H_NT=R.T @ TX.T,
        H_Nf=R.T @ fX.T,
        H_NU=np.asarray(c.N @ X_U),
        H_TU=np.asarray(c.T @ X_U),
        H_fU=loads.T @ X_U,
        H_UU=shapes.T @ X_U,
    )


def independent_rows(N: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns (k,) of N (m, n) that are not zero, Q (k, r) on them and R (r, m) with N^T = Q R.

    r is the rank of N to round-off.
    """
    columns = np.unique(N.indices)
    Q, R, order = la.qr(N[:, columns].T.toarray(), mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > INDEPENDENT * size.max(initial=0.0)).sum())
    unsorted = np.empty((rank, N.shape[0]))
    unsorted[:, order] = R[:rank]
    return columns, Q[:, :rank], unsorted


def _check_held(factor: RefinedFactor) -> None:
    """Solve once for a known load: a matrix that is singular to round-off does not give it back."""
    b = np.random.default_rng(0).standard_normal(factor.A.shape[0])
    if not np.linalg.norm(factor.A @ factor.solve(b) - b) < HELD * np.linalg.norm(b):
        raise ConvergenceError(SINGULAR, "the static stiffness is singular: some motion is free")
