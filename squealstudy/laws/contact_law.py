"""Contact laws, the pressure over the gap; each law is a file of `laws/contact`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import Any, ClassVar

import numpy as np

from squealstudy.laws.consistency import EQUAL_REL_TOLERANCE, SLOPE_REL_TOLERANCE, Tried, flat
from squealstudy.laws.registry import Law, LawDefinition, Registry, at_points, central_slope

MAX_EXPONENT = 200.0  # exp(200) = 7e86 stays finite in every product that follows
MAX_BISECTIONS = 200  # of a gap interval
TEST_GAPS_M = (-4.3e-6, -1.1e-6, -2.3e-7, 3.1e-7, 2.2e-6)  # m: where laws are tried
TEST_INTERVAL_M = 7.3e-7  # m: interval over which a mean pressure is tried there
MAX_GAP_M = 1e3  # m: modulus of a gap up to which a pressure is searched

Scalar = Callable[..., float]
Pair = Callable[..., tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class ContactLawDefinition(LawDefinition):
    """A contact law p(g) of the gap g [m], positive when open, as functions of one point.

    Every function takes the law's parameters behind its other arguments, in their order, as
    floats. Kernels compile the functions of one point (`pressure`, `potential`, `mean_pressure`):
    they may have plain arithmetic, branches and functions of `math` imported by name (``from math
    import exp``; kernels replace these by versions with which loops over points vectorise).
    Functions that are None are computed from the others, slower or less exactly. Parameters of the
    same name are shared by laws, and must be defined equally.

    Attributes
    ----------
    pressure : (g, ..) -> p [Pa], -dp/dg [Pa/m]
        Pressure and tangent; NaN for a NaN.
    potential : (g, ..) -> U [J/m2]
        Stored energy per area: the integral of p from g to an open gap.
    mean_pressure : (g, d, ..) -> [Pa]
        Mean pressure over the gaps from g - d/2 to g + d/2: the loss of U over this interval is d
        times the mean pressure.
    gap_at : (p, ..) -> g
        Gap at a pressure p > 0, from which static solutions start.
    gap_scale : (p, ..) -> [m]
        Change of gap that changes the pressure p by about its own size.
    closing_rate : (..) -> [1/m]
        Inverse of the closing over which the tangent grows by a factor e; None for laws without.
    evaluate : (g, ..) -> p, -dp/dg
        `pressure` for an array of gaps.
    slopes : (g, ..) -> sequence of (slope of pressure, slope of tangent)
        Derivatives at an array of gaps: by the gap, then by every parameter.
    pulls : bool
        Whether an open gap pulls, as of contact that is meant to stay closed.
    """

    registry: ClassVar[Registry[Any]] = Registry("contact law")
    compiled = ("pressure", "potential", "mean_pressure")

    pressure: Pair
    potential: Scalar
    mean_pressure: Scalar | None = None
    gap_at: Scalar | None = None
    gap_scale: Scalar | None = None
    closing_rate: Scalar | None = None
    evaluate: Callable[..., tuple[np.ndarray, np.ndarray]] | None = None
    slopes: Callable[..., Sequence[tuple[np.ndarray, np.ndarray]]] | None = None
    pulls: bool = False

    def expect_consistent(self) -> None:
        """`expect_consistent_at` some gaps, with the parameters' defaults."""
        values = [p.default for p in self.parameters]
        for g in TEST_GAPS_M:
            self.expect_consistent_at(g, values, TEST_INTERVAL_M)

    @cached_property
    def _tried(self) -> tuple[Tried, Tried]:
        names = ("g", *(p.name for p in self.parameters))
        return (
            Tried(self.name, self.pressure, names, ("p", "-dp/dg")),
            Tried(self.name, self.potential, names, ("U",)),
        )

    def expect_consistent_at(
        self, g: float, values: Sequence[float], width: float | None = None
    ) -> None:
        """ModelError where the law's functions contradict each other at a gap g [m].

        `values` are those of the parameters. The mean pressure is tried over an interval of `width`
        [m], by default half of ``|p|`` over the tangent.
        """
        (pressure, potential), where = self._tried, f"at g = {g:g} m"
        p, tangent = pressure(g, *values)
        scale = abs(p) / tangent if p and tangent > 0 else abs(g) or TEST_INTERVAL_M
        pressure.expect_slope(f"dp/dg {where}", -tangent, (g, *values), 0, scale)
        potential.expect_slope(f"-p, which is dU/dg, {where}", -p, (g, *values), 0, scale)
        names = tuple(p.name for p in self.parameters)
        if self.mean_pressure is not None:
            d = width or 0.5 * scale
            mean = Tried(self.name, self.mean_pressure, ("g", "d", *names), ("mean p",))
            found = mean(g, d, *values)[0]
            ends = [potential(g + side * d / 2, *values)[0] for side in (-1, 1)]
            expected = (ends[0] - ends[1]) / d
            text = f"is {found:g} {where}, the potential gives {expected:g} Pa"
            mean.expect_same(found, expected, SLOPE_REL_TOLERANCE, text)
        if self.gap_at is not None and p > 0:
            inverse = Tried(self.name, self.gap_at, ("p", *names), ("g",))
            back = pressure(inverse(p, *values)[0], *values)[0]
            text = f"gives a gap of {back:g} Pa for {p:g} Pa"
            inverse.expect_same(back, p, SLOPE_REL_TOLERANCE, text)
        if self.evaluate is not None:
            array = Tried(self.name, flat(_of_one(self.evaluate)), ("g", *names), ("p", "-dp/dg"))
            found_p, found_tangent = array(g, *values)
            array.expect_same(
                found_p, p, EQUAL_REL_TOLERANCE, f"p is {found_p:g} {where}, pressure gives {p:g}"
            )
            text = f"-dp/dg is {found_tangent:g} {where}, pressure gives {tangent:g}"
            array.expect_same(found_tangent, tangent, EQUAL_REL_TOLERANCE, text)
        if self.slopes is not None:
            pressure.expect_slopes(_of_one(self.slopes), (g, *values), self.parameters, scale)


