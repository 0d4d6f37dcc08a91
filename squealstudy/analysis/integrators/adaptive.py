"""Adaptive solvers of scipy on the modal equations, as their own authors would run them.

Right-hand side and tangents are compiled; the implicit solvers get an analytic Jacobian. Saved
times come from each solver's dense output.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import BDF, DOP853, LSODA, Radau

from squealstudy.analysis.integrators.fixed_step import Arrays
from squealstudy.analysis.integrators.options import Value
from squealstudy.analysis.transient.settings import TransientResult
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.modal_rate import modal_rate, point_tangents, show_state

SOLVERS: Mapping[str, Any] = {"dop853": DOP853, "radau": Radau, "bdf": BDF, "lsoda": LSODA}
IMPLICIT = ("radau", "bdf", "lsoda")
ATOL = 1e-3  # absolute over relative tolerance, in units of each coordinate's scale


class Equations:
    """f(t, y) and its Jacobian for one design, y = (q, v)."""

    def __init__(self, system: ModalSystem, design: TransientDesign, case: Arrays) -> None:
        self.case, self.n = case, case.n
        self.contact = np.concatenate([system.N, system.T1, system.T2])
        modes = case.modal.modes[0, :, : case.n]
        d, s = case.modal.tuned[0]
        U = system.shapes
        self.K = np.diag(modes[layout.W2]) + U.T @ (s[:, None] * U)
        self.C = np.diag(modes[layout.C]) + U.T @ (d[:, None] * U)
        self.parts = (system.N, system.T1, system.T2)
        self.D = np.zeros((6, len(system.area)))

    def rate(self, _t: float, y: np.ndarray) -> np.ndarray:
        """Right-hand side (2 n,)."""
        dy = np.empty(2 * self.n)
        modal_rate(np.ascontiguousarray(y), self.case.B, self.case.modal, self.case.work, dy)
        return dy

    def jacobian(self, _t: float, y: np.ndarray) -> np.ndarray:
        """df/dy (2 n, 2 n)."""
        n, D = self.n, self.D
        point_tangents(np.ascontiguousarray(y), self.case.B, self.case.modal, self.case.work, D)
        N, T1, T2 = self.parts
        J = np.zeros((2 * n, 2 * n))
        J[:n, n:] = np.eye(n)
        pushed = np.concatenate([D[0][:, None] * N, D[1][:, None] * N, D[2][:, None] * N])
        J[n:, :n] = self.contact.T @ pushed - self.K
        along = D[3][:, None] * T1 + D[4][:, None] * T2
        across = D[4][:, None] * T1 + D[5][:, None] * T2
        J[n:, n:] = T1.T @ along + T2.T @ across - self.C
        return J


def scales(system: ModalSystem, case: Arrays, speed: float) -> np.ndarray:
    """Size (2 n,) that each coordinate may have: one velocity for all modes, over frequencies.

    The velocity is the largest of those of the initial state, of the load on a free mode, and of
    1/1000 of the sliding speed in the mode that moves a point most.
    """
    n, x = case.n, case.work.x[0]
    q0, v0 = x[layout.Q, :n], x[layout.V, :n]
    omega = np.sqrt(np.abs(system.omega2))
    slow = np.maximum(omega, 1.0 / case.settings.duration)
    load = case.modal.modes[0, layout.LOAD, :n]
    largest = [np.abs(v0).max(), np.abs(omega * q0).max(), np.abs(load / slow).max()]
    row = max(np.linalg.norm(T, axis=1).max(initial=0.0) for T in (system.T1, system.T2))
    if row > 0.0:
        largest.append(1e-3 * abs(speed) / row)
    velocity = max(largest) or 1.0
    return np.concatenate([velocity / slow, np.full(n, velocity)])


def run_adaptive(
    name: str,
    system: ModalSystem,
    design: TransientDesign,
    case: Arrays,
    options: Mapping[str, Value],
) -> TransientResult:
    """Run one of SOLVERS; a failure of it is an outcome.

    `steps` and `mean_iterations` are the solver's own steps and evaluations of the right-hand side
    in one of them, `newton_steps` its Jacobians. Works and dissipations are NaN: nothing
    integrates them.
    """
    n, settings = case.n, case.settings
    equations = Equations(system, design, case)
    rtol = float(options["rtol"])
    atol = (float(options["atol"]) or ATOL * rtol) * scales(system, case, design.speed)
    y0 = np.concatenate([case.work.x[0, layout.Q, :n], case.work.x[0, layout.V, :n]])
    end = settings.n_steps * settings.step
    extra = {"jac": equations.jacobian} if name in IMPLICIT else {}
    case.work.real[0, layout.W_LOAD : layout.STORED_START] = np.nan
    case.work.real[0, layout.STORED_START] = shown(case, y0, 0)
    course = Course(case, y0)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # what solvers warn of is in the outcome
        try:
            solver = SOLVERS[name](equations.rate, 0.0, y0, end, rtol=rtol, atol=atol, **extra)
            course.march(solver, int(options["max_evaluations"]))
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            course.fail("solver_failed", str(error) or "the solver raised an error")
    return course.result()


def shown(case: Arrays, y: np.ndarray, step: int) -> float:
    """Keep y as the state after `step` steps of the settings; its stored energy, J."""
    every = case.settings.save_every
    case.work.counts[0, layout.STEP] = step
    keep = every > 0 and step % every == 0
    return float(show_state(y, *case.kernel, keep))


class Course:
    """How far a solver came."""

    def __init__(self, case: Arrays, y0: np.ndarray) -> None:
        self.case, self.y, self.t = case, y0, 0.0
        self.steps = self.evaluations = self.most = self.jacobians = 0
        self.outcome, self.reason = "ok", ""

    def fail(self, outcome: str, reason: str) -> None:
        """End with an outcome."""
        self.outcome, self.reason = outcome, reason

    def march(self, solver: Any, limit: int) -> None:
        """Step to the end, or to a failure; `limit` evaluations at most, 0 for any number."""
        settings = self.case.settings
        every = settings.save_every or settings.n_steps
        due = every
        while solver.status == "running":
            before = solver.nfev
            message = solver.step()
            if solver.status == "failed":
                self.fail("solver_failed", message or "the solver gave up")
                return
            if not np.isfinite(solver.y).all():
                self.fail("not_finite", "the state is not finite")
                return
            self.y, self.t = np.array(solver.y), float(solver.t)
            self.steps += 1
            self.most = max(self.most, solver.nfev - before)
            self.evaluations, self.jacobians = solver.nfev, solver.njev
            if due * settings.step <= self.t or solver.status == "finished":
                due = self.save(solver, due, every)
            if solver.status == "running" and 0 < limit <= solver.nfev:
                self.fail("solver_failed", f"more than {limit} evaluations")
                return

    def save(self, solver: Any, due: int, every: int) -> int:
        """Keep the rows from step `due` on that the solver has passed; the next one."""
        settings = self.case.settings
        dense = solver.dense_output()
        while due <= settings.n_steps:
            t = due * settings.step
            if t > self.t and solver.status == "running":
                break
            shown(self.case, np.ascontiguousarray(dense(min(t, self.t))), due)
            due += every
        return due

    def result(self) -> TransientResult:
        """After the end."""
        case, settings = self.case, self.case.settings
        counts, real = case.work.counts[0], case.work.real[0]
        stored = float(show_state(self.y, *case.kernel, False))
        counts[layout.STATUS] = layout.DONE
        if self.outcome == "ok":
            real[layout.STORED_END] = stored
        message = f"t = {self.t:.9g} s: {self.reason}" if self.reason else ""
        return replace(
            case.result(),
            outcome=self.outcome,
            message=message,
            time=self.t if self.outcome != "ok" else settings.n_steps * settings.step,
            mean_iterations=self.evaluations / max(self.steps, 1),
            max_iterations=self.most,
            newton_steps=self.jacobians,
            steps=self.steps,
        )
