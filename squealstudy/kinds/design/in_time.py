"""A design in time at one operating point: from today's vibrations, and kicked.

Complex modes cannot tell that a design which decays from small motions lasts from large ones, and
what is found of limit cycles may leave out a cycle apart. Each start here is a run: it decays, or
it does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.growth import linear_modes
from squealstudy.engine.cache import NewGaps
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import CyclesRequest
from squealstudy.kinds.transient.batch import SAMPLES_A_PERIOD, sensed_modes
from squealstudy.kinds.transient.section import TransientSection
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.settling import known_outcome
from squealstudy.motion.outcome.summary import summarise
from squealstudy.motion.point import contact_speed, perturbed
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.wording import FAILED, STABLE

STEPS = 64  # a period of the highest assembly mode of the band
FINER = 4  # times as many where a run fails, as impacts of a strong kick make it
LONGEST = 3000  # such periods
LOOKS = 40  # at a run, evenly over the longest time
TOLERANCE = 0.02  # of levels, at which a run that lasts may end
LEAD = 0.02  # of the sliding speed: where the run of today's design begins
SIZES = (1.0, 0.25)  # of kicks, of the reach of [limit_cycles]
KICKED = 4  # modes
OUTSIDE = 0.5  # share of the energy beyond the band's modes from which on none of these leads
TODAY = "today's vibration"
ELSEWHERE = f"{TODAY} of [parameters]"
TURN = 2 * np.pi
LASTS, DECAYS, UNDECIDED = "lasts", "decays", "undecided"  # what all runs of a point come to


@dataclass(frozen=True)
class Run:
    """What one start came to.

    Attributes
    ----------
    start : str
        In words.
    found : str
        A class of runs (`wording`), ``stable`` where it decays.
    frequency_hz : float
        Of the assembly mode with most energy at the end.
    """

    start: str
    found: str
    frequency_hz: float

    @property
    def text(self) -> str:
        """In words."""
        if self.found == STABLE:
            return f"{self.start}: {DECAYS}"
        at = f" near {self.frequency_hz:.4g} Hz" if np.isfinite(self.frequency_hz) else ""
        return f"{self.start}: {self.found.replace('_', ' ')}{at}"


def runs_in_time(
    point: DesignPoint, today: Mapping[str, DesignPoint], asked: CyclesRequest, gaps: NewGaps
) -> tuple[WorkingPoint, list[Run]]:
    """A design at an operating point, from every start.

    Kicks are along the complex modes of least damping, and along those near the ones that grow in
    today's design, in the phase of largest velocity.

    Parameters
    ----------
    point : DesignPoint
    today : mapping of str -> DesignPoint
        Today's design there and elsewhere, of the same structure, by what its vibration is called.

    Raises
    ------
    ConvergenceError
        No steady sliding, a mode above the band that grows, or a model too large; ParameterError
        for a value that cannot be used.
    """
    steady, contact = asked.contact(point, gaps)
    growing = contact.point.growing
    if growing.n_above:  # every run comes to it, whatever is asked about
        text = f"a mode above the band grows by itself in time, at {growing.frequency_above:.4g} Hz"
        raise ConvergenceError("unstable_above_band", text)
    names, starts, near = [], [], []
    for name, design in today.items():
        _, was = asked.contact(design, gaps)
        near += (np.abs(was.point.growing.lam[: was.point.growing.n_unstable]) / TURN).tolist()
        motion = _today(point, was, asked)
        if motion is not None:
            names.append(name)
            starts.append(replace(contact.point, q0=motion.q, v0=motion.v, continued=True))
    for name, start in _kicks(contact, near, asked):
        names.append(name)
        starts.append(start)
    ends = [_told(motion) for motion in _run(point, contact, starts, asked)]
    return steady, [Run(name, *own) for name, own in zip(names, ends, strict=True)]


def _today(point: DesignPoint, was: ContactOscillator, asked: CyclesRequest) -> Motion | None:
    """Today's design where a small start has led it; None where that decays or fails."""
    if not was.point.growing.n_unstable:
        return None
    start = perturbed(was.system, was.point, LEAD * abs(was.point.speed))
    (motion,) = _run(point, was, [start], asked)
    return None if _told(motion)[0] in (STABLE, FAILED) else motion


def _kicks(
    contact: ContactOscillator, near: Sequence[float], asked: CyclesRequest
) -> Iterator[tuple[str, MotionPoint]]:
    low, high = asked.band
    lam, psi = linear_modes(contact, high)
    inside = np.flatnonzero((np.abs(lam) >= low) & (np.abs(lam) <= high) & (lam.imag > 0))
    if not len(inside):
        return
    zeta, hz = -lam.real / np.abs(lam), np.abs(lam) / TURN
    wanted = [int(inside[np.argmin(np.abs(hz[inside] - f))]) for f in near]
    wanted += [int(k) for k in inside[np.argsort(zeta[inside], kind="stable")]]
    largest = asked.section.reach * abs(contact.point.speed)
    for k in list(dict.fromkeys(wanted))[:KICKED]:
        # the phase at which the velocity is largest: the displacement is then small
        x = psi[:, k] * np.exp(-0.5j * np.angle(np.sum((lam[k] * psi[:, k]) ** 2)))
        q, v = x.real, (lam[k] * x).real
        for share in SIZES:
            factor = share * largest / contact_speed(contact.system, v)
            name = f"kick of {share * largest:.3g} m/s along the mode at {hz[k]:.4g} Hz"
            yield name, replace(contact.point, q0=factor * q, v0=factor * v)


def _run(
    point: DesignPoint,
    contact: ContactOscillator,
    starts: Sequence[MotionPoint],
    asked: CyclesRequest,
) -> list[Motion]:
    """Runs until their outcome is known, or to the longest time."""
    reference = asked.reference(point.structure)
    omega2 = contact.system.omega2[: reference.n_exact]
    section = TransientSection(friction=asked.section.friction)
    system = replace(contact.system, sensed=sensed_modes(section, omega2, asked.band_hz))
    top = float(np.sqrt(omega2[system.sensed[-1] - 1])) / TURN
    settings = MotionSettings(
        duration=LONGEST / top,
        step=1.0 / (STEPS * top),
        save_every=STEPS // SAMPLES_A_PERIOD,
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


def _told(motion: Motion) -> tuple[str, float]:
    """Class of a run, and the frequency of its leading mode [Hz]; NaN of one outside the band."""
    if motion.outcome != "ok":
        return FAILED, np.nan
    summary = summarise(motion)
    shares = {float(m["frequency_hz"]): m["energy_share"] for m in summary.modes}
    outside = summary.point.get("energy_outside_share", 0.0) > OUTSIDE
    leader = max(shares, key=lambda hz: shares[hz], default=np.nan)
    return summary.point["class"], np.nan if outside else leader
