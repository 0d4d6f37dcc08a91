"""How a run in time ended: the outcomes that limit cycles and design studies ask for.

Classes are those of studies in time, with one exception: a lasting motion of an undamped model is
undecided, since there any motion stays that a run begins with. A run also ends early where its
motion repeats.
"""

from __future__ import annotations

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.behaviour import LEAST_DAMPING
from squealstudy.motion.outcome.energies import moving_energy
from squealstudy.motion.outcome.intervals import mean_interval
from squealstudy.motion.outcome.levels import last_window
from squealstudy.motion.outcome.periods import comes_back
from squealstudy.motion.outcome.settling import LEAST_ROWS, SETTLED, known_outcome, levels_of_rows
from squealstudy.motion.outcome.spectrum import spectrum
from squealstudy.motion.outcome.verdict import expected_rise, run_verdict
from squealstudy.wording import LASTING, UNDECIDED


def class_of(run: Motion) -> str:
    """Class of a finished run (`wording`)."""
    name = run_verdict(run, moving_energy(run)).name
    return UNDECIDED if name in LASTING and _undamped(run) else name


def undecided_because(run: Motion) -> str:
    """Why the class of a finished run is undecided."""
    if run_verdict(run, moving_energy(run)).name in LASTING:
        return "it lasts, but without damping any motion does"
    return f"{run.time:.3g} s were too short to tell whether it lasts"


def known_so_far(run: Motion, duration: float, tolerance: float) -> str:
    """`known_outcome`, or ``settled`` where the motion repeats and nothing else in it rises.

    Its level has to be known within `tolerance` (relative), too.
    """
    outcome = known_outcome(run, duration, tolerance)
    torque = run.history["torque"]
    if outcome or len(run.times) < LEAST_ROWS or not np.isfinite(torque).all():
        return outcome
    window = last_window(run.times, torque)
    levels = levels_of_rows(run, window)
    if not 0.5 * (levels.rms_high - levels.rms_low) <= tolerance * levels.rms:
        return ""  # the tests below cost more
    if not comes_back(run):
        return ""
    return SETTLED if expected_rise(run, window, duration) <= 2 * tolerance else ""


def _undamped(run: Motion) -> bool:
    """Whether no mode grows, and the least damped one does not decay either."""
    modes = run.point.growing
    if modes.n_unstable or modes.n_outside or not len(modes.lam):
        return False
    return bool(abs(modes.lam[0].real) <= LEAST_DAMPING * abs(modes.lam[0]))


def band_level(motion: Motion, band: tuple[float, float]) -> tuple[float, float, float]:
    """RMS of the torque within a band [rad/s], its relative half-width (95 %), its line [Hz].

    Computed from the last window. The filter is wrong at the ends of the window: a tenth at either
    end is left out.
    """
    torque = motion.history["torque"]
    window = last_window(motion.times, torque)
    time, signal = motion.times[window], torque[window]
    step = float(time[-1] - time[0]) / (len(time) - 1)
    hz = np.fft.rfftfreq(len(signal), step)
    low, high = (w / (2 * np.pi) for w in band)
    inside = (hz >= low) & (hz <= high)
    filtered = np.fft.irfft(np.fft.rfft(signal - signal.mean()) * inside, len(signal))
    ends = len(signal) // 10
    mean, lowest, highest = (
        float(x) for x in mean_interval(filtered[ends : len(signal) - ends] ** 2)
    )
    rms = float(np.sqrt(mean))
    spread = 0.5 * (np.sqrt(highest) - np.sqrt(max(lowest, 0.0))) / rms if rms else np.nan
    return rms, float(spread), float(spectrum(step, filtered).peak())
