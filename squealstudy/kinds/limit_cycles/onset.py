"""Where the mode that cycles shrink to turns unstable along a way between designs."""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.onset import criticality
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import DesignLine
from squealstudy.modes.tracking.onsets import SolvedLine, refine_onset
from squealstudy.modes.tracking.refinement import Modes

ONSET_REL_TOLERANCE = 1e-9  # tolerance over the range of the parameter
MIN_BRACKET_HALF_WIDTH = 1e-6  # half-width of the first bracket over the range
MAX_BRACKET_DOUBLINGS = 8  # largest number of doublings of the bracket


def onset_near(
    designs: DesignLine, motion: PeriodicMotion, half: float
) -> tuple[float, float, str]:
    """Where the mode that a cycle shrinks to turns unstable, as onsets are refined.

    Parameters
    ----------
    designs : DesignLine
    motion : PeriodicMotion
        A small cycle; its `parameter` is a value near by.
    half : float
        Of the bracket about that value; it is widened where stability does not change in it.

    Returns
    -------
    value, frequency in Hz, criticality

    Raises
    ------
    ConvergenceError
        Where stability does not change near by, or the mode cannot be followed.
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
    )  # two may be near
    criticality_text = criticality(
        designs.contact(found.value), complex(neutral.lam[k]), neutral.shapes[k]
    )
    return found.value, found.frequency_hz, criticality_text
