"""Finds the onset of instability of a mode that is followed between two design points.

Between points so close that a polynomial through them is accurate, the onset is the polynomial's
zero (`cubic_onsets`).
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.modes.tracking.refinement import Modes

MOST_ITERATIONS = 40  # of Brent's or Chandrupatla's method
MIN_JUMP = 0.1  # change of zeta + tolerance across the zero over its largest value: a jump
NO_CROSSING = "no_crossing"  # status of the error: the unstable mode stays so over the bracket
# least value beside a jump over the jump: a square-root onset is as steep, but zero on one side
MIN_VALUE_BESIDE_JUMP = 0.02
# change to another root over the change of the mode's own root, below which they were exchanged
EXCHANGED_DISTANCE_RATIO = 0.25
# largest relative change of a root across a bracket as narrow as an onset's error
MAX_REL_ROOT_CHANGE = 0.05
HALVINGS = 50  # bisections for the zero of a cubic
MOST_HALVINGS = 4  # halvings of a step in which a mode is lost
N_CHECKED = 9  # values of the parameter at which the error of a cubic is evaluated
# factor on the error of a cubic: with it 0 of 2,300 onsets of random families had a larger error,
# without it 1
CUBIC_SAFETY_FACTOR = 2.0
# largest change of the slope from one pair of points to the next, over the least slope
MAX_REL_SLOPE_CHANGE = 0.5


class Onset(NamedTuple):
    """Value of the parameter at which a mode turns unstable.

    Attributes
    ----------
    value : float
        Value of the parameter.
    frequency_hz : float
        ``|lambda|/2 pi`` of the mode there.
    evaluations : int
        Number of design points that were solved for it.
    """

    value: float
    frequency_hz: float
    evaluations: int


class SolvedLine:
    """Modes at the values of a parameter between two design points, each solved once.

    Parameters
    ----------
    low, high : float
        Values of the parameter at both ends.
    at_low, at_high : Modes
        Modes at both ends.
    solve : callable
        Returns the modes at a value; raises ConvergenceError where there are none.
    """

    def __init__(
        self,
        low: float,
        at_low: Modes,
        high: float,
        at_high: Modes,
        solve: Callable[[float], Modes],
    ) -> None:
        self.low, self.high = low, high
        self._solve = solve
        self._modes_at = {low: at_low, high: at_high}

    @property
    def values(self) -> list[float]:
        """Values of the parameter at which modes are known, ascending."""
        return sorted(self._modes_at)

    def at(self, x: float) -> Modes:
        """Modes at a value of the parameter, solved where they are not known yet."""
        if x not in self._modes_at:
            self._modes_at[x] = self._solve(x)
        return self._modes_at[x]


class FollowedMode:
    """One mode between two design points, of which one end or both are known.

    The modes at a value in between are paired with those at the nearest known values on both sides.
    Where these disagree the pairing of more trust counts: near a lock-in one is ambiguous.

    Parameters
    ----------
    samples : SolvedLine
        Modes between the two design points.
    at_low, at_high : int or None
        Index of the mode at both ends; None at one end to follow it from the other.
    """

    def __init__(self, samples: SolvedLine, at_low: int | None, at_high: int | None) -> None:
        self._samples = samples
        ends = {samples.low: at_low, samples.high: at_high}
        self._index_at = {x: index for x, index in ends.items() if index is not None}
        self._followed_x = sorted(self._index_at)

    def root(self, x: float) -> complex:
        """Root of the mode, rad/s. Raises ConvergenceError where it cannot be followed."""
        if x not in self._index_at and not self._follow(x, MOST_HALVINGS):
            raise ConvergenceError("lost", f"the mode cannot be followed at {x:g}")
        return complex(self._samples.at(x).lam[self._index_at[x]])

    def at(self, x: float) -> tuple[np.ndarray, int]:
        """All roots at a value, and the index of the mode among them."""
        self.root(x)
        return self._samples.at(x).lam, self._index_at[x]

    def outwards(self, values: list[float]) -> list[float]:
        """Values by their distance from those where the mode is known, nearest first."""
        return sorted(values, key=lambda x: min(abs(x - known_x) for known_x in self._followed_x))

    def _follow(self, x: float, halvings: int) -> bool:
        """Whether the mode can be followed to x; a step that is too long is halved."""
        index = self._paired_index(x)
        if index is None and halvings:
            nearest = min(self._followed_x, key=lambda known_x: abs(known_x - x))
            middle = (x + nearest) / 2
            if self._follow(middle, halvings - 1):
                return self._follow(x, halvings - 1)
        if index is not None:
            self._index_at[x] = index
            insort(self._followed_x, x)
        return index is not None

    def _paired_index(self, x: float) -> int | None:
        """Index of the followed mode at x, by the neighbour that pairs it with most trust."""
        modes_at_x = self._samples.at(x)
        number = bisect_left(self._followed_x, x)
        choices = []
        for neighbour in self._followed_x[max(number - 1, 0) : number + 1]:
            neighbour_modes, neighbour_index = (
                self._samples.at(neighbour),
                self._index_at[neighbour],
            )
            pairs = pair_modes(
                neighbour_modes.lam, neighbour_modes.shapes, modes_at_x.lam, modes_at_x.shapes
            )
            if pairs.partner[neighbour_index] >= 0:
                choices.append(
                    (float(pairs.trust[neighbour_index]), int(pairs.partner[neighbour_index]))
                )
        return max(choices, key=lambda choice: choice[0])[1] if choices else None


def refine_onset(
    samples: SolvedLine, at_low: int, at_high: int, tolerance: float, precision: float
) -> Onset:
    """Value at which the damping ratio of a mode passes -tolerance, by Brent's method.

    Where the two ends are of different modes (by a wrong label), the damping ratio jumps between
    them. Then the mode is followed from its unstable end only.

    Parameters
    ----------
    samples : SolvedLine
        Values that have been solved for other modes narrow the bracket.
    at_low, at_high : int
        Index of the mode at both ends, at one of which it is unstable.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    precision : float
        Absolute error of the value.

    Raises
    ------
    ConvergenceError
        Where the mode cannot be followed, or a point has no modes; with status NO_CROSSING where
        the unstable mode does not turn stable between the points.
    """
    before = len(samples.values)
    low, high = (samples.at(x).lam[i] for x, i in ((samples.low, at_low), (samples.high, at_high)))
    growing_high = -high.real / abs(high) < -low.real / abs(low)
    from_unstable = (None, at_high) if growing_high else (at_low, None)
    for ends in ((at_low, at_high), from_unstable):
        mode = FollowedMode(samples, *ends)
        onset, jumps = _root(mode, samples.values, tolerance, precision)
        if not jumps:
            nearest = min(samples.values, key=lambda x: abs(x - onset))
            frequency = abs(mode.root(nearest)) / (2 * np.pi)
            return Onset(onset, frequency, len(samples.values) - before)
    raise ConvergenceError("lost", f"the damping ratio jumps at {onset:g}")


def _root(
    mode: FollowedMode, solved_values: list[float], tolerance: float, precision: float
) -> tuple[float, bool]:
    """First change of sign of zeta + tolerance, and whether that is a jump instead of a zero."""
    for x in mode.outwards(solved_values):
        mode.root(x)
    crossing = bracketed_crossing(mode.root, solved_values, tolerance, precision)
    ends = [mode.at(x) for x in crossing.around]
    other = exchanged(*(lam[None] for lam, _ in ends), *(np.array([p]) for _, p in ends))[0]
    return crossing.value, bool(crossing.jumps or other)


class Crossing(NamedTuple):
    """Where the damping ratio of a mode passes a value.

    Attributes
    ----------
    value : float
        Value of the parameter.
    around : (float, float)
        The nearest values on both sides at which the root is known.
    jumps : bool
        Whether the damping ratio or the root jumps between these.
    """

    value: float
    around: tuple[float, float]
    jumps: bool


def bracketed_crossing(
    root: Callable[[float], complex], solved_values: list[float], tolerance: float, precision: float
) -> Crossing:
    """First zero of the damping ratio of a root plus `tolerance`, by Brent's method.

    Parameters
    ----------
    root : callable
        Returns the root of a mode [rad/s] at a value of the parameter.
    solved_values : list of float
        Values at which the root is known, ascending. The bracket is the first two between which
        the sign changes.
    precision : float
        Absolute error of the value.

    Raises
    ------
    ConvergenceError
        With status NO_CROSSING where there is no bracket; any that `root` raises.
    """
    from scipy.optimize import brentq

    excess: dict[float, float] = {}

    def function(x: float) -> float:
        if x not in excess:
            lam = root(x)
            excess[x] = -lam.real / max(abs(lam), 1e-300) + tolerance
        return excess[x]

    signs = np.sign([function(x) for x in solved_values])
    changes = np.flatnonzero(signs[:-1] * signs[1:] <= 0)
    if not len(changes):
        raise ConvergenceError(
            NO_CROSSING, "the damping ratio does not cross zero between the points"
        )
    a, b = solved_values[changes[0]], solved_values[changes[0] + 1]
    zero = float(brentq(function, a, b, xtol=precision, rtol=1e-14, maxiter=MOST_ITERATIONS))
    sampled = [x for x in sorted(excess) if a <= x <= b]
    excesses = np.array([excess[x] for x in sampled])
    change = int(np.flatnonzero(np.sign(excesses[:-1]) * np.sign(excesses[1:]) <= 0)[0])
    excess_before, excess_after = excesses[change], excesses[change + 1]
    step = abs(excess_after - excess_before)
    scale = max(abs(zeta) for zeta in excess.values())
    jumps = (
        min(abs(excess_before), abs(excess_after))
        > MIN_VALUE_BESIDE_JUMP * step
        > MIN_VALUE_BESIDE_JUMP * MIN_JUMP * scale
    )
    before, after = sampled[change], sampled[change + 1]
    is_jump = abs(root(after) - root(before)) > MAX_REL_ROOT_CHANGE * min(
        abs(root(x)) for x in (before, after)
    )
    return Crossing(zero, (before, after), bool(jumps or is_jump))


def exchanged(
    low: np.ndarray, high: np.ndarray, at_low: np.ndarray, at_high: np.ndarray
) -> np.ndarray:
    """Mask (n,) of brackets whose ends are two different modes that seem to change places.

    There the mode's root at either end is much closer to another root at the other end than to the
    mode's own. Where two modes merge both are equally close.

    Parameters
    ----------
    low, high : ndarray (n, m) complex
        All roots at the lower and the upper end of each bracket.
    at_low, at_high : ndarray (n,) of int
        Index of the mode among them.
    """
    rows = np.arange(len(low))
    own_low, own_high = low[rows, at_low], high[rows, at_high]
    distance = np.abs(own_high - own_low)
    from_low, from_high = np.abs(high - own_low[:, None]), np.abs(low - own_high[:, None])
    nearest = np.maximum(from_low.min(axis=1), from_high.min(axis=1))
    is_exchanged: np.ndarray = nearest < EXCHANGED_DISTANCE_RATIO * distance
    return is_exchanged


def cubic_onsets(x: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Zeros of the cubics through the inner four of six points, between the third and the fourth.

    Parameters
    ----------
    x : ndarray (n, 6)
        Values of the parameter, ascending; the first and the last may be NaN where a line ends.
    f : ndarray (n, 6)
        Values of the function, with opposite signs, or zero, at the third and fourth point.

    Returns
    -------
    value : ndarray (n,)
        Zeros of the cubics.
    error : ndarray (n,)
        CUBIC_SAFETY_FACTOR times the largest distance between a cubic and a parabola through three
        of the four points, anywhere in the interval, over the least slope there. The largest third
        difference of all points is used, as that of four points may vanish by chance. Infinite
        where there are four points only, or where the slope between the points changes by more than
        MAX_REL_SLOPE_CHANGE: at a kink, at a square-root onset, and where the mode is not the same.
    """
    inner, at = slice(1, 5), x[:, 1:5]
    c = _divided_differences(at, f[:, inner])
    zero = _zero(at, c)
    fractions = np.linspace(0.0, 1.0, N_CHECKED)
    checked_x = at[:, 1, None] + fractions * (at[:, 2] - at[:, 1])[:, None]
    distance = checked_x[:, :, None] - at[:, None, :]
    product = np.maximum(*(np.abs(distance[:, :, i : i + 3].prod(axis=2)) for i in (0, 1)))
    slope = np.diff(_evaluated(at[:, :, None], c[:, :, None], checked_x), axis=1) / np.diff(
        checked_x, axis=1
    )
    smallest_slope = np.abs(slope).min(axis=1)
    turns = (np.sign(slope) != np.sign(slope[:, :1])).any(axis=1) | (smallest_slope == 0)
    turns |= ~_secants_agree(x, f) | (np.isnan(x[:, 0]) & np.isnan(x[:, 5]))
    third = [np.abs(_divided_differences(x[:, k : k + 4], f[:, k : k + 4])[:, 3]) for k in range(3)]
    bend = np.nanmax(third, axis=0)
    error = CUBIC_SAFETY_FACTOR * bend * product.max(axis=1) / np.where(turns, 1.0, smallest_slope)
    return zero, np.where(turns, np.inf, error)


