"""Time integration of the hybrid model, with which modal runs are compared, and its history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ConvergenceError, ParameterError
from squealstudy.kernels import hybrid_layout as layout
from squealstudy.kernels import newmark_layout as newmark
from squealstudy.kernels.hybrid_state import (
    commit,
    history_row,
    potential_energy,
    start,
    sum_step,
    sums_to_row,
)
from squealstudy.kernels.hybrid_step import balance, predict
from squealstudy.motion.hybrid_arrays import StepSolver, hybrid_arrays, initial_state
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.motion import EnergyBalance, Motion, outcome_of
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.hybrid import HybridModel

# options of `Newmark` that have no meaning here
UNUSED = ("contact_factor", "contact_stiffness", "prewarp", "single_storage", "corner_halvings")


@dataclass(frozen=True, kw_only=True)
class HybridMotion(Motion):
    """A motion, and how often the sparse factor was used.

    Attributes
    ----------
    solves : float
        Forward and back solves in each step, in the mean.
    columns : float
        Columns of J^-1 B^T that were added in each step instead of a second solve, in the mean.
    """

    solves: float
    columns: float


def simulate_hybrid(
    model: HybridModel,
    design: MotionPoint,
    settings: MotionSettings,
    sensed: np.ndarray | None = None,
    sensors_of: HybridModel | None = None,
) -> HybridMotion:
    """Integrate one design point from its start.

    Parameters
    ----------
    model : HybridModel
    design : MotionPoint
        Its vectors are in the model's coordinates, `c` in its real modes.
    settings : MotionSettings
        Its integrator is ``newmark``, without the options of the modal kernel's Jacobian. The
        contact iteration is a Gauss-Seidel iteration in the contact directions: `aitken` and
        `tangential_damping` have no effect.
    sensed : ndarray (ns,) of int or None
        Numbers of modes, from 1, whose amplitudes are saved; None for all.
    sensors_of : HybridModel or None
        A model in the same coordinates about another working point: amplitudes and modal energies
        are those of its modes and its stiffness. None for `model`.

    Raises
    ------
    ModelError
        Arrays that do not fit the model.
    ParameterError
        An integrator or an option that the hybrid representation does not have.
    """
    method = settings.integrator
    if not isinstance(method, Newmark):
        raise ParameterError("integrator", f"'{method.name}' is of the modal representation")
    for name in UNUSED:
        if getattr(method, name) != Newmark.model_fields[name].default:
            raise ParameterError(name, "belongs to the modal representation")
    sensor_model = model if sensors_of is None else sensors_of
    if sensed is None:
        sensed = np.arange(len(sensor_model.omega)) + 1
    return _Run(model, design, settings, method.max_halvings, sensed, sensor_model).motion()


class _Run:
    """State of one integration, whose time is counted in units of the shortest sub-step."""

    def __init__(
        self,
        model: HybridModel,
        design: MotionPoint,
        settings: MotionSettings,
        max_halvings: int,
        sensed: np.ndarray,
        sensor_model: HybridModel,
    ) -> None:
        self._model, self._design, self._settings = model, design, settings
        self._max_halvings, self._sensed = max_halvings, sensed
        self._omega = sensor_model.omega[sensed - 1]
        self._hybrid = hybrid_arrays(model, design)
        self._state = initial_state(model, self._hybrid, *design.start(model.n))
        modes, watching = sensed - 1, design.growing.sensors.reshape(-1, model.n)
        if sensor_model is not model:
            modes, watching = modes[:0], np.vstack([sensor_model.sensors[modes], watching])
        self._recorder = Recorder(
            model,
            self._hybrid,
            self._state,
            settings,
            modes,
            watching,
            model.k_ref - sensor_model.k_ref,
        )
        self._limits = layout.Limits(
            settings.tolerance, settings.friction_tolerance, settings.max_iterations
        )
        self._solvers: dict[int, StepSolver] = {}
        self._n_equal_steps = 0  # successive sub-steps of the present size so far
        self._position, self._level, self._step = 0, 0, 0
        self._evaluations, self._step_evaluations, self._max_evaluations = 0, 0, 0
        self._halvings, self._contraction, self._columns = 0, 0.0, 0
        self._status = newmark.DONE if start(self._hybrid, self._state) else newmark.NOT_FINITE
        self._stored_start = self._recorder.stored()[1]
        if self._status == newmark.DONE:
            self._recorder.sum(0.0)
            self._recorder.save(0)
            self._integrate()

    def _integrate(self) -> None:
        """Advance to the end, or until a sub-step of the shortest size fails."""
        settings = self._settings
        n_shortest = 1 << self._max_halvings
        while self._step < settings.n_steps:
            status = self._advance()
            if status != newmark.DONE:
                self._n_equal_steps = 0
                if self._level == self._max_halvings or status == newmark.SINGULAR:
                    self._status = status
                    return
                self._level += 1
                self._halvings += 1
                continue
            self._position += n_shortest >> self._level
            if self._position == n_shortest:
                self._n_equal_steps = 0 if self._level else self._n_equal_steps
                self._position, self._level = 0, 0
                self._step += 1
                self._max_evaluations = max(self._max_evaluations, self._step_evaluations)
                self._step_evaluations = 0
                self._recorder.save(self._step)

    def _advance(self) -> int:
        """Try one sub-step; return its status."""
        hybrid, state = self._hybrid, self._state
        try:
            solver = self._solver()
        except ConvergenceError:
            return newmark.SINGULAR
        predict(hybrid, solver.level, state, self._n_equal_steps + 1)
        dv = solver.solve(state.vectors[layout.RHS])
        status, evaluations, contraction, heavy, solve = balance(
            hybrid, solver.level, state, dv, self._limits
        )
        self._evaluations += evaluations
        self._step_evaluations += evaluations
        if status != newmark.DONE:
            return int(status)
        self._contraction = max(self._contraction, contraction)
        if solve:
            state.vectors[layout.DV] += solver.solve(state.vectors[layout.RHS])
        else:
            self._columns += 3 * heavy
        commit(hybrid, solver.level, state)
        self._recorder.sum(solver.level.h)
        self._n_equal_steps += 1
        return newmark.DONE

    def _solver(self) -> StepSolver:
        """The factor for the present step size, made when it is first needed."""
        if self._level not in self._solvers:
            normal = self._hybrid.points[:, newmark.POINT_NORMAL]
            drag = self._hybrid.law[newmark.LAW_MU] * normal
            forces = np.column_stack([normal, drag, drag]).ravel()
            h = self._settings.step / (1 << self._level)
            self._solvers[self._level] = StepSolver(self._model.M, self._hybrid, h, forces)
        return self._solvers[self._level]

    def motion(self) -> HybridMotion:
        """The motion of the run."""
        settings, recorder = self._settings, self._recorder
        steps = max(self._step, 1)
        time = (self._step + self._position / (1 << self._max_halvings)) * settings.step
        outcome, message = outcome_of(self._status, time)
        q, v = recorder.motion()
        sensed = recorder.sensed()
        solvers = self._solvers.values()
        return HybridMotion(
            point=self._design,
            sensed=self._sensed,
            omega=self._omega,
            outcome=outcome,
            message=message,
            time=time,
            q=q,
            v=v,
            history=recorder.history(),
            displacement=sensed[:, 0].copy(),
            velocity=sensed[:, 1].copy(),
            q_history=recorder.coordinates(),
            mean_iterations=self._evaluations / steps,
            max_iterations=max(self._max_evaluations, self._step_evaluations),
            halvings=self._halvings,
            newton_steps=0,
            contraction=self._contraction,
            energy=self._energy(),
            steps=self._step,
            solves=sum(s.solves for s in solvers) / steps,
            columns=self._columns / steps,
        )

    def _energy(self) -> EnergyBalance:
        end = self._recorder.stored()[1] if self._status == newmark.DONE else np.nan
        return EnergyBalance(*[*self._state.work.tolist(), self._stored_start, end])


@dataclass
class Recorder:
    """Reads a run's state, whose motion is q = q_s + phi (alpha - alpha_s) (hybrid_layout).

    Parameters
    ----------
    model : HybridModel
    hybrid, state : hybrid_layout tuples
        Arrays of the run.
    settings : MotionSettings
    modes : ndarray (ns,) of int
        Indices of the model's modes whose amplitudes are saved.
    watching : ndarray (m, n)
        Sensors, whose products with q and q' are saved after these amplitudes.
    excess : ndarray (nc,)
        Contact tangents in the model's stiffness less those in the stiffness of modal energies,
        N/m.
    """

    model: HybridModel
    hybrid: layout.HybridArrays
    state: layout.HybridState
    settings: MotionSettings
    modes: np.ndarray
    watching: np.ndarray
    excess: np.ndarray

    def __post_init__(self) -> None:
        self._watching_modes = self.watching @ self.model.phi
        self._rows: list[np.ndarray] = []
        self._sensed: list[np.ndarray] = []
        self._q: list[np.ndarray] = []
        self._sums, self._now = np.zeros(newmark.N_SUM), np.zeros(len(newmark.HISTORY))

    def sum(self, h: float) -> None:
        """Add the accepted sub-step h [s] to the sums of the next row; 0 for the start."""
        sum_step(self.hybrid, self.state, h, self._now, self._sums)

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Final deviation q [m] and velocity [m/s] in the model's coordinates, (n,) each."""
        x, lag = self.state.vectors, self._lag()
        shape_motion = self.model.phi @ lag.T
        return x[layout.Q] + shape_motion[:, 0], x[layout.V] + shape_motion[:, 1]

    def stored(self) -> tuple[float, float]:
        """Mechanical energy with the stiffness of modal energies, and that with the contact, J.

        Modes are orthogonal in M and K. So the energy of the sparse motion is corrected by the
        energy of the modes less that of the modes' part in it.
        """
        x, modes, w2 = self.state.vectors, self.state.modes, self.hybrid.omega2
        v = x[layout.V]
        a, a_s = modes[layout.ALPHA], modes[layout.ALPHA_S]
        rate, rate_s = modes[layout.RATE], modes[layout.RATE_S]
        twice = v @ (self.model.M @ v) + x[layout.Q] @ x[layout.KQ]
        twice += rate @ rate - rate_s @ rate_s + w2 @ (a * a - a_s * a_s)
        linear = 0.5 * float(twice)
        gaps = self.state.point[:, newmark.X_START]
        modal = linear - 0.5 * float(self.excess @ (gaps * gaps))
        return modal, linear + float(potential_energy(self.hybrid, self.state))

    def save(self, step: int) -> None:
        """Append the accepted state, if this step is to be saved."""
        every = self.settings.save_every
        if not every or step % every:
            return
        row = np.zeros(len(newmark.HISTORY))
        history_row(self.hybrid, self.state, row)
        row[newmark.TIME] = step * self.settings.step
        row[newmark.MODAL_ENERGY], row[newmark.STORED] = self.stored()
        sums_to_row(self._sums, row)
        self._rows.append(row)
        amplitudes = self.state.modes[[layout.ALPHA, layout.RATE]][:, self.modes]
        motion = self.state.vectors[[layout.Q, layout.V]]
        watched = motion @ self.watching.T + self._lag() @ self._watching_modes.T
        self._sensed.append(np.hstack([amplitudes, watched]))
        if self.settings.save_q:
            self._q.append(self.motion()[0])

    def history(self) -> dict[str, np.ndarray]:
        """The saved rows by column name (newmark_layout.HISTORY), (rows,) each."""
        rows = np.array(self._rows).reshape(-1, len(newmark.HISTORY))
        return {name: rows[:, i].copy() for i, name in enumerate(newmark.HISTORY)}

    def sensed(self) -> np.ndarray:
        """Amplitudes, then products of the sensors, for q and q' (rows, 2, ns + m)."""
        ns = len(self.modes) + len(self.watching)
        return np.array(self._sensed).reshape(-1, 2, ns)

    def coordinates(self) -> np.ndarray:
        """Deviations (rows, n); no rows without `MotionSettings.save_q`."""
        return np.array(self._q).reshape(-1, self.model.n)

    def _lag(self) -> np.ndarray:
        """Amplitudes and velocities (2, m) of the modes less those in the sparse motion."""
        modes = self.state.modes
        part = modes[[layout.ALPHA, layout.RATE]] - modes[[layout.ALPHA_S, layout.RATE_S]]
        return np.asarray(part)
