"""What a run in time of one design point leaves: its histories, its energies, how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from squealstudy.kernels import newmark_layout as layout
from squealstudy.motion.growing_modes import coordinates, projection
from squealstudy.motion.system import MotionPoint

# outcome of a run and its reason, by the status that the kernel returns
OUTCOMES = {
    layout.RUNNING: ("ok", ""),  # so far
    layout.DONE: ("ok", ""),
    layout.NOT_CONVERGED: ("not_converged", "the contact iteration did not converge"),
    layout.NOT_FINITE: ("not_finite", "the forces are not finite"),
    layout.SINGULAR: ("singular_jacobian", "the Jacobian is singular"),
    layout.BLOWN_UP: ("blown_up", "far more energy than was ever put in"),
}


def outcome_of(status: int, time: float) -> tuple[str, str]:
    """Outcome and message of a run that reached a time [s], by the kernel's status."""
    outcome, reason = OUTCOMES[status]
    return outcome, f"t = {time:.4g} s: {reason}" if reason else ""


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of a run, which show how well the integration conserves energy.

    Work done = dissipation + change of stored energy + residual.

    Attributes
    ----------
    work_load, work_belt : float
        Work of the loads, and of the drive that imposes the sliding, J.
    friction, damping : float
        Energy that friction and damping dissipate, J.
    stored_start, stored_end : float
        Kinetic and elastic energy at the start and at the end, J.
    """

    work_load: float
    work_belt: float
    friction: float
    damping: float
    stored_start: float
    stored_end: float

    @property
    def residual(self) -> float:
        """Energy that appeared (negative) or was lost (positive) without a cause, J."""
        dissipated = self.friction + self.damping
        return self.work_load + self.work_belt - dissipated - self.stored_end + self.stored_start

    @property
    def relative(self) -> float:
        """Residual over the work of friction in modulus; without friction over the largest term."""
        scale = abs(self.friction)
        if scale == 0.0:
            terms = (self.work_load, self.damping, self.stored_start, self.stored_end)
            scale = max(abs(x) for x in terms)
        return self.residual / scale if scale > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A run of one design point: its last state, its histories, and how the integration went.

    Attributes
    ----------
    point : MotionPoint
    sensed : ndarray (ns,) of int
        Numbers, from 1, of the assembly modes whose amplitudes are saved.
    omega : ndarray (ns,)
        Their frequencies, rad/s.
    outcome : str
        ``ok``, ``not_converged``, ``not_finite``, ``singular_jacobian`` or ``blown_up`` (far more
        energy than was put in). Adaptive solvers also give ``solver_failed``.
    message : str
        Time and reason of a failure; empty otherwise.
    time : float
        Time that the run reached, s.
    q, v : ndarray (n,)
        Last accepted state.
    history : dict of str -> ndarray (rows,)
        Columns kernels.newmark_layout.HISTORY.
    displacement, velocity : ndarray (rows, ns + 8 m)
        Amplitudes of the sensed modes, then products of the point's `GrowingModes.sensors`.
    q_history : ndarray (rows, n) or (0, n)
        Displacements of all coordinates, where they are saved.
    squares : ndarray (rows, 2, ns)
        Means of the squares of displacement and velocity of the sensed modes since the row before;
        NaN where the integrator does not sum them.
    mean_iterations, max_iterations : float, int
        Evaluations of the contact forces in a step.
    halvings, newton_steps : int
        Numbers of halvings of a step and of Newton steps.
    cuts : int
        Number of sub-steps that were repeated because a contact point met a corner of its law.
    contraction : float
        Largest ratio of residuals over a plain first correction.
    energy : EnergyBalance
        Energies of the whole run; `stored_end` is NaN after a failure.
    steps : int
        Whole steps taken.
    stopped : str
        Why the run was ended before its time, where its outcome was known; empty otherwise.
    windows : dict
        Cache of levels and frequencies of time windows (`outcome.torque`, `outcome.periods`);
        empty in a copy by `dataclasses.replace`.
    """

    point: MotionPoint
    sensed: np.ndarray
    omega: np.ndarray
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
    stopped: str = ""
    cuts: int = 0
    squares: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 0)))
    windows: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def stop_reason(self) -> str:
        """Why the run ended: ``end`` of its time, ``failed``, or `stopped`."""
        return self.stopped or ("end" if self.outcome == "ok" else "failed")

    @property
    def times(self) -> np.ndarray:
        """Times of the saved rows (rows,), s."""
        return self.history["time"]

    @property
    def modal_energy(self) -> np.ndarray:
        """Mechanical energy of all modes (rows,), J."""
        return self.history["modal_energy"]

    @property
    def sensed_q(self) -> np.ndarray:
        """Displacements of the sensed modes (rows, ns)."""
        return self.displacement[:, : len(self.sensed)]

    @property
    def sensed_v(self) -> np.ndarray:
        """Velocities of the sensed modes (rows, ns)."""
        return self.velocity[:, : len(self.sensed)]

    def xi(self, k: int) -> np.ndarray:
        """Complex amplitude (rows,) of the followed mode `k` alone, by its left vector."""
        return projection(*self._watched(k))

    def plane(self, k: int) -> np.ndarray:
        """Coordinates (rows, 2) on the plane of the followed mode `k`, sqrt(J)."""
        return coordinates(*self._watched(len(self.point.growing.lam) + k))

    def _watched(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and velocities (rows, 4) at the four sensors of group `k`.

        The groups are those of the point's `GrowingModes.sensors`.
        """
        first = len(self.sensed) + 4 * k
        columns = slice(first, first + 4)
        return self.displacement[:, columns], self.velocity[:, columns]
