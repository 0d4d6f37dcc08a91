"""The limit cycles of a design: growth over amplitude of its mode families, cycles, a verdict.

A verdict never says more than was found: `no_cycle_found` is of a curve that was followed as far as
was asked, `squeals_if_kicked` of a cycle that attracts, with all its digits in order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.cycle import LADDER, OK, Cycle, Search, cycle_near, same_cycle
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.growth import (
    DAMPED,
    FAR,
    ZERO,
    SecondLook,
    family_curve,
    found_again,
    linear_motion,
    looked_again,
)
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.projection import Projection
from squealstudy.cycles.trials import Ended
from squealstudy.errors import ConvergenceError
from squealstudy.wording import plural

SQUEALS, IF_KICKED = "squeals", "squeals_if_kicked"
NO_CYCLE, UNDECIDED = "no_cycle_found", "undecided"
VERDICTS = (SQUEALS, IF_KICKED, UNDECIDED, NO_CYCLE)  # of a design the first of its families'
NOT_FOLLOWED = "not_followed"  # end of a curve that was not asked for
SEARCHED = (FAR, DAMPED)  # ends of curves that were followed as far as there is hope
VAGUE = 0.05  # error of a contact velocity beyond which it is no threshold, and has no share
HOPELESS = 0.02  # damping ratio missing, beyond small motions', at which large models are left
MORE = 2  # numbers of harmonics with which they are looked at again
CURVE_HARMONICS, PROJECTED_HARMONICS = 5, 3  # of curves: of small models, of projected ones
START = 1e-3  # contact velocity over the sliding speed at which a curve begins
STEPS = Steps(first=0.3, largest=0.5, count=200)
PROJECTED_STEPS = Steps(first=0.5, least=2e-3, largest=1.0, count=90)


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
    look : SecondLook or None
        With more harmonics, of a stable mode's curve on which no cycle is confirmed.
    verdict, reason : str
    threshold : Cycle or None
        The unstable cycle that a kick must exceed.
    run : Ended or None
        In time, of a family that was undecided without: the loudest that lasts, or what is open.
    largest : PeriodicMotion or None
        Of the curve.
    """

    lam: complex
    cycles: tuple[Cycle, ...]
    lost: int
    curve: list[dict[str, Any]]
    end: str
    look: SecondLook | None = None
    verdict: str = UNDECIDED
    reason: str = ""
    threshold: Cycle | None = None
    run: Ended | None = None
    largest: PeriodicMotion | None = None

    @property
    def reached(self) -> float:
        """Largest contact velocity of the curve, m/s."""
        return max((p["contact_velocity"] for p in self.curve), default=0.0)

    @property
    def cut_short(self) -> bool:
        """Whether nothing speaks for a cycle but what of the curve was not followed to its end."""
        return not (self.cycles or self.lost or self.grows)

    @property
    def grows(self) -> bool:
        """Whether a motion of the curve does, with the most harmonics that were tried."""
        if self.look is not None:
            return self.look.grows
        return any(p["added_damping"] > 0.0 for p in self.curve)

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
    lam, psi = contact.oscillator.steady_modes(band[1])
    unstable = lam.real > tolerance * np.abs(lam)
    if (unstable & (lam.imag == 0)).any():
        raise ConvergenceError("diverges", "steady sliding diverges without oscillation")
    any_unstable = bool(unstable.any()) or contact.point.growing.n_outside > 0
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
            found.append((number, _judged(family, grows, any_unstable)))
        elif grows:
            family = Family(complex(lam[k]), (), 0, [], NOT_FOLLOWED)
            found.append((number, _judged(family, grows, any_unstable)))
    found = [(number, _alone(number, family, found)) for number, family in found]
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

    def stop(motion: PeriodicMotion) -> str:
        if contact.contact_velocity(motion) > search.reach:
            return FAR
        missing = (min(start.mu, 0.0) - motion.mu) / (2.0 * start.omega)
        return DAMPED if not whole and missing > HOPELESS else ""

    try:
        curve, end = family_curve(
            projection,
            replace(start, Q=with_harmonics(start.Q, harmonics)),
            stop,
            STEPS if whole else PROJECTED_STEPS,
        )
    except ConvergenceError as error:
        return Family(lam, (), 0, [], error.status, largest=start)
    cycles: list[Cycle] = []
    lost, look = _confirmed(contact, curve, search, cycles), None
    if end in SEARCHED and start.mu <= 0.0 and not cycles:
        look = looked_again(contact.oscillator, curve, [h for h in LADDER if h > harmonics][:MORE])
        _confirmed(contact, chain(*look.pieces), search, cycles)
        if cycles or not (look.open or look.grows):  # more harmonics decide about its zeros
            lost = 0
    shown = _shown(contact, curve)
    place = max(range(len(curve)), key=lambda k: float(shown[k]["contact_velocity"]))
    return Family(lam, tuple(cycles), lost, shown, end, look, largest=curve[place].motion)


