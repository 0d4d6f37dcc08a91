"""Runs in time from periodic motions: what they come to.

A run is judged by the means over windows of its energy: it squeals where that has become the stable
cycle's, it has decayed where it is a small part of it, and else nothing is said of it. From a cycle
of which the balance cannot tell whether it attracts, a run decays or lasts, whatever it becomes.
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
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate

GROWS, DECAYS, LASTS, OPEN = "grows", "decays", "lasts", "undecided"
STEPS = 200  # a period
SAVED = 10  # steps between rows: 20 rows a period
WINDOW = 20  # periods between looks
LONGEST = 1000  # periods
SILENT = 1e-2  # of the least energy that is known of a cycle: what is below it has decayed
NEAR = 0.02  # relative: an energy that is that of the cycle
SPAN = 100  # periods: a motion lasts whose energy over so many is that over as many before

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
class Lasting:
    """What a run in time from an uncertain cycle came to.

    Attributes
    ----------
    outcome : str
        ``lasts``, ``decays`` or ``undecided``.
    torque_rms : float
        About its mean, over the last `SPAN` periods, N m; NaN where it does not last.
    spread : float
        Half of what this differs between windows of it, relative.
    frequency_hz : float
        Of the largest line of the torque.
    start : str
        What it began with, in words.
    """

    outcome: str
    torque_rms: float
    spread: float
    frequency_hz: float
    start: str


def lasting(
    contact: ContactOscillator, motion: PeriodicMotion, start: str, factor: float = 1.0
) -> Lasting:
    """Run in time from a periodic motion, times a factor, until it has decayed or lasts.

    It lasts where its energy over the last `SPAN` periods is that over as many before, to 2 %.
    """
    period, rows = 2 * np.pi / motion.omega, SPAN * STEPS // SAVED
    settings = MotionSettings(LONGEST * period, period / STEPS, SAVED, integrator=ExactFreeMotion())
    first: list[float] = []

    def judge(_: int, run: Motion) -> str:
        energy = run.modal_energy
        first[:] = first or [float(energy[: WINDOW * STEPS // SAVED].mean())]
        if energy[-WINDOW * STEPS // SAVED :].mean() < SILENT * first[0]:
            return DECAYS
        if len(energy) < 3 * rows:
            return ""
        last, before = energy[-rows:].mean(), energy[-2 * rows : -rows].mean()
        return LASTS if abs(last / before - 1.0) < NEAR else ""

    q, v = state_of(motion, factor)
    watch = Watch([WINDOW * STEPS], judge)
    (run,) = simulate(contact.system, [replace(contact.point, q0=q, v0=v)], settings, watch)
    if run.stopped != LASTS:
        return Lasting(run.stopped or OPEN, np.nan, np.nan, np.nan, start)
    torque = run.history["torque"][-rows:]
    windows = torque.reshape(-1, WINDOW * STEPS // SAVED).std(axis=1)
    spread = float(np.ptp(windows) / (2.0 * windows.mean()))
    lines = np.abs(np.fft.rfft((torque - torque.mean()) * np.hanning(rows)))
    k = int(np.argmax(lines[1:-1])) + 1
    a, b, c = np.log(lines[k - 1 : k + 2])
    line = k + 0.5 * (a - c) / (a - 2.0 * b + c)
    hz = float(line / (rows * SAVED * period / STEPS))
    return Lasting(LASTS, float(torque.std()), spread, hz, start)
