"""The least kick along a mode that starts squeal; what runs in time decide of designs."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.trials import (
    DECAYS,
    GROWS,
    LASTS,
    OPEN,
    Ended,
    State,
    Trials,
    ended,
    run_on,
    state_of,
    with_regularisation,
)
from squealstudy.cycles.verdicts import NOT_FOLLOWED, SEARCHED_ENDS, Family, Followed
from squealstudy.wording import IF_KICKED, NEUTRAL, NO_CYCLE, SQUEALS, UNDECIDED

N_PHASES = 8
MIN_REL_KICK = 1e-3  # of the largest kick tried: smaller ones are not looked for
KICK_REL_TOLERANCE = 0.02  # relative width of the bracket at which a search ends
START_SIZES = 1.0, 1.5  # of `reach`: how large motions of lost curves are made, whose runs decide
START_ANGLES_RAD = 0.0, 0.5 * np.pi  # at which of their angles
CYCLE = "the cycle"  # where a run goes on with it
START_OF_LOST = "the curve's largest motion"  # where runs of a lost curve begin
MADE_AS_LARGE = "scaled to"  # whatever the curve itself has come to
ABOVE = 1.1  # times an unstable cycle: where a run begins that shall tell what is beyond it
# status of a search
KICK_FOUND, NO_KICK, KICK_UNDECIDED, KICK_WITHOUT_CYCLE = "ok", "none", "undecided", "no_cycle"

LEVEL = "torque_rms"  # by which cycles of a design that squeals are compared
DISTINCT_LEVEL_RATIO = 1.02  # times the loudest stable one: another that is no other reading of it
MAX_LEVEL_RUNS = 2  # runs for its level at most
FREQUENCY_MARGIN = 1.01  # of the frequency of a mode that is looked for


@dataclass(frozen=True)
class Kick:
    """The least kick along a mode that starts squeal, at the worst of its phases.

    Attributes
    ----------
    velocity : float
        Largest velocity at a contact point of the mode's motion so large, m/s; NaN without one.
    phase : float
        Of the mode's motion at the start, rad.
    energy : float
        Of the start, kinetic and in the reference stiffness, J.
    error : float
        Width of the bracket, relative.
    status : str
        ``ok``; ``none`` where no phase of any kick tried, up to the largest, leads to the cycle;
        ``undecided`` where a run that decides came to nothing that can be named; ``no_cycle`` where
        a run lasts beside steady sliding, but no stable cycle is known that runs could come to.
    """

    velocity: float
    phase: float
    energy: float
    error: float
    status: str


def kick_along_mode(trials: Trials, lam: complex, phi: np.ndarray, largest: float) -> Kick:
    """Bisect the size of a kick along a complex mode, all phases at once.

    A kick is a state Re(phi exp(i phase)) of displacements with the velocities that the mode has
    there. From twice the stable cycle's contact velocity, but `largest` at most, the size is halved
    until no phase leads to the cycle; where none of the first size does it is doubled up to
    `largest`. The last pair is bisected. Larger kicks may decay again: what is found is an edge
    next to silence. From the largest ones contact that softens may run away: then half of them is
    tried.

    Parameters
    ----------
    trials : Trials
    lam : complex
        Root, rad/s.
    phi : ndarray (n,) complex
        Right vector.
    largest : float
        Contact velocity of the largest kick, m/s.
    """
    contact = trials.contact
    unit = PeriodicMotion(np.vstack([0 * phi.real, phi.real, -phi.imag]), abs(lam.imag))
    phi = phi / contact.contact_velocity(unit)
    phases = 2 * np.pi * np.arange(N_PHASES) / N_PHASES

    def start(size: float, phase: float) -> State:
        x = size * phi * np.exp(1j * phase)
        return x.real, (lam * x).real

    def tried(size: float) -> list[str]:
        return trials.outcomes([start(size, phase) for phase in phases])

    high = min(2.0 * contact.contact_velocity(trials.cycle), largest)
    top, worst, low, too_large = high, -1, 0.0, False
    while True:
        size = high if worst < 0 else 0.5 * high if low == 0.0 else 0.5 * (low + high)
        outcomes = tried(size)
        if GROWS in outcomes:
            high, worst = size, outcomes.index(GROWS)
        elif OPEN in outcomes and worst < 0 and low == 0.0:
            high, too_large = 0.5 * size, True
        elif OPEN in outcomes or (too_large and worst < 0):
            return Kick(np.nan, np.nan, np.nan, np.nan, KICK_UNDECIDED)
        elif worst < 0 and size < largest:
            low, high = size, min(2.0 * size, largest)
        elif worst < 0:
            return Kick(np.nan, np.nan, np.nan, np.nan, NO_KICK)
        else:
            low = size
        if worst >= 0 and high - low < KICK_REL_TOLERANCE * high:
            break
        if high < MIN_REL_KICK * top:  # no size was seen to decay
            return Kick(np.nan, np.nan, np.nan, np.nan, KICK_UNDECIDED)
    q, v = start(high, phases[worst])
    energy = 0.5 * float(v @ v + contact.system.omega2 @ q**2)
    return Kick(high, float(phases[worst]), energy, (high - low) / high, KICK_FOUND)


def decided_in_time(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """A design that cycles leave open, after runs in time.

    One that squeals has the level of a run where no stable cycle is the loudest (`_with_level`), or
    where one to larger motion lasts (`_with_larger`). Of one whose modes are all stable runs begin
    with what was found of families that are undecided: the loudest cycle, above it where it is
    unstable; without any the motion that lacks least damping, and the largest of the curve, made as
    large as `reach` [m/s] and larger: on the brake a motion of that size along a mode may lose what
    a cycle of half of it needs. Where one lasts the design squeals if kicked, and no more are run.
    Where all of a family decay there is no cycle found if nothing but the curve's end was missing;
    else that is told, and the verdict stays open.
    `band` [rad/s] is that of `run_on`.
    """
    families = [family for _, family in followed.families]
    if any(family.verdict == NEUTRAL for family in families):
        return followed  # every run keeps what it begins with of that mode
    if any(family.verdict == SQUEALS for family in families):
        return _with_larger(contact, _with_level(contact, followed, band, reach), band, reach)
    if followed.unstable_outside or contact.point.growing.n_outside > 0:
        return followed
    starts = [list(_starts(contact, family, reach)) for family in families]
    ends: list[list[Ended]] = [[] for _ in families]
    for some in (slice(0, 1), slice(1, None)):
        if any(family.verdict == IF_KICKED for family in families) or _lasting(chain(*ends)):
            break
        tries = [
            (family_ends, *s)
            for family_ends, all_ in zip(ends, starts, strict=True)
            for s in all_[some]
        ]
        points = [
            replace(contact.point, q0=q, v0=v, continued=name == CYCLE) for _, name, (q, v) in tries
        ]
        for (family_ends, name, _), motion in zip(
            tries, run_on(contact, points, band), strict=True
        ):
            family_ends.append(with_regularisation(contact, ended(name, motion), motion, band))
    decided = []
    for (k, family), family_ends, tried in zip(followed.families, ends, starts, strict=True):
        if len(family_ends) == len(tried) or _lasting(family_ends):
            family = _decided(family, family_ends)
        else:
            not_lasting = (
                f"a run in time from {family_ends[0].start} does not last; others"
                if family_ends
                else "runs in time"
            )
            why = f"{not_lasting} were not tried, as the design squeals if kicked by another mode"
            family = replace(family, reason=f"{family.reason}; {why}")
        decided.append((k, family))
    return followed._replace(families=decided)


def _with_level(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """A design that squeals, with the level of a run where no stable cycle is known to be loudest.

    It begins with the loudest cycle, above it where that is unstable; then with the largest motion
    of the curve of the mode without a stable cycle that grows fastest, also where another has one.
    Where it does not last the next is tried. Where a mode outside the band grows the level is that
    of the torque within it.
    """
    families = dict(followed.families)
    levels = [
        followed_family.loudest.levels[LEVEL]
        for followed_family in families.values()
        if followed_family.loudest
    ]
    tries = {}
    for mode, family in families.items():
        level = max((c.levels[LEVEL] for c in family.cycles), default=0.0)
        louder = level > DISTINCT_LEVEL_RATIO * max(levels, default=0.0)
        louder |= family.verdict == SQUEALS and family.loudest is None  # it has a level of its own
        if louder and (start := next(_starts(contact, family, reach), None)):
            tries[mode] = (level, family.lam.real), start
    if not tries:
        return followed
    for number in sorted(tries, key=lambda mode: tries[mode][0], reverse=True)[:MAX_LEVEL_RUNS]:
        family, (name, (q, v)) = families[number], tries[number][1]
        point = replace(contact.point, q0=q, v0=v, continued=name == CYCLE)
        (motion,) = run_on(contact, [point], band)
        run = with_regularisation(contact, ended(name, motion, band), motion, band)
        reason = f"{family.reason}; {run.nothing_told}"
        if run.outcome == LASTS and family.verdict == SQUEALS:
            reason = f"unstable mode; level of a run in time from {name}"
        elif run.outcome == LASTS:
            reason = f"{family.reason}; the design squeals, a run in time from {name} lasts"
        if run.band:
            hz = contact.point.growing.frequency_outside
            reason += f"; the level is that within the band: {hz:.4g} Hz, outside it, grows too"
        families[number] = replace(family, run=run, reason=reason)
        if run.outcome == LASTS:
            break
    return followed._replace(families=list(families.items()))


def _with_larger(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """A design that squeals, with the level of a larger motion where one run to it lasts.

    Of the loudest family that squeals whose curve was not followed to its end: beyond it there may
    be another motion, which a kick leads to.
    """
    levels = {
        mode: _level(family)
        for mode, family in followed.families
        if family.verdict == SQUEALS
        and family.largest is not None
        and family.end not in (*SEARCHED_ENDS, NOT_FOLLOWED)
        and _level(family) > 0.0
        and (family.run is None or family.run.start == CYCLE)  # else it began above all cycles
    }
    if not levels or contact.point.growing.n_outside > 0:
        return followed
    families, mode = dict(followed.families), max(levels, key=lambda mode: levels[mode])
    family = families[mode]
    name, (q, v) = _scaled_start(contact, family, START_SIZES[0] * reach, START_ANGLES_RAD[0])
    (motion,) = run_on(contact, [replace(contact.point, q0=q, v0=v)], band)
    run = with_regularisation(contact, ended(name, motion, band), motion, band)
    loudest = max(_level(family) for family in families.values())
    if run.outcome == LASTS and run.torque_rms > DISTINCT_LEVEL_RATIO * loudest:
        reason = f"{family.reason}; the level is that of a louder run in time from {name}"
        if family.loudest is None:  # its level was of a quieter run
            reason = f"unstable mode; level of a run in time from {name}"
        families[mode] = replace(family, run=run, reason=reason)
    elif run.outcome == LASTS:
        why = f"a run in time from {name} comes to no louder motion"
        families[mode] = replace(family, reason=f"{family.reason}; {why}")
    else:
        families[mode] = replace(family, reason=f"{family.reason}; {run.nothing_told}")
    return followed._replace(families=list(families.items()))


def _level(family: Family) -> float:
    """Level of the loudest motion of a family that lasts; 0 without one."""
    cycle = family.loudest.levels[LEVEL] if family.loudest else 0.0
    by_run = family.run.torque_rms if family.run and family.run.outcome == LASTS else 0.0
    return max(cycle, by_run)


def _lasting(runs: Iterable[Ended]) -> list[Ended]:
    """The outcomes of runs that last."""
    return [run for run in runs if run.outcome == LASTS]


def _starts(
    contact: ContactOscillator, family: Family, reach: float
) -> Iterator[tuple[str, State]]:
    """Where runs of a family that cycles leave open begin, in words and as states."""
    if family.verdict not in (UNDECIDED, SQUEALS):
        return
    if family.cycles:
        cycle = max(family.cycles, key=lambda c: c.levels["contact_velocity"])
        above = cycle.attracts is False
        name = f"{ABOVE:g} times the unstable cycle" if above else CYCLE
        yield name, state_of(cycle.motion, ABOVE if above else 1.0)
        return
    if family.look is not None:
        open_ = [*family.look.open, *(p.motion for piece in family.look.pieces for p in piece)]
        if open_:
            yield "the motion nearest to growing", state_of(max(open_, key=lambda m: m.parameter))
    if family.largest is not None:
        for size, theta in itertools.product(START_SIZES, START_ANGLES_RAD):
            yield _scaled_start(contact, family, size * reach, theta)


def _scaled_start(
    contact: ContactOscillator, family: Family, size: float, theta: float
) -> tuple[str, State]:
    """The curve's largest motion made as large as `size` [m/s], in words and as a state."""
    assert family.largest is not None
    factor = size / contact.contact_velocity(family.largest)
    name = f"{START_OF_LOST} {MADE_AS_LARGE} {size:.3g} m/s"
    return name, state_of(family.largest, factor, theta)


