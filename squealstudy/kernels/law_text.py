"""The source of the kernels' choice among laws: a branch, and a loop over points, for each.

A law's functions are compiled as they stand in its file, but for `exp` of `math`, for which they
get `exponential`, which loops over points can vectorise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType
from typing import Any

import numpy as np

from squealstudy.kernels.jit import exact_kernel
from squealstudy.kernels.newmark_layout import (
    CONSTANT,
    LAW_CONTACT,
    LAW_CURVE,
    LAW_FIRST,
    LAW_MU,
    LAW_REGULARISATION,
    LAW_SLOPE,
)
from squealstudy.laws import ContactLawDefinition, FrictionCurveDefinition, Regularisation
from squealstudy.laws.registry import LawDefinition

HIGHEST, LOWEST = 200.0, -700.0  # exp(200) = 7e86 stays finite in every product that follows
PER_LN2 = 1.0 / math.log(2.0)
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # k LN2_HIGH is exact
C2, C3, C4, C5, C6, C7 = (1.0 / math.factorial(i) for i in range(2, 8))
C8, C9, C10, C11, C12, C13 = (1.0 / math.factorial(i) for i in range(8, 14))


def law_text(
    contact: Sequence[ContactLawDefinition],
    curves: Sequence[FrictionCurveDefinition],
    slopes: Sequence[Regularisation],
) -> str:
    """Text of a module that needs the names of `law_names`."""
    place = friction_place(contact)
    gap = [_row(LAW_FIRST, len(law.parameters)) for law in contact]
    mu = {c: f"curve_{c}_mu(s, p, {_row(place, _count(x))})" for c, x in enumerate(curves)}
    mu = {CONSTANT: f"law[{LAW_MU}], 0.0, 0.0"} | mu
    pressure = {c: f"contact_{c}_pressure(g, {row})" for c, row in enumerate(gap)}
    potential = {c: f"contact_{c}_potential(g, {row})" for c, row in enumerate(gap)}
    choices = [
        _choice("@kernel", "contact_at(law, g)", LAW_CONTACT, pressure, 2),
        _choice("@fast_kernel", "potential(law, g)", LAW_CONTACT, potential, 1),
        _choice("@kernel", "mu_at(law, s, p)", LAW_CURVE, mu, 3),
        *(
            _choice(
                kind,
                f"{name}(law, k_t, bound, s)",
                LAW_REGULARISATION,
                {r: f"slope_{r}_{name}(k_t, bound, s)" for r in range(len(slopes))},
                n_out,
            )
            for kind, name, n_out in (
                ("@fast_kernel", "resistance", 1),
                ("@fast_kernel", "slope", 1),
                ("@kernel", "partials", 3),
            )
        ),
    ]
    loops = {
        "pressures(law, gap, x, p, first, last)": [
            _pressure_loop(c, x) for c, x in enumerate(contact)
        ],
        "mean_pressures(law, gap, x, x0, p, first, last)": [
            _mean_loop(c, x) for c, x in enumerate(contact)
        ],
        "frictions(law, area, factor, w1, w2, p, t1, t2, first, last)": [
            f"    k_t = law[{LAW_SLOPE}]\n",
            *(
                _friction_loop(c, place, _count(x), r)
                for c, x in [(CONSTANT, None), *enumerate(curves)]
                for r in range(len(slopes))
            ),
        ],
    }
    looping = [f"@fast_kernel\ndef {head}:\n" + "".join(body) for head, body in loops.items()]
    return "\n\n".join(['"""Written by squealstudy.kernels.law_text."""\n', *choices, *looping])


def law_names(
    contact: Sequence[ContactLawDefinition],
    curves: Sequence[FrictionCurveDefinition],
    slopes: Sequence[Regularisation],
) -> dict[str, Any]:
    """The laws' functions, compiled, by the names that `law_text` calls them."""
    made: dict[Callable[..., Any], Any] = {math.exp: exponential}
    sorts: dict[str, Sequence[LawDefinition]]
    sorts = {"contact": contact, "curve": curves, "slope": slopes}
    names = {
        f"{sort}_{code}_{field}": compiled(function, made)
        for sort, laws in sorts.items()
        for code, law in enumerate(laws)
        for field, function in law.functions.items()
    }
    return names | {"NAN": math.nan}


def compiled(function: Callable[..., Any], made: dict[Callable[..., Any], Any]) -> Any:
    """A function of a law's file for kernels, with the functions that it calls."""
    if function not in made:
        assert isinstance(function, FunctionType)
        own = dict(function.__globals__)
        for name in function.__code__.co_names:
            called = own.get(name)
            if called is math.exp or isinstance(called, FunctionType):
                own[name] = compiled(called, made)
        copy = FunctionType(
            function.__code__, own, function.__name__, function.__defaults__, function.__closure__
        )
        made[function] = exact_kernel(copy)
    return made[function]


