"""Runs in time from periodic motions, which tell whether these decay, last or grow.

Whether a motion lasts, decays or is undecided is judged as in studies in time, whatever motion it
has become (`run_on`, `ended`). Beside a stable cycle it is enough to know whether a run comes to
that cycle (`Trials`): whether the mean energy of both halves of a window is that of the cycle and
the state is near it, or the energy nearly zero. A run that decays passes the energy of the cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from squealstudy.cycles.arrivals import Judge, arrived_at, or_arrived, steps_to_arrive
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.friction_steps import longest_step, rounds_off
from squealstudy.cycles.harmonics import series_at
from squealstudy.cycles.outcomes import band_level, class_of, known_so_far, undecided_because
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.level import OF_THE_WINDOW, Level, LevelParts, StepParts
from squealstudy.motion.outcome.summary import run_levels, summarise, told_frequency
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.motion.step_errors import MAX_REL_STEP_PART, has_few_points, settling, step_parts
from squealstudy.motion.system import MotionPoint
from squealstudy.wording import FAILED, LASTING, STABLE, SUSTAINED, UNDECIDED

GROWS, DECAYS, LASTS, OPEN = "grows", "decays", "lasts", UNDECIDED
# runs beside a stable cycle (`Trials`)
STEPS_PER_PERIOD = 200  # steps of a period of the cycle
STEPS_PER_ROW = 10  # steps between rows: 20 rows a period
STOP_TEST_PERIODS = 20  # periods between tests of whether a run may end
MAX_PERIODS = 1000  # longest time of a run
DECAYED_ENERGY_RATIO = 1e-2  # a run has decayed below this share of the smallest cycle's energy
CYCLE_ENERGY_REL_TOLERANCE = 0.02  # relative difference of energies of a run and of the cycle
# energy of the difference of a state and the nearest one of the cycle, over the cycle's energy
CYCLE_DISTANCE_ENERGY = 0.04
# runs whose outcome may be any (`run_on`)
TOP_STEPS = 64  # steps of a period of the highest assembly mode of the band
TOP_SAVED = 8  # steps between rows
HALVINGS = 4  # largest number of halvings of the step of a run that lasts
STEP_REL_TOLERANCE = 0.01  # relative change of a level by half the step that counts as small
STEP_REFINEMENT = 4  # steps are shortened by this where a run fails, as by impacts of a strong kick
TOP_PERIODS = 3000  # longest time of a run, in periods of that highest mode
N_STOP_TESTS = 40  # tests of whether a run may end, evenly over the longest time
TOLERANCE = 0.02  # relative error of levels at which a run that lasts may end
OUTSIDE = 0.5  # no mode of the band is named if modes outside have more of the energy

State = tuple[np.ndarray, np.ndarray]  # displacements and velocities (n,) of the coordinates


@dataclass(frozen=True)
class Trials:
    """Runs in time beside a stable cycle.

    Parameters
    ----------
    contact : ContactOscillator
    cycle : PeriodicMotion
        The stable cycle.
    smallest : PeriodicMotion or None
        The cycle of least energy that was found; None for `cycle` itself.
    periods : int
        Longest time of a run, in periods of the cycle.
    """

    contact: ContactOscillator
    cycle: PeriodicMotion
    smallest: PeriodicMotion | None = None
    periods: int = MAX_PERIODS

    def outcomes(self, starts: Sequence[State]) -> list[str]:
        """Outcome of the run from each start: ``grows`` to the cycle, ``decays``, ``undecided``."""
        period = 2 * np.pi / self.cycle.omega
        settings = MotionSettings(
            self.periods * period,
            period / STEPS_PER_PERIOD,
            STEPS_PER_ROW,
            integrator=ExactFreeMotion(),
        )
        level = self._energy(self.cycle)
        silent = DECAYED_ENERGY_RATIO * (
            level if self.smallest is None else self._energy(self.smallest)
        )

        rows = STOP_TEST_PERIODS * STEPS_PER_PERIOD // STEPS_PER_ROW

        def judge(_: int, motion: Motion) -> str:
            energies = motion.modal_energy[-rows:]
            halves = np.array([half.mean() for half in np.array_split(energies, 2)])
            if halves.mean() < silent:
                return DECAYS
            is_level = (np.abs(halves / level - 1.0) < CYCLE_ENERGY_REL_TOLERANCE).all()
            return GROWS if is_level and self._is_near(motion, level) else ""

        points = [replace(self.contact.point, q0=q, v0=v) for q, v in starts]
        watch = Watch([STOP_TEST_PERIODS * STEPS_PER_PERIOD] * len(points), judge)
        motions = simulate(self.contact.system, points, settings, watch)
        return [motion.stopped or OPEN for motion in motions]

    def _energy(self, motion: PeriodicMotion) -> float:
        """Mean energy [J] of a periodic motion: kinetic, and in the reference stiffness."""
        return float(self._energies(*_states(motion)).mean())

    def _is_near(self, motion: Motion, level: float) -> bool:
        """Whether a run has come near the cycle, whose mean energy [J] is `level`."""
        q, v = _states(self.cycle)
        distance = self._energies(q - motion.q, v - motion.v)
        return bool(distance.min() < CYCLE_DISTANCE_ENERGY * level)

    def _energies(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Energy [J] of displacements and velocities (m, n)."""
        energies: np.ndarray = 0.5 * (v**2 + self.contact.system.omega2 * q**2).sum(axis=1)
        return energies


