"""The onset of the mode to which cycles shrink, along a line of designs."""

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

ONSET_REL_TOLERANCE = 1e-9  # tolerance over the range of the parameter
MIN_BRACKET_HALF_WIDTH = 1e-6  # least half-width of the first bracket over the range
MAX_BRACKET_DOUBLINGS = 8  # number of brackets that are tried, each twice as wide as the last
# distance of a neutral root to the motion that begins at it, over the frequency
NEUTRAL_REL_DISTANCE = 1e-4
SMALLER = 0.9  # size of a cycle that has shrunk over that of the branch's first, at most
NO_SIZE = 1e-6  # contact velocity over the sliding speed below which a cycle counts as none


def has_shrunk(
    designs: DesignLine, motion: PeriodicMotion, start: PeriodicMotion | None = None
) -> bool:
    """Whether a cycle is steady sliding, nearly: it is small, and a mode of its frequency neutral.

    Two modes whose frequencies are as 1 to 2 have small cycles that end at no onset. Nor do those
    that are no smaller than the branch's `start`.
    """
    contact = designs.contact(motion.parameter)
    velocity, speed = contact.contact_velocity(motion), abs(contact.point.speed)
    if not velocity < START * speed:
        return False
    if velocity < NO_SIZE * speed:
        return True
    if start is not None:
        first = designs.contact(start.parameter).contact_velocity(start)
        if velocity > SMALLER * first:
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
        Half-width of the first bracket about that value; it is doubled while stability does not
        change in it.

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

    def place(modes: Modes) -> int:
        return int(np.argmin(np.abs(np.abs(modes.lam) - motion.omega)))

    width = abs(designs.bounds[1] - designs.bounds[0])
    half = max(half, MIN_BRACKET_HALF_WIDTH * width)
    for _ in range(MAX_BRACKET_DOUBLINGS):
        low, high = motion.parameter - half, motion.parameter + half
        ends = [modes(value) for value in (low, high)]
        zeta = [-m.lam[place(m)].real / abs(m.lam[place(m)]) for m in ends]
        if (zeta[0] + designs.request.tolerance) * (zeta[1] + designs.request.tolerance) < 0:
            break
        half *= 2.0
    else:
        raise ConvergenceError("no_onset", "no change of stability beside the end of a branch")
    line = SolvedLine(low, ends[0], high, ends[1], modes)
    modes_at_ends = [place(m) for m in ends]
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
    """Error of an onset where it stands for the start of cycles, in units of the parameter.

    It is the sum of the error of the search, and of the distance from the value at which the
    damping ratio is zero, where cycles begin: a mode counts as unstable only where its damping
    ratio is below minus the tolerance. NaN where a value beside the onset cannot be solved.
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