def _secants_agree(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Mask (n,) of lines whose secants agree; at a kink a third difference may vanish by chance."""
    secants = np.diff(f, axis=1) / np.diff(x, axis=1)
    size, middle = np.nanmin(np.abs(secants), axis=1), np.sign(secants[:, 2:3])
    same = ((np.sign(secants) == middle) | np.isnan(secants)).all(axis=1)
    steady: np.ndarray = same & (
        np.nanmax(np.abs(np.diff(secants, axis=1)), axis=1) <= MAX_REL_SLOPE_CHANGE * size
    )
    return steady


def _zero(x: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Zeros (n,) of interpolating polynomials between their points 1 and 2, by bisection."""
    low, high = x[:, 1].copy(), x[:, 2].copy()
    before = np.sign(_evaluated(x, c, low))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        is_same_side = np.sign(_evaluated(x, c, middle)) == before
        low, high = np.where(is_same_side, middle, low), np.where(is_same_side, high, middle)
    zero: np.ndarray = (low + high) / 2
    return zero


def _divided_differences(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Coefficients (n, k) of the interpolating polynomials in Newton's form."""
    c = np.array(f, dtype=float)
    for order in range(1, x.shape[1]):
        c[:, order:] = (c[:, order:] - c[:, order - 1 : -1]) / (x[:, order:] - x[:, :-order])
    return c


def _evaluated(x: np.ndarray, c: np.ndarray, at: np.ndarray) -> np.ndarray:
    polynomial = np.zeros_like(at)
    for k in range(c.shape[1] - 1, -1, -1):
        polynomial = polynomial * (at - x[:, k]) + c[:, k]
    return polynomial
