"""Adaptive solvers of scipy for the modal equations, used as their authors would use them.

Right-hand side and tangents are compiled, and implicit solvers get an analytic Jacobian. Rows at
saved times come from each solver's dense output.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.integrate import BDF, DOP853, LSODA, Radau

from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.modal_rate import modal_rate, point_tangents, show_state
from squealstudy.laboratory.integrators.fixed_step import own_arrays
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import KernelRun, OneByOne
from squealstudy.motion.system import ModalSystem, MotionPoint

ATOL_OVER_RTOL = 1e-3  # absolute tolerance, over each coordinate's scale, over the relative one


class Adaptive(OneByOne):
    """A solver that chooses its own steps; the step of the settings decides on the times of rows.

    Of a run, `steps` is the number of the solver's steps, `mean_iterations` that of evaluations of
    the right-hand side in each, and `newton_steps` that of its Jacobians. Works and dissipations
    are NaN, as nothing integrates them.
    """

    solver: ClassVar[Any]
    implicit: ClassVar[bool] = True  # whether it takes a Jacobian

    rtol: float = Field(default=1e-6, ge=1e-14, le=1, description="relative tolerance")
    atol: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="absolute tolerance over the scale of each coordinate; 0: rtol / 1000",
    )
    max_evaluations: int = Field(
        default=0, ge=0, description="evaluations of the right-hand side, at most; 0: no limit"
    )

    def run(self, system: ModalSystem, design: MotionPoint, settings: MotionSettings) -> Motion:
        """Integrate a design point; a failure of the solver is an outcome."""
        plain = Newmark(max_halvings=0, tangential_damping="never")
        case = own_arrays(system, design, replace(settings, integrator=plain))
        equations = Equations(case)
        atol = (self.atol or ATOL_OVER_RTOL * self.rtol) * scales(case)
        y0 = np.concatenate(design.start(system.n))
        end = settings.n_steps * settings.step
        extra = {"jac": equations.jacobian} if self.implicit else {}
        case.work.real[0, layout.W_LOAD : layout.STORED_START] = np.nan
        case.work.real[0, layout.STORED_START] = shown(case, y0, 0)
        course = SolverRun(case, y0)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # the outcome says what solvers warn of
            try:
                solver = self.solver(
                    equations.rate, 0.0, y0, end, rtol=self.rtol, atol=atol, **extra
                )
                outcome, reason = course.march(solver, self.max_evaluations)
            except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
                outcome, reason = "solver_failed", str(error) or "the solver raised an error"
        return course.motion(outcome, reason)


class Dop853(Adaptive):
    """Explicit Runge-Kutta, by scipy."""

    name = "dop853"
    label = "DOP853"
    description = "explicit Runge-Kutta of order 8, adaptive (Hairer)"
    solver = DOP853
    implicit = False


class RadauIIA(Adaptive):
    """Implicit Runge-Kutta, by scipy."""

    name = "radau"
    label = "Radau"
    description = "implicit Runge-Kutta of order 5, adaptive"
    solver = Radau


class BackwardDifferences(Adaptive):
    """Backward differences, by scipy."""

    name = "bdf"
    label = "BDF"
    description = "backward differences of orders 1 to 5, adaptive"
    solver = BDF


class Lsoda(Adaptive):
    """Adams and backward differences, by scipy."""

    name = "lsoda"
    label = "LSODA"
    description = "Adams and BDF with automatic switching, adaptive (Petzold)"
    solver = LSODA


class Equations:
    """Right-hand side f(t, y) and its Jacobian for one design, with y = (q, v)."""

    def __init__(self, case: KernelRun) -> None:
        system, U = case.system, case.system.shapes
        self.case, self.n = case, system.n
        modes, (d, s) = case.modal.modes[0, :, : self.n], case.modal.component_terms[0]
        self.K = np.diag(modes[layout.W2]) + U.T @ (s[:, None] * U)
        self.C = np.diag(modes[layout.C]) + U.T @ (d[:, None] * U)
        if case.designs[0].damping_between is not None:
            self.C += case.designs[0].damping_between
        self.D = np.zeros((6, len(system.area)))

    def rate(self, _t: float, y: np.ndarray) -> np.ndarray:
        """Time derivative (2 n,) of the state y = [q, v]."""
        dy = np.empty(2 * self.n)
        modal_rate(np.ascontiguousarray(y), self.case.B, self.case.modal, self.case.work, dy)
        return dy

    def jacobian(self, _t: float, y: np.ndarray) -> np.ndarray:
        """Jacobian df/dy (2 n, 2 n)."""
        n, D = self.n, self.D
        point_tangents(np.ascontiguousarray(y), self.case.B, self.case.modal, self.case.work, D)
        N, T1, T2 = self.case.system.N, self.case.system.T1, self.case.system.T2
        along = D[3][:, None] * T1 + D[4][:, None] * T2
        across = D[4][:, None] * T1 + D[5][:, None] * T2
        pushed = [part.T @ (D[i][:, None] * N) for i, part in enumerate((N, T1, T2))]
        return np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [sum(pushed) - self.K, T1.T @ along + T2.T @ across - self.C],
            ]
        )


def scales(case: KernelRun) -> np.ndarray:
    """Size (2 n,) that each coordinate may have: a velocity for all modes, and it over frequency.

    The velocity is the largest of three: that of the initial state, that of the load on a free
    mode, and that at which a mode moves a contact point at 1/1000 of the sliding speed.
    """
    system, design = case.system, case.designs[0]
    n = system.n
    q0, v0 = design.start(n)
    omega = np.sqrt(np.abs(system.omega2))
    slow = np.maximum(omega, 1.0 / case.settings.duration)
    load = case.modal.modes[0, layout.LOAD, :n]
    largest = [np.abs(v0).max(), np.abs(omega * q0).max(), np.abs(load / slow).max()]
    row = max(np.linalg.norm(T, axis=1).max(initial=0.0) for T in (system.T1, system.T2))
    if row > 0.0:
        largest.append(1e-3 * abs(design.speed) / row)
    velocity = max(largest) or 1.0
    return np.concatenate([velocity / slow, np.full(n, velocity)])


def shown(case: KernelRun, y: np.ndarray, step: int) -> float:
    """Keep y as the state after `step` steps of the settings; return its stored energy, J."""
    every = case.settings.save_every
    case.work.counts[0, layout.STEP] = step
    keep = every > 0 and step % every == 0
    return float(show_state(y, *case.arguments, keep))


class SolverRun:
    """The run of a solver: how far it is, and what it counted."""

    def __init__(self, case: KernelRun, y0: np.ndarray) -> None:
        self.case, self.y, self.t = case, y0, 0.0
        self.steps = self.evaluations = self.most = self.jacobians = 0

    def march(self, solver: Any, limit: int) -> tuple[str, str]:
        """Step to the end, or to a failure; return the outcome and its reason.

        The run fails after a step that reaches `limit` evaluations before the end; 0: no limit.
        """
        settings = self.case.settings
        every = settings.save_every or settings.n_steps
        due = every
        while solver.status == "running":
            before = solver.nfev
            message = solver.step()
            if solver.status == "failed":
                return "solver_failed", message or "the solver gave up"
            if not np.isfinite(solver.y).all():
                return "not_finite", "the state is not finite"
            self.y, self.t = np.array(solver.y), float(solver.t)
            self.steps += 1
            self.most = max(self.most, solver.nfev - before)
            self.evaluations, self.jacobians = solver.nfev, solver.njev
            if due * settings.step <= self.t or solver.status == "finished":
                due = self.save(solver, due, every)
            if solver.status == "running" and 0 < limit <= solver.nfev:
                return "solver_failed", f"the limit of {limit} evaluations is reached"
        return "ok", ""

    def save(self, solver: Any, due: int, every: int) -> int:
        """Keep the rows from step `due` on that the solver has passed; return the next one."""
        settings = self.case.settings
        dense = solver.dense_output()
        while due <= settings.n_steps:
            t = due * settings.step
            if t > self.t and solver.status == "running":
                break
            shown(self.case, np.ascontiguousarray(dense(min(t, self.t))), due)
            due += every
        return due

    def motion(self, outcome: str, reason: str) -> Motion:
        """Motion at the end of the run, with how it ended and why."""
        case, settings = self.case, self.case.settings
        counts, real = case.work.counts[0], case.work.real[0]
        stored = float(show_state(self.y, *case.arguments, False))
        counts[layout.STATUS] = layout.DONE
        if outcome == "ok":
            real[layout.STORED_END] = stored
        return replace(
            case.motion(0),
            outcome=outcome,
            message=f"t = {self.t:.9g} s: {reason}" if reason else "",
            time=self.t if outcome != "ok" else settings.n_steps * settings.step,
            mean_iterations=self.evaluations / max(self.steps, 1),
            max_iterations=self.most,
            newton_steps=self.jacobians,
            steps=self.steps,
        )