def _states(motion: PeriodicMotion) -> State:
    """Displacements and velocities (STEPS_PER_PERIOD, n) of a periodic motion over its period."""
    theta = 2 * np.pi * np.arange(STEPS_PER_PERIOD) / STEPS_PER_PERIOD
    synthesis, slope = series_at(theta, motion.harmonics)
    return synthesis @ motion.Q, motion.omega * (slope @ motion.Q)


def state_of(motion: PeriodicMotion, factor: float = 1.0, theta: float = 0.0) -> State:
    """Displacements and velocities (n,) of a periodic motion at an angle, times a factor."""
    synthesis, slope = series_at(np.array([theta]), motion.harmonics)
    return factor * (synthesis @ motion.Q)[0], factor * motion.omega * (slope @ motion.Q)[0]


@dataclass(frozen=True)
class Ended:
    """Outcome of a run.

    Attributes
    ----------
    start : str
        The motion that it began with, in words.
    found : str
        Class of the run (`wording`), ``stable`` where it decays, or ``failed``.
    torque_rms : float
        RMS of the torque about its mean in the last window, N m; NaN where no motion lasts.
    spread : float
        Relative half-width of the bounds of `torque_rms`.
    frequency_hz, line_hz : float
        Frequency of the motion, NaN where it does not repeat, and of the torque's strongest line.
    frequency_error : float
        Relative error of `frequency_hz`.
    mode_hz : float
        Frequency of the band's assembly mode with most energy at the end; NaN where most of the
        energy is in modes outside the band.
    open_share_max : float
        Largest share of the contact area that is open in the last window.
    regularisation : float
        Relative change of the level, estimated, if the corner of friction at zero sliding were not
        rounded; NaN where that was not computed.
    band : bool
        Whether the level is that of the torque within the band alone.
    level : Level or None
        The level with the parts of its error: window, step, regularisation.
    why : str
        Why the run failed, or why its outcome is undecided, in words.
    """

    start: str
    found: str
    torque_rms: float = np.nan
    spread: float = np.nan
    frequency_hz: float = np.nan
    line_hz: float = np.nan
    frequency_error: float = np.nan
    mode_hz: float = np.nan
    open_share_max: float = 0.0
    regularisation: float = np.nan
    band: bool = False
    level: Level | None = None
    why: str = ""

    @property
    def outcome(self) -> str:
        """``lasts``, ``decays``, or ``undecided``, failed runs among these."""
        return LASTS if self.found in LASTING else DECAYS if self.found == STABLE else OPEN

    @property
    def goes_on(self) -> bool:
        """Whether the run ends with a vibration that lasts, or may last."""
        return self.outcome != DECAYS and self.found != FAILED

    @property
    def text(self) -> str:
        """The start and the outcome, in words."""
        if self.outcome == DECAYS:
            return f"{self.start}: {DECAYS}"
        mode_text = f" near {self.mode_hz:.4g} Hz" if np.isfinite(self.mode_hz) else ""
        why = f" ({self.why})" if self.why else ""
        return f"{self.start}: {self.found.replace('_', ' ')}{mode_text}{why}"

    @property
    def nothing_told(self) -> str:
        """Clause that says what became of a run that does not last."""
        if self.outcome == DECAYS:
            return f"a run in time from {self.start} decays"
        if self.found == FAILED:
            return f"a run in time from {self.start} fails: {self.why}"
        return f"a run in time from {self.start} is undecided: {self.why}"


