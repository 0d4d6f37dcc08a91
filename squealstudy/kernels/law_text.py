"""The source of the kernels' choice among laws: a branch, and a loop over points, for each.

A law's functions are compiled as they stand in its file, but for `exp` of `math`, for which they
get `exponential`, which loops over points can vectorise. Laws from outside are the last branch, a
call by an address of the row; the same functions, of one law alone, are what is called.
"""

from __future__ import annotations

import importlib.util
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from squealstudy.kernels import newmark_layout as at
from squealstudy.kernels.jit import exact_kernel
from squealstudy.laws import ContactLawDefinition, FrictionCurveDefinition, Regularisation
from squealstudy.laws.registry import LawDefinition

ContactLaws = Mapping[int, ContactLawDefinition]  # by their codes
Curves = Mapping[int, FrictionCurveDefinition | None]  # None for a constant coefficient
Slopes = Mapping[int, Regularisation]
# exp(200) = 7e86 stays finite in every product that follows
MAX_EXPONENT, MIN_EXPONENT = 200.0, -700.0
PER_LN2 = 1.0 / math.log(2.0)
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # k LN2_HIGH is exact
C2, C3, C4, C5, C6, C7 = (1.0 / math.factorial(i) for i in range(2, 8))
C8, C9, C10, C11, C12, C13 = (1.0 / math.factorial(i) for i in range(8, 14))


PLACES = {  # of addresses in a row of laws, by the names of the functions
    "contact_at": at.LAW_CONTACT_AT,
    "potential": at.LAW_POTENTIAL,
    "pressures": at.LAW_PRESSURES,
    "mean_pressures": at.LAW_MEAN_PRESSURES,
    "mu_at": at.LAW_MU_AT,
    "resistance": at.LAW_RESISTANCE,
    "slope": at.LAW_STICK_SLOPE,
    "partials": at.LAW_PARTIALS,
    "frictions": at.LAW_FRICTIONS,
}


def contact_text(laws: ContactLaws, first: int, outside: bool) -> list[str]:
    """Functions of contact for laws whose parameters begin at a place of the row.

    `outside` adds the call of a law from outside; all need the names of `law_names`.
    """
    rows = {code: _row(first, len(law.parameters)) for code, law in laws.items()}
    pressure = {c: f"contact_{c}_pressure(g, {row})" for c, row in rows.items()}
    potential = {c: f"contact_{c}_potential(g, {row})" for c, row in rows.items()}
    place, loops = at.LAW_CONTACT, [_pressure_loop(c, law, first) for c, law in laws.items()]
    means = [_mean_loop(c, law, first) for c, law in laws.items()]
    last = f"law[{place}] == {at.OUTSIDE}" if outside else ""
    return [
        _choice("@kernel", "contact_at(law, g)", place, pressure, 2, outside),
        _choice("@fast_kernel", "potential(law, g)", place, potential, 1, outside),
        _loops("pressures(law, gap, x, p, first, last)", loops, last),
        _loops("mean_pressures(law, gap, x, x0, p, first, last)", means, last),
    ]


def curve_text(curves: Curves, first: int, outside: bool) -> list[str]:
    """The same for friction coefficients."""
    mu = {c: f"curve_{c}_mu(s, p, {_row(first, _count(x))})" for c, x in curves.items() if x}
    if at.CONSTANT in curves:
        mu = {at.CONSTANT: f"law[{at.LAW_MU}], 0.0, 0.0"} | mu
    own = [_choice("@kernel", "package_mu_at(law, s, p)", at.LAW_CURVE, mu, 3, False)]
    all_laws = _choice("@kernel", "mu_at(law, s, p)", at.LAW_CURVE, mu, 3, outside)
    return [*(own if outside else []), all_laws]


def slope_text(slopes: Slopes, outside: bool) -> list[str]:
    """The same for regularisations."""
    sorts = (("@fast_kernel", "resistance", 1), ("@fast_kernel", "slope", 1))
    return [
        _choice(
            kind,
            f"{name}(law, k_t, bound, s)",
            at.LAW_REGULARISATION,
            {r: f"slope_{r}_{name}(k_t, bound, s)" for r in slopes},
            n_out,
            outside,
        )
        for kind, name, n_out in (*sorts, ("@kernel", "partials", 3))
    ]


def friction_text(curves: Curves, slopes: Slopes, first: int, outside: bool) -> list[str]:
    """The same for friction forces of all points, which need a curve and a regularisation."""
    loops = [_friction_loop(c, first, _count(x), r) for c, x in curves.items() for r in slopes]
    places = (at.LAW_CURVE, at.LAW_REGULARISATION)
    last = " or ".join(f"law[{place}] == {at.OUTSIDE}" for place in places) if outside else ""
    begin = f"    k_t = law[{at.LAW_SLOPE}]\n"
    head = "frictions(law, area, factor, w1, w2, p, t1, t2, first, last)"
    return [_loops(head, [begin, *loops], last)]


def law_names(contact: ContactLaws, curves: Curves, slopes: Slopes) -> dict[str, Any]:
    """The laws' functions, compiled, by the names that texts call them."""
    made: dict[Callable[..., Any], Any] = {math.exp: exponential}
    sorts: dict[str, Mapping[int, LawDefinition | None]]
    sorts = {"contact": contact, "curve": curves, "slope": slopes}
    names = {
        f"{sort}_{code}_{field}": compiled(function, made)
        for sort, laws in sorts.items()
        for code, law in laws.items()
        if law is not None
        for field, function in law.functions.items()
    }
    return names | {"NAN": math.nan, "math_sqrt": math.sqrt}


