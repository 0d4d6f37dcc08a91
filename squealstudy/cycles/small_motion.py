"""What small motion grows to where steady sliding is unstable: the level that squeal begins with.

A run from small motion ends once it has come to a cycle that is known to be stable: its state is
then close to the cycle's for several periods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.arrivals import arrived_at
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.trials import LASTS, State, ended, run_on, state_of, with_regularisation
from squealstudy.cycles.verdicts import Family, Followed
from squealstudy.wording import SQUEALS

FROM_SMALL = "small motion"  # start of a run as squeal begins by itself, in words
SMALL_START_RATIO = 0.1  # size with which it begins over the smallest cycle's
OTHERS_RATIO = 0.1  # size of other modes that grow in it, over that of the fastest
LEVEL = "torque_rms"  # level by which motions of a design that squeals are compared
DISTINCT_LEVEL_RATIO = 1.02  # a level above another by this ratio is that of another motion
COMES_TO = f"; {FROM_SMALL} comes to"  # begins the clause on a quieter motion


@dataclass(frozen=True)
class Reached:
    """What a run from small motion came to.

    Attributes
    ----------
    mode : int
        Number of the mode that grows fastest, along which it began.
    level : float
        RMS of the torque [N m]; NaN where that is not known.
    error : float
        Its relative error; NaN where that is not known.
    why : str
        What became of a run without a level, in words.
    """

    mode: int
    level: float = np.nan
    error: float = 0.0
    why: str = ""

    def told(self, followed: Followed) -> Followed:
        """The families; the reason of the fastest mode says where small motion stays quieter."""
        families = dict(followed.families)
        loudest = max(level_of(family) for family in families.values())
        clause = f"; {self.why}" if self.why else ""
        if self.level * (DISTINCT_LEVEL_RATIO + np.nan_to_num(self.error)) < loudest:
            about = "" if np.isfinite(self.error) else " about"
            clause = f"{COMES_TO}{about} {self.level / loudest:.2g} of the level told"
        family = families[self.mode]
        families[self.mode] = replace(family, reason=family.reason + clause)
        return followed._replace(families=list(families.items()))


def level_of(family: Family) -> float:
    """Level of the loudest motion of a family that lasts; 0 without one."""
    cycle = family.loudest.levels[LEVEL] if family.loudest else 0.0
    by_run = family.run.torque_rms if family.run and family.run.outcome == LASTS else 0.0
    return max(cycle, by_run)


def from_small_motion(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float]
) -> tuple[Followed, Reached | None]:
    """A design that squeals, with the level that small motion grows to where that is louder.

    The run begins along the mode that grows fastest, with a little of the other modes that grow.
    Nothing is run where that mode was not followed, or one outside the band grows too.
    """
    growing = [(n, f) for n, f in followed.families if f.verdict == SQUEALS and f.lam.real > 0.0]
    if not growing or contact.point.growing.n_outside > 0:
        return followed, None
    mode, family = max(growing, key=lambda numbered: numbered[1].lam.real)
    if not family.path:
        return followed, None
    stable = [c for _, f in followed.families for c in f.cycles if c.attracts]
    others = [f for n, f in growing if n != mode and f.path]
    loudest = max(level_of(f) for _, f in followed.families)
    q, v = _small_start(family, others)
    same = (loudest / DISTINCT_LEVEL_RATIO, loudest * DISTINCT_LEVEL_RATIO)
    start = replace(contact.point, q0=q, v0=v)
    (motion,) = run_on(contact, [start], band, same, [c.motion for c in stable])
    if (number := arrived_at(motion)) is not None:
        return followed, Reached(mode, stable[number].levels[LEVEL])
    run = ended(FROM_SMALL, motion, band)
    if run.outcome != LASTS:
        return followed, Reached(mode, why=run.nothing_told)
    if not run.torque_rms > same[1]:
        return followed, Reached(mode, run.torque_rms, error=run.spread)
    run = with_regularisation(contact, run, motion, band)
    reason = f"unstable mode; level of a run in time from {FROM_SMALL}"
    families = dict(followed.families) | {mode: replace(family, run=run, reason=reason)}
    return followed._replace(families=list(families.items())), Reached(mode, run.torque_rms)


def _small_start(family: Family, others: Sequence[Family]) -> State:
    """A motion smaller than the cycles of a family, with a part of the modes of others."""
    first = family.path[0].motion
    smallest = min((c.motion for c in family.cycles), key=lambda m: m.size, default=None)
    factor = 1.0 if smallest is None else SMALL_START_RATIO * smallest.size / first.size
    q, v = state_of(first, factor)
    for other in others:
        motion = other.path[0].motion
        more_q, more_v = state_of(motion, OTHERS_RATIO * factor * first.size / motion.size)
        q, v = q + more_q, v + more_v
    return q, v
