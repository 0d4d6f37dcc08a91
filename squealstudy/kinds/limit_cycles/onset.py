"""Finds the onset at which a branch of limit cycles begins or ends.

Along a line of designs, limit cycles may shrink to steady sliding. There a complex mode turns
unstable: the point is a Hopf point of the branch and an onset of that mode.
"""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import START
from squealstudy.cycles.onset import criticality
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import DesignLine
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.tracking.onsets import SolvedLine, refine_onset
from squealstudy.modes.tracking.refinement import Modes

ONSET_REL_TOLERANCE = 1e-9  # error of an onset over the range of the parameter
MIN_BRACKET_HALF_WIDTH = 1e-6  # least half-width of the first bracket over the range
MAX_BRACKET_DOUBLINGS = 8  # number of brackets that are tried, each twice as wide as the last
# largest distance of a root from i omega of a small cycle, over omega, that shows a neutral mode
NEUTRAL_REL_DISTANCE = 1e-4
MAX_SHRUNK_SIZE_RATIO = 0.9  # a cycle has shrunk if its size is below this share of the first one's
# contact velocity over the sliding speed below which a cycle is steady sliding
MIN_CYCLE_VELOCITY_RATIO = 1e-6


def has_shrunk(
    designs: DesignLine, motion: PeriodicMotion, start: PeriodicMotion | None = None
) -> bool:
    """Whether a branch of cycles has come to an onset, so that it can end there.

    The cycle must be small, and a mode of its frequency neutral. Small cycles without a neutral
    mode occur where the frequencies of two modes are as 1 to 2. A cycle that is about as large as
    the branch's first, `start`, has not shrunk either.
    """
    contact = designs.contact(motion.parameter)
    velocity, speed = contact.contact_velocity(motion), abs(contact.point.speed)
    if not velocity < START * speed:
        return False
    if velocity < MIN_CYCLE_VELOCITY_RATIO * speed:
        return True
    if start is not None:
        first = designs.contact(start.parameter).contact_velocity(start)
        if velocity > MAX_SHRUNK_SIZE_RATIO * first:
            return False
    lam, _ = contact.oscillator.steady_modes(2.0 * motion.omega)
    distance = np.abs(lam - 1j * motion.omega).min(initial=np.inf)
    return bool(distance <= NEUTRAL_REL_DISTANCE * motion.omega)


def onset_near(
    designs: DesignLine, motion: PeriodicMotion, half: float
) -> tuple[float, float, str]:
    """Onset of the mode to which a cycle shrinks, by `refine_onset`.

    Parameters
    ----------
    designs : DesignLine
        Designs along the parameter.
    motion : PeriodicMotion
        A small cycle; its `parameter` is a value nearby.
    half : float
        Half-width of the first bracket about that value. The bracket is widened to twice its width
        until stability changes within it.

    Returns
    -------
    value : float
        Value of the parameter at the onset.
    frequency_hz : float
        Frequency of the mode at the onset, Hz.
    criticality : str
        Direction in which cycles leave the onset (`cycles.onset.criticality`).

    Raises
    ------
    ConvergenceError
        Where stability does not change nearby, or the mode cannot be followed.
    """

    def modes(value: float) -> Modes:
        lam, psi = designs.oscillator(value).steady_modes(2.0 * motion.omega)
        return Modes(lam[lam.imag > 0], psi[:, lam.imag > 0].T)

    def nearest_mode(modes: Modes) -> int:
        return int(np.argmin(np.abs(np.abs(modes.lam) - motion.omega)))

    width = abs(designs.bounds[1] - designs.bounds[0])
    half = max(half, MIN_BRACKET_HALF_WIDTH * width)
    for _ in range(MAX_BRACKET_DOUBLINGS):
        low, high = motion.parameter - half, motion.parameter + half
        ends = [modes(value) for value in (low, high)]
        zeta = [-m.lam[nearest_mode(m)].real / abs(m.lam[nearest_mode(m)]) for m in ends]
        if (zeta[0] + designs.request.tolerance) * (zeta[1] + designs.request.tolerance) < 0:
            break
        half *= 2.0
    else:
        raise ConvergenceError("no_onset", "no change of stability beside the end of a branch")
    line = SolvedLine(low, ends[0], high, ends[1], modes)
    modes_at_ends = [nearest_mode(m) for m in ends]
    found = refine_onset(
        line,
        modes_at_ends[0],
        modes_at_ends[1],
        designs.request.tolerance,
        ONSET_REL_TOLERANCE * width,
    )
    neutral, omega = modes(found.value), 2.0 * np.pi * found.frequency_hz
    k = int(
        np.argmin(np.abs(neutral.lam - omega * (designs.request.tolerance + 1j)))
    )  # of two modes that are near, the neutral one
    criticality_text = criticality(
        designs.contact(found.value), complex(neutral.lam[k]), neutral.shapes[k]
    )
    return found.value, found.frequency_hz, criticality_text


def onset_error(designs: DesignLine, value: float, frequency_hz: float) -> float:
    """Error [unit of the parameter] of an onset as the value at which cycles begin.

    Cycles begin where the damping ratio of the mode is zero. The onset is where it is minus the
    tolerance. The error is the distance of these two values plus the error of the search. NaN where
    a value beside the onset cannot be solved.
    """
    width, omega = abs(designs.bounds[1] - designs.bounds[0]), 2.0 * np.pi * frequency_hz
    step = MIN_BRACKET_HALF_WIDTH * width
    zeta = []
    for beside in (value - step, value + step):
        try:
            lam, _ = designs.oscillator(beside).steady_modes(2.0 * omega)
        except FAILURES:
            return np.nan
        nearest = lam[int(np.argmin(np.abs(lam - 1j * omega)))]
        zeta.append(-nearest.real / abs(nearest))
    change = abs(zeta[1] - zeta[0])
    shift = 2.0 * step * designs.request.tolerance / change if change else np.nan
    return ONSET_REL_TOLERANCE * width + shift
