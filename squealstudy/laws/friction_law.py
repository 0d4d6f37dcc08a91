"""Friction: curves of the coefficient over sliding speed and pressure, and their regularisations.

With sliding velocity w (two tangential directions), s = |w|, e = w/s and pressure p, the traction
of a point is t = -f(s, p) e with the bound b = mu(s, p) max(p, 0): a curve of `laws/friction` gives
mu, a regularisation of `laws/regularisation` gives f up to the bound, from the slope k_t [N s/m3]
at zero sliding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, NamedTuple

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.laws.consistency import EQUAL_REL_TOLERANCE, Tried
from squealstudy.laws.registry import Law, LawDefinition, Registry, at_points, central_slope
from squealstudy.parameter import Parameter

Number = float | np.ndarray

# where curves are tried: no round numbers, at which kinks lie
TEST_SPEEDS = (0.0437, 0.517, 5.23)  # m/s
TEST_PRESSURES = (1.3e5, 1.1e6, 1.7e7)  # Pa
TEST_FRICTION = 0.43
OF_FRICTION = Parameter("friction", TEST_FRICTION, "", "", minimum=0.0)


class Friction(NamedTuple):
    """A friction coefficient and its derivatives: floats, or arrays with one for each point."""

    mu: Number
    by_speed: Number  # s/m
    by_pressure: Number  # 1/Pa

    def following(self, p: np.ndarray) -> Number:
        """Derivative mu + p dmu/dp of the traction mu p by the pressures p (nc,) [Pa]."""
        return self.mu + p * self.by_pressure if np.any(self.by_pressure) else self.mu


@dataclass(frozen=True, kw_only=True)
class FrictionCurveDefinition(LawDefinition):
    """A friction coefficient over sliding speed s [m/s] and pressure p [Pa]: functions of floats.

    Behind s and p they take the study's ``friction`` (the coefficient of fast sliding, which scales
    the curve: mu is 0 where it is 0) and the curve's parameters, in their order. Kernels compile
    `mu`, which may have plain arithmetic, branches and functions of `math` imported by name.

    Attributes
    ----------
    mu : (s, p, friction, ..) -> mu, dmu/ds [s/m], dmu/dp [1/Pa]
    pressure_dependent : bool
        Whether mu depends on p; False saves time.
    constant : (..) -> bool, or None
        Whether values of the parameters make mu equal to ``friction`` everywhere; None if no values
        do.
    slopes : (s, p, friction, ..) -> sequence of (slope of mu, of dmu/ds, of dmu/dp), or None
        Derivatives by s, p, friction and every parameter; None for central differences.
    """

    registry: ClassVar[Registry[Any]] = Registry("friction law")
    compiled = ("mu",)

    mu: Callable[..., tuple[float, float, float]]
    pressure_dependent: bool = True
    constant: Callable[..., bool] | None = None
    slopes: Callable[..., Sequence[tuple[float, float, float]]] | None = None

    @cached_property
    def _tried(self) -> Tried:
        names = ("s", "p", "friction", *(p.name for p in self.parameters))
        return Tried(self.name, self.mu, names, ("mu", "dmu/ds", "dmu/dp"))

    def expect_consistent(self) -> None:
        """`expect_consistent_at` some speeds and pressures, with the parameters' defaults."""
        values = [p.default for p in self.parameters]
        for s, p in product(TEST_SPEEDS, TEST_PRESSURES):
            self.expect_consistent_at(s, p, TEST_FRICTION, values)

    def expect_consistent_at(
        self, s: float, p: float, friction: float, values: Sequence[float]
    ) -> None:
        """ModelError where the curve's functions contradict each other.

        They are tried at a speed s [m/s], a pressure p [Pa] and values of the parameters: slopes
        against differences, mu at a friction of 0, and whether mu is constant where it should be.
        """
        mu, arguments = self._tried, (s, p, friction, *values)
        coefficient, by_speed, by_pressure = mu(*arguments)
        where = f"at s = {s:g} m/s, p = {p:g} Pa"
        mu.expect_slope(f"dmu/ds {where}", by_speed, arguments, 0)
        mu.expect_slope(f"dmu/dp {where}", by_pressure, arguments, 1, TEST_PRESSURES[0])
        if by_pressure and not self.pressure_dependent:
            raise mu.error(f"dmu/dp is {by_pressure:g} {where}, expected pressure_dependent")
        if mu(s, p, 0.0, *values)[0]:
            raise mu.error(f"expected mu to be 0 {where} with a friction of 0")
        if self.constant is not None and self.constant(*values):
            text = f"is {coefficient:g} {where}, where it is constant {friction:g} is expected"
            mu.expect_same(coefficient, friction, EQUAL_REL_TOLERANCE, text)
        if self.slopes is not None:
            known = (OF_FRICTION, *self.parameters)
            mu.expect_slopes(self.slopes, arguments, known, TEST_PRESSURES[0])


@dataclass(frozen=True, kw_only=True)
class Regularisation(LawDefinition):
    """Friction f(s) near zero sliding, from a slope k_t at s = 0 to a bound b: functions of floats.

    Attributes
    ----------
    resistance : (k_t, b, s) -> f / s
        k_t at s = 0, and 0 where b <= 0; without branches, so that loops over points vectorise.
    slope : (k_t, b, s) -> [N s/m3]
        Slope of the straight line by which a point that is about to stick is solved.
    partials : (k_t, b, s) -> f, df/ds, df/db
        Friction and its derivatives, for b > 0 and s > 0.
    saturation : float
        Value of k_t s / b from which f is equal to b.
    """

    registry: ClassVar[Registry[Any]] = Registry("regularisation of friction")
    compiled = ("resistance", "slope", "partials")

    resistance: Callable[[float, float, float], float]
    slope: Callable[[float, float, float], float]
    partials: Callable[[float, float, float], tuple[float, float, float]]
    saturation: float


