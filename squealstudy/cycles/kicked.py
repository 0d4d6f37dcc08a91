"""Runs in time that decide what cycles leave open, and the least kick that starts squeal."""

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

N_PHASES = 8  # phases of a kick
MIN_REL_KICK = 1e-3  # smallest kick that is tried over the first one
KICK_REL_TOLERANCE = 0.02  # relative width of the bracket at which a search ends
START_SIZES = 1.0, 1.5  # contact velocities over `reach` with which runs of a lost curve begin
START_ANGLES_RAD = 0.0, 0.5 * np.pi  # angles of the motion at which these runs begin
CYCLE = "the cycle"  # start of a run that continues a cycle, in words
START_OF_LOST = "the curve's largest motion"  # start of runs of a lost curve, in words
MADE_AS_LARGE = "scaled to"
FROM_SMALL = "small motion"  # start of a run as squeal begins by itself, in words
SMALL_START_RATIO = 0.1  # size with which it begins over the smallest cycle's
ABOVE = 1.1  # size over an unstable cycle's with which a run begins that shows what is beyond it
# status of a search
KICK_FOUND, NO_KICK, KICK_UNDECIDED, KICK_WITHOUT_CYCLE = "ok", "none", "undecided", "no_cycle"

LEVEL = "torque_rms"  # level by which cycles of a design that squeals are compared
DISTINCT_LEVEL_RATIO = 1.02  # a level above another by this ratio is that of another motion
MAX_LEVEL_RUNS = 2  # most runs for the level of a design that squeals
FREQUENCY_MARGIN = 1.01  # modes are computed up to this factor times the frequency of the mode


@dataclass(frozen=True)
class Kick:
    """The least kick along a mode that starts squeal, at the worst of its phases.

    Attributes
    ----------
    velocity : float
        Size of the kick: the largest velocity [m/s] of a contact point in the mode's harmonic
        motion of that size. NaN where the status is not ``ok``.
    phase : float
        Phase of the mode's motion at the start, rad.
    energy : float
        Kinetic energy and energy in the reference stiffness of the start, J.
    error : float
        Relative width of the bracket.
    status : str
        ``ok``; ``none`` where no phase of any kick tried, up to the largest, leads to the cycle;
        ``undecided`` where the runs that would decide neither decay nor come to the cycle;
        ``no_cycle`` where a run lasts beside steady sliding, but no stable cycle is known that runs
        could come to.
    """

    velocity: float
    phase: float
    energy: float
    error: float
    status: str


