"""A level and the parts of its error: the one place where bounds of levels are made."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np


@dataclass(frozen=True)
class LevelParts:
    """Parts of a level's error in its unit: half-widths about the value.

    A part is NaN where it is not known.

    Attributes
    ----------
    window : float
        Half-width of the 95 % interval by the finite length of the window.
    step : float
        Error by the integrator's step: the change by another step, times a safety factor.
    rows : float
        Error of levels that are made from saved rows; 0 where every step is summed.
    regularisation : float
        Change of the level if friction at zero sliding were not regularised. It is not part of the
        bounds, which are those of the law as it is run. NaN where it was not computed.
    """

    window: float = 0.0
    step: float = 0.0
    rows: float = 0.0
    regularisation: float = np.nan

    @property
    def total(self) -> float:
        """Half-width of the bounds; NaN where a part is not known."""
        return self.window + self.step + self.rows


@dataclass(frozen=True)
class Level:
    """A level of a vibration.

    Attributes
    ----------
    value, low, high : float
        Value and its bounds, in the unit of the signal; bounds are NaN where they are not known.
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
        """Half-width over the value; NaN where bounds are not known, or the value is zero."""
        return self.parts.total / abs(self.value) if self.value else np.nan


@dataclass(frozen=True)
class StepParts:
    """Relative errors of levels by the step of a run; NaN where they are not known.

    Attributes
    ----------
    rms, peak_to_peak : float
        Errors over the level itself.
    mean : float
        Error of the mean over the RMS of the fluctuation.
    frequency : float
        Relative error of the motion's own frequency.
    reason : str
        Why the errors are not known, or were not computed; else empty.
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
        """Errors that are not known, and why."""
        return cls(np.nan, np.nan, np.nan, np.nan, reason)


OF_THE_WINDOW = StepParts(0.0, 0.0, 0.0, 0.0)  # bounds are those of the window alone
NOT_ASKED = replace(OF_THE_WINDOW, reason="of motion that passes bounds are those of the window")
ONE_STEP = replace(OF_THE_WINDOW, reason="what the step changes is left out: no other was tried")