def friction_place(contact: Sequence[ContactLawDefinition]) -> int:
    """Place of friction in a row of laws, before the parameters of its curve."""
    return LAW_FIRST + max(len(law.parameters) for law in contact)


def _count(curve: FrictionCurveDefinition | None) -> int:
    return 0 if curve is None else 1 + len(curve.parameters)


def _row(first: int, count: int) -> str:
    """Values of a law's parameters in its row."""
    return ", ".join(f"law[{first + i}]" for i in range(count))


def _values(count: int) -> str:
    """The same in the variables of a loop."""
    return ", ".join(f"a{i}" for i in range(count))


def _choice(kind: str, head: str, place: int, results: Mapping[int, str], n_out: int) -> str:
    """A function that returns the result of the law whose code is in a place of its row."""
    lines = [f"{kind}\ndef {head}:"]
    lines += [f"    if law[{place}] == {c}:\n        return {r}" for c, r in results.items()]
    return "\n".join([*lines, "    return " + ", ".join(["NAN"] * n_out) + "\n"])


def _loop(condition: str, first: int, count: int, lines: Sequence[str]) -> str:
    """A loop over points with the values of a law in variables a0, a1, ..: rows may overlap."""
    values = [f"        a{i} = law[{first + i}]" for i in range(count)]
    body = [f"            {line}" for line in lines]
    head = [f"    if {condition}:", *values, "        for i in range(first, last):"]
    return "\n".join([*head, *body]) + "\n"


def _pressure_loop(code: int, law: ContactLawDefinition) -> str:
    count = len(law.parameters)
    line = f"p[i] = contact_{code}_pressure(gap[i] + x[i], {_values(count)})[0]"
    return _loop(f"law[{LAW_CONTACT}] == {code}", LAW_FIRST, count, [line])


def _mean_loop(code: int, law: ContactLawDefinition) -> str:
    """By the law's own mean, else by the difference of its potential where the gap changes much.

    The middle errs by the square of the relative change then, the difference by the round-off over
    it: both by some 1e-10 where they meet.
    """
    count, values = len(law.parameters), _values(len(law.parameters))
    lines = ["g, d = gap[i] + x[i], 2.0 * (x[i] - x0[i])"]
    if law.mean_pressure is not None:
        lines.append(f"p[i] = contact_{code}_mean_pressure(g, d, {values})")
    else:
        lines += [
            "if abs(d) <= 1e-5 * abs(g):",
            f"    p[i] = contact_{code}_pressure(g, {values})[0]",
            "else:",
            f"    U0 = contact_{code}_potential(g - 0.5 * d, {values})",
            f"    p[i] = (U0 - contact_{code}_potential(g + 0.5 * d, {values})) / d",
        ]
    return _loop(f"law[{LAW_CONTACT}] == {code}", LAW_FIRST, count, lines)


def _friction_loop(code: int, first: int, count: int, regularisation: int) -> str:
    mu = "mu" if code == CONSTANT else f"curve_{code}_mu(s, p[i], {_values(count)})[0]"
    lines = [
        "s = math_sqrt(w1[i] * w1[i] + w2[i] * w2[i])",
        f"bound = factor[i] * {mu} * p[i]",
        f"f = area[i] * slope_{regularisation}_resistance(k_t, bound, s)",
        "t1[i], t2[i] = -f * w1[i], -f * w2[i]",
    ]
    chosen = f"law[{LAW_CURVE}] == {code} and law[{LAW_REGULARISATION}] == {regularisation}"
    loop = _loop(chosen, first, count, lines)
    if code == CONSTANT:
        loop = loop.replace("        for i", f"        mu = law[{LAW_MU}]\n        for i", 1)
    return loop


@exact_kernel
def exponential(x: float) -> float:
    """exp(x) to two units in the last place; 0 below -700, exp(200) beyond 200; NaN stays NaN.

    exp(x) = 2^k exp(r) with |r| <= ln(2) / 2, where the Taylor series to r^13 is good to 4e-18.
    """
    z = HIGHEST if x > HIGHEST else x
    z = LOWEST if z < LOWEST else z
    k = np.rint(z * PER_LN2)
    r = (z - k * LN2_HIGH) - k * LN2_LOW
    y = (((((C13 * r + C12) * r + C11) * r + C10) * r + C9) * r + C8) * r + C7
    y = (((((y * r + C6) * r + C5) * r + C4) * r + C3) * r + C2) * r + 1.0
    power = k if k > LOWEST * 2.0 else LOWEST * 2.0  # NaN has no integer
    y = (y * r + 1.0) * np.int64((np.int64(power) + 1023) << 52).view(np.float64)
    return 0.0 if x < LOWEST else y
