"""Onset of instability by one root that is followed alone, without the other modes.

At each value of the parameter the root and both its vectors are iterated by two-sided residual
inverse iteration (Neumaier, SIAM J. Numer. Anal. 22, 1985). The error of the two-sided Rayleigh
functional is the product of the errors of both vectors, and one factor is enough for neighbouring
values. The converged root is exact; its shape shows whether it is the right one. Where that is not
certain there is no answer, and all modes must be solved.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.quadratic_pencil import QuadraticPencil, ShiftedFactor, product
from squealstudy.modes.tracking.onsets import Onset, bracketed_crossing
from squealstudy.modes.tracking.pairing import mac
from squealstudy.modes.tracking.refinement import Modes

MIN_MAC = 0.9  # least MAC of a followed mode with that mode at both ends
MAX_OTHER_MAC = 0.7  # largest MAC at the ends with any other mode
ROOT_TOLERANCE = 1e-12  # largest last change of a converged root, over its modulus
RESIDUAL_TOLERANCE = 1e-9  # |Q(lambda) x| / |lambda^2 x| of both vectors
MAX_TURNS = 8  # iterations with one factor
MAX_FACTORS = 3  # factors at one value of the parameter
MAX_CONDITION = 1e3  # condition of a root; next to an exceptional point two roots would be followed


class RootState(NamedTuple):
    """A root with its right and left vectors, of unit norm.

    Attributes
    ----------
    lam : complex
        The root, rad/s.
    right, left : ndarray (n,) complex
        Vectors with Q(lam) right = 0 and left^H Q(lam) = 0.
    """

    lam: complex
    right: np.ndarray
    left: np.ndarray


class RootFollower:
    """Follows a root and its vectors from one pencil to the next, with few factorisations."""

    def __init__(self) -> None:
        self._factor: ShiftedFactor | None = None

    def at(self, pencil: QuadraticPencil, start: RootState) -> RootState:
        """The root of a pencil nearby `start`, a guess from neighbouring pencils.

        Raises
        ------
        ConvergenceError
            ``lost`` where it does not converge, or next to an exceptional point.
        """
        state = start
        for number in range(MAX_FACTORS):
            if self._factor is None or number:
                self._factor = pencil.factor(state.lam)
            state, converged = _converged(pencil, self._factor, state)
            if converged:
                return state
        raise ConvergenceError("lost", "a root that is followed does not converge")


def _converged(
    pencil: QuadraticPencil, factor: ShiftedFactor, state: RootState
) -> tuple[RootState, bool]:
    """The root after some iterations with one factor, and whether it has converged."""
    lam, x, y = state
    adjoint, last = pencil.adjoint(), np.inf
    for _ in range(MAX_TURNS):
        parts = [product(A, x) for A in (pencil.M, pencil.C, pencil.K)]
        adjoint_products = [product(A, y) for A in (adjoint.M, adjoint.C, adjoint.K)]
        before = lam
        lam = _nearest_zero([complex(np.vdot(y, part)) for part in parts], before)
        r = lam**2 * parts[0] + lam * parts[1] + parts[2]
        s = (
            np.conj(lam) ** 2 * adjoint_products[0]
            + np.conj(lam) * adjoint_products[1]
            + adjoint_products[2]
        )
        size = float(max(np.linalg.norm(r), np.linalg.norm(s))) / abs(lam) ** 2
        if not size < np.inf:
            break
        if abs(lam - before) <= ROOT_TOLERANCE * abs(lam) and size <= RESIDUAL_TOLERANCE:
            slope = np.vdot(y, 2 * lam * parts[0] + parts[1])
            return RootState(lam, x, y), bool(2 * abs(lam) <= MAX_CONDITION * abs(slope))
        if size > last:
            break
        last = size
        x, y = x - factor.solve(r), y - factor.solve_adjoint(s)
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return RootState(lam, x, y), False


def _nearest_zero(coefficients: list[complex], guess: complex) -> complex:
    """Zero nearest to `guess` of a quadratic polynomial with coefficients of falling powers."""
    zeros = np.roots(coefficients)
    if not len(zeros):
        raise ConvergenceError("lost", "vectors of a root that is followed are orthogonal")
    return complex(zeros[np.argmin(np.abs(zeros - guess))])


class FollowedEnd(NamedTuple):
    """A mode at one end of a bracket.

    Attributes
    ----------
    x : float
        Value of the parameter.
    modes : Modes
        All modes at that value.
    place : int
        Index of the followed mode.
    """

    x: float
    modes: Modes
    place: int

    @property
    def lam(self) -> complex:
        """The followed root, rad/s."""
        return complex(self.modes.lam[self.place])

    def is_this(self, shape: np.ndarray) -> bool:
        """Whether a shape (k,) is like the mode's and like no other mode's here."""
        likeness = mac(shape[None], self.modes.shapes)[0]
        likeness_of_mode = likeness[self.place]
        return bool(
            likeness_of_mode >= MIN_MAC
            and np.delete(likeness, self.place).max(initial=0.0) <= MAX_OTHER_MAC
        )


class PencilLine(NamedTuple):
    """Design points along a parameter, at which single roots are solved.

    Attributes
    ----------
    pencil : callable
        Returns the pencil at a value of the parameter; ConvergenceError where there is none.
    basis : ndarray (n, k)
        Orthonormal columns: shapes of `Modes` are coordinates on them.
    """

    pencil: Callable[[float], QuadraticPencil]
    basis: np.ndarray


def followed_onset(
    line: PencilLine, ends: tuple[FollowedEnd, FollowedEnd], tolerance: float, precision: float
) -> Onset | None:
    """Value at which the damping ratio of a mode passes -tolerance, by its root alone.

    Parameters
    ----------
    line : PencilLine
    ends : (low, high)
        The mode at both ends of the bracket; it is unstable at one of them.
    tolerance, precision : float
        Those of `onsets.refine_onset`.

    Returns
    -------
    Onset or None
        None where the mode is not clearly the same at both ends and at all values between them, or
        where there is no answer for another reason: then all modes have to be solved.
    """
    low, high = ends
    sure = low.is_this(high.modes.shapes[high.place]) and high.is_this(low.modes.shapes[low.place])
    if not sure:
        return None
    mode = _Followed(line, ends)
    try:
        crossing = bracketed_crossing(mode.root, [low.x, high.x], tolerance, precision)
    except (ConvergenceError, np.linalg.LinAlgError):
        return None
    if crossing.jumps:
        return None
    onset = crossing.value
    nearest = min(crossing.around, key=lambda x: abs(x - onset))
    return Onset(onset, abs(mode.root(nearest)) / (2 * np.pi), len(mode.states))


class _Followed:
    """One mode between two ends; each value of the parameter is solved once."""

    def __init__(self, line: PencilLine, ends: tuple[FollowedEnd, FollowedEnd]) -> None:
        self._line, self._ends, self._follower = line, ends, RootFollower()
        self.states: dict[float, RootState] = {}

    def root(self, x: float) -> complex:
        """Root of the mode, rad/s; ConvergenceError where it is lost."""
        for end in self._ends:
            if x == end.x:
                return end.lam
        if x not in self.states:
            state = self._follower.at(self._line.pencil(x), self._guess(x))
            shape = self._line.basis.T @ state.right
            if not all(end.is_this(shape) for end in self._ends):
                raise ConvergenceError("lost", f"the mode is not clearly the same at {x:g}")
            self.states[x] = state
        return self.states[x].lam

    def _guess(self, x: float) -> RootState:
        """The root on the straight line between its neighbours, the vectors of the nearest one."""
        root_at = {end.x: end.lam for end in self._ends}
        root_at |= {solved_x: state.lam for solved_x, state in self.states.items()}
        solved = np.array(sorted(root_at))
        roots = np.array([root_at[solved_x] for solved_x in solved])
        lam = complex(np.interp(x, solved, roots.real), np.interp(x, solved, roots.imag))
        if self.states:
            nearest = min(self.states, key=lambda at: abs(at - x))
            return self.states[nearest]._replace(lam=lam)
        end = min(self._ends, key=lambda end: abs(end.x - x))
        right = self._line.basis @ end.modes.shapes[end.place].astype(complex)
        right = right / np.linalg.norm(right)
        return RootState(lam, right, right.conj())  # the left vector of a symmetric pencil: a guess
