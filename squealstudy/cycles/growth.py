"""Growth over amplitude of one mode family: the added damping that keeps each amplitude constant.

A model of many coordinates is followed on a basis that grows with the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import CurveMotion, Path, between
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import derivative, with_harmonics
from squealstudy.cycles.oscillator import Oscillator
from squealstudy.cycles.projection import CURVE_BASIS_ERROR, SIZE_HELD, Projection
from squealstudy.errors import ConvergenceError

ZERO = "C"  # event: a cycle, where no damping need be added
FAR, OTHER_RESONANCE = "far", "other_resonance"  # why curves end
DAMPED, OUTSIDE = "damped", "outside"
SHRUNK, STANDSTILL, RETRACED = "shrunk", "standstill", "retraced"
# a motion with less than this share of the mode's frequency is on its way to another equilibrium
MIN_REL_FREQUENCY = 0.05
# a curve ends where its size falls to this share of the first size; it is checked for having turned
# back where its size falls to this share of the largest size
END_SIZE_RATIO = 0.5
# two motions are the same if they differ less in frequency (relative) and in added damping (over
# the largest of the curve), and the MAC of their first harmonics is more
SAME_MOTION_TOLERANCES = 1e-3, 2e-2, 0.99
MAX_HARMONICS_OVER_FIRST = 10.0  # a curve ends if all harmonics, over the first, have a larger norm
N_SIZE_OCTAVES = 5  # octaves of size, down from the largest, in each of which a motion is checked
MIN_CHECKS = 3  # least number of motions that are balanced with more harmonics
HARMONIC_SAFETY_FACTOR = 2.0  # largest change by still more harmonics, over the change by more
# distance over size beyond which a motion is not that of a design nearby
MAX_REL_DISTANCE = 0.1
N_FIRST_ORDER_POINTS = 12  # points of such a curve that are corrected to first order
ON_ZERO = 1  # most neighbouring motions without added damping: more are a range, no cycle
# damping ratio by which more harmonics are assumed to change a motion at least
MIN_DAMPING_CHANGE = 0.0025
PIECE_STEPS = Steps(first=0.2, least=2e-3, largest=0.5, count=25)  # each way, with more harmonics


def linear_motion(phi: np.ndarray, lam: complex, scale: np.ndarray, size: float) -> PeriodicMotion:
    """The motion along a complex mode phi (n,) at size a, with the added damping it needs."""
    phi = phi * size / np.linalg.norm(phi * scale)
    Q = np.vstack([np.zeros(len(phi)), phi.real, -phi.imag])
    return PeriodicMotion(Q, abs(lam.imag), 2.0 * lam.real)


def family_curve(
    projection: Projection,
    start: PeriodicMotion,
    stop: Callable[[PeriodicMotion], str],
    steps: Steps,
) -> tuple[list[CurveMotion], str]:
    """Follow the added damping over amplitude from a small motion along a complex mode.

    Returns
    -------
    motions : list of CurveMotion
        Motions along the curve. Its zeros (event C) are among them; on a projected model they are
        located to a part of a step.
    end : str
        The reason that `stop` gave; ``other_resonance`` where the first harmonic is less than a
        tenth of the motion (`MAX_HARMONICS_OVER_FIRST`); ``shrunk`` where the amplitude went back
        to zero, ``standstill`` where the frequency did; ``retraced`` where the curve turned by
        mistake and came back along its own path; ``basis`` where too many vectors would be needed;
        ``steps`` or ``not_converged``.

    Raises
    ------
    ConvergenceError
        Where the mode cannot be continued.
    """
    min_size = END_SIZE_RATIO * start.size
    passed: list[PeriodicMotion] = []

    def ended(_: np.ndarray, motion: PeriodicMotion) -> str:
        passed.append(motion)
        if _retraced(passed):
            return RETRACED
        moving = np.linalg.norm(motion.Q[1:] * projection.weight)
        first = np.linalg.norm(motion.Q[[1, motion.harmonics + 1]] * projection.weight)
        if moving > MAX_HARMONICS_OVER_FIRST * first:
            return OTHER_RESONANCE
        if motion.size < min_size:
            return SHRUNK
        if motion.omega < MIN_REL_FREQUENCY * start.omega:
            return STANDSTILL
        return stop(motion)

    tests = {ZERO: lambda u, _: float(u[-1])}
    path = Path(projection, start.harmonics, (SIZE_HELD, 1.0), ended, steps, tests, watched=-1)
    return path.from_motion(start)


def without_noise(curve: Sequence[CurveMotion], noise: float) -> list[CurveMotion]:
    """A curve without the zeros at which added damping does not change sign beyond `noise` [1/s].

    A mode without damping needs none over a range of sizes; there its sign is round-off.
    """
    sign = [
        0 if abs(p.motion.parameter) <= noise else 1 if p.motion.parameter > 0 else -1
        for p in curve
    ]
    certain = []
    for k, point in enumerate(curve):
        if point.event == ZERO:
            before = next((i for i in range(k - 1, -1, -1) if sign[i]), -1)
            after = next((i for i in range(k + 1, len(curve)) if sign[i]), -1)
            range_ = [i for i in range(before + 1, after) if not curve[i].event]
            if before < 0 or after < 0 or sign[before] == sign[after] or len(range_) > ON_ZERO:
                continue
        certain.append(point)
    return certain


def _retraced(passed: Sequence[PeriodicMotion]) -> bool:
    """Whether a curve that has shrunk to `END_SIZE_RATIO` of its largest size retraces its rise."""
    sizes, last = np.log([m.size for m in passed]), passed[-1]
    rose = int(np.argmax(sizes >= sizes[-1]))
    if sizes[-1] > sizes.max() + np.log(END_SIZE_RATIO) or not 0 < rose < len(passed) - 1:
        return False
    share = (sizes[-1] - sizes[rose - 1]) / (sizes[rose] - sizes[rose - 1])
    crossing = between(passed[rose - 1], passed[rose], float(share))
    frequency, damping, alike = SAME_MOTION_TOLERANCES
    max_damping = max(abs(m.parameter) for m in passed)
    x, y = (m.Q[1] - 1j * m.Q[m.harmonics + 1] for m in (crossing, last))
    mac = abs(x.conj() @ y) ** 2 / ((x.conj() @ x) * (y.conj() @ y)).real
    same_frequency = abs(crossing.omega / last.omega - 1.0) < frequency
    return bool(
        same_frequency
        and abs(crossing.parameter - last.parameter) < damping * max_damping
        and mac > alike
    )


@dataclass
class SecondLook:
    """A curve on which no motion grows, checked with more harmonics.

    Attributes
    ----------
    harmonics : int
        Largest number of harmonics with which motions of the curve were balanced.
    checked : int
        Number of motions of the curve that were balanced with more harmonics.
    pieces : list of list of CurveMotion
        Curves with more harmonics through the motions that might grow.
    open : list of PeriodicMotion
        Motions that may grow or not: more harmonics do not decide it.
    motions : list of CurveMotion
        The motions with more harmonics.
    """

    harmonics: int
    checked: int = 0
    pieces: list[list[CurveMotion]] = field(default_factory=list)
    open: list[PeriodicMotion] = field(default_factory=list)
    motions: list[CurveMotion] = field(default_factory=list)

    @property
    def grows(self) -> bool:
        """Whether a motion of the pieces grows."""
        return any(p.motion.parameter > 0.0 for piece in self.pieces for p in piece)

    def holds(self, motion: PeriodicMotion) -> bool:
        """Whether a piece has a motion near this one."""
        return any(motion.near(p.motion) for piece in self.pieces for p in piece)


def looked_again(
    osc: Oscillator,
    curve: Sequence[CurveMotion],
    ladder: Sequence[int],
    shift: float | None = None,
) -> SecondLook:
    """Check a curve on which no motion grows, with more harmonics where growth is nearest.

    Few harmonics miss resonances of higher ones, which feed a motion or damp it. So the motion with
    the largest (least negative) added damping in each octave of size, and every local maximum, are
    balanced with more harmonics. This goes on until the others are below zero by
    `HARMONIC_SAFETY_FACTOR` times the largest change seen, which is taken as `MIN_DAMPING_CHANGE`
    at least: small motions change little, and say nothing of larger ones. Through those that might
    grow the curve is followed with more harmonics.

    Parameters
    ----------
    osc : Oscillator
    curve : sequence of CurveMotion
        A curve without a zero; all added damping is negative.
    ladder : sequence of int
        Larger numbers of harmonics, ascending.
    shift : float or None
        Given where the curve is that of a design nearby: by how much added damping [1/s] is known
        to change. Then a motion is left open where it is not found, is `MAX_REL_DISTANCE` from that
        of the curve, or may grow: the design needs a curve of its own.
    """
    look = SecondLook(curve[0].motion.harmonics)
    max_change = max(2.0 * MIN_DAMPING_CHANGE * curve[0].motion.omega, shift or 0.0)
    failed: list[PeriodicMotion] = []
    span = float(np.ptp([p.motion.parameter for p in curve]))
    for motion, rise in _likeliest(curve):
        if (
            look.checked >= MIN_CHECKS
            and motion.parameter + HARMONIC_SAFETY_FACTOR * (rise + max_change) < 0.0
        ):
            break
        if look.holds(motion):
            continue
        try:
            projection, balanced = _with_more(osc, motion, ladder[0])
        except ConvergenceError:
            failed.append(motion)
            continue
        look.checked += 1
        look.harmonics = max(look.harmonics, ladder[0])
        look.motions.append(balanced)
        better, elsewhere = balanced.motion, 0.0
        if shift is not None:
            rel_distance = _rel_distance(projection.weight, motion, better)
            if rel_distance > MAX_REL_DISTANCE:
                look.open.append(better)
                break
            elsewhere = (
                rel_distance * span
            )  # a maximum that has moved aside is higher than the value here
        max_change = max(max_change, change := abs(better.parameter - motion.parameter) + elsewhere)
        margin = HARMONIC_SAFETY_FACTOR * (rise + change)
        if better.parameter + margin < 0.0 or look.holds(better):
            continue
        if shift is not None:
            look.open.append(better)
            break
        try:
            piece = _piece(projection, better, -margin)
        except ConvergenceError:
            failed.append(motion)
            continue
        look.pieces.append(piece)
        top = max((p.motion for p in piece), key=lambda m: m.parameter)
        if top.parameter <= 0.0:
            _settle(osc, top, ladder[1:], look)
    look.open += [
        m
        for m in failed
        if m.parameter + HARMONIC_SAFETY_FACTOR * max_change >= 0.0 and not look.holds(m)
    ]
    if not look.checked or shift is not None:
        look.open += [m for m in failed if m not in look.open]
    return look


def holds_here(osc: Oscillator, curve: Sequence[CurveMotion]) -> bool:
    """Whether the curve of a design nearby is everywhere near to one of this design.

    It is if the first-order correction of its motions is everywhere less than `MAX_REL_DISTANCE`.
    It is not where the curves of the two designs part, as where one has met another branch.
    """
    path = [p.motion for p in curve if not p.event]
    checked = np.unique(np.linspace(0, len(path) - 1, N_FIRST_ORDER_POINTS).round().astype(int))
    projection = Projection.on_harmonics_of(osc, path[0])
    if projection.complete:
        return True
    try:
        return all(
            _rel_distance(projection.weight, m, m.changed(projection.correction(m, True)))
            < MAX_REL_DISTANCE
            for m in (path[k] for k in checked)
        )
    except ConvergenceError:
        return False


def _rel_distance(weight: np.ndarray, motion: PeriodicMotion, other: PeriodicMotion) -> float:
    """Norm of the difference of two motions of nearly one phase, each over its first harmonic."""
    H = max(motion.harmonics, other.harmonics)
    a, b = (with_harmonics(m.Q, H) * weight for m in (motion, other))
    a, b = (Q / np.linalg.norm(Q[[1, H + 1]]) for Q in (a, b))
    turn = derivative(a)
    difference = b - a - turn * (turn * (b - a)).sum() / (turn**2).sum()
    return float(np.linalg.norm(difference))


def _likeliest(curve: Sequence[CurveMotion]) -> list[tuple[PeriodicMotion, float]]:
    """Motions of a curve that may grow if any does, those with the largest added damping first.

    With each, how much less [1/s] is lacking beside it, by the parabola through three points.
    """
    motions = [p.motion for p in curve]
    sizes = np.log2([m.size for m in motions])
    octaves = np.floor(sizes.max() - sizes)
    damping = np.array([m.parameter for m in motions])
    ends = np.concatenate([[-np.inf], damping, [-np.inf]])
    before, after = damping - ends[:-2], damping - ends[2:]
    tops = set(np.flatnonzero((before > 0) & (after >= 0)).tolist())
    for octave in range(N_SIZE_OCTAVES):
        inside = np.flatnonzero(octaves == octave)
        if len(inside):
            tops.add(int(inside[np.argmax(damping[inside])]))
    likeliest = []
    for k in sorted(tops, key=lambda k: -damping[k]):
        drops = before[k], after[k]
        rise = 0.0
        if min(drops) >= 0.0 and 0.0 < sum(drops) < np.inf:
            rise = (drops[0] - drops[1]) ** 2 / (8.0 * sum(drops))
        likeliest.append((motions[k], float(rise)))
    return likeliest


def _with_more(
    osc: Oscillator, motion: PeriodicMotion, harmonics: int
) -> tuple[Projection, CurveMotion]:
    """The motion of the same size with more harmonics, on a basis of its own; ConvergenceError."""
    projection = Projection.on_harmonics_of(osc, motion)
    start = replace(motion, Q=with_harmonics(motion.Q, harmonics))
    better, error, residual = projection.improve(start, CURVE_BASIS_ERROR, SIZE_HELD)
    return projection, CurveMotion(better, residual, error)


def _settle(
    osc: Oscillator, top: PeriodicMotion, ladder: Sequence[int], second_look: SecondLook
) -> None:
    """Balance a maximum below zero with still more harmonics; left open if that is not enough."""
    for harmonics in ladder:
        try:
            better = _with_more(osc, top, harmonics)[1].motion
        except ConvergenceError:
            break
        second_look.harmonics, change = (
            max(second_look.harmonics, harmonics),
            abs(better.parameter - top.parameter),
        )
        if better.parameter + HARMONIC_SAFETY_FACTOR * change < 0.0:
            return
        top = better
    second_look.open.append(top)


def found_again(osc: Oscillator, zero: PeriodicMotion, harmonics: int) -> list[PeriodicMotion]:
    """Zeros with more harmonics next to the zero of a curve, where there is none at its size.

    Raises
    ------
    ConvergenceError
        Where no motion of its size is found with so many.
    """
    projection, balanced = _with_more(osc, zero, harmonics)
    start = balanced.motion
    high = np.inf if start.parameter > 0.0 else 0.0
    piece = _piece(projection, start, -HARMONIC_SAFETY_FACTOR * abs(start.parameter), high)
    return [p.motion for p in piece if p.event == ZERO]


def _piece(
    projection: Projection, start: PeriodicMotion, low: float, high: float = np.inf
) -> list[CurveMotion]:
    """The curve both ways from a motion while its added damping [1/s] is between bounds."""

    def ended(_: np.ndarray, motion: PeriodicMotion) -> str:
        return "" if low <= motion.parameter <= high else OUTSIDE

    tests = {ZERO: lambda u, _: float(u[-1])}
    piece: list[CurveMotion] = []
    for way in (-1.0, 1.0):
        path = Path(
            projection, start.harmonics, (SIZE_HELD, way), ended, PIECE_STEPS, tests, watched=-1
        )
        part, _ = path.from_motion(start)
        piece = [*piece[:0:-1], *part]
    is_shrinking = piece[0].motion.size > piece[-1].motion.size
    return piece[::-1] if is_shrinking else piece