DEFAULT_CURVE = "exponential_fall"  # the curve of models without a choice
FRICTION_CURVES: Registry[FrictionCurveDefinition] = FrictionCurveDefinition.registry
REGULARISATIONS: Registry[Regularisation] = Regularisation.registry


class FrictionCurve(Law[FrictionCurveDefinition]):
    """A friction curve with values of its parameters."""

    registry = FRICTION_CURVES
    title = "friction law {}"

    @property
    def constant(self) -> bool:
        """Whether mu is equal to the study's friction everywhere."""
        constant = self.definition.constant
        return constant is not None and bool(constant(*self.parameters))

    @property
    def pressure_dependent(self) -> bool:
        """Whether mu depends on the pressure."""
        return self.definition.pressure_dependent and not self.constant

    def at(self, friction: float, s: Number, p: np.ndarray) -> Friction:
        """Coefficient at sliding speeds s [m/s], a number or (n,), and pressures p (n,) [Pa].

        The result has floats for all points together where mu is constant, or s is a number and mu
        does not depend on pressure; else arrays (n,).
        """
        mu = self.definition.mu
        if self.constant:
            return Friction(float(friction), 0.0, 0.0)
        if not self.pressure_dependent:
            p = np.zeros(1)
            if not np.ndim(s):
                return Friction(*mu(float(s), 0.0, float(friction), *self.parameters))
        return Friction(*at_points(mu, 3, s, p, friction, *self.parameters))

    def expect_consistent(self, friction: float, speed: float, pressures: Sequence[float]) -> None:
        """Try the curve at a speed [m/s] and pressures [Pa]; ModelError at a contradiction."""
        for p in pressures:
            self.definition.expect_consistent_at(speed, p, friction, self.parameters)

    def at_rest(self, friction: float, p: np.ndarray) -> Number:
        """Static coefficient, at zero speed and pressures p (n,) [Pa]: a float or (n,)."""
        return self.at(friction, 0.0, p).mu

    def slopes(self, friction: float, s: Number, p: np.ndarray) -> np.ndarray:
        """Derivatives (k, 3, 1 or n) of mu, dmu/ds and dmu/dp.

        They are by s, by p, by friction and by each of the curve's parameters in turn. If the curve
        does not give them, they are central differences, exact to about 1e-9.
        """
        pressures = p if self.definition.pressure_dependent else np.zeros(1)
        return curve_slopes(self.definition, s, pressures, (float(friction), *self.parameters))


def curve_slopes(
    law: FrictionCurveDefinition, s: Number, p: np.ndarray, values: Sequence[Number]
) -> np.ndarray:
    """`FrictionCurve.slopes`; `values`, friction and the parameters, are numbers or (n,)."""
    count = 2 + len(values)
    if law.slopes is not None:
        slopes = law.slopes
        rows = at_points(lambda *x: np.ravel(slopes(*x)), 3 * count, s, p, *values)
        return rows.reshape(count, 3, *rows.shape[1:] or (1,))
    found = []
    for number in range(count):
        arguments: list[Number] = [s, p, *values]
        base_value, size, start = arguments[number], 0.0, 0.0
        if np.ndim(base_value):  # all points move together
            size = float(np.abs(base_value).max(initial=0.0))
        else:
            start, base_value = float(base_value), 0.0

        before, after = arguments[:number], arguments[number + 1 :]

        def moved(
            x: float, base: Number = base_value, a: list[Number] = before, b: list[Number] = after
        ) -> np.ndarray:
            return at_points(law.mu, 3, *a, base + x, *b)

        found.append(central_slope(moved, start, size))
    return np.array(found)


@dataclass(frozen=True)
class FrictionLaw:
    """Friction of a motion in time: coefficient, curve and regularisation.

    Parameters
    ----------
    friction : float
        Coefficient of fast sliding, not negative.
    k_t : float
        Slope of friction at zero sliding, N s/m3.
    curve : FrictionCurve
    regularisation : str
        Name of a registered regularisation: ``regularised`` (kinked), ``smooth`` (tanh).

    Raises
    ------
    ModelError
        Unknown regularisation, or values that are not finite or of the wrong sign.
    """

    friction: float
    k_t: float
    curve: FrictionCurve = field(default_factory=lambda: friction_curve())
    regularisation: str = "regularised"

    def __post_init__(self) -> None:
        REGULARISATIONS[self.regularisation]
        values = (self.friction, self.k_t)
        if not (np.isfinite(values).all() and self.friction >= 0 and self.k_t > 0):
            raise ModelError(f"friction law needs friction >= 0 and k_t > 0, got {values}")

    @property
    def saturation(self) -> float:
        """k_t s over the bound, from which friction is equal to the bound."""
        return REGULARISATIONS[self.regularisation].saturation


def friction_curve(kind: str = DEFAULT_CURVE, **parameters: float) -> FrictionCurve:
    """`FrictionCurve.named`; by default the curve that falls with speed."""
    return FrictionCurve.named(kind, **parameters)
