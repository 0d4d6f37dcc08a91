"""Arithmetic of named numbers as a tree: evaluated by closures, differentiated by rules."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce

Values = Mapping[str, float]
Evaluation = Callable[[Values], float]


@dataclass(frozen=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True)
class Name:
    """A parameter."""

    name: str


@dataclass(frozen=True)
class Call:
    """A function of `FUNCTIONS` or an operator (``+ - * / **``, unary ``neg``) of sub-trees."""

    function: str
    arguments: tuple[Node, ...]


Node = Number | Name | Call
ZERO, ONE = Number(0.0), Number(1.0)

FUNCTIONS: dict[str, Callable[..., float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "log10": math.log10,
    "abs": abs,
    "min": min,
    "max": max,
}
SEVERAL = ("min", "max")  # functions of two and more arguments; all others have one
_INNER: dict[str, Callable[..., float]] = {  # what only derivatives need
    "sign": lambda x: math.copysign(1.0, x) if x else 0.0,
    "below": lambda a, b, x, y: x if a <= b else y,
}
_OPERATORS: dict[str, Callable[..., float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "**": math.pow,  # real powers of floats: neither complex numbers nor endless integers
    "neg": lambda a: -a,
}
_APPLIED = FUNCTIONS | _INNER | _OPERATORS


def names_of(node: Node) -> tuple[str, ...]:
    """Parameters of a tree, each once, in the order of their first use."""
    if isinstance(node, Name):
        return (node.name,)
    parts = node.arguments if isinstance(node, Call) else ()
    return tuple(dict.fromkeys(name for part in parts for name in names_of(part)))


def compiled(node: Node) -> Evaluation:
    """A closure that evaluates the tree; it raises what Python's floats raise."""
    if isinstance(node, Number):
        value = node.value
        return lambda _: value
    if isinstance(node, Name):
        name = node.name
        return lambda values: values[name]
    function, parts = _APPLIED[node.function], tuple(map(compiled, node.arguments))
    if len(parts) == 1:
        (only,) = parts
        return lambda values: function(only(values))
    if len(parts) == 2:
        first, second = parts
        return lambda values: function(first(values), second(values))
    return lambda values: function(*(part(values) for part in parts))


def derivative(node: Node, name: str) -> Node:
    """The tree of the derivative by a parameter.

    Of ``abs``, ``min`` and ``max`` that of the branch in force; at a kink, abs has slope 0 and min
    and max that of the first argument.
    """
    if isinstance(node, Number):
        return ZERO
    if isinstance(node, Name):
        return ONE if node.name == name else ZERO
    if name not in names_of(node):
        return ZERO
    if node.function in SEVERAL:
        return reduce(_chooser(node.function, name), node.arguments[1:], _pair(node, name))[1]
    slopes = tuple(derivative(part, name) for part in node.arguments)
    return _RULES[node.function](node, node.arguments, slopes)


def _pair(node: Call, name: str) -> tuple[Node, Node]:
    return node.arguments[0], derivative(node.arguments[0], name)


def _chooser(function: str, name: str) -> Callable[[tuple[Node, Node], Node], tuple[Node, Node]]:
    """One step of the fold of min or max: (value so far, its slope) with one more argument."""

    def step(so_far: tuple[Node, Node], more: Node) -> tuple[Node, Node]:
        value, slope = so_far
        first, second = (value, more) if function == "min" else (_neg(value), _neg(more))
        chosen = Call("below", (first, second, slope, derivative(more, name)))
        return Call(function, (value, more)), chosen

    return step


def _add(a: Node, b: Node) -> Node:
    if a == ZERO or b == ZERO:
        return b if a == ZERO else a
    return Call("+", (a, b))


def _neg(a: Node) -> Node:
    return Number(-a.value) if isinstance(a, Number) else Call("neg", (a,))


def _sub(a: Node, b: Node) -> Node:
    return a if b == ZERO else _neg(b) if a == ZERO else Call("-", (a, b))


def _mul(a: Node, b: Node) -> Node:
    if ZERO in (a, b):
        return ZERO
    return b if a == ONE else a if b == ONE else Call("*", (a, b))


def _div(a: Node, b: Node) -> Node:
    return ZERO if a == ZERO else a if b == ONE else Call("/", (a, b))


def _pow(a: Node, b: Node) -> Node:
    return a if b == ONE else ONE if b == ZERO else Call("**", (a, b))


def _power_rule(node: Call, parts: tuple[Node, ...], slopes: tuple[Node, ...]) -> Node:
    """Slope b a^(b-1) a' where b is constant (a may be negative), else a log a b' as well."""
    (a, b), (da, db) = parts, slopes
    lower = Number(b.value - 1.0) if isinstance(b, Number) else Call("-", (b, ONE))
    direct = _mul(_mul(b, _pow(a, lower)), da)
    return _add(direct, _mul(_mul(node, Call("log", (a,))), db) if db != ZERO else ZERO)


def _quotient_rule(node: Call, parts: tuple[Node, ...], slopes: tuple[Node, ...]) -> Node:
    return _div(_sub(slopes[0], _mul(node, slopes[1])), parts[1])


_Rule = Callable[[Call, tuple[Node, ...], tuple[Node, ...]], Node]
_SQUARE = Number(2.0)


def _one(outer: Callable[[Node, Node], Node]) -> _Rule:
    """Chain rule of a function of one argument: `outer(node, argument)` is its slope."""
    return lambda node, parts, slopes: _mul(outer(node, parts[0]), slopes[0])


_RULES: dict[str, _Rule] = {
    "+": lambda _, __, slopes: _add(*slopes),
    "-": lambda _, __, slopes: _sub(*slopes),
    "*": lambda _, p, s: _add(_mul(s[0], p[1]), _mul(p[0], s[1])),
    "/": _quotient_rule,
    "**": _power_rule,
    "neg": lambda _, __, slopes: _neg(slopes[0]),
    "sin": _one(lambda _, x: Call("cos", (x,))),
    "cos": _one(lambda _, x: _neg(Call("sin", (x,)))),
    "tan": _one(lambda f, _: _add(ONE, _pow(f, _SQUARE))),
    "asin": _one(lambda _, x: _div(ONE, Call("sqrt", (_sub(ONE, _pow(x, _SQUARE)),)))),
    "acos": _one(lambda _, x: _div(Number(-1.0), Call("sqrt", (_sub(ONE, _pow(x, _SQUARE)),)))),
    "atan": _one(lambda _, x: _div(ONE, _add(ONE, _pow(x, _SQUARE)))),
    "sqrt": _one(lambda f, _: _div(Number(0.5), f)),
    "exp": _one(lambda f, _: f),
    "log": _one(lambda _, x: _div(ONE, x)),
    "log10": _one(lambda _, x: _div(Number(1.0 / math.log(10.0)), x)),
    "abs": _one(lambda _, x: Call("sign", (x,))),
    "sign": _one(lambda _, __: ZERO),
    "below": lambda _, p, s: Call("below", (p[0], p[1], s[2], s[3])),
}