def _decided(family: Family, ends: Sequence[Ended]) -> Family:
    """A family after its runs in time."""
    if not ends:
        return family
    if lasting := _lasting(ends):
        run = max(lasting, key=lambda run: np.nan_to_num(run.torque_rms))
        reason = (
            f"steady sliding is stable, but a run in time from {run.start} lasts; no threshold: "
        )
        return replace(family, run=run, verdict=IF_KICKED, reason=reason + family.reason)
    run = next((run for run in ends if run.outcome != DECAYS), ends[0])
    if run.outcome != DECAYS:
        return replace(family, run=run, reason=f"{family.reason}; {run.nothing_told}")
    names = " and ".join(dict.fromkeys(run.start for run in ends))
    before, first, after = names.partition(START_OF_LOST)
    names = before + first + after.replace(f" and {START_OF_LOST} {MADE_AS_LARGE}", " and")
    count = "a run in time" if len(ends) == 1 else f"each of {len(ends)} runs in time"
    reason = f"{family.reason}; {count} from {names} decays"
    if family.cut_short and family.largest is not None:
        reason += "; cycles apart from the curve and these runs were not searched"
        return replace(family, run=run, verdict=NO_CYCLE, reason=reason)
    return replace(family, run=run, reason=reason)


def kicks(contact: ContactOscillator, followed: Followed, largest: float) -> dict[int, Kick]:
    """`kick_along_mode` of the families that squeal if kicked, by the numbers of their modes.

    None where any mode is unstable: it then squeals without a kick.
    """
    families = [family for _, family in followed.families]
    unstable = followed.unstable_outside or any(f.verdict == SQUEALS for f in families)
    if unstable or contact.point.growing.n_outside > 0:
        return {}
    return {
        mode: _kick(contact, family, largest)
        for mode, family in followed.families
        if family.verdict == IF_KICKED
    }


def _kick(contact: ContactOscillator, family: Family, largest: float) -> Kick:
    stable, cycles = family.loudest, family.cycles
    if stable is None:
        return Kick(np.nan, np.nan, np.nan, np.nan, KICK_WITHOUT_CYCLE)
    smallest = min(cycles, key=lambda c: c.levels["energy"])
    lam, psi = contact.oscillator.steady_modes(FREQUENCY_MARGIN * abs(family.lam))
    phi = psi[:, int(np.argmin(np.abs(lam - family.lam)))]
    trials = Trials(contact, stable.motion, smallest.motion)
    return kick_along_mode(trials, family.lam, phi, largest)