def run_on(
    contact: ContactOscillator,
    starts: Sequence[MotionPoint],
    band: tuple[float, float],
    same: tuple[float, float] = (np.inf, -np.inf),
    cycles: Sequence[PeriodicMotion] = (),
) -> list[Motion]:
    """Runs from states of a design point until their outcome is known, or to the longest time.

    Growth is watched in the modes of `band` [rad/s]; the highest of them sets steps and times. The
    error by the step is not computed for runs whose level (RMS of the torque) is within `same`.
    Runs also end where they have come to one of `cycles`, all stable (`arrived_at`).
    """
    omega = contact.system.frequencies
    sensed = np.flatnonzero((omega >= band[0]) & (omega <= band[1])) + 1
    system = replace(contact.system, sensed=sensed)
    top = 2 * np.pi / float(omega[sensed[-1] - 1] if len(sensed) else omega[-1])
    step, saved = top / TOP_STEPS, TOP_SAVED
    if (max_step := longest_step(contact)) < step:
        step, saved = max_step, round(step / max_step)  # rows show how a point breaks loose
    settings = MotionSettings(
        TOP_PERIODS * top,
        step,
        saved,
        integrator=ExactFreeMotion(),
        tolerance=ExactFreeMotion.tolerance,
    )

    def judge(_: int, motion: Motion) -> str:
        return known_so_far(motion, settings.duration, TOLERANCE)

    def run(some: Sequence[MotionPoint], how: MotionSettings) -> list[Motion]:
        steps = how.n_steps // N_STOP_TESTS
        test: Judge = judge
        if cycles and (often := steps_to_arrive(cycles, how.step)) < steps:
            steps, test = often, or_arrived(judge, steps, cycles, often)
        return simulate(system, some, how, Watch([steps] * len(some), test))

    def lasts(motion: Motion) -> bool:
        is_open = motion.outcome == "ok" and arrived_at(motion) is None
        return is_open and class_of(motion) in SUSTAINED

    def refined(motion: Motion) -> Refined:
        """Continue a run that lasts with half the step, until its level changes little by that."""
        if same[0] <= run_levels(motion)[0]["torque_rms"] <= same[1]:
            return Refined.of(motion, StepParts.unknown("it is of no other level"))
        if not has_few_points(system):
            return Refined.of(motion, step_parts(system, motion, settings))
        parts = OF_THE_WINDOW
        for halving in range(1, HALVINGS + 1):
            finer_settings = shorter(settings, 2**halving)
            (finer,) = run(
                [replace(motion.point, q0=motion.q, v0=motion.v, continued=True)], finer_settings
            )
            if arrived_at(finer) is not None:
                return Refined.of(finer, StepParts.unknown("it comes to a cycle"))
            if not lasts(finer):
                return Refined.of(motion, StepParts.unknown("it does not last with half the step"))
            parts, is_converged = between(motion, finer)
            motion = finer
            if is_converged:
                break
        return Refined.of(motion, parts)

    runs = run(starts, settings)
    bad = [k for k, motion in enumerate(runs) if motion.outcome != "ok"]
    again = run([starts[k] for k in bad], shorter(settings, STEP_REFINEMENT))
    repeated = dict(zip(bad, again, strict=True))
    runs = [repeated.get(k, motion) for k, motion in enumerate(runs)]
    return [refined(motion) if lasts(motion) else motion for motion in runs]


def shorter(settings: MotionSettings, times: int) -> MotionSettings:
    """The settings with a step so many times shorter, and the same time between rows."""
    return replace(settings, step=settings.step / times, save_every=settings.save_every * times)


