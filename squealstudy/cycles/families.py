"""The limit cycles of a design: growth over amplitude of its mode families, cycles, a verdict.

A verdict never says more than was found: `no_cycle_found` is of a curve that was followed as far as
was asked, `squeals_if_kicked` of a cycle that attracts, with all its digits in order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.growth import (
    FAR,
    SLOWEST,
    STILL,
    ZERO,
    family_curve,
    linear_modes,
    linear_motion,
)
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.projection import Projection
from squealstudy.errors import ConvergenceError

SQUEALS, IF_KICKED = "squeals", "squeals_if_kicked"
NO_CYCLE, UNDECIDED = "no_cycle_found", "undecided"
VERDICTS = (SQUEALS, IF_KICKED, UNDECIDED, NO_CYCLE)  # of a design the first of its families'
OK, INACCURATE = "ok", "inaccurate"
NOT_FOLLOWED = "not_followed"  # end of a curve that was not asked for
CURVE_HARMONICS, PROJECTED_HARMONICS = 5, 3  # of curves: of small models, of projected ones
LADDER = (5, 7, 11, 17, 25, 39, 59)  # harmonics tried, each half as many again
PROJECTED_LADDER = LADDER[:3]  # on projected models, where more cost seconds each
HOPELESS = 2.5  # times the tolerance: an error that half as many harmonics again do not mend
SAFETY = 2.0  # error over the last change: series that converge like 1/H are bounded too
START = 1e-3  # contact velocity over the sliding speed at which a curve begins
LEVELS = ("torque_rms", "contact_velocity")  # by which cycles are told apart, and errors told
SAME = 1e-5  # relative difference of frequencies and levels of one cycle found twice, beside errors
MOST_APART = 1e-2  # and the most of it, however large the errors are
STEPS = Steps(first=0.3, largest=0.5, count=200)
PROJECTED_STEPS = Steps(first=0.5, least=2e-3, largest=1.0, count=60)


@dataclass(frozen=True)
class Search:
    """What is looked for.

    Attributes
    ----------
    harmonics : int or None
        None: as many as the tolerance asks for.
    tolerance : float
        Of levels, relative.
    reach : float
        Contact velocity [m/s] up to which curves are followed.
    highest : float
        rad/s: complex modes up to it are in what the stability of cycles is judged on.
    """

    harmonics: int | None
    tolerance: float
    reach: float
    highest: float = np.inf


@dataclass(frozen=True, eq=False)
class Cycle:
    """A limit cycle.

    Attributes
    ----------
    motion : PeriodicMotion
    multipliers : Floquet
    levels : mapping
        `ContactOscillator.levels`.
    torque_harmonics : ndarray (H,)
        N m.
    level_error, frequency_error : float
        Estimates, relative: from fewer harmonics, and of the basis.
    basis_error : float
        The basis's share of the level's error: by how much it was corrected in all coordinates.
    n_vectors : int
        Size of the basis.
    residual : float
    status : str
        ``ok`` or ``inaccurate``: the level's error is beyond the tolerance.
    """

    motion: PeriodicMotion
    multipliers: Floquet
    levels: dict[str, float]
    torque_harmonics: np.ndarray
    level_error: float
    frequency_error: float
    basis_error: float
    n_vectors: int
    residual: float
    status: str

    @property
    def attracts(self) -> bool | None:
        """Whether it is stable; None where that cannot be said."""
        return self.multipliers.stable if self.status == OK else None


@dataclass(frozen=True, eq=False)
class Family:
    """A mode, its growth over amplitude, its cycles.

    Attributes
    ----------
    lam : complex
        Root of the linearised equation, rad/s.
    cycles : tuple of Cycle
        In the order of the curve.
    lost : int
        Zeros of the curve that more harmonics did not confirm, or lead to another one's cycle.
    curve : list of dict
        ``contact_velocity`` m/s, ``frequency_hz``, ``added_damping`` 1/s, ``residual``,
        ``basis_error``, ``event``.
    end : str
        Why the curve ended: ``far`` where it was followed as far as asked.
    verdict, reason : str
    threshold : Cycle or None
        The unstable cycle that a kick must exceed.
    """

    lam: complex
    cycles: tuple[Cycle, ...]
    lost: int
    curve: list[dict[str, Any]]
    end: str
    verdict: str = UNDECIDED
    reason: str = ""
    threshold: Cycle | None = None

    @property
    def reached(self) -> float:
        """Largest contact velocity of the curve, m/s."""
        return max((p["contact_velocity"] for p in self.curve), default=0.0)

    @property
    def loudest(self) -> Cycle | None:
        """The stable cycle of largest level."""
        stable = [c for c in self.cycles if c.attracts]
        return max(stable, key=lambda c: c.levels["contact_velocity"], default=None)


class Followed(NamedTuple):
    """What was followed of a design.

    Attributes
    ----------
    families : list of (int, Family)
        By the numbers of their modes, unstable ones that were not asked for among them.
    left_out : int
        Modes of the band that were not followed, unstable ones too.
    unstable_outside : bool
        Whether a mode outside the band is unstable.
    """

    families: list[tuple[int, Family]]
    left_out: int
    unstable_outside: bool


def families(
    contact: ContactOscillator,
    band: tuple[float, float],
    wanted: Sequence[int] | None,
    tolerance: float,
    search: Search,
    screen: float = np.inf,
) -> Followed:
    """The families of a band, by the numbers of their modes, with verdicts.

    Parameters
    ----------
    contact : ContactOscillator
    band : (low, high)
        rad/s.
    wanted : sequence of int or None
        Numbers of modes, from 1 by frequency in the band; None for all.
    tolerance : float
        Damping ratio below minus which a mode is unstable.
    search : Search
    screen : float
        1/s: where no modes are named, those that decay faster are left out.

    Raises
    ------
    ConvergenceError
        Steady sliding that diverges without oscillation (``diverges``); a wanted mode that the
        band does not have (``no_mode``).
    """
    lam, psi = linear_modes(contact, band[1])
    unstable = lam.real > tolerance * np.abs(lam)
    if (unstable & (lam.imag == 0)).any():
        raise ConvergenceError("diverges", "steady sliding diverges without oscillation")
    any_unstable = bool(unstable.any()) or contact.point.growing.n_above > 0
    inside = (lam.imag > 0) & (np.abs(lam) >= band[0]) & (np.abs(lam) <= band[1])
    places = np.flatnonzero(inside)
    slow = 1 + np.flatnonzero(lam[places].real > -screen)
    numbers = slow.tolist() if wanted is None else list(wanted)
    if max(numbers, default=0) > len(places):
        count = len(places)
        raise ConvergenceError("no_mode", f"mode {max(numbers)} of {count} modes in the band")
    found = []
    for number, k in enumerate(places, start=1):
        grows = bool(unstable[k])
        if number in numbers:
            family = _family(contact, complex(lam[k]), psi[:, k], search)
            found.append((number, _judged(family, grows, any_unstable, search)))
        elif grows:
            family = Family(complex(lam[k]), (), 0, [], NOT_FOLLOWED)
            found.append((number, _judged(family, grows, any_unstable, search)))
    outside = any_unstable and not unstable[places].any()
    left_out = len(places) - sum(family.end != NOT_FOLLOWED for _, family in found)
    return Followed(found, left_out, outside)


def _family(contact: ContactOscillator, lam: complex, phi: np.ndarray, search: Search) -> Family:
    speed = abs(contact.point.speed)
    unit = PeriodicMotion(np.vstack([0 * phi.real, phi.real, -phi.imag]), abs(lam.imag))
    velocity = contact.contact_velocity(unit)
    scale = np.sqrt(np.abs(np.diag(contact.oscillator.K)) + lam.imag**2)
    if velocity <= 0.0:
        return Family(lam, (), 0, [], "no_contact_motion")
    projection = Projection(contact.oscillator, phi, lam.imag)
    whole = projection.complete
    size = START * speed * float(np.linalg.norm(phi * scale)) / velocity
    harmonics = search.harmonics or (CURVE_HARMONICS if whole else PROJECTED_HARMONICS)
    start = linear_motion(phi, lam, scale, size)
    try:
        curve, end = family_curve(
            projection,
            replace(start, Q=with_harmonics(start.Q, harmonics)),
            lambda m: contact.contact_velocity(m) > search.reach,
            STEPS if whole else PROJECTED_STEPS,
        )
    except ConvergenceError as error:
        return Family(lam, (), 0, [], error.status)
    cycles: list[Cycle] = []
    lost = 0
    for point in curve:
        if point.event != ZERO:
            continue
        try:
            cycle = cycle_near(contact, projection, point.motion, search)
        except ConvergenceError:
            lost += 1
            continue
        twice = any(same_cycle(cycle, known) for known in cycles)
        lost += twice
        cycles += [] if twice else [cycle]
    return Family(lam, tuple(cycles), lost, _shown(contact, curve), end)


def _shown(contact: ContactOscillator, curve: list[CurveMotion]) -> list[dict[str, Any]]:
    """The curve as rows."""
    return [
        {
            "contact_velocity": contact.contact_velocity(point.motion),
            "frequency_hz": point.motion.omega / (2 * np.pi),
            "added_damping": point.motion.mu,
            "residual": point.residual,
            "basis_error": point.error,
            "event": point.event,
        }
        for point in curve
    ]


def cycle_near(
    contact: ContactOscillator, projection: Projection, motion: PeriodicMotion, search: Search
) -> Cycle:
    """The cycle near a motion, with as many harmonics as asked for; ConvergenceError."""
    slowest = SLOWEST * motion.omega
    tried: tuple[int, ...] = LADDER if projection.complete else PROJECTED_LADDER
    if search.harmonics is not None:
        tried = _pair(search.harmonics)
    cycle = rougher = motion
    levels = dict[str, float]()
    level_error = frequency_error = basis_error = residual = np.inf
    for harmonics in tried:
        try:
            motion, residual = projection.cycle_near(motion, harmonics)
        except ConvergenceError:
            if not np.isfinite(level_error):
                raise
            break  # more harmonics are lost: what the last ones changed is the error
        if motion.omega < slowest:
            raise ConvergenceError(STILL, "a motion that comes to a standstill is no cycle")
        rougher, before = cycle, levels
        cycle = projection.corrected(motion)
        levels = contact.levels(cycle)
        if before:
            basis_error = _change(contact.levels(motion), levels)
            level_error = SAFETY * _change(before, levels) + basis_error
            frequency_error = SAFETY * abs(cycle.omega / rougher.omega - 1.0)
            frequency_error += abs(cycle.omega / motion.omega - 1.0)
            if level_error < search.tolerance:
                break
            if not projection.complete and level_error > HOPELESS * search.tolerance:
                break
    status = OK if level_error < search.tolerance else INACCURATE
    found = projection.stability(cycle, search.highest, rougher)
    return Cycle(
        cycle,
        found,
        levels,
        contact.torque_harmonics(cycle),
        level_error,
        frequency_error,
        basis_error,
        projection.size,
        residual,
        status,
    )


def _pair(harmonics: int) -> tuple[int, int]:
    """The number asked for, after two thirds of it to tell its error."""
    return max(1, min(harmonics - 1, round(harmonics / 1.5))), harmonics


def _change(before: dict[str, float], now: dict[str, float]) -> float:
    """Relative change of the level of the friction torque and of the contact velocity."""
    return max(abs(before[n] - now[n]) / now[n] if now[n] > 0 else 0.0 for n in LEVELS)


def _judged(family: Family, unstable: bool, any_unstable: bool, search: Search) -> Family:
    """The family with its verdict."""
    stable = family.loudest
    inexact = sum(c.attracts is None for c in family.cycles) + family.lost
    level = "with a stable cycle" if stable else "no stable cycle found: level undecided"
    if family.end == NOT_FOLLOWED:
        level = "not followed: level undecided"
    if unstable:
        return replace(family, verdict=SQUEALS, reason=f"unstable mode, {level}")
    if stable is not None:
        threshold, why = None, "another mode is unstable"
        if not any_unstable:
            threshold, why = _threshold(family, stable)
        reason = "a stable cycle beside a stable mode" + (f"; no threshold: {why}" if why else "")
        return replace(family, verdict=IF_KICKED, reason=reason, threshold=threshold)
    if inexact:
        reason = f"{inexact} cycles whose stability or level cannot be told"
    elif family.cycles:
        reason = "unstable cycles alone: what is beyond them was not found"
    elif family.end != FAR:
        reason = f"growth over amplitude was lost at {family.reached:.3g} m/s: {family.end}"
    elif max((p["added_damping"] for p in family.curve), default=0.0) > 0:
        reason = "grows at some amplitude, no cycle found"
    else:
        return replace(
            family,
            verdict=NO_CYCLE,
            reason=f"none on this mode's curve up to {search.reach:.3g} m/s; "
            "a cycle apart from it is not excluded",
        )
    return replace(family, reason=reason)


def _threshold(family: Family, stable: Cycle) -> tuple[Cycle | None, str]:
    """The only cycle below the stable one, if it is a saddle; why there is none."""
    below = family.cycles[: family.cycles.index(stable)]
    if family.lost or len(below) != 1:
        return None, "not one cycle between them"
    if below[0].status != OK:
        return None, "the cycle between them is inaccurate"
    if not below[0].multipliers.saddle:
        return None, "the cycle between them has not just one unstable direction for certain"
    return below[0], ""


def same_cycle(one: Cycle, other: Cycle) -> bool:
    """Whether two families have found one cycle."""
    a, b = ([c.motion.omega, *(c.levels[n] for n in LEVELS)] for c in (one, other))
    return alike(a, b, one.level_error + other.level_error)


def alike(one: Sequence[float], other: Sequence[float], errors: float) -> bool:
    """Whether frequencies and `LEVELS` are those of one cycle, by the relative errors of both."""
    near = min(SAME + errors, MOST_APART)
    return all(abs(a - b) <= near * abs(b) for a, b in zip(one, other, strict=True))
