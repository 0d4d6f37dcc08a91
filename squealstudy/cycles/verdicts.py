"""The verdict on a mode family: whether it squeals, by its cycles and runs in time.

A verdict never says more than was found. A family is `no_cycle_found` only if its curve was
followed as far as was asked, or if runs in time decay where it was not; `squeals_if_kicked` only if
a cycle is stable by more than its errors, or a run in time lasts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from squealstudy.cycles.curve import BASIS, LOST, CurveMotion
from squealstudy.cycles.cycle import OK, Cycle, same_cycle
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.growth import (
    DAMPED,
    FAR,
    OTHER_RESONANCE,
    RETRACED,
    SHRUNK,
    STANDSTILL,
    SecondLook,
)
from squealstudy.cycles.trials import Ended
from squealstudy.wording import IF_KICKED, NEUTRAL, NO_CYCLE, SQUEALS, UNDECIDED, plural

NOT_FOLLOWED = "not_followed"  # end of a curve where the family was not to be followed
CURVE_ENDS = {  # why a curve ended before it was followed as far as asked, in words
    OTHER_RESONANCE: "the motion became that of another resonance",
    SHRUNK: "the motion came back to no amplitude",
    STANDSTILL: "the frequency of the motion went to zero",
    RETRACED: "the curve turned back on its own path",
    BASIS: "more vectors would be needed than are used",
    LOST: "the equations did not converge",
    "steps": "it took too many steps",
    "no_contact_motion": "the mode does not move the contact",
}
SEARCHED_ENDS = (FAR, DAMPED)  # ends of curves that were followed far enough
ONLY_UNSTABLE = "only unstable cycles found"
# in large models a curve ends where a motion decays faster than small ones by this damping ratio
GIVE_UP_DAMPING_RATIO = 0.02
# relative error of a cycle's contact velocity beyond which the cycle is no threshold
MAX_THRESHOLD_REL_ERROR = 0.05


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
        Number of zeros of the curve that more harmonics did not confirm, or that lead to the cycle
        of another zero.
    curve : list of dict
        Rows with ``contact_velocity`` m/s, ``frequency_hz``, ``added_damping`` 1/s, ``residual``,
        ``basis_error``, ``event``.
    end : str
        Why the curve ended: ``far`` where it was followed as far as asked.
    look : SecondLook or None
        The check with more harmonics of a stable mode's curve on which no cycle is confirmed.
    verdict, reason : str
    threshold : Cycle or None
        The unstable cycle that a kick along it must exceed.
    run : Ended or None
        The run in time that decided the verdict or the level, or that left it open.
    largest : PeriodicMotion or None
        The motion of the curve with the largest contact velocity.
    path : tuple of CurveMotion
        Motions of the curve; those of a design nearby where `origin` is not empty.
    origin : str
        Name of a design nearby whose silent curve was used for this family.
    furthest : float
        Largest contact velocity of that design's curve, m/s.
    noise : float
        Added damping [1/s] up to which it counts as none.
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
    path: tuple[CurveMotion, ...] = ()
    origin: str = ""
    furthest: float = 0.0
    noise: float = 0.0

    @property
    def reached(self) -> float:
        """Largest contact velocity of the curve, m/s."""
        velocities = (p["contact_velocity"] for p in self.curve)
        return self.furthest or max(velocities, default=0.0)

    @property
    def cut_short(self) -> bool:
        """Whether there is no sign of a cycle: none found, no zero lost, no motion that grows."""
        return not (self.cycles or self.lost or self.grows)

    @property
    def grows(self) -> bool:
        """Whether a motion of the curve grows, with the most harmonics that were tried."""
        if self.look is not None:
            return self.look.grows
        return any(p["added_damping"] > self.noise for p in self.curve)

    @property
    def undamped(self) -> float:
        """Contact velocity [m/s] up to which motions neither grow nor decay; 0 if small ones do."""
        if abs(2.0 * self.lam.real) > self.noise:
            return 0.0
        small = itertools.takewhile(lambda p: abs(p["added_damping"]) <= self.noise, self.curve)
        return max((p["contact_velocity"] for p in small), default=0.0)

    @property
    def grew(self) -> bool:
        """Whether a motion of the curve grows, or there is a cycle."""
        return self.grows or bool(self.cycles)

    @property
    def loudest(self) -> Cycle | None:
        """The stable cycle with the largest contact velocity; None without a stable one."""
        stable = [c for c in self.cycles if c.attracts]
        return max(stable, key=lambda c: c.levels["contact_velocity"], default=None)


class Followed(NamedTuple):
    """The mode families that were followed for a design.

    Attributes
    ----------
    families : list of (int, Family)
        Numbers of modes and their families; unstable modes are listed even if not asked for.
    left_out : int
        Number of modes of the band that were not followed, unstable ones included.
    unstable_outside : bool
        Whether a mode is unstable, and none in the band.
    modes : ndarray (n, m) complex
        Right vectors of the band's modes.
    name : str
        Name of the design.
    """

    families: list[tuple[int, Family]]
    left_out: int
    unstable_outside: bool
    modes: np.ndarray = np.zeros((0, 0))
    name: str = ""

    @property
    def n_growing(self) -> int:
        """Number of families that have a motion that grows, or a cycle."""
        return sum(family.grew for _, family in self.families)


def judged(family: Family, unstable: bool, any_unstable: bool) -> Family:
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
        reason = "steady sliding is stable, and so is a cycle beside it" + (
            f"; no threshold: {why}" if why else ""
        )
        return replace(family, verdict=IF_KICKED, reason=reason, threshold=threshold)
    if family.undamped and family.cut_short and family.end in SEARCHED_ENDS:
        return replace(family, verdict=NEUTRAL, reason=_neutral(family))
    if inexact:
        count = plural(inexact, "cycle")
        reason = f"{count} found, too inexactly to tell whether stable or how loud"
    elif family.cycles:
        reason = f"{ONLY_UNSTABLE}; what larger motions come to is open"
    elif family.end not in SEARCHED_ENDS:
        why = CURVE_ENDS.get(family.end, family.end)
        velocity = f"a contact velocity of {family.reached:.3g} m/s"
        reason = f"the curve was followed up to {velocity} only: {why}"
    elif family.look is None or family.look.grows:
        reason = "motions of some amplitude grow, but no cycle was found"
    elif family.look.open:
        count = plural(len(family.look.open), "amplitude")
        reason = f"{count} at which more harmonics do not tell whether motions grow"
    else:
        return replace(family, verdict=NO_CYCLE, reason=_searched(family, family.look))
    return replace(family, reason=reason)


def _neutral(family: Family) -> str:
    """What a kick of a mode without damping leads to, in words."""
    small = family.undamped
    larger = f"; larger ones, up to {family.reached:.3g} m/s, decay"
    return (
        f"no damping: motions up to a contact velocity of {small:.3g} m/s stay as large as a kick "
        f"makes them{larger if small < family.reached else ''}"
    )


def _searched(family: Family, look: SecondLook) -> str:
    """Range that was searched without finding a cycle, in words."""
    limit = f" (not further: {100 * GIVE_UP_DAMPING_RATIO:g} % of damping missing)"
    limit *= family.end == DAMPED
    on = f" on the curve of {family.origin}, a design nearby" if family.origin else ""
    checked = plural(look.checked, "amplitude")
    return (
        f"no cycle up to a contact velocity of {family.reached:.3g} m/s{on}{limit}, checked at "
        f"{checked} with up to {look.harmonics} harmonics; cycles apart from this curve were not "
        "searched"
    )


def alone(number: int, family: Family, families: Sequence[tuple[int, Family]]) -> Family:
    """The family, without its threshold where another one grows at smaller motions, or may."""
    if family.threshold is None:
        return family
    own_threshold = family.threshold
    for other, other_family in families:
        smaller = any(
            cycle.levels["energy"] < own_threshold.levels["energy"]
            and not same_cycle(cycle, own_threshold)
            for cycle in other_family.cycles
        )
        if other != number and (smaller or (other_family.grows and not other_family.cycles)):
            reason = f"{family.reason}; no threshold: mode {other} grows at smaller motions"
            return replace(family, threshold=None, reason=reason)
    return family


def _threshold(family: Family, stable: Cycle) -> tuple[Cycle | None, str]:
    """The cycle below the stable one, if it is the only one and a saddle; else None and why."""
    below = family.cycles[: family.cycles.index(stable)]
    if family.lost:
        return None, "other cycles below the stable one may be missing"
    if len(below) != 1:
        return None, f"it would be the only cycle below the stable one, found {len(below)}"
    if below[0].status != OK or below[0].velocity_error > MAX_THRESHOLD_REL_ERROR:
        return None, "the cycle below the stable one is inexact"
    if not below[0].multipliers.saddle:
        return None, "the cycle below the stable one may have no or several unstable directions"
    return below[0], ""
