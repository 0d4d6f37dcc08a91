"""Damping of the assembly at a design's own working point, in the coordinates of a run.

Modal damping (THEORY.md eq. (18)) is on the real modes of the design's own symmetric stiffness, as
complex modes have it. In the modes of a reference working point that is a full matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ParameterError
from squealstudy.models.matrix_checks import is_skew
from squealstudy.models.operating import DesignState
from squealstudy.reduction.hybrid import SAME_TANGENT_REL_CHANGE
from squealstudy.system.modal_damping import modal_damping


@dataclass(frozen=True)
class AssemblyDamping:
    """Parts of the damping of design points, in all modes of the reference.

    Attributes
    ----------
    omega2 : ndarray (n,)
        Diagonal stiffness at the reference, contact tangent included, (rad/s)^2.
    N : ndarray (nc, n)
        Changes of the contact gaps by the modes.
    k_ref : ndarray (nc,)
        Contact tangents inside `omega2`, N/m.
    shapes : ndarray (m, n)
        Rows of component modes that design points stiffen.
    own : ndarray (n, n) or None
        The components' own damping and gyroscopic terms, rad/s; None where they have none.
    turning : ndarray (n, n) or None
        Gyroscopic terms of the turning parts at 1 m/s of sliding, 1/m; None without such parts.
    unturned : str
        Why `turning` is None although parts turn.
    damped_to : float
        Frequency [rad/s]; modes beyond it have the damping coefficient of a mode at it.
    basis : ndarray (n, r) or None
        Orthonormal coordinates of the run; None for all modes.
    n_exact : int
        Leading coordinates of the run that are assembly modes.
    """

    omega2: np.ndarray
    N: np.ndarray
    k_ref: np.ndarray
    shapes: np.ndarray
    own: np.ndarray | None
    damped_to: float
    n_exact: int
    basis: np.ndarray | None = None
    turning: np.ndarray | None = None
    unturned: str = ""

    @cached_property
    def turns(self) -> bool:
        """Whether there are gyroscopic terms of the components' own."""
        return self.own is not None and is_skew(self.own)

    def on(self, basis: np.ndarray, n_exact: int) -> AssemblyDamping:
        """The damping in coordinates of orthonormal columns (n, r) of all modes."""
        return replace(self, basis=basis, n_exact=n_exact)

    def turning_at(self, state: DesignState) -> np.ndarray | None:
        """Gyroscopic terms (r, r) of parts that turn at the sliding speed, 1/s; None without."""
        rate = state.operating.turning
        if not rate or self.turning is None:
            return None
        G = rate * self.turning
        return G if self.basis is None else self.basis.T @ G @ self.basis

    def at(
        self, state: DesignState, tangents: np.ndarray, stiffness: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Damping of a design point: of each coordinate by itself, and between coordinates.

        Parameters
        ----------
        state : DesignState
        tangents : ndarray (nc,)
            Contact tangents of its working point, N/m.
        stiffness : ndarray (m,)
            Stiffness that it adds to the shapes, (rad/s)^2.

        Returns
        -------
        diagonal : ndarray (r,)
            Damping of each coordinate, 1/s. Negative where the components' own damping is, or
            where stiffness damping acts on a negative stiffness.
        between : ndarray (r, r) or None
            Damping between coordinates with zeros on the diagonal, 1/s; symmetric where nothing
            turns. None where all of it is zero.

        Raises
        ------
        ParameterError
            Damping of an assembly mode that the basis does not have; gyroscopic terms of a
            structure that has none.
        """
        state.operating.expect_turning(self.turning, self.unturned)
        rate = state.operating.turning
        zeta = self._ratios(state)
        changed = np.abs(tangents - self.k_ref).max(
            initial=0.0
        ) > SAME_TANGENT_REL_CHANGE * self.k_ref.max(initial=0)
        if changed or stiffness.any():
            C = self._anew(zeta, state.stiffness_damping, tangents, stiffness)
        else:
            omega = np.sqrt(np.maximum(self.omega2, 0.0))
            rates = 2.0 * zeta * np.minimum(omega, self.damped_to)
            with np.errstate(over="ignore"):  # an infinite rate fails the point where it is used
                rates += state.stiffness_damping * self.omega2
            if self.own is None and self.basis is None and not rate:
                return rates, None
            C = np.diag(rates)
        if self.own is not None:
            C = C + self.own
        if rate and self.turning is not None:
            C = C + rate * self.turning
        if self.basis is not None:
            C = self.basis.T @ C @ self.basis
        between = C if self.turns or rate else 0.5 * (C + C.T)
        between = between - np.diag(np.diag(C))
        return np.diag(C), between if between.any() else None

    def _ratios(self, state: DesignState) -> np.ndarray:
        """Damping ratios (n,) of the assembly's modes."""
        beyond = [mode for mode in state.assembly_damping if mode > self.n_exact]
        if beyond:
            raise ParameterError(
                f"modes[{beyond[0]}].damping_ratio",
                f"this basis has assembly modes 1 to {self.n_exact}",
            )
        return state.assembly_damping_ratios(len(self.omega2))

    def _anew(
        self, zeta: np.ndarray, beta: float, tangents: np.ndarray, stiffness: np.ndarray
    ) -> np.ndarray:
        """Modal and stiffness damping (n, n) of the design's own stiffness, 1/s."""
        change = (tangents - self.k_ref)[:, None]
        K = np.diag(self.omega2) + self.N.T @ (change * self.N)
        K += self.shapes.T @ (stiffness[:, None] * self.shapes)
        C = beta * K
        if zeta.any():
            C += modal_damping(la.eigh(K, driver="evd"), zeta, self.damped_to)
        return C
