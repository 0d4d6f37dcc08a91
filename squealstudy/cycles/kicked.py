"""What becomes of kicks, by runs in time beside a stable cycle; the least that starts squeal.

A run is judged by the means over windows of its energy: it squeals where that has become the stable
cycle's, it has decayed where it is a small part of it, and else nothing is said of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import IF_KICKED, SQUEALS, Family, Followed
from squealstudy.cycles.growth import linear_modes
from squealstudy.cycles.harmonics import series_at
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate

GROWS, DECAYS, OPEN = "grows", "decays", "undecided"
STEPS = 200  # a period
SAVED = 10  # steps between rows: 20 rows a period
WINDOW = 20  # periods between looks
LONGEST = 1000  # periods
SILENT = 1e-2  # of the least energy that is known of a cycle: what is below it has decayed
NEAR = 0.02  # relative: an energy that is that of the cycle
PHASES = 8
LEAST = 1e-3  # of the largest kick tried: smaller ones are not looked for
CLOSE = 0.02  # relative width of the bracket at which a search ends
# status of a search
FOUND, NONE, UNCLEAR = "ok", "none", "undecided"

WIDER = 1.01  # of the frequency of a mode that is looked for

State = tuple[np.ndarray, np.ndarray]  # q, q' (n,)


@dataclass(frozen=True)
class Trials:
    """Runs in time beside a stable cycle.

    Parameters
    ----------
    contact : ContactOscillator
    cycle : PeriodicMotion
        Stable.
    smallest : PeriodicMotion or None
        The smallest cycle that is known, where that is another one.
    periods : int
        Of the cycle: longest time of a run.
    """

    contact: ContactOscillator
    cycle: PeriodicMotion
    smallest: PeriodicMotion | None = None
    periods: int = LONGEST

    def outcomes(self, starts: Sequence[State]) -> list[str]:
        """What each start comes to: ``grows`` to the cycle, ``decays``, or ``undecided``."""
        period = 2 * np.pi / self.cycle.omega
        settings = MotionSettings(
            self.periods * period, period / STEPS, SAVED, integrator=ExactFreeMotion()
        )
        level = self._energy(self.cycle)
        silent = SILENT * (level if self.smallest is None else self._energy(self.smallest))

        def judge(_: int, motion: Motion) -> str:
            energy = float(motion.modal_energy[-WINDOW * STEPS // SAVED :].mean())
            if energy < silent:
                return DECAYS
            return GROWS if abs(energy / level - 1.0) < NEAR else ""

        points = [replace(self.contact.point, q0=q, v0=v) for q, v in starts]
        watch = Watch([WINDOW * STEPS] * len(points), judge)
        motions = simulate(self.contact.system, points, settings, watch)
        return [motion.stopped or OPEN for motion in motions]

    def _energy(self, motion: PeriodicMotion) -> float:
        """Mean energy [J] of a periodic motion, as runs in time tell it."""
        theta = 2 * np.pi * np.arange(STEPS) / STEPS
        synthesis, slope = series_at(theta, motion.harmonics)
        q, v = synthesis @ motion.Q, motion.omega * (slope @ motion.Q)
        return float(0.5 * (v**2 + self.contact.system.omega2 * q**2).sum(axis=1).mean())


def state_of(motion: PeriodicMotion, factor: float = 1.0, theta: float = 0.0) -> State:
    """Displacements and velocities (n,) of a periodic motion at an angle, times a factor."""
    synthesis, slope = series_at(np.array([theta]), motion.harmonics)
    return factor * (synthesis @ motion.Q)[0], factor * motion.omega * (slope @ motion.Q)[0]


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
        ``ok``; ``none`` where no phase of the largest kick tried leads to the cycle;
        ``undecided`` where a run that decides came to nothing that can be named.
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
    until no phase leads to the cycle, and the last pair is bisected. Larger kicks may decay again:
    what is found is the edge next to silence.

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
    phases = 2 * np.pi * np.arange(PHASES) / PHASES

    def start(size: float, phase: float) -> State:
        x = size * phi * np.exp(1j * phase)
        return x.real, (lam * x).real

    def tried(size: float) -> list[str]:
        return trials.outcomes([start(size, phase) for phase in phases])

    high = min(2.0 * contact.contact_velocity(trials.cycle), largest)
    top, worst, low = high, -1, 0.0
    while True:
        size = high if worst < 0 else 0.5 * high if low == 0.0 else 0.5 * (low + high)
        found = tried(size)
        if GROWS in found:
            high, worst = size, found.index(GROWS)
        elif OPEN in found:
            return Kick(np.nan, np.nan, np.nan, np.nan, UNCLEAR)
        elif worst < 0:
            return Kick(np.nan, np.nan, np.nan, np.nan, NONE)
        else:
            low = size
        if high - low < CLOSE * high:
            break
        if high < LEAST * top:  # no size was seen to decay
            return Kick(np.nan, np.nan, np.nan, np.nan, UNCLEAR)
    q, v = start(high, phases[worst])
    energy = 0.5 * float(v @ v + contact.system.omega2 @ q**2)
    return Kick(high, float(phases[worst]), energy, (high - low) / high, FOUND)


def kicks(contact: ContactOscillator, found: Followed, largest: float) -> dict[int, Kick]:
    """`kick_along_mode` of the families that squeal if kicked, by the numbers of their modes.

    None where any mode is unstable: it then squeals without a kick.
    """
    families = [family for _, family in found.families]
    unstable = found.unstable_outside or any(f.verdict == SQUEALS for f in families)
    if unstable or contact.point.growing.n_above > 0:
        return {}
    return {
        mode: _kick(contact, family, largest)
        for mode, family in found.families
        if family.verdict == IF_KICKED
    }


def _kick(contact: ContactOscillator, family: Family, largest: float) -> Kick:
    stable, known = family.loudest, family.cycles
    assert stable is not None
    smallest = min(known, key=lambda c: c.levels["energy"])
    lam, psi = linear_modes(contact, WIDER * abs(family.lam))
    phi = psi[:, int(np.argmin(np.abs(lam - family.lam)))]
    trials = Trials(contact, stable.motion, smallest.motion)
    return kick_along_mode(trials, family.lam, phi, largest)