def between(coarse: Motion, fine: Motion) -> tuple[StepParts, bool]:
    """Errors of levels by the step, from runs with a step and half of it; whether they are small.

    The error of the finer run is taken as the whole difference. That is right for a method of first
    order; for one of second order the error is a third of it.
    """
    (coarse_levels, _), (fine_levels, window) = run_levels(coarse), run_levels(fine)
    rms, swing = fine_levels["torque_rms"], fine_levels["torque_peak_to_peak"]
    if not (rms > 0 and swing > 0):
        return StepParts.unknown("nothing vibrates at its end"), True
    change = abs(fine_levels["torque_rms"] - coarse_levels["torque_rms"]) / rms
    windows = (
        sum(
            0.5 * (r["torque_rms_high"] - r["torque_rms_low"]) for r in (coarse_levels, fine_levels)
        )
        / rms
    )
    mean = abs(fine_levels["torque_mean"] - coarse_levels["torque_mean"]) / rms
    peaks = abs(fine_levels["torque_peak_to_peak"] - coarse_levels["torque_peak_to_peak"]) / swing
    if change > MAX_REL_STEP_PART:
        return StepParts.unknown(f"half the step changes its level by {100 * change:.0f} %"), False
    hz = abs(fine_levels["frequency_hz"] / coarse_levels["frequency_hz"] - 1.0)
    parts = np.array([change, mean, peaks, hz]) + settling(fine, window)
    return StepParts(*parts.tolist()), change <= max(STEP_REL_TOLERANCE, windows)


@dataclass(frozen=True, kw_only=True)
class Refined(Motion):
    """A run that lasts, and what its step does to its levels."""

    by_step: StepParts

    @classmethod
    def of(cls, motion: Motion, by_step: StepParts) -> Refined:
        """The motion with the errors of its levels by its step."""
        motion_fields = {
            field.name: getattr(motion, field.name) for field in fields(Motion) if field.init
        }
        return cls(**motion_fields, by_step=by_step)


def ended(start: str, motion: Motion, band: tuple[float, float] | None = None) -> Ended:
    """Outcome of a run from `start` (in words).

    If `band` [rad/s] is given and a mode outside it grows, the level is that of the torque within
    the band.
    """
    if motion.outcome != "ok":
        return Ended(start, FAILED, why=motion.message)
    by_step = motion.by_step if isinstance(motion, Refined) else OF_THE_WINDOW
    summary = summarise(motion)
    point, class_name = summary.point, class_of(motion)
    shares = {float(m["frequency_hz"]): m["energy_share"] for m in summary.modes}
    outside = point.get("energy_outside_share", 0.0) > OUTSIDE
    mode = np.nan if outside else max(shares, key=lambda hz: shares[hz], default=np.nan)
    if class_name not in SUSTAINED:
        why = undecided_because(motion) if class_name == UNDECIDED else ""
        return Ended(start, class_name, mode_hz=mode, why=why)
    line = point["torque_line_hz"]
    error = point["frequency_error"] + by_step.frequency
    hz, error = told_frequency(point["frequency_hz"], error)
    opened = float(point["open_share_max"])
    if band is not None and motion.point.growing.n_outside:
        rms, spread, line = band_level(motion, band)
        spread += by_step.rms
        return Ended(start, class_name, rms, spread, hz, line, error, mode, opened, band=True)
    rms = float(point["torque_rms"])
    window, rows = (float(point[f"torque_rms_{name}"]) for name in ("window", "rows"))
    level = Level.of(rms, LevelParts(window, by_step.rms * rms, rows), 0.0)
    return Ended(start, class_name, rms, level.relative, hz, line, error, mode, opened, level=level)


def with_regularisation(
    contact: ContactOscillator, run: Ended, motion: Motion, band: tuple[float, float]
) -> Ended:
    """Outcome of a run, with the change of its level by the rounded corner of its friction curve.

    Where the corner is wide enough to change the fall of friction, the run is continued with half
    the width. Levels change in proportion to the width (THEORY.md, section 16), so without a
    rounded corner the level would change by twice as much.
    """
    if run.outcome != LASTS or not run.torque_rms > 0.0 or not rounds_off(contact):
        return run
    friction = replace(motion.point.friction, k_t=2.0 * motion.point.friction.k_t)
    goes_on = replace(motion.point, friction=friction, q0=motion.q, v0=motion.v, continued=True)
    sharper = ended("", run_on(contact, [goes_on], band)[0])
    change = abs(sharper.torque_rms / run.torque_rms - 1.0) if sharper.outcome == LASTS else np.nan
    level = run.level
    if level is not None:
        parts = replace(level.parts, regularisation=2.0 * change * run.torque_rms)
        level = replace(level, parts=parts)
    return replace(run, regularisation=2.0 * change, level=level)