def _of_one(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make of a function of an array of gaps one of a single gap."""

    @wraps(function)
    def of_one(g: float, *values: float) -> Any:
        return function(np.array([g]), *values)

    return of_one


CONTACT_LAWS: Registry[ContactLawDefinition] = ContactLawDefinition.registry


class ContactLaw(Law[ContactLawDefinition]):
    """A contact law with values of its parameters."""

    registry = CONTACT_LAWS
    title = "{} contact law"

    def evaluate(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pressure p(g) [Pa] and tangent -dp/dg [Pa/m] at gaps g (n,) [m]."""
        g, law = np.asarray(g, dtype=float), self.definition
        if law.evaluate is not None:
            return law.evaluate(g, *self.parameters)
        p, kappa = at_points(law.pressure, 2, g, *self.parameters)
        return p, kappa

    def slopes(self, g: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Derivatives of pressure and tangent at gaps g (n,): by the gap, then by each parameter.

        If the law does not give them, they are central differences, exact to about 1e-9.
        """
        law, values = self.definition, self.parameters
        if law.slopes is not None:
            return list(law.slopes(g, *values))
        size = float(np.abs(g).max(initial=0.0))
        found = [central_slope(lambda step: np.array(self.evaluate(g + step)), 0.0, size)]
        for name, value in zip(self.names, values, strict=True):

            def moved(x: float, name: str = name) -> np.ndarray:
                return np.array(self.with_value(name, x).evaluate(g))

            found.append(central_slope(moved, value))
        return [(dp, dkappa) for dp, dkappa in found]

    def expect_consistent(self, gaps: Sequence[float]) -> None:
        """Try the law at gaps [m]; ModelError where its functions contradict each other."""
        for g in gaps:
            self.definition.expect_consistent_at(g, self.parameters)

    def gap_at(self, p: float) -> float:
        """The gap [m] at which the pressure is p > 0 [Pa], from which static solutions start."""
        law = self.definition
        if law.gap_at is not None:
            return float(law.gap_at(p, *self.parameters))
        return self.searched_gap(p)

    def gap_scale(self, p: float) -> float:
        """Change of gap [m] that changes the pressure p [Pa] by about its own size."""
        law = self.definition
        if law.gap_scale is not None:
            return max(float(law.gap_scale(p, *self.parameters)), 1e-300)
        _, kappa = self.evaluate(np.array([self.gap_at(p)]))
        return max(p / float(kappa[0]), 1e-300)

    @property
    def closing_rate(self) -> float:
        """Inverse [1/m] of the closing over which the tangent grows e-fold; 0 if there is none."""
        rate = self.definition.closing_rate
        return 0.0 if rate is None else float(rate(*self.parameters))

    def searched_gap(self, p: float) -> float:
        """`gap_at` by bisection; the pressure must fall as the gap opens."""

        def presses(g: float) -> bool:
            return bool(self.evaluate(np.array([g]))[0][0] >= p)

        closed, opened = -1e-12, 1e-12
        while not presses(closed) and -closed < MAX_GAP_M:
            closed, opened = 2.0 * closed, closed
        while presses(opened) and opened < MAX_GAP_M:
            closed, opened = opened, 2.0 * abs(opened)
        for _ in range(MAX_BISECTIONS):
            middle = 0.5 * (closed + opened)
            closed, opened = (middle, opened) if presses(middle) else (closed, middle)
        return 0.5 * (closed + opened)


def contact_law(kind: str = "exponential", **parameters: float) -> ContactLaw:
    """`ContactLaw.named`; the exponential law by default."""
    return ContactLaw.named(kind, **parameters)
