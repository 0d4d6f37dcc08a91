"""How a transient run is integrated, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.errors import ParameterError

METHODS = ("newmark", "newmark_newton", "exponential")
MOCKUPS = ("auto", "always", "never")


@dataclass(frozen=True)
class TransientSettings:
    """How to integrate.

    Parameters
    ----------
    duration, step : float
        s; the duration is rounded to whole steps.
    save_every : int
        Steps between saved rows; 0 keeps none.
    method : str
        ``newmark`` (fixed Jacobian), ``newmark_newton`` (the slow reference) or ``exponential``
        (free modes exact, contact forces by the trapezoidal rule, iterated as Newmark's; what a
        study's runs in modal coordinates do by default).
    tolerance, tolerance_t : float
        Largest imbalance of forces, relative to inertia and contact forces, and largest change of
        the friction forces between iterations, relative to their bounds; the state is corrected
        once more after that. Newton converges quadratically and takes the squares of both.
    contact_factor : float
        k_c, factor on the contact stiffness of the Jacobian; 1 keeps it diagonal.
    contact_stiffness : float or None
        Of a uniform law in the Jacobian, Pa/m (THEORY.md eq. (67)); None: static tangents.
    mockup : str
        Tangential mock-up k_t/2 in the Jacobian: ``auto``, ``always``, ``never``.
    prewarp : bool
        Frequencies and dampings that cancel Newmark's period error of free modes.
    exact_limit : float
        Of ``exponential``: omega h up to which a mode's free motion is exact; average
        acceleration beyond.
    single_storage : bool
        Observation matrix in single precision.
    save_q : bool
        Keep all coordinates in the histories.
    extrapolate : bool
        The contact forces of the last two steps predict those of the next; else the last alone.

    Raises
    ------
    ParameterError
        A value that cannot be used; its key is the name.
    """

    duration: float
    step: float
    save_every: int = 10
    method: str = "newmark"
    tolerance: float = 1e-3
    tolerance_t: float = 1e-2
    max_iterations: int = 40
    max_halvings: int = 4
    aitken: bool = True
    contact_factor: float = 1.0
    contact_stiffness: float | None = None
    mockup: str = "auto"
    prewarp: bool = False
    exact_limit: float = 2.0
    single_storage: bool = False
    save_q: bool = False
    extrapolate: bool = True

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0):
            raise ParameterError("step", f"must be positive, got {self.step}")
        if not (np.isfinite(self.duration) and self.duration >= self.step):
            raise ParameterError("duration", f"{self.duration} s is less than one step")
        if self.save_every < 0:
            raise ParameterError("save_every", f"must not be negative, got {self.save_every}")
        if self.method not in METHODS:
            raise ParameterError("method", f"'{self.method}' is none of {', '.join(METHODS)}")
        if self.prewarp and self.method == "exponential":
            raise ParameterError("prewarp", "free modes of method 'exponential' are exact")
        if self.mockup not in MOCKUPS:
            raise ParameterError("mockup", f"'{self.mockup}' is none of {', '.join(MOCKUPS)}")
        if not (self.tolerance > 0 and self.tolerance_t > 0):
            raise ParameterError("tolerance", "must be positive")
        if not (self.max_iterations >= 1 and 0 <= self.max_halvings <= 20):
            raise ParameterError("max_iterations", "at least 1, with 0 to 20 halvings")

    @property
    def n_steps(self) -> int:
        """Whole steps of the run."""
        return round(self.duration / self.step)


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of a run, J: work in = dissipation + change of stored energy, to the residual."""

    work_load: float
    work_belt: float
    friction: float
    damping: float
    stored_start: float
    stored_end: float

    @property
    def residual(self) -> float:
        """Energy from nowhere (negative) or lost (positive), J."""
        dissipated = self.friction + self.damping
        return self.work_load + self.work_belt - dissipated - self.stored_end + self.stored_start

    @property
    def relative(self) -> float:
        """Residual over the absolute work of friction, or over the largest term without any."""
        scale = abs(self.friction)
        if scale == 0.0:
            terms = (self.work_load, self.damping, self.stored_start, self.stored_end)
            scale = max(abs(x) for x in terms)
        return self.residual / scale if scale > 0.0 else 0.0


@dataclass(frozen=True)
class TransientResult:
    """What one design point did.

    Attributes
    ----------
    outcome : str
        ``ok``, ``not_converged``, ``not_finite``, ``singular_jacobian`` or ``blown_up`` (far more
        energy than was put in); of adaptive solvers also ``solver_failed``.
    message : str
        Time and reason of a failure; empty otherwise.
    time : float
        Reached, s.
    q, v : ndarray (n,)
        Last accepted state.
    history : dict of str -> ndarray (rows,)
        Columns kernels.newmark_layout.HISTORY.
    displacement, velocity : ndarray (rows, ns)
        Sensor rows times q and q'.
    q_history : ndarray (rows, n) or (0, n)
    mean_iterations, max_iterations : float, int
        Evaluations of the contact forces a step.
    halvings, newton_steps : int
    contraction : float
        Largest ratio of residuals over a plain first correction.
    energy : EnergyBalance
        Of the whole run; its end is NaN after a failure.
    steps : int
        Whole steps taken.
    stopped : str
        Why a watch ended the run before its time; empty otherwise.
    """

    outcome: str
    message: str
    time: float
    q: np.ndarray
    v: np.ndarray
    history: dict[str, np.ndarray]
    displacement: np.ndarray
    velocity: np.ndarray
    q_history: np.ndarray
    mean_iterations: float
    max_iterations: int
    halvings: int
    newton_steps: int
    contraction: float
    energy: EnergyBalance
    steps: int
    stopped: str = field(default="", kw_only=True)

    @property
    def stop_reason(self) -> str:
        """``end``, ``failed`` or what the watch said."""
        return self.stopped or ("end" if self.outcome == "ok" else "failed")
