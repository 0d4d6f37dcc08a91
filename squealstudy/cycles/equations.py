"""Unknowns and equations of a curve of periodic motions.

    u = (Z, omega / omega_0, log a, scaled parameter),    series of the coordinates q = a Z / s,

with the first harmonic of Z of unit norm, so that a is its size: sqrt(2 a^2 / 2) of an energy in J.
Equations are the balance over a, which has the complex mode as its limit for a -> 0; that norm;
and the phase, <dZ_ref/dtheta, Z - Z_ref> = 0 with the last accepted motion. The scaled parameter is
the added damping xi / omega_0, or a parameter of the design from 0 to 1 over its range.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from squealstudy.cycles.balance import Balance, Balanced
from squealstudy.cycles.continuation import TOLERANCE
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.kernels.harmonic_balance import scaled_jacobian, scaled_residual

PARAMETER_STEP = 1e-6  # difference over the range: tangents turn by as much as it errs by
OSCILLATOR_CACHE_SIZE = 4  # oscillators
LOG_SIZE, FREQUENCY = 0.05, 1e-3  # by what motions in nearly one place differ at most; relative


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic motion, or one that added damping makes periodic.

    Attributes
    ----------
    Q : ndarray (2 H + 1, n)
        Its series about the steady state.
    omega : float
        rad/s.
    parameter : float
        Along which motions are followed: the added damping [1/s], or a parameter of the design.
    """

    Q: np.ndarray
    omega: float
    parameter: float = 0.0

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return (len(self.Q) - 1) // 2

    @cached_property
    def size(self) -> float:
        """Norm of the first harmonic."""
        return float(np.linalg.norm(self.Q[[1, self.harmonics + 1]]))

    def changed(self, change: PeriodicMotion) -> PeriodicMotion:
        """The motion with a change of all that it is."""
        Q, omega = self.Q + change.Q, self.omega + change.omega
        return PeriodicMotion(Q, omega, self.parameter + change.parameter)

    def near(self, other: PeriodicMotion) -> bool:
        """Whether two motions are nearly of one size and frequency."""
        distance = abs(np.log(self.size / other.size)) / LOG_SIZE
        return bool(max(distance, abs(self.omega / other.omega - 1.0) / FREQUENCY) < 1.0)

    @property
    def tail(self) -> float:
        """Share of the highest harmonic in the norm of all beyond the mean."""
        H = self.harmonics
        norm = float(np.linalg.norm(self.Q[1:]))
        return float(np.linalg.norm(self.Q[[H, 2 * H]])) / norm


