"""Sliding speed and brake pressure that change during a run, relative to its design point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.errors import ModelError


@dataclass(frozen=True)
class Schedule:
    """Imposed speed and pressure over time: linear between points, constant before and after.

    Attributes
    ----------
    times : ndarray (m,)
        Rising times of two points or more, s.
    speeds : ndarray (m,)
        Sliding speed over that of the design point; negative where it slides the other way.
    pressures : ndarray (m,)
        Brake pressure over that of the design point.
    pressing : ndarray (n,) or None
        Modal load of the brake pressure of the design point; needed where the pressure changes.
    pressure : float
        Brake pressure of the design point, Pa; NaN where it does not change.
    turning : ndarray (n, n) or None
        Gyroscopic terms at the speed of the design point, part of its `damping_between`, 1/s:
        they follow the speed. None where nothing turns.

    Raises
    ------
    ModelError
        Times that do not rise, fewer than two points, numbers that are not finite, or a pressure
        that changes without `pressing`.
    """

    times: np.ndarray
    speeds: np.ndarray
    pressures: np.ndarray
    pressing: np.ndarray | None = field(default=None, repr=False)
    pressure: float = np.nan
    turning: np.ndarray | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        arrays = np.array([self.times, self.speeds, self.pressures])
        if arrays.shape[1] < 2 or not np.isfinite(arrays).all():
            raise ModelError("a schedule needs two or more points of finite numbers")
        if not (np.diff(self.times) > 0).all():
            raise ModelError("a schedule needs times that rise")
        if self.pressing is None and (self.pressures != 1.0).any():
            raise ModelError("a schedule of the pressure needs the load of the brake pressure")

    def speed_at(self, time: np.ndarray | float) -> np.ndarray:
        """Sliding speed over that of the design point at times [s]."""
        return np.asarray(np.interp(time, self.times, self.speeds))

    def pressure_at(self, time: np.ndarray | float) -> np.ndarray:
        """Brake pressure over that of the design point at times [s]."""
        return np.asarray(np.interp(time, self.times, self.pressures))
