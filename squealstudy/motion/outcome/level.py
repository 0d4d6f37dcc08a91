"""A level with all that is known to be wrong with it: the one place where bounds are made."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np


@dataclass(frozen=True)
class LevelParts:
    """Parts of a level's error in its unit: half-widths about the value.

    NaN is a part that cannot be told.

    Attributes
    ----------
    window : float
        95 % of what the length of the window leaves open.
    step : float
        Of the integrator's step: the change by another one, times its safety.
    rows : float
        Of levels made from saved rows alone; 0 where every step is summed.
    regularisation : float
        What the slope of friction at zero sliding changes. It is not part of the bounds, which are
        those of the law as it is run; NaN where nobody measured it.
    """

    window: float = 0.0
    step: float = 0.0
    rows: float = 0.0
    regularisation: float = np.nan

    @property
    def total(self) -> float:
        """Half-width of the bounds; NaN where a part cannot be told."""
        return self.window + self.step + self.rows


@dataclass(frozen=True)
class Level:
    """A level of a vibration.

    Attributes
    ----------
    value, low, high : float
        In the unit of the signal; bounds are NaN where they cannot be told, never narrower than
        the truth.
    parts : LevelParts
    """

    value: float
    low: float
    high: float
    parts: LevelParts = field(default_factory=LevelParts)

    @classmethod
    def of(cls, value: float, parts: LevelParts, lower_bound: float = -np.inf) -> Level:
        """A value with the bounds that its parts make, none below `lower_bound`."""
        half = parts.total
        if not np.isfinite(half):
            return cls(value, np.nan, np.nan, parts)
        return cls(value, max(value - half, lower_bound), value + half, parts)

    @property
    def relative(self) -> float:
        """Half-width over the value; NaN where bounds cannot be told, or of no level."""
        return self.parts.total / abs(self.value) if self.value else np.nan


@dataclass(frozen=True)
class StepParts:
    """Half-widths that a step leaves to levels, relative; NaN where they cannot be told.

    Attributes
    ----------
    rms, peak_to_peak : float
        Over the level itself.
    mean : float
        Over the RMS of the fluctuation.
    frequency : float
        Of the motion's own frequency.
    reason : str
        Why they cannot be told, or are not; else empty.
    """

    rms: float
    mean: float
    peak_to_peak: float
    frequency: float
    reason: str = ""

    @property
    def measured(self) -> bool:
        """Whether another step was tried."""
        return np.isfinite(self.rms) and self not in (OF_THE_WINDOW, NOT_ASKED, ONE_STEP)

    @classmethod
    def unknown(cls, reason: str) -> StepParts:
        """None can be told."""
        return cls(np.nan, np.nan, np.nan, np.nan, reason)


OF_THE_WINDOW = StepParts(0.0, 0.0, 0.0, 0.0)  # where nobody asked for another step
NOT_ASKED = replace(OF_THE_WINDOW, reason="of motion that passes bounds are those of the window")
ONE_STEP = replace(OF_THE_WINDOW, reason="what the step changes is left out: no other was tried")
