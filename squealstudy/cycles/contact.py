"""An oscillator in contact, made from a design point, and levels of its periodic motions.

Forces, tangents, torque and shares of the contact are those of the kernels that run in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import LEAST_SAMPLES, period_at
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES, LocalForces, Oscillator
from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.harmonic_balance import sampled_forces, sampled_rows
from squealstudy.kernels.turns import resolve_turns
from squealstudy.motion.system import ModalSystem, MotionPoint

LEVEL_SAMPLES = 512  # samples of a period for levels and shares
FEWER_SAMPLES = 32  # least number of samples of a period for the forces of large models


@dataclass(frozen=True)
class ContactForces:
    """Forces of all contact points beyond those of steady sliding.

    Attributes
    ----------
    points : ndarray (N_POINT_ROWS, nc)
        Numbers of the contact points (`MotionPoint.points`).
    law : ndarray (N_LAW or more,)
        Numbers of the contact and friction laws (`MotionPoint.laws`).
    """

    points: np.ndarray
    law: np.ndarray

    def __call__(self, y: np.ndarray, w: np.ndarray) -> LocalForces:
        """Forces at displacements y and velocities w (S, nc, 3)."""
        f = np.zeros(y.shape)
        by_y, by_w = np.zeros((*y.shape, 3)), np.zeros((*y.shape, 3))
        sampled_forces(self.points, self.law, y, w, f, by_y, by_w)
        return LocalForces(f, by_y, by_w)

    def turning(self, y: np.ndarray, w: np.ndarray) -> LocalForces:
        """Forces at even samples of a period, with those reversals of friction between samples."""
        forces = self(y, w)
        resolve_turns(self.points, self.law, y, w, (forces.f, forces.by_y, forces.by_w))
        return forces


@dataclass(frozen=True)
class ContactOscillator:
    """A design point on a modal system, for harmonic balance.

    Parameters
    ----------
    system : ModalSystem
    point : MotionPoint
        A design point about its own steady sliding, without loads beyond those of its base state.

    Raises
    ------
    ModelError
        A design point with loads, or that does not fit the system.
    """

    system: ModalSystem
    point: MotionPoint

    @cached_property
    def oscillator(self) -> Oscillator:
        """The equation of motion."""
        system, point = self.system, self.point
        if point.load is not None and np.any(point.load):
            raise ModelError("harmonic balance is about steady sliding, without other loads")
        U, m = system.shapes, len(system.shapes)
        d, s = (np.zeros(m) if x is None else x for x in (point.d, point.s))
        forces = ContactForces(point.points(system), point.laws(system)[0])
        C = np.diag(point.c) + U.T @ (d[:, None] * U)
        return Oscillator(
            C=C if point.damping_between is None else C + point.damping_between,
            K=np.diag(system.omega2) + U.T @ (s[:, None] * U),
            B=np.stack([system.N, system.T1, system.T2], axis=1),
            forces=forces,
            samples=LEAST_SAMPLES if system.n <= MAX_UNPROJECTED_COORDINATES else FEWER_SAMPLES,
            turning=forces.turning,
        )

    def contact_velocity(self, motion: PeriodicMotion) -> float:
        """Largest velocity of a contact point over the period beside steady sliding, m/s."""
        w = self._observed(motion, LEVEL_SAMPLES // 4)[1][:, self.system.touching]
        return float(np.sqrt((w**2).sum(axis=2).max(initial=0.0)))

    def velocity_between_samples(self, motion: PeriodicMotion) -> float:
        """Amount by which `contact_velocity` of `levels` may miss a peak between samples, m/s.

        A parabola of the largest curvature over the phase rises so much within half a sample.
        """
        w = self._observed(motion, LEVEL_SAMPLES)[1][:, self.system.touching]
        spectrum = np.fft.rfft(w, axis=0)
        order = np.arange(len(spectrum))[:, None, None]
        curvature = np.fft.irfft(order**2 * spectrum, LEVEL_SAMPLES, axis=0)
        largest = np.sqrt((curvature**2).sum(axis=2).max(initial=0.0))
        return 0.5 * (np.pi / LEVEL_SAMPLES) ** 2 * float(largest)

    def slip_apart(self, motion: PeriodicMotion, other: PeriodicMotion) -> float:
        """Largest difference between two motions in the sliding velocity of a point, m/s."""
        touching = self.system.touching
        a, b = (self._observed(m, LEVEL_SAMPLES)[1][:, touching, 1] for m in (motion, other))
        return float(np.abs(a - b).max(initial=0.0))

    def energy(self, motion: PeriodicMotion) -> float:
        """Mean over the period of kinetic energy and elastic energy in the diagonal of K, J."""
        weights = np.full(len(motion.Q), 0.25)
        weights[0] = 0.5
        h = motion.omega * np.concatenate([[0], *[np.arange(1, motion.harmonics + 1)] * 2])
        energies = (np.diag(self.oscillator.K) + h[:, None] ** 2) * motion.Q**2
        return float(weights @ energies.sum(axis=1))

    def levels(self, motion: PeriodicMotion, samples: int = LEVEL_SAMPLES) -> dict[str, float]:
        """Torque, contact shares and powers of the motion, from `samples` of the period.

        Returns
        -------
        dict
            ``torque_mean``, ``torque_rms`` (about the mean), ``torque_peak`` (largest distance to
            the mean), N m; ``contact_velocity`` m/s; ``stick_share``, ``open_share``: means over
            the period; ``stick_share_max``, ``open_share_max``; ``normal_force_rms`` N;
            ``friction_power``, ``damping_power``, ``belt_power`` W: means; ``power_imbalance``:
            power of the belt and of the loads that balance the base state, less that of friction
            and damping; relative to the larger of the damping power and the change of the first
            two against steady sliding; ``energy`` J.
        """
        y, w = self._observed(motion, samples)
        touching = self.system.touching
        forces = self.oscillator.forces
        assert isinstance(forces, ContactForces)
        rows = np.zeros((samples, len(layout.HISTORY)))
        powers = np.zeros((samples, 3))
        sampled_rows(forces.points, forces.law, y, w, rows, powers)
        torque, force = rows[:, layout.TORQUE], rows[:, layout.NORMAL_FORCE]
        friction, belt, loads = powers.mean(axis=0).tolist()
        damping = self._damping_power(motion)
        scale = max(abs(damping), abs(belt + loads - self._steady_power))
        return {
            "torque_mean": float(torque.mean()),
            "torque_rms": float(torque.std()),
            "torque_peak": float(np.abs(torque - torque.mean()).max()),
            "normal_force_rms": float(force.std()),
            "contact_velocity": float(np.sqrt((w[:, touching] ** 2).sum(axis=2).max())),
            "stick_share": float(rows[:, layout.STICK].mean()),
            "stick_share_max": float(rows[:, layout.STICK].max()),
            "open_share": float(rows[:, layout.OPEN].mean()),
            "open_share_max": float(rows[:, layout.OPEN].max()),
            "friction_power": friction,
            "damping_power": damping,
            "belt_power": belt,
            "power_imbalance": (belt + loads - friction - damping) / scale if scale else 0.0,
            "energy": self.energy(motion),
        }

    def levels_of_states(self, q: np.ndarray, v: np.ndarray) -> dict[str, float]:
        """``torque_rms``, ``torque_peak``, ``contact_velocity`` of `levels`, of even samples.

        `q`, `v` (S, n) are displacements and velocities over a period.
        """
        B = self.oscillator.rows
        y, w = ((x @ B.T).reshape(len(x), *self.oscillator.B.shape[:2]) for x in (q, v))
        torque, touching = self._torque(y, w), self.system.touching
        return {
            "torque_rms": float(torque.std()),
            "torque_peak": float(np.abs(torque - torque.mean()).max()),
            "contact_velocity": float(np.sqrt((w[:, touching] ** 2).sum(axis=2).max())),
        }

    def torque(self, motion: PeriodicMotion, slip: float = 0.0) -> np.ndarray:
        """Torque (LEVEL_SAMPLES,) [N m] over the period, sliding faster by `slip` [m/s]."""
        y, w = self._observed(motion, LEVEL_SAMPLES)
        w[:, :, 1] += slip
        return self._torque(y, w)

    def _torque(self, y: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Torque (S,) [N m] at displacements y and velocities w (S, nc, 3)."""
        forces = self.oscillator.forces
        assert isinstance(forces, ContactForces)
        rows = np.zeros((len(y), len(layout.HISTORY)))
        sampled_rows(forces.points, forces.law, y, w, rows, np.zeros((len(y), 3)))
        torque: np.ndarray = rows[:, layout.TORQUE]
        return torque

    def torque_harmonics(self, motion: PeriodicMotion) -> np.ndarray:
        """Amplitudes (H,) [N m] of the torque's harmonics 1 to H."""
        spectrum = np.abs(np.fft.rfft(self.torque(motion))) * 2.0 / LEVEL_SAMPLES
        amplitudes: np.ndarray = spectrum[1 : motion.harmonics + 1]
        return amplitudes

    @cached_property
    def _steady_power(self) -> float:
        """Power of the belt in steady sliding, W."""
        points = self.point.points(self.system)
        return float(-points[layout.POINT_SPEED] @ points[layout.POINT_T1])

    def _damping_power(self, motion: PeriodicMotion) -> float:
        H, C = motion.harmonics, self.oscillator.C
        h = np.arange(1, H + 1)[:, None] * motion.omega
        parts = (h * motion.Q[1 : H + 1], h * motion.Q[H + 1 :])
        return float(sum(0.5 * np.einsum("hi,ij,hj->", v, C, v) for v in parts))

    def _observed(self, motion: PeriodicMotion, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and velocities (S, nc, 3) of the contact points over a period."""
        synthesis, slope = period_at(samples, motion.harmonics)
        B = self.oscillator.rows
        shape = (samples, *self.oscillator.B.shape[:2])
        observed = motion.Q @ B.T
        y, w = synthesis @ observed, motion.omega * (slope @ observed)
        return y.reshape(shape), w.reshape(shape)