def _confirmed(
    contact: ContactOscillator, curve: Iterable[CurveMotion], search: Search, known: list[Cycle]
) -> int:
    """The cycles at the zeros of a curve join those known; how many zeros lead to no new one."""
    lost = 0
    for point in curve:
        if point.event == ZERO:
            near = _cycles_at(contact, point.motion, search)
            new = [c for c in near if not any(same_cycle(c, other) for other in known)]
            lost += not new
            known += new
    return lost


def _cycles_at(contact: ContactOscillator, zero: PeriodicMotion, search: Search) -> list[Cycle]:
    """The cycle at a zero of a curve; where more harmonics move it away, those next to it."""
    osc, found = contact.oscillator, list[Cycle]()
    try:
        return [cycle_near(contact, Projection.about(osc, zero), zero, search)]
    except ConvergenceError:
        pass
    try:
        more = search.harmonics or next(h for h in LADDER if h > zero.harmonics)
        for motion in found_again(osc, zero, more):
            found += [cycle_near(contact, Projection.about(osc, motion), motion, search)]
    except ConvergenceError:
        pass
    return found


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


def _judged(family: Family, unstable: bool, any_unstable: bool) -> Family:
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
    elif family.end not in SEARCHED:
        reason = f"growth over amplitude was lost at {family.reached:.3g} m/s: {family.end}"
    elif family.look is None or family.look.grows:
        reason = "grows at some amplitude, no cycle found"
    elif family.look.open:
        count = plural(len(family.look.open), "amplitude")
        reason = f"{count} at which more harmonics leave growth open"
    else:
        return replace(family, verdict=NO_CYCLE, reason=_searched(family, family.look))
    return replace(family, reason=reason)


def _searched(family: Family, look: SecondLook) -> str:
    """What was searched where no cycle was found."""
    left = f" (left there, {100 * HOPELESS:g} % of damping missing)" if family.end == DAMPED else ""
    places = f"{plural(look.checked, 'place')} of it with up to {look.harmonics} harmonics"
    return (
        f"none on this mode's curve up to {family.reached:.3g} m/s{left}, {places}; "
        "a cycle apart from it is not excluded"
    )


def _alone(number: int, family: Family, found: Sequence[tuple[int, Family]]) -> Family:
    """A family without its threshold where another grows at smaller motions, or may."""
    if family.threshold is None:
        return family
    mine = family.threshold
    for other, own in found:
        smaller = any(
            cycle.levels["energy"] < mine.levels["energy"] and not same_cycle(cycle, mine)
            for cycle in own.cycles
        )
        if other != number and (smaller or (own.grows and not own.cycles)):
            reason = f"{family.reason}; no threshold: mode {other} grows at smaller motions"
            return replace(family, threshold=None, reason=reason)
    return family


def _threshold(family: Family, stable: Cycle) -> tuple[Cycle | None, str]:
    """The only cycle below the stable one, if it is a saddle; why there is none."""
    below = family.cycles[: family.cycles.index(stable)]
    if family.lost or len(below) != 1:
        return None, "not one cycle between them"
    if below[0].status != OK or below[0].velocity_error > VAGUE:
        return None, "the cycle between them is inaccurate"
    if not below[0].multipliers.saddle:
        return None, "the cycle between them has not just one unstable direction for certain"
    return below[0], ""