def kick_along_mode(trials: Trials, lam: complex, phi: np.ndarray, largest: float) -> Kick:
    """Bisect the size of a kick along a complex mode, all phases at once.

    A kick is a state Re(phi exp(i phase)) of displacements with the velocities that the mode has
    there. The first size is twice the stable cycle's contact velocity, but `largest` at most. It is
    halved until no phase leads to the cycle; where no phase of the first size does, it is doubled
    up to `largest`. The last two sizes are bisected. Still larger kicks may decay again: the size
    that is returned is an edge next to silence. From large kicks contact that softens may run away:
    then half the size is tried.

    Parameters
    ----------
    trials : Trials
    lam : complex
        Root of the mode, rad/s.
    phi : ndarray (n,) complex
        Its right vector.
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

    def outcomes_at(size: float) -> list[str]:
        return trials.outcomes([start(size, phase) for phase in phases])

    high = min(2.0 * contact.contact_velocity(trials.cycle), largest)
    first_size, growing_phase, low, too_large = high, -1, 0.0, False
    while True:
        size = high if growing_phase < 0 else 0.5 * high if low == 0.0 else 0.5 * (low + high)
        outcomes = outcomes_at(size)
        if GROWS in outcomes:
            high, growing_phase = size, outcomes.index(GROWS)
        elif OPEN in outcomes and growing_phase < 0 and low == 0.0:
            high, too_large = 0.5 * size, True
        elif OPEN in outcomes or (too_large and growing_phase < 0):
            return Kick(np.nan, np.nan, np.nan, np.nan, KICK_UNDECIDED)
        elif growing_phase < 0 and size < largest:
            low, high = size, min(2.0 * size, largest)
        elif growing_phase < 0:
            return Kick(np.nan, np.nan, np.nan, np.nan, NO_KICK)
        else:
            low = size
        if growing_phase >= 0 and high - low < KICK_REL_TOLERANCE * high:
            break
        if high < MIN_REL_KICK * first_size:  # no size was seen to decay
            return Kick(np.nan, np.nan, np.nan, np.nan, KICK_UNDECIDED)
    q, v = start(high, phases[growing_phase])
    energy = 0.5 * float(v @ v + contact.system.omega2 @ q**2)
    return Kick(high, float(phases[growing_phase]), energy, (high - low) / high, KICK_FOUND)


def decided_in_time(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """A design whose verdict or level its cycles leave open, after runs in time.

    A design that squeals gets the level of a run where no stable cycle is the loudest
    (`_with_level`), where small motion grows to a louder one (`_from_rest`), or where a run to a
    larger motion lasts (`_with_larger`).

    In a design whose modes are all stable, runs are made for the families that are undecided. They
    begin with the loudest cycle, or above it where that is unstable. Without a cycle they begin
    with the motion that is nearest to growing, and with the largest of the curve, scaled to `reach`
    [m/s] and to more: on the brake a motion along a mode may decay from `reach` although there is a
    cycle of half that size. Where one run lasts the design squeals if kicked, and no more are made.
    Where all runs of a family decay the verdict is that no cycle was found, if only the end of the
    curve was missing; else it stays open, and the reason names the runs.

    `band` [rad/s] is that of `run_on`.
    """
    families = [family for _, family in followed.families]
    if any(family.verdict == NEUTRAL for family in families):
        return followed  # in every run such a mode stays as large as it begins
    if any(family.verdict == SQUEALS for family in families):
        with_level = _from_rest(contact, _with_level(contact, followed, band, reach), band)
        return _with_larger(contact, with_level, band, reach)
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

    Runs are made for families whose loudest cycle is louder than every stable one, and for unstable
    modes without a stable cycle: first the louder one, then the one that grows faster. They begin
    as `_starts` says. Where a run does not last the next is made, `MAX_LEVEL_RUNS` at most. Where a
    mode outside the band grows the level is that of the torque within the band.
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


def _from_rest(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float]
) -> Followed:
    """A design that squeals, with the level that small motion grows to where that is louder.

    The run is made for the mode that grows fastest, where no stable cycle of its curve is known:
    runs that began above its unstable cycle may have come to another motion.
    """
    growing = [(n, f) for n, f in followed.families if f.verdict == SQUEALS]
    mode, family = max(growing, key=lambda numbered: numbered[1].lam.real)
    if family.loudest is not None or not family.path or contact.point.growing.n_outside > 0:
        return followed
    smallest = min((c.motion for c in family.cycles), key=lambda m: m.size, default=None)
    first = family.path[0].motion
    factor = 1.0 if smallest is None else SMALL_START_RATIO * smallest.size / first.size
    q, v = state_of(first, factor)
    above = DISTINCT_LEVEL_RATIO * max(_level(f) for _, f in followed.families)
    (motion,) = run_on(contact, [replace(contact.point, q0=q, v0=v)], band, above)
    run = ended(FROM_SMALL, motion, band)
    if run.outcome != LASTS or not run.torque_rms > above:
        return followed
    run = with_regularisation(contact, run, motion, band)
    reason = f"unstable mode; level of a run in time from {FROM_SMALL}"
    families = dict(followed.families) | {mode: replace(family, run=run, reason=reason)}
    return followed._replace(families=list(families.items()))


def _with_larger(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """A design that squeals, with the level of a larger motion where a run to it lasts.

    The run is made for the loudest family that squeals and whose curve was not followed to its end:
    there may be another motion beyond, which a kick leads to.
    """
    levels = {
        mode: _level(family)
        for mode, family in followed.families
        if family.verdict == SQUEALS
        and family.largest is not None
        and family.end not in (*SEARCHED_ENDS, NOT_FOLLOWED)
        and _level(family) > 0.0
        # others began above all cycles
        and (family.run is None or family.run.start in (CYCLE, FROM_SMALL))
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
    """Starts of runs for a family that is undecided or squeals, in words and as states."""
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
    """`kick_along_mode` for the families that squeal if kicked, by the numbers of their modes.

    Empty where any mode is unstable: the design then squeals without a kick.
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
