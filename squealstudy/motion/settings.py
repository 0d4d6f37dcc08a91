"""Settings of the integration of a run in time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.integrators.newmark import Newmark

SAMPLES_A_PERIOD = 8  # rows that summaries need in a period of the highest frequency of a band
FRICTION_TOLERANCE = 10.0  # over `tolerance`: friction forces are bounded where points slide


@dataclass(frozen=True)
class MotionSettings:
    """Duration, steps and integrator of a run.

    Parameters
    ----------
    duration, step : float
        Length of the run, rounded to whole steps, and of a step, s.
    save_every : int
        Steps between saved rows; 0 to save none.
    integrator : Integrator
        The integrator with its options.
    tolerance : float
        Largest imbalance of forces, relative to inertia and contact forces. Friction forces may
        change between iterations by ten times this share of their bounds; the state is corrected
        once more after that. Newton's method converges quadratically: it uses the squares of both
        tolerances.
    max_iterations : int
        Largest number of evaluations of the contact forces in a step.
    save_q : bool
        Whether to save all coordinates in the histories.

    Raises
    ------
    ParameterError
        A value that cannot be used; its key is the name.
    """

    duration: float
    step: float
    save_every: int = 10
    integrator: Integrator = field(default_factory=Newmark)
    tolerance: float = 1e-3
    max_iterations: int = 40
    save_q: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0):
            raise ParameterError("step", f"must be positive, got {self.step}")
        if not (np.isfinite(self.duration) and self.duration >= self.step):
            raise ParameterError("duration", f"{self.duration} s is less than one step")
        if self.save_every < 0:
            raise ParameterError("save_every", f"must not be negative, got {self.save_every}")
        if not self.tolerance > 0:
            raise ParameterError("tolerance", "must be positive")
        if self.max_iterations < 1:
            raise ParameterError("max_iterations", "at least 1")

    @property
    def n_steps(self) -> int:
        """Whole steps of the run."""
        return round(self.duration / self.step)

    @property
    def friction_tolerance(self) -> float:
        """Largest change of friction forces between iterations, relative to their bounds."""
        return FRICTION_TOLERANCE * self.tolerance


def steps_between_rows(save_every: int, step: float, top_hz: float) -> int:
    """Steps between the rows that summaries are made from.

    A divisor of `save_every` if rows are saved, else a power of two: then runs whose steps are
    halves of each other have rows at equal times, and their summaries differ only by the
    integration.

    Parameters
    ----------
    save_every : int
        Steps between saved rows; 0 where none are saved.
    step : float
        Length of a step, s.
    top_hz : float
        Highest frequency in summaries, Hz.

    Raises
    ------
    ValueError
        Where `save_every` has no divisor of a useful size.
    """
    enough = 2 ** int(np.log2(max(1.0, 1.0 / (SAMPLES_A_PERIOD * top_hz * step))))
    if save_every == 0:
        return enough
    best = max(d for d in range(1, enough + 1) if save_every % d == 0)
    if 4 * best < min(enough, save_every):
        multiple = max(1, round(save_every / enough)) * enough
        raise ValueError(
            f"{save_every} has no divisor near {enough}, the steps between samples that "
            f"summaries need; {multiple} does"
        )
    return best
