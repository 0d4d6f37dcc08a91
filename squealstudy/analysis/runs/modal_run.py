"""A run in time with what its sensors are, and what follows from both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.runs.complex_shares import complex_shares
from squealstudy.analysis.runs.modal_energies import (
    mode_energies,
    static_energy,
    vibration_energy,
)
from squealstudy.analysis.transient.mode_planes import coordinates
from squealstudy.analysis.transient.point import TransientPoint
from squealstudy.analysis.transient.reference_modes import projection
from squealstudy.analysis.transient.settings import TransientResult

NOISE = 3e-21  # of the work of friction: energy of round-off


@dataclass(frozen=True)
class ModalRun:
    """A result with what its sensors are.

    Attributes
    ----------
    result : TransientResult
    point : TransientPoint
    modes : ndarray (ns,) of int
        Sensed assembly modes, from 1.
    omega : ndarray (ns,)
        rad/s.
    q, v : ndarray (rows, ns)
        Their modal displacement and velocity.
    growth_q, growth_v : ndarray (rows, 8 m)
        Products of `TransientPoint.sensor_rows`.
    continued : bool
        The run goes on from another; otherwise its first energy is that of the perturbation.
    """

    result: TransientResult
    point: TransientPoint
    modes: np.ndarray
    omega: np.ndarray
    q: np.ndarray
    v: np.ndarray
    growth_q: np.ndarray
    growth_v: np.ndarray
    continued: bool = False

    @property
    def time(self) -> np.ndarray:
        """S, (rows,)."""
        return self.result.history["time"]

    @property
    def energy(self) -> np.ndarray:
        """Mechanical energy of all modes (rows,), J."""
        return self.result.history["modal_energy"]

    def xi(self, k: int) -> np.ndarray:
        """Complex amplitude (rows,) of the followed mode `k` through its left vector."""
        rows = slice(4 * k, 4 * k + 4)
        return projection(self.growth_q[:, rows], self.growth_v[:, rows])

    def plane(self, k: int) -> np.ndarray:
        """Coordinates (rows, 2) on the plane of the followed mode `k`, sqrt(J)."""
        first = 4 * (len(self.point.modes.lam) + k)
        rows = slice(first, first + 4)
        return coordinates(self.growth_q[:, rows], self.growth_v[:, rows])


def level_shares(run: ModalRun, window: slice) -> np.ndarray:
    """Share (m,) of each followed complex mode in the energy of the vibration over a window."""
    states = [run.plane(k)[window] for k in range(len(run.point.modes.lam))]
    energy = float(run.energy[window].mean()) - static_energy(run.q[window], run.omega)
    return complex_shares(np.hstack(states), run.point.plane_overlap, energy)


def moving_energy(run: ModalRun) -> np.ndarray:
    """Energy of the vibration (rows,), J: twice the kinetic energy of the sensed modes.

    That is blind to static shifts; where the sensors miss most of the energy, all of it is taken.
    """
    last = slice(round(0.6 * len(run.time)), None)
    sensed = mode_energies(run.q, run.v, run.omega)[last].sum()
    if sensed < 0.5 * run.energy[last].sum():
        return run.energy
    return vibration_energy(run.v)


def round_off(run: ModalRun) -> float:
    """Energy below which nothing moves, J: of the work of friction, which scales as it does."""
    return NOISE * abs(run.result.energy.friction)
