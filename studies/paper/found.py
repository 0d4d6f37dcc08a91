"""What both settings of damping found, and how a claim of VdR 2010 is answered."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from squealstudy import Results

AGREES, PARTLY, DIFFERS, OPEN = "agrees", "partly", "does not", "cannot be told"
VERDICTS = (AGREES, PARTLY, DIFFERS, OPEN)
ALONE, GROUP = "caliper.modes[7]", "caliper.modes[8-9]"
SCALE, DAMPING = "frequency_scale", "damping_ratio"
TAKES_PART = 0.1  # of the elastic energy
GONE = 0.01  # of a mode's energy in the cycle before
SAME_LEVEL = 0.05  # of the torque's RMS
SEEN = 0.01  # of the dominant line: a harmonic
SAME_SHAPE = 0.99  # MAC
NOTHING = 1e-12  # of the kinetic energy: rounding
CLOSE = 1e-3  # relative error of frequencies
Answer = tuple[str, str]


@dataclass(frozen=True)
class Found:
    """All results of one setting of damping.

    Attributes
    ----------
    stability, frequency, damping : Results
        Complex modes.
    sensitivity : Results
    squeal, kicked, damped : Results
        In time: from a small start, from one ten times as strong, from the end of `squeal`.
    projection : DataFrame
        Caliper mode 7 on real modes of the assembly: a row a basis.
    """

    stability: Results
    sensitivity: Results
    frequency: Results
    damping: Results
    squeal: Results
    kicked: Results
    damped: Results
    projection: pd.DataFrame
