"""Unknowns and equations of a curve of periodic motions.

    u = (Z, omega / omega_0, log a, scaled parameter),    series of the coordinates q = a Z / s,

where s_i^2 = |K_ii| + omega_0^2 and the first harmonic of Z has unit norm. So a is the size of the
motion: near omega_0 its first harmonic has a mean energy of a^2 / 4 in J, kinetic and elastic.

The equations are the balance over a, which has the complex mode as its limit for a -> 0; that norm;
and a phase, <dZ_ref/dtheta, Z - Z_ref> = 0 with the last accepted motion Z_ref. The scaled
parameter is the added damping xi / omega_0, or a parameter of the design, from 0 to 1 over its
range.
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

# step of differences by the parameter, over its range; their error turns the tangent of the curve
PARAMETER_STEP = 1e-6
OSCILLATOR_CACHE_SIZE = 4  # number of parameter values whose balances are cached
LOG_SIZE, FREQUENCY = 0.05, 1e-3  # differences in log size and relative frequency of near motions


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic motion, or one that added damping makes periodic.

    Attributes
    ----------
    Q : ndarray (2 H + 1, n)
        Fourier series of its coordinates about the steady state.
    omega : float
        Angular frequency, rad/s.
    parameter : float
        What motions are followed along: the added damping [1/s], or a parameter of the design.
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
        """The motion with a change added to its series, frequency and parameter."""
        Q, omega = self.Q + change.Q, self.omega + change.omega
        return PeriodicMotion(Q, omega, self.parameter + change.parameter)

    def near(self, other: PeriodicMotion) -> bool:
        """Whether size and frequency of two motions are nearly the same."""
        distance = abs(np.log(self.size / other.size)) / LOG_SIZE
        return bool(max(distance, abs(self.omega / other.omega - 1.0) / FREQUENCY) < 1.0)

    @property
    def tail(self) -> float:
        """Norm of the highest harmonic over that of all harmonics but the mean."""
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
        Frequency omega_0 [rad/s] of the mode that the curve begins with.
    tolerance : float
        Largest scaled residual. Where it is more than `TOLERANCE`, as in a basis with a larger
        error, derivatives are in single precision.
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
        self._in_first = np.zeros(size)  # 1 at coordinates of the first harmonic
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
        """Unknowns (m + 3,) of a motion in all coordinates, with the equations' harmonics."""
        Z = self._start.lowered(with_harmonics(motion.Q, self.harmonics)) * self.scale
        a = float(np.linalg.norm(np.concatenate([Z[part] for part in self._parts[1]])))
        rest = [motion.omega / self.omega0, np.log(a), self.scaled(motion.parameter)]
        return np.concatenate([Z / a, rest])

    def motion(self, u: np.ndarray) -> PeriodicMotion:
        """The motion of u, in all coordinates."""
        z, omega, _ = self.unpack(u)
        return PeriodicMotion(self._start.lifted(z), omega, self.value(float(u[-1])))

    def accepted(self, u: np.ndarray) -> None:
        """Make the motion of u the reference of the phase equation."""
        turn = self._start.turned(u[:-3])
        self._phase, self._reference = turn / np.linalg.norm(turn), u[:-3].copy()

    # -- equations -------------------------------------------------------------------------------
    def forces(self, u: np.ndarray) -> LocalForces:
        """Samples of forces at u; the last ones are stored for the Jacobian after a line search."""
        if (at := u.tobytes()) != self._at_u:
            z, omega, _ = self.unpack(u)
            self._at_u, self._local = at, self.balance(u).sampled(z, omega)
        return self._local

    def residual(self, u: np.ndarray) -> np.ndarray:
        """All equations (m + 2,) at u (m + 3,)."""
        z, omega, _ = self.unpack(u)
        R = self.balance(u).imbalance(z, omega, self.added(u), self.forces(u))
        return scaled_residual(u, R, *self._closing)

    @np.errstate(over="ignore", invalid="ignore")  # `newton` refuses numbers that are not finite
    def jacobian(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual and its derivatives (m + 2, m + 3)."""
        z, omega, _ = self.unpack(u)
        precision = np.float32 if self.rough else np.float64
        balanced = self.balance(u).balanced(z, omega, self.added(u), self.forces(u), precision)
        slopes = balanced.J, balanced.by_omega, self._by_parameter(u, balanced)
        return scaled_jacobian(u, balanced.R, *slopes, self.omega0, *self._closing)

    @property
    def _closing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The scale of the coordinates and the vectors in the equations of size and phase, (m,)."""
        return self.scale, self._in_first, self._phase, self._reference


class BranchEquations(CycleEquations):
    """Equations of cycles along a parameter of the design.

    Parameters
    ----------
    oscillators : callable
        Returns the oscillator at a value of the parameter, about the steady state there.
    harmonics : int
    omega : float
        Frequency of a cycle on the branch, rad/s.
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
        self.rough = False  # the tangents that show a fold need an exact Jacobian

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
        """Balance at a scaled value of the parameter; the last few are stored."""
        if scaled not in self._balances:
            while len(self._balances) >= OSCILLATOR_CACHE_SIZE:
                del self._balances[next(iter(self._balances))]
            osc = self._oscillators(self.value(scaled))
            self._balances[scaled] = Balance(osc, self.harmonics, self._vectors)
        return self._balances[scaled]
