"""Operating points side by side: laws whose parameters have one value for each point."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES, FrictionCurve
from squealstudy.laws.contact_law import ContactLaw, ContactLawDefinition
from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.own_friction import NO_OWN_FRICTION, has_own, own_mu
from squealstudy.laws.registry import at_points
from squealstudy.laws.spring import evaluate_springs
from squealstudy.models.operating import FRICTION, PRESSURE, SLIDING_SPEED, OperatingPoint

OPERATING_NAMES = (
    FRICTION.name,
    PRESSURE.name,
    SLIDING_SPEED.name,
)  # parameters that belong to no law


@dataclass(frozen=True, eq=False)
class StackedFriction:
    """Coefficients and their derivatives (m, c) at the contact points of m operating points.

    As in `OperatingPoint.friction_at`, the coefficient and its slope by pressure are negative for
    sliding against T, and all are 0 where contact pulls.
    """

    mu: np.ndarray
    by_speed: np.ndarray
    by_pressure: np.ndarray

    def following(self, p: np.ndarray) -> np.ndarray:
        """Derivative mu + p dmu/dp of the traction by the pressures p (m, c)."""
        return self.mu + p * self.by_pressure if self.by_pressure.any() else self.mu


@dataclass(frozen=True, eq=False)
class StackedOperating:
    """m operating points of one contact law and one friction curve.

    Attributes
    ----------
    friction, pressure, sliding_speed : ndarray (m,)
        As in `OperatingPoint`; Pa and m/s.
    law : ContactLawDefinition
    law_values : tuple of ndarray (m, 1)
        Values of the law's parameters, in their order.
    curve : FrictionCurveDefinition
    curve_values : tuple of ndarray (m, 1)
        Values of the curve's parameters, in their order.
    """

    friction: np.ndarray
    pressure: np.ndarray
    sliding_speed: np.ndarray
    law: ContactLawDefinition
    law_values: tuple[np.ndarray, ...]
    curve: FrictionCurveDefinition
    curve_values: tuple[np.ndarray, ...]

    @staticmethod
    def of(
        law: str, curve: str, values: Mapping[str, np.ndarray | float], count: int
    ) -> StackedOperating:
        """Operating points from values by parameter name, each a number or an array (count,)."""

        def column(name: str, default: float) -> np.ndarray:
            return np.broadcast_to(np.asarray(values.get(name, default), dtype=float), count)

        of_law, of_curve = CONTACT_LAWS[law], FRICTION_CURVES[curve]
        return StackedOperating(
            friction=column("friction", 0.0),
            pressure=column("pressure", 1.0),
            sliding_speed=column("sliding_speed", 1.0),
            law=of_law,
            law_values=tuple(column(p.name, p.default)[:, None] for p in of_law.parameters),
            curve=of_curve,
            curve_values=tuple(column(p.name, p.default)[:, None] for p in of_curve.parameters),
        )

    def at(self, rows: np.ndarray) -> StackedOperating:
        """The operating points of some rows."""
        return StackedOperating(
            friction=self.friction[rows],
            pressure=self.pressure[rows],
            sliding_speed=self.sliding_speed[rows],
            law=self.law,
            law_values=tuple(column[rows] for column in self.law_values),
            curve=self.curve,
            curve_values=tuple(column[rows] for column in self.curve_values),
        )

    def law_at(self, row: int) -> ContactLaw:
        """The contact law of one operating point."""
        return ContactLaw(self.law.name, tuple(float(x[row, 0]) for x in self.law_values))

    def point_at(self, row: int) -> OperatingPoint:
        """One operating point."""
        values = tuple(float(x[row, 0]) for x in self.curve_values)
        return OperatingPoint(
            friction=float(self.friction[row]),
            brake_pressure=float(self.pressure[row]),
            sliding_speed=float(self.sliding_speed[row]),
            law=self.law_at(row),
            curve=FrictionCurve(self.curve.name, values),
        )

    def value(self, name: str) -> np.ndarray:
        """Values (m,) of a parameter; KeyError where operating points do not have it."""
        if name in OPERATING_NAMES:
            column: np.ndarray = getattr(self, name)
            return column
        for law, values in ((self.curve, self.curve_values), (self.law, self.law_values)):
            names = [p.name for p in law.parameters]
            if name in names:
                return values[names.index(name)][:, 0]
        raise KeyError(name)

    def with_value(self, name: str, value: np.ndarray) -> StackedOperating:
        """The points with other values (m,) of a parameter, in both laws if both have it."""
        changed: dict[str, Any] = {name: value} if name in OPERATING_NAMES else {}
        for field, law in (("law_values", self.law), ("curve_values", self.curve)):
            before = getattr(self, field)
            parameters_and_values = zip(law.parameters, before, strict=True)
            changed[field] = tuple(
                value[:, None] if p.name == name else x for p, x in parameters_and_values
            )
        return replace(self, **changed)

    def contact(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and tangent -dp/dg [Pa/m] at gaps g (m, c) [m]."""
        if self.law.in_package and self.law.evaluate is not None:
            p, kappa = self.law.evaluate(g, *self.law_values)
            return p, np.broadcast_to(kappa, g.shape)
        p, kappa = at_points(self.law.pressure, 2, g, *self.law_values)
        return p, kappa

    def at_points(self, g: np.ndarray, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`contact` at gaps (m, c), the last of which are those of springs (m or 1, ns, 5)."""
        if not (count := springs.shape[1]):
            return self.contact(g)
        first = g.shape[1] - count
        pairs = self.contact(g[:, :first]), evaluate_springs(g[:, first:], springs)
        p, kappa = (np.concatenate(parts, axis=1) for parts in zip(*pairs, strict=True))
        return p, kappa

    def gap_at(self, p: np.ndarray) -> np.ndarray:
        """Gaps (m,) [m] at which the pressures are p (m,) > 0 [Pa]."""
        if self.law.gap_at is None:
            return np.array([self.law_at(i).gap_at(float(x)) for i, x in enumerate(p)])
        values = (column[:, 0] for column in self.law_values)
        return _mapped(self.law.gap_at, p, *values)

    def gap_scale(self, p: np.ndarray) -> np.ndarray:
        """Changes of gap (m,) [m] that change the pressures p (m,) [Pa] by about their own size."""
        if self.law.gap_scale is None:
            return np.array([self.law_at(i).gap_scale(float(x)) for i, x in enumerate(p)])
        values = (column[:, 0] for column in self.law_values)
        return np.maximum(_mapped(self.law.gap_scale, p, *values), 1e-300)

    def rubbing(
        self, p: np.ndarray, speed_factor: np.ndarray, own_friction: np.ndarray = NO_OWN_FRICTION
    ) -> StackedFriction:
        """Friction at contact pressures p (m, c) of points with these factors (m or 1, c).

        `own_friction` (m or 1, c, k) is that of points which do not follow the study's friction.
        """
        curve, values = self.curve, self.curve_values
        mu = np.broadcast_to(self.friction[:, None], p.shape)
        nothing = np.zeros(p.shape)
        friction = StackedFriction(mu, nothing, nothing)
        if has_own(own_friction):
            speeds = np.abs(self.sliding_speed)[:, None] * speed_factor
            of_study = (self.friction[:, None], values)
            mus = own_mu(curve, of_study, own_friction, speeds, p)
            friction = StackedFriction(*(np.broadcast_to(x, p.shape) for x in mus))
        elif curve.constant is None or not np.all(curve.constant(*values)):
            speeds = np.abs(self.sliding_speed)[:, None] * speed_factor
            pressures = p if curve.pressure_dependent else 0.0
            arguments = (speeds, pressures, self.friction[:, None], *values)
            curve_values = at_points(curve.mu, 3, *arguments)
            friction = StackedFriction(*(np.broadcast_to(x, p.shape) for x in curve_values))
        if (pulling := p < 0.0).any():
            parts = (friction.mu, friction.by_speed, friction.by_pressure)
            friction = StackedFriction(*(np.where(pulling, 0.0, part) for part in parts))
        sign = np.copysign(1.0, self.sliding_speed)[:, None]
        if (sign < 0).any():
            if has_own(own_friction):
                sign = np.where(speed_factor == 0.0, 1.0, sign)
            return StackedFriction(
                sign * friction.mu, friction.by_speed, sign * friction.by_pressure
            )
        return friction


def _mapped(function: Callable[..., float], *arrays: np.ndarray) -> np.ndarray:
    """A function of floats at all entries of arrays (m,), in one call if it takes arrays."""
    try:
        mapped = np.asarray(function(*arrays), dtype=float)
    except (TypeError, ValueError):  # it calls `math`, or branches
        return np.asarray(at_points(function, 1, *arrays)[0])
    return np.broadcast_to(mapped, arrays[0].shape).copy()