def law_module(path: Path, texts: Sequence[str], names: Mapping[str, Any]) -> ModuleType:
    """A module of such functions, written where it is not there yet."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        own = path.with_suffix(f".{os.getpid()}")
        head = '"""Written by squealstudy.kernels.law_text."""\n'
        own.write_text("\n\n".join([head, *texts]), encoding="utf-8")
        own.replace(path)
    spec = importlib.util.spec_from_file_location(f"squealstudy_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    vars(module).update(names)
    sys.modules[spec.name] = module  # where numba looks when it loads what was compiled
    spec.loader.exec_module(module)
    return module


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


def _count(curve: FrictionCurveDefinition | None) -> int:
    return 0 if curve is None else 1 + len(curve.parameters)


def _row(first: int, count: int) -> str:
    """Values of a law's parameters in its row."""
    return ", ".join(f"law[{first + i}]" for i in range(count))


def _values(count: int) -> str:
    """The same in the variables of a loop."""
    return ", ".join(f"a{i}" for i in range(count))


def _call(head: str) -> str:
    """Call of the function of that head at its address in the row."""
    name, _, arguments = head.partition("(")
    return f"call_{name}(law[{PLACES[name]}], {arguments}"


def _choice(
    kind: str, head: str, place: int, results: Mapping[int, str], n_out: int, outside: bool
) -> str:
    """A function that returns the result of the law whose code is in a place of its row."""
    lines = [f"{kind}\ndef {head}:"]
    all_results = dict(results) | ({at.OUTSIDE: _call(head)} if outside else {})
    lines += [f"    if law[{place}] == {c}:\n        return {r}" for c, r in all_results.items()]
    return "\n".join([*lines, "    return " + ", ".join(["NAN"] * n_out) + "\n"])


def _loops(head: str, loops: Sequence[str], outside: str) -> str:
    """A function of loops, with the condition of a call of a law from outside, if any."""
    call = f"    if {outside}:\n        {_call(head)}\n" if outside else ""
    return f"@fast_kernel\ndef {head}:\n" + "".join(loops) + call


def _loop(condition: str, first: int, count: int, lines: Sequence[str]) -> str:
    """A loop over points with the values of a law in variables a0, a1, ..: rows may overlap."""
    values = [f"        a{i} = law[{first + i}]" for i in range(count)]
    body = [f"            {line}" for line in lines]
    head = [f"    if {condition}:", *values, "        for i in range(first, last):"]
    return "\n".join([*head, *body]) + "\n"


def _pressure_loop(code: int, law: ContactLawDefinition, first: int) -> str:
    count = len(law.parameters)
    line = f"p[i] = contact_{code}_pressure(gap[i] + x[i], {_values(count)})[0]"
    return _loop(f"law[{at.LAW_CONTACT}] == {code}", first, count, [line])


def _mean_loop(code: int, law: ContactLawDefinition, first: int) -> str:
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
    return _loop(f"law[{at.LAW_CONTACT}] == {code}", first, count, lines)


def _friction_loop(code: int, first: int, count: int, regularisation: int) -> str:
    mu = "mu" if code == at.CONSTANT else f"curve_{code}_mu(s, p[i], {_values(count)})[0]"
    lines = [
        "s = math_sqrt(w1[i] * w1[i] + w2[i] * w2[i])",
        f"bound = factor[i] * {mu} * p[i]",
        f"f = area[i] * slope_{regularisation}_resistance(k_t, bound, s)",
        "t1[i], t2[i] = -f * w1[i], -f * w2[i]",
    ]
    chosen = f"law[{at.LAW_CURVE}] == {code} and law[{at.LAW_REGULARISATION}] == {regularisation}"
    loop = _loop(chosen, first, count, lines)
    if code == at.CONSTANT:
        loop = loop.replace("        for i", f"        mu = law[{at.LAW_MU}]\n        for i", 1)
    return loop


@exact_kernel
def exponential(x: float) -> float:
    """exp(x) to two units in the last place; 0 below -700, exp(200) beyond 200; NaN stays NaN.

    exp(x) = 2^k exp(r) with |r| <= ln(2) / 2, where the Taylor series to r^13 is good to 4e-18.
    """
    z = MAX_EXPONENT if x > MAX_EXPONENT else x
    z = MIN_EXPONENT if z < MIN_EXPONENT else z
    k = np.rint(z * PER_LN2)
    r = (z - k * LN2_HIGH) - k * LN2_LOW
    y = (((((C13 * r + C12) * r + C11) * r + C10) * r + C9) * r + C8) * r + C7
    y = (((((y * r + C6) * r + C5) * r + C4) * r + C3) * r + C2) * r + 1.0
    power = k if k > MIN_EXPONENT * 2.0 else MIN_EXPONENT * 2.0  # NaN has no integer
    y = (y * r + 1.0) * np.int64((np.int64(power) + 1023) << 52).view(np.float64)
    return 0.0 if x < MIN_EXPONENT else y
