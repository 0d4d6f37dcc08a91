"""Runs in time for verdicts that limit cycles leave open, and the least kick that starts squeal."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from squealstudy.cycles.arrivals import arrived_at
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.small_motion import (
    DISTINCT_LEVEL_RATIO,
    FROM_SMALL,
    LEVEL,
    from_small_motion,
    level_of,
)
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

N_PHASES = 8  # number of phases of a kick that are tried
MIN_REL_KICK = 1e-3  # smallest kick that is tried, over the first one
KICK_REL_TOLERANCE = 0.02  # relative width of the bracket at which a search ends
# runs from the largest motion of a curve: its contact velocity over `reach`, its phase at the start
START_SIZES, START_ANGLES_RAD = (1.0, 1.5), (0.0, 0.5 * np.pi)
# how messages name the states with which runs start
CYCLE = "the cycle"
START_OF_LOST, MADE_AS_LARGE = "the curve's largest motion", "scaled to"
ABOVE = 1.1  # size of the start of a run above an unstable cycle, over the size of the cycle
# status of a search for the least kick
KICK_FOUND, NO_KICK, KICK_UNDECIDED, KICK_WITHOUT_CYCLE = "ok", "none", "undecided", "no_cycle"
MAX_LEVEL_RUNS = 2  # most runs of `_with_level` for a design
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

    A kick is a state of the mode's motion: displacements Re(phi exp(i phase)) and their velocities.
    The first size is twice the stable cycle's contact velocity, but `largest` at most. The size is
    halved until no phase leads to the cycle. Where no phase of the first size leads to it, the size
    is doubled up to `largest`. The last two sizes are bisected. Larger kicks than the returned one
    may decay again: it is one border between decay and growth. Large kicks may make contact that
    softens run away: then half the size is tried.

    Parameters
    ----------
    trials : Trials
    lam : complex
        Root of the mode, rad/s.
    phi : ndarray (n,) complex
        Right vector of the mode.
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
    """Decide a design's verdicts and level by runs in time, where its limit cycles leave them open.

    A design that squeals gets its level from a run in three cases: no stable cycle is the loudest
    (`_with_level`), small motion grows to a louder one (`from_small_motion`), or a run from a
    larger motion lasts (`_with_larger`). If all modes are stable, runs are made for families
    without a verdict. They begin with the loudest cycle, or above that cycle if it is unstable.
    Without a cycle they begin with the motion that is nearest to growing, and with the curve's
    largest motion, scaled to `reach` [m/s] and to more: on the brake a motion may decay from
    `reach` although there is a cycle of half that size. If one run lasts, the design squeals if
    kicked, and no more runs are made. If all runs of a family decay and only the end of its curve
    was missing, the verdict is that no cycle was found. Otherwise the verdict stays open, and its
    reason names the runs. `band` [rad/s] is that of `run_on`.
    """
    families = [family for _, family in followed.families]
    if any(family.verdict == NEUTRAL for family in families):
        return followed  # in every run such a mode stays as large as it begins
    if any(family.verdict == SQUEALS for family in families):
        with_level = _with_level(contact, followed, band, reach)
        with_level, reached = from_small_motion(contact, with_level, band)
        with_larger = _with_larger(contact, with_level, band, reach)
        return with_larger if reached is None else reached.told(with_larger)
    if followed.unstable_outside or contact.point.growing.n_outside > 0:
        return followed
    starts = [list(_starts(contact, family, reach)) for family in families]
    ends: list[list[Ended]] = [[] for _ in families]
    for round_ in (slice(0, 1), slice(1, None)):  # the first start of each family, then the others
        if any(family.verdict == IF_KICKED for family in families) or _lasting(chain(*ends)):
            break
        plans = [
            (family_ends, *s)
            for family_ends, family_starts in zip(ends, starts, strict=True)
            for s in family_starts[round_]
        ]
        points = [
            replace(contact.point, q0=q, v0=v, continued=name == CYCLE) for _, name, (q, v) in plans
        ]
        for (family_ends, name, _), motion in zip(
            plans, run_on(contact, points, band), strict=True
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
    """Take the level of a design that squeals from a run, where no stable cycle is the loudest.

    Runs are made for families whose loudest cycle is louder than every stable cycle, and for
    unstable modes without a stable cycle. The loudest family comes first; of equally loud ones the
    one that grows fastest. `_starts` gives the states with which runs begin. If a run does not
    last, the next run is made, `MAX_LEVEL_RUNS` at most. If a mode outside the band grows, the
    level is that of the torque within the band.
    """
    families = dict(followed.families)
    levels = [
        followed_family.loudest.levels[LEVEL]
        for followed_family in families.values()
        if followed_family.loudest
    ]
    plans = {}
    for mode, family in families.items():
        level = max((c.levels[LEVEL] for c in family.cycles), default=0.0)
        louder = level > DISTINCT_LEVEL_RATIO * max(levels, default=0.0)
        louder |= family.verdict == SQUEALS and family.loudest is None  # unknown level
        if louder and (start := next(_starts(contact, family, reach), None)):
            plans[mode] = (level, family.lam.real), start
    if not plans:
        return followed
    for number in sorted(plans, key=lambda mode: plans[mode][0], reverse=True)[:MAX_LEVEL_RUNS]:
        family, (name, (q, v)) = families[number], plans[number][1]
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
            reason += "; the level is that within the band: "
            reason += f"a mode outside it, at {hz:,.0f} Hz, grows too"
        families[number] = replace(family, run=run, reason=reason)
        if run.outcome == LASTS:
            break
    return followed._replace(families=list(families.items()))


def _with_larger(
    contact: ContactOscillator, followed: Followed, band: tuple[float, float], reach: float
) -> Followed:
    """Take the level of a design that squeals from a larger motion, if a run from it lasts.

    The run is made for the loudest family that squeals and whose curve was not followed to its end:
    beyond the last motion of the curve there may be a louder one, which a kick leads to.
    """
    levels = {
        mode: level_of(family)
        for mode, family in followed.families
        if family.verdict == SQUEALS
        and family.largest is not None
        and family.end not in (*SEARCHED_ENDS, NOT_FOLLOWED)
        and level_of(family) > 0.0
        # other runs began above all cycles already
        and (family.run is None or family.run.start in (CYCLE, FROM_SMALL))
    }
    if not levels or contact.point.growing.n_outside > 0:
        return followed
    families, mode = dict(followed.families), max(levels, key=lambda mode: levels[mode])
    family = families[mode]
    name, (q, v) = _scaled_start(contact, family, START_SIZES[0] * reach, START_ANGLES_RAD[0])
    above = DISTINCT_LEVEL_RATIO * max(level_of(f) for f in families.values())
    stable = [c.motion for f in families.values() for c in f.cycles if c.attracts]
    start = replace(contact.point, q0=q, v0=v)
    (motion,) = run_on(contact, [start], band, (-np.inf, above), stable)
    run = ended(name, motion, band) if arrived_at(motion) is None else None
    if run is not None and run.outcome == LASTS and run.torque_rms > above:
        run = with_regularisation(contact, run, motion, band)
        reason = f"{family.reason}; the level is that of a louder run in time from {name}"
        if family.loudest is None:  # it had the level of a quieter run
            reason = f"unstable mode; level of a run in time from {name}"
        families[mode] = replace(family, run=run, reason=reason)
    elif run is None or run.outcome == LASTS:
        why = f"a run in time from {name} comes to no louder motion"
        families[mode] = replace(family, reason=f"{family.reason}; {why}")
    else:
        families[mode] = replace(family, reason=f"{family.reason}; {run.nothing_told}")
    return followed._replace(families=list(families.items()))


def _lasting(runs: Iterable[Ended]) -> list[Ended]:
    """Those of the runs that last."""
    return [run for run in runs if run.outcome == LASTS]


def _starts(
    contact: ContactOscillator, family: Family, reach: float
) -> Iterator[tuple[str, State]]:
    """States with which runs for a family begin, each with its name in messages."""
    if family.verdict not in (UNDECIDED, SQUEALS):
        return
    if family.cycles:
        cycle = max(family.cycles, key=lambda c: c.levels["contact_velocity"])
        above = cycle.attracts is False
        name = f"{ABOVE:g} times the unstable cycle" if above else CYCLE
        yield name, state_of(cycle.motion, ABOVE if above else 1.0)
        return
    if family.look is not None:
        looked_at = chain(family.look.open, (p.motion for p in chain(*family.look.pieces)))
        nearest = max(looked_at, key=lambda m: m.parameter, default=None)
        if nearest is not None:
            yield "the motion nearest to growing", state_of(nearest)
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
    """The family with the verdict and reason that its runs in time give."""
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
    """The least kick along the mode of a family that leads to its loudest stable cycle."""
    stable, cycles = family.loudest, family.cycles
    if stable is None:
        return Kick(np.nan, np.nan, np.nan, np.nan, KICK_WITHOUT_CYCLE)
    smallest = min(cycles, key=lambda c: c.levels["energy"])
    lam, psi = contact.oscillator.steady_modes(FREQUENCY_MARGIN * abs(family.lam))
    phi = psi[:, int(np.argmin(np.abs(lam - family.lam)))]
    trials = Trials(contact, stable.motion, smallest.motion)
    return kick_along_mode(trials, family.lam, phi, largest)
