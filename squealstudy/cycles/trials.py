"""Runs in time from periodic motions: what they come to.

Whether a motion lasts, decays or is undecided is told as studies in time tell it, whatever it has
become (`run_on`, `ended`). Beside a stable cycle it is enough to know whether a run comes to it
(`Trials`): the means over windows of its energy have become the cycle's, or a small part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import series_at
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import LEAST_DAMPING
from squealstudy.motion.outcome.settling import known_outcome
from squealstudy.motion.outcome.summary import summarise
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.system import MotionPoint
from squealstudy.wording import FAILED, LASTING, STABLE, SUSTAINED, UNDECIDED

GROWS, DECAYS, LASTS, OPEN = "grows", "decays", "lasts", UNDECIDED
STEPS = 200  # a period
SAVED = 10  # steps between rows: 20 rows a period
WINDOW = 20  # periods between looks
LONGEST = 1000  # periods
SILENT = 1e-2  # of the least energy that is known of a cycle: what is below it has decayed
NEAR = 0.02  # relative: an energy that is that of the cycle
# runs of which nothing is known but the start
TOP_STEPS = 64  # a period of the highest assembly mode of the band
TOP_SAVED = 8  # steps between rows
FINER = 4  # times as many steps where a run fails, as impacts of a strong kick make it
TOP_PERIODS = 3000  # such periods, the longest
LOOKS = 40  # at a run, evenly over the longest time
TOLERANCE = 0.02  # of levels, at which a run that lasts may end
OUTSIDE = 0.5  # share of the energy beyond the band's modes from which on none of these leads

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
class Ended:
    """What a run came to.

    Attributes
    ----------
    start : str
        What it began with, in words.
    found : str
        A class of runs (`wording`), ``stable`` where it decays.
    torque_rms : float
        Of its last window, about the mean, N m; NaN where no level lasts.
    spread : float
        Half of what this is uncertain by, relative.
    frequency_hz, line_hz : float
        Of the motion, NaN where it does not repeat; of the strongest line of the torque.
    mode_hz : float
        Of the assembly mode with most energy at the end; NaN of one outside the band.
    open_share_max : float
        Of the contact area, in the last window.
    """

    start: str
    found: str
    torque_rms: float = np.nan
    spread: float = np.nan
    frequency_hz: float = np.nan
    line_hz: float = np.nan
    mode_hz: float = np.nan
    open_share_max: float = 0.0

    @property
    def outcome(self) -> str:
        """``lasts``, ``decays``, or ``undecided``, failed runs among these."""
        return LASTS if self.found in LASTING else DECAYS if self.found == STABLE else OPEN

    @property
    def text(self) -> str:
        """In words."""
        if self.outcome == DECAYS:
            return f"{self.start}: {DECAYS}"
        at = f" near {self.mode_hz:.4g} Hz" if np.isfinite(self.mode_hz) else ""
        return f"{self.start}: {self.found.replace('_', ' ')}{at}"


def run_on(
    contact: ContactOscillator, starts: Sequence[MotionPoint], band: tuple[float, float]
) -> list[Motion]:
    """Runs from states of a design point until their outcome is known, or to the longest time.

    `band` [rad/s] has the modes that are watched; the highest of them gives steps and times.
    """
    omega = contact.system.frequencies
    sensed = np.flatnonzero((omega >= band[0]) & (omega <= band[1])) + 1
    system = replace(contact.system, sensed=sensed)
    top = 2 * np.pi / float(omega[sensed[-1] - 1] if len(sensed) else omega[-1])
    settings = MotionSettings(
        TOP_PERIODS * top,
        top / TOP_STEPS,
        TOP_SAVED,
        integrator=ExactFreeMotion(),
        tolerance=ExactFreeMotion.tolerance,
    )

    def judge(_: int, motion: Motion) -> str:
        return known_outcome(motion, settings.duration, TOLERANCE)

    def run(some: Sequence[MotionPoint], how: MotionSettings) -> list[Motion]:
        return simulate(system, some, how, Watch([how.n_steps // LOOKS] * len(some), judge))

    found = run(starts, settings)
    bad = [k for k, motion in enumerate(found) if motion.outcome != "ok"]
    finer = replace(settings, step=settings.step / FINER, save_every=settings.save_every * FINER)
    for k, motion in zip(bad, run([starts[k] for k in bad], finer), strict=True):
        found[k] = motion
    return found


def _undamped(motion: Motion) -> bool:
    """Whether no mode grows, and the least damped one does not decay either."""
    growing = motion.point.growing
    if growing.n_unstable or growing.n_outside or not len(growing.lam):
        return False
    lam = growing.lam[0]
    return bool(abs(lam.real) <= LEAST_DAMPING * abs(lam))


def ended(start: str, motion: Motion) -> Ended:
    """What a run from `start`, in words, came to."""
    if motion.outcome != "ok":
        return Ended(start, FAILED)
    summary = summarise(motion)
    point, found = summary.point, summary.point["class"]
    shares = {float(m["frequency_hz"]): m["energy_share"] for m in summary.modes}
    outside = point.get("energy_outside_share", 0.0) > OUTSIDE
    mode = np.nan if outside else max(shares, key=lambda hz: shares[hz], default=np.nan)
    if found in LASTING and _undamped(motion):
        found = UNDECIDED  # any motion of that mode stays
    if found not in SUSTAINED:
        return Ended(start, found, mode_hz=mode)
    rms = float(point["torque_rms"])
    spread = 0.5 * (point["torque_rms_high"] - point["torque_rms_low"]) / rms if rms else np.nan
    hz, line = point["frequency_hz"], point["torque_line_hz"]
    return Ended(start, found, rms, spread, hz, line, mode, float(point["open_share_max"]))
