"""How a design point is integrated in time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.integrators.newmark import Newmark

SAMPLES_A_PERIOD = 8  # of the highest frequency of a band: what summaries need
FRICTION_TOLERANCE = 10.0  # times the tolerance: a friction force ends where its point slides


@dataclass(frozen=True)
class MotionSettings:
    """How long, by what steps and by which integrator.

    Parameters
    ----------
    duration, step : float
        s; the duration is rounded to whole steps.
    save_every : int
        Steps between saved rows; 0 keeps none.
    integrator : Integrator
        With its own options.
    tolerance : float
        Largest imbalance of forces, relative to inertia and contact forces; the friction forces
        may change between iterations by ten times this share of their bounds, and the state is
        corrected once more after that. Newton converges quadratically and takes the squares of
        both.
    max_iterations : int
        Evaluations of the contact forces in a step, at most.
    save_q : bool
        Keep all coordinates in the histories.

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
    """Steps between rows that summaries are made from: a divisor of `save_every` where kept.

    Else a power of two: runs whose steps are halves of each other are then seen at equal times,
    and differences of what is found in them are those of the integration.

    Parameters
    ----------
    save_every : int
        Steps between rows that are kept; 0 keeps none.
    step : float
        s.
    top_hz : float
        The highest frequency that summaries tell of, Hz.

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
