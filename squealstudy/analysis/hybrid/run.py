"""Time integration of the hybrid model: the reference of the modal representation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.hybrid.arrays import hybrid_arrays, initial_state
from squealstudy.analysis.hybrid.history import Recorder
from squealstudy.analysis.hybrid.solver import StepSolver
from squealstudy.analysis.hybrid.system import HybridDesign
from squealstudy.analysis.transient.settings import (
    EnergyBalance,
    TransientResult,
    TransientSettings,
)
from squealstudy.errors import ConvergenceError, ModelError, ParameterError
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.kernels.hybrid_balance import balance
from squealstudy.kernels.hybrid_commit import commit, start
from squealstudy.kernels.hybrid_predict import predict
from squealstudy.reduction.hybrid import HybridModel

SINGULAR = 4
OUTCOMES = {
    layout.ACCEPTED: ("ok", ""),
    layout.NOT_CONVERGED: ("not_converged", "the contact iteration did not converge"),
    layout.NOT_FINITE: ("not_finite", "the forces are not finite"),
    SINGULAR: ("singular_jacobian", "the Jacobian is singular"),
}
# settings of the modal kernel that have no meaning here, and the values that ask for nothing
UNUSED = {
    "method": "newmark",
    "contact_factor": 1.0,
    "contact_stiffness": None,
    "prewarp": False,
    "single_storage": False,
}


@dataclass(frozen=True)
class HybridResult(TransientResult):
    """A TransientResult and what the sparse factor had to do.

    Attributes
    ----------
    solves : float
        Forward/back solves of the factor a step.
    columns : float
        Columns of J^-1 B^T added a step instead of a second solve, for few points; fill / n of
        them cost as much as a solve.
    fill : int
        Entries of the factors.
    """

    solves: float
    columns: float
    fill: int


def simulate_hybrid(
    model: HybridModel,
    design: HybridDesign,
    settings: TransientSettings,
    q0: np.ndarray,
    v0: np.ndarray,
    sensors: np.ndarray | None = None,
) -> HybridResult:
    """Integrate one design point.

    Parameters
    ----------
    model : HybridModel
    design : HybridDesign
    settings : TransientSettings
        Method ``newmark`` without the options of the modal kernel's Jacobian. The contact iteration
        is a Gauss-Seidel iteration in the contact directions, so that `aitken` and `mockup` have
        nothing to do.
    q0, v0 : ndarray (n,)
        Initial deviation and velocity (HybridBasis.restrict).
    sensors : ndarray (ns, n) or None
        Rows whose products with q and q' are kept; None for the modal amplitudes.

    Raises
    ------
    ModelError
        Arrays that do not fit the model.
    ParameterError
        A setting that the hybrid representation does not have.
    """
    for name, value in UNUSED.items():
        if getattr(settings, name) != value:
            raise ParameterError(name, "belongs to the modal representation")
    for x in (q0, v0):
        if np.shape(x) != (model.n,) or not np.isfinite(x).all():
            raise ModelError(f"an initial state needs {model.n} finite values")
    if sensors is not None and sensors.shape[1] != model.n:
        raise ModelError(f"sensors need {model.n} columns")
    return _Run(model, design, settings, q0, v0, sensors).result()


class _Run:
    """State of one integration; time advances in units of the shortest sub-step."""

    def __init__(
        self,
        model: HybridModel,
        design: HybridDesign,
        settings: TransientSettings,
        q0: np.ndarray,
        v0: np.ndarray,
        sensors: np.ndarray | None,
    ) -> None:
        self._M, self._settings = model.M, settings
        self._hybrid = hybrid_arrays(model, design)
        self._state = initial_state(model, self._hybrid, q0, v0)
        self._recorder = Recorder(model, self._hybrid, self._state, settings, sensors)
        self._solvers: dict[int, StepSolver] = {}
        self._equal = 0  # steps of one size behind the present
        self._position, self._level, self._step = 0, 0, 0
        self._evaluations, self._step_evaluations, self._most = 0, 0, 0
        self._halvings, self._contraction, self._columns = 0, 0.0, 0
        self._outcome = layout.ACCEPTED if start(self._hybrid, self._state) else layout.NOT_FINITE
        self._stored_start = self._recorder.stored()[1]
        if self._outcome == layout.ACCEPTED:
            self._recorder.save(0)
            self._integrate()

    def _integrate(self) -> None:
        """Step to the end, or to a sub-step that fails at the shortest size."""
        settings = self._settings
        whole = 1 << settings.max_halvings
        while self._step < settings.n_steps:
            outcome = self._advance()
            if outcome != layout.ACCEPTED:
                self._equal = 0
                if self._level == settings.max_halvings or outcome == SINGULAR:
                    self._outcome = outcome
                    return
                self._level += 1
                self._halvings += 1
                continue
            self._position += whole >> self._level
            if self._position == whole:
                self._equal = 0 if self._level else self._equal
                self._position, self._level = 0, 0
                self._step += 1
                self._most = max(self._most, self._step_evaluations)
                self._step_evaluations = 0
                self._recorder.save(self._step)

    def _advance(self) -> int:
        """Try one sub-step; its outcome."""
        settings, hybrid, state = self._settings, self._hybrid, self._state
        try:
            solver = self._solver()
        except ConvergenceError:
            return SINGULAR
        predict(hybrid, solver.level, state, self._equal + 1)
        dv = solver.solve(state.vectors[layout.RHS])
        outcome, evaluations, contraction, heavy, solve = balance(
            hybrid,
            solver.level,
            state,
            dv,
            settings.tolerance,
            settings.tolerance_t,
            settings.max_iterations,
        )
        self._evaluations += evaluations
        self._step_evaluations += evaluations
        if outcome != layout.ACCEPTED:
            return int(outcome)
        self._contraction = max(self._contraction, contraction)
        if solve:
            state.vectors[layout.DV] += solver.solve(state.vectors[layout.RHS])
        else:
            self._columns += 3 * heavy
        commit(hybrid, solver.level, state)
        self._equal += 1
        return layout.ACCEPTED

    def _solver(self) -> StepSolver:
        """The factor of the present size of step, made when it is first needed."""
        if self._level not in self._solvers:
            normal = self._hybrid.points[:, 5]
            drag = self._hybrid.law[4] * normal
            forces = np.column_stack([normal, drag, drag]).ravel()
            h = self._settings.step / (1 << self._level)
            self._solvers[self._level] = StepSolver(self._M, self._hybrid, h, forces)
        return self._solvers[self._level]

    def result(self) -> HybridResult:
        """What the run did."""
        settings, recorder = self._settings, self._recorder
        steps = max(self._step, 1)
        time = (self._step + self._position / (1 << settings.max_halvings)) * settings.step
        outcome, reason = OUTCOMES[self._outcome]
        failed = self._outcome != layout.ACCEPTED
        q, v = recorder.motion()
        sensed = recorder.sensed()
        solvers = self._solvers.values()
        return HybridResult(
            outcome=outcome,
            message=f"t = {time:.9g} s: {reason}" if failed else "",
            time=float(time),
            q=q,
            v=v,
            history=recorder.history(),
            displacement=sensed[:, 0].copy(),
            velocity=sensed[:, 1].copy(),
            q_history=recorder.coordinates(),
            mean_iterations=self._evaluations / steps,
            max_iterations=max(self._most, self._step_evaluations),
            halvings=self._halvings,
            newton_steps=0,
            contraction=self._contraction,
            energy=self._energy(failed),
            steps=self._step,
            solves=sum(s.solves for s in solvers) / steps,
            columns=self._columns / steps,
            fill=max((s.fill for s in solvers), default=0),
        )

    def _energy(self, failed: bool) -> EnergyBalance:
        work = [float(w) for w in self._state.work]
        end = np.nan if failed else self._recorder.stored()[1]
        return EnergyBalance(work[0], work[1], work[2], work[3], self._stored_start, end)
