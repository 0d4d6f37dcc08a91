"""How the values of a swept parameter scatter in a random design."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from squealstudy.study.design_sections import DistributionName, Scale

if TYPE_CHECKING:  # numpy and scipy only where something is sampled: files are read without
    import numpy as np

UNIFORM: DistributionName = "uniform"
KEYS: dict[str, tuple[str, ...]] = {  # keys of a [[sweep]], all of which are needed
    "uniform": ("start", "stop"),
    "normal": ("mean", "std"),
    "truncated_normal": ("mean", "std", "start", "stop"),
    "lognormal": ("median", "sigma"),
}
# probability of each tail beyond the range that is shown of an unbounded distribution
DISPLAY_TAIL_PROBABILITY = 1e-4
# relative change of a density over its range, below which it counts as uniform
DENSITY_REL_ROUND_OFF = 1e-7
SOBOL_CLIP = 2.0**-31  # half a step of a Sobol sequence: keeps unbounded quantiles finite


@dataclass(frozen=True)
class Distribution:
    """A distribution of values, sampled by its quantile function.

    Attributes
    ----------
    name : str
        A key of KEYS.
    mean, std : float
        Mean and standard deviation of the normal distributions, before truncation. For the
        lognormal the median, and the standard deviation of ln x, which is normal about ln(median).
    start, stop : float
        Ends of the uniform and the truncated distribution, start < stop.
    scale : str
        ``log`` if the logarithm is uniform, else ``linear``.
    zero : float
        Value from which logarithms measure the distance: -273.15 for a temperature in degC.
    """

    name: DistributionName
    mean: float = math.nan
    std: float = math.nan
    start: float = -math.inf
    stop: float = math.inf
    scale: Scale = "linear"
    zero: float = 0.0

    @property
    def bounded(self) -> bool:
        """Whether all values lie from start to stop."""
        return "start" in KEYS[self.name]

    def quantiles(self, u: np.ndarray) -> np.ndarray:
        """Values (n,) below which a share u (n,), from 0 to 1, of the distribution lies."""
        import numpy as np

        inside = u if self.bounded else np.clip(u, SOBOL_CLIP, 1.0 - SOBOL_CLIP)
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.asarray(self._scipy.ppf(inside), dtype=float)
        return np.clip(values, self.start, self.stop)

    @cached_property
    def range(self) -> tuple[float, float]:
        """Start and stop; if unbounded the quantiles DISPLAY_TAIL_PROBABILITY from 0 and 1."""
        if self.bounded:
            return self.start, self.stop
        import numpy as np

        low, high = self.quantiles(
            np.array([DISPLAY_TAIL_PROBABILITY, 1.0 - DISPLAY_TAIL_PROBABILITY])
        ).tolist()
        return low, high

    @property
    def text(self) -> str:
        """The name and its numbers, as messages show them."""
        if self.name == UNIFORM:
            return "uniform in the logarithm" if self.scale == "log" else UNIFORM
        first, second = KEYS[self.name][:2]
        return f"{self.name}, {first} {self.mean:g}, {second} {self.std:g}"

    @cached_property
    def _scipy(self) -> Any:
        """The frozen distribution of scipy.stats."""
        from scipy import stats

        if self.name == "normal":
            return stats.norm(self.mean, self.std)
        if self.name == "lognormal":
            return stats.lognorm(self.std, self.zero, self.mean - self.zero)
        if self.name == "truncated_normal":
            a, b = ((end - self.mean) / self.std for end in (self.start, self.stop))
            if max(abs(a), abs(b)) * (b - a) < DENSITY_REL_ROUND_OFF:
                return stats.uniform(self.start, self.stop - self.start)
            return stats.truncnorm(a, b, self.mean, self.std)
        if self.scale == "log":
            return stats.loguniform(self.start - self.zero, self.stop - self.zero, self.zero)
        return stats.uniform(self.start, self.stop - self.start)