class CycleEquations:
    """Equations of periodic motions along added damping.

    Parameters
    ----------
    osc : Oscillator
    harmonics : int
    omega : float
        omega_0 [rad/s], of the mode that the curve begins with.
    tolerance : float
        Of the scaled equations. Where it is that of a basis, which errs by more, derivatives are of
        single precision.
    vectors : sequence of ndarray (n, r_h), or None
        The basis of each harmonic; None for all coordinates.
    """

    def __init__(
        self,
        osc: Oscillator,
        harmonics: int,
        omega: float,
        tolerance: float = TOLERANCE,
        vectors: Sequence[np.ndarray] | None = None,
    ) -> None:
        self.harmonics, self.omega0, self.tolerance = harmonics, omega, tolerance
        self.rough = tolerance > TOLERANCE
        self._start = Balance(osc, harmonics, vectors)
        self._parts, size = self._start.parts, self._start.size
        self.scale = np.zeros(size)
        for K, parts in zip(self._start.K, self._parts, strict=True):
            for part in parts:
                self.scale[part] = np.sqrt(np.abs(np.diag(K)) + omega**2)
        self._in_first = np.zeros(size)  # 1 of the first harmonic
        for part in self._parts[1]:
            self._in_first[part] = 1.0
        self._phase, self._reference = np.zeros(size), np.zeros(size)
        self._at_u = b""
        self._local: LocalForces

    # -- the parameter ---------------------------------------------------------------------------
    def balance(self, u: np.ndarray) -> Balance:
        """The balance at u."""
        return self._start

    def added(self, u: np.ndarray) -> float:
        """Added damping xi at u, 1/s."""
        return float(u[-1]) * self.omega0

    def value(self, scaled: float) -> float:
        """Value of the parameter in its own unit, here 1/s."""
        return scaled * self.omega0

    def scaled(self, value: float) -> float:
        """Inverse of `value`."""
        return value / self.omega0

    def _by_parameter(self, u: np.ndarray, balanced: Balanced) -> np.ndarray:
        """Derivative of the balance (m,) by the scaled parameter."""
        return balanced.by_xi * self.omega0

    # -- unknowns --------------------------------------------------------------------------------
    def unpack(self, u: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Coordinates (m,), omega [rad/s] and size a of u."""
        a = float(np.exp(u[-2]))
        return a * u[:-3] / self.scale, float(u[-3]) * self.omega0, a

    def pack(self, motion: PeriodicMotion) -> np.ndarray:
        """Unknowns of a motion of all coordinates, with as many harmonics as the equations have."""
        Z = self._start.lowered(with_harmonics(motion.Q, self.harmonics)) * self.scale
        a = float(np.linalg.norm(np.concatenate([Z[part] for part in self._parts[1]])))
        rest = [motion.omega / self.omega0, np.log(a), self.scaled(motion.parameter)]
        return np.concatenate([Z / a, rest])

    def motion(self, u: np.ndarray) -> PeriodicMotion:
        """The motion of u, of all coordinates."""
        z, omega, _ = self.unpack(u)
        return PeriodicMotion(self._start.lifted(z), omega, self.value(float(u[-1])))

    def accepted(self, u: np.ndarray) -> None:
        """Count phases from the motion of u on."""
        turn = self._start.turned(u[:-3])
        self._phase, self._reference = turn / np.linalg.norm(turn), u[:-3].copy()

    # -- equations -------------------------------------------------------------------------------
    def forces(self, u: np.ndarray) -> LocalForces:
        """Samples of forces at u, kept: the next Jacobian begins where a line search ended."""
        if (at := u.tobytes()) != self._at_u:
            z, omega, _ = self.unpack(u)
            self._at_u, self._local = at, self.balance(u).sampled(z, omega)
        return self._local

    def residual(self, u: np.ndarray) -> np.ndarray:
        """All equations (m + 2,) at u (m + 3,)."""
        z, omega, _ = self.unpack(u)
        R = self.balance(u).imbalance(z, omega, self.added(u), self.forces(u))
        return scaled_residual(u, R, *self._closing)

    @np.errstate(over="ignore", invalid="ignore")  # what is not finite is found by Newton's method
    def jacobian(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual and its derivatives (m + 2, m + 3)."""
        z, omega, _ = self.unpack(u)
        precision = np.float32 if self.rough else np.float64
        balanced = self.balance(u).balanced(z, omega, self.added(u), self.forces(u), precision)
        slopes = balanced.J, balanced.by_omega, self._by_parameter(u, balanced)
        return scaled_jacobian(u, balanced.R, *slopes, self.omega0, *self._closing)

    @property
    def _closing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Scale of the coordinates, then what the equations of size and phase are made of."""
        return self.scale, self._in_first, self._phase, self._reference


class BranchEquations(CycleEquations):
    """Equations of cycles along a parameter of the design.

    Parameters
    ----------
    oscillators : callable
        Oscillator of a value of the parameter, about the steady state there.
    harmonics : int
    omega : float
        rad/s, of a cycle on the branch.
    bounds : (low, high)
        Range of the parameter; scaled 0 to 1.
    """

    def __init__(
        self,
        oscillators: Callable[[float], Oscillator],
        harmonics: int,
        omega: float,
        bounds: tuple[float, float],
        tolerance: float = TOLERANCE,
        vectors: Sequence[np.ndarray] | None = None,
    ) -> None:
        self._oscillators, self._bounds, self._vectors = oscillators, bounds, vectors
        self._balances: dict[float, Balance] = {}
        super().__init__(oscillators(bounds[0]), harmonics, omega, tolerance, vectors)
        self.rough = False  # folds are where the tangent turns

    def balance(self, u: np.ndarray) -> Balance:
        """The balance at the parameter's value."""
        return self._at(float(u[-1]))

    def added(self, u: np.ndarray) -> float:
        """No damping is added on a branch."""
        return 0.0

    def value(self, scaled: float) -> float:
        """Value of the parameter in its own unit."""
        low, high = self._bounds
        return low + scaled * (high - low)

    def scaled(self, value: float) -> float:
        """Inverse of `value`."""
        low, high = self._bounds
        return (value - low) / (high - low)

    def _by_parameter(self, u: np.ndarray, balanced: Balanced) -> np.ndarray:
        z, omega, _ = self.unpack(u)
        ahead = self._at(float(u[-1]) + PARAMETER_STEP).imbalance(z, omega, 0.0)
        slope: np.ndarray = (ahead - balanced.R) / PARAMETER_STEP
        return slope

    def _at(self, scaled: float) -> Balance:
        """Balance at a scaled value; the last ones are kept."""
        if scaled not in self._balances:
            while len(self._balances) >= OSCILLATOR_CACHE_SIZE:
                del self._balances[next(iter(self._balances))]
            osc = self._oscillators(self.value(scaled))
            self._balances[scaled] = Balance(osc, self.harmonics, self._vectors)
        return self._balances[scaled]
