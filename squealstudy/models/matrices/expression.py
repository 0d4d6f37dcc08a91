"""Evaluates expressions of parameters in study and model files, without executing them as Python.

Python's own parser makes the syntax tree. Only the nodes listed here are accepted, so that a text
can compute a number and nothing else.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from keyword import iskeyword
from typing import Any

import numpy as np

from squealstudy.errors import ModelError

# takes values of the parameters, returns the value; with floats it raises the errors of Python's
# floats
Evaluation = Callable[[Mapping[str, Any]], Any]

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
ARRAY_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
    "abs": np.abs,
    "min": lambda *parts: np.minimum.reduce(np.broadcast_arrays(*parts)),
    "max": lambda *parts: np.maximum.reduce(np.broadcast_arrays(*parts)),
}
WITH_SEVERAL_ARGUMENTS = ("min", "max")  # functions of two and more arguments; all others have one
_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,  # real powers of floats: neither complex numbers nor endless integers
}

CONSTANTS = {"pi": math.pi, "e": math.e}
RESERVED = frozenset({*CONSTANTS, *FUNCTIONS})  # no parameter can have these names
WITH_UNIT = re.compile(r"\s*[-+]?\d[\d.]*(e[-+]?\d+)?\s+[A-Za-z]")  # a number and a unit after it
_WORD = re.compile(r"[A-Za-z_]\w*")
MAX_CHARACTERS, MAX_NESTING = 1000, 60
_REFUSED = {  # what messages call parts of Python that are not accepted
    ast.Attribute: "an attribute (a dot after a name)",
    ast.Subscript: "an index in square brackets",
    ast.Compare: "a comparison",
    ast.IfExp: "a condition",
    ast.BoolOp: "and/or",
    ast.Lambda: "a lambda",
    ast.NamedExpr: "an assignment",
    ast.JoinedStr: "text",
    ast.Tuple: "a tuple",
    ast.List: "a list",
    ast.Starred: "a star",
}


class ExpressionError(ModelError):
    """A text is no expression, or an expression has no finite value."""


@dataclass(frozen=True)
class Expression:
    """A number as a function of named parameters.

    Numbers, names, ``+ - * / **``, brackets, the constants pi and e, and the functions sin, cos,
    tan, asin, acos, atan, sqrt, exp, log (natural), log10, abs, min and max.

    Attributes
    ----------
    text : str
        The expression.

    Raises
    ------
    ExpressionError
        The text is no expression; the message has the position (character, from 1).
    """

    text: str

    def __post_init__(self) -> None:
        _check_text(self.text)
        object.__setattr__(self, "text", self.text.strip())
        _ = self._read

    @cached_property
    def _read(self) -> tuple[Evaluation, tuple[str, ...]]:
        """Function that evaluates the expression, and the parameters that it uses."""
        reader = _Reader(self.text, FUNCTIONS, _OPERATORS)
        return reader.node(self._tree, 0), tuple(reader.names)

    @cached_property
    def _of_arrays(self) -> Evaluation:
        """Function that evaluates the expression for arrays."""
        return _Reader(self.text, ARRAY_FUNCTIONS, _OPERATORS | {ast.Pow: np.power}).node(
            self._tree, 0
        )

    @property
    def _tree(self) -> ast.expr:
        """The syntax tree of the text; ExpressionError where Python cannot parse it."""
        try:
            tree = ast.parse(self.text, mode="eval")
        except SyntaxError as error:
            where = f" at character {error.offset}" if error.offset else ""
            unit = "; units are read in [parameters] alone" if WITH_UNIT.match(self.text) else ""
            raise ExpressionError(
                f"'{self.text}' is no expression: {error.msg}{where}{unit}"
            ) from None
        except (ValueError, RecursionError, MemoryError):  # beyond what Python's own parser takes
            raise ExpressionError("an expression nested too deeply") from None
        return tree.body

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters used, each once, in the order of their first use."""
        return self._read[1]

    def value(self, values: Mapping[str, float]) -> float:
        """Value of the expression at given values of its parameters.

        Raises
        ------
        ExpressionError
            There is no finite real value: division by zero, overflow, outside of a domain.
        """
        try:
            number = float(self._read[0](values))
        except ZeroDivisionError:
            reason = "division by zero"
        except OverflowError:
            reason = "the number is too large"
        except ValueError:
            reason = "a function or power outside its domain"
        else:
            if math.isfinite(number):
                return number
            reason = f"the result is {number}"
        values_text = ", ".join(f"{name} = {values[name]:g}" for name in self.names)
        raise ExpressionError(
            f"'{self.text}' has no value{values_text and f' at {values_text}'}: {reason}"
        )

    def of_arrays(self, values: Mapping[str, float | np.ndarray]) -> np.ndarray:
        """Values (m,) or () of the expression where parameters are arrays (m,) or numbers.

        Raises
        ------
        ExpressionError
            As in `value`, about the first entry without a value.
        """
        arrays = {name: np.asarray(values[name], dtype=float) for name in self.names}
        try:
            with np.errstate(all="ignore"):  # values that are not finite raise an error below
                evaluated = np.asarray(self._of_arrays(arrays), dtype=float)
        except (ArithmeticError, ValueError):  # constants alone, as in 1/0
            evaluated = np.asarray(np.nan)
        bad = np.flatnonzero(~np.isfinite(evaluated))
        if len(bad):
            at = {
                n: float(np.broadcast_to(v, evaluated.shape).flat[bad[0]])
                for n, v in arrays.items()
            }
            self.value(at)
            raise ExpressionError(f"'{self.text}' has no finite value")
        return evaluated


def _check_text(text: str) -> None:
    """Raise ExpressionError for a long text, other characters than ASCII, or a word of Python."""
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
    if not text.isascii() or not text.isprintable():
        raise ExpressionError(f"{text!r}: expected plain ASCII text in one line")
    for word in _WORD.finditer(text):
        if iskeyword(word[0]):
            position = f"character {word.start() + 1}"
            raise ExpressionError(f"'{text}', {position}: '{word[0]}' is a reserved word, no name")


class _Reader:
    """Converts the allowed nodes of Python's syntax tree to closures.

    Attributes
    ----------
    text : str
    functions : mapping of name -> callable
        Those of `FUNCTIONS`, of floats or of arrays.
    operators : mapping of syntax node -> callable
    names : dict of str -> None
        Parameters in the order of their first use.
    """

    def __init__(
        self,
        text: str,
        functions: Mapping[str, Callable[..., Any]],
        operators: Mapping[type[ast.operator], Callable[[Any, Any], Any]],
    ) -> None:
        self.text, self.functions, self.operators = text, functions, operators
        self.names: dict[str, None] = {}

    def node(self, tree: ast.expr, depth: int) -> Evaluation:
        """Function that evaluates a part of the tree; ExpressionError for a refused part."""
        if depth > MAX_NESTING:
            raise self._error(tree, f"nested more than {MAX_NESTING} deep")
        if isinstance(tree, ast.Constant):
            return _constant(self._number(tree))
        if isinstance(tree, ast.Name):
            return self._name(tree)
        if isinstance(tree, ast.Call):
            return self._call(tree, depth)
        if isinstance(tree, ast.BinOp) and type(tree.op) in self.operators:
            apply = self.operators[type(tree.op)]
            left_operand, right = self.node(tree.left, depth + 1), self.node(tree.right, depth + 1)
            return lambda values: apply(left_operand(values), right(values))
        if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.USub | ast.UAdd):
            operand = self.node(tree.operand, depth + 1)
            return operand if isinstance(tree.op, ast.UAdd) else lambda values: -operand(values)
        raise self._error(tree, f"{self._what(tree)} cannot be used")

    def _number(self, tree: ast.Constant) -> float:
        """A number of the expression as a float."""
        if isinstance(tree.value, bool) or not isinstance(tree.value, int | float):
            raise self._error(tree, f"{self._source(tree)} is no real number")
        try:
            number = float(tree.value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._error(tree, "a number too large")
        return number

    def _name(self, tree: ast.Name) -> Evaluation:
        if tree.id in CONSTANTS:
            return _constant(CONSTANTS[tree.id])
        if tree.id in FUNCTIONS:
            raise self._error(tree, f"the function '{tree.id}' needs its argument in brackets")
        self.names[tree.id] = None
        return operator.itemgetter(tree.id)

    def _call(self, tree: ast.Call, depth: int) -> Evaluation:
        """Function that evaluates the call of a function."""
        name = tree.func.id if isinstance(tree.func, ast.Name) else ""
        if name not in FUNCTIONS:
            what = f"'{name or self._source(tree.func)}' is no function"
            raise self._error(tree, f"{what}, expected one of {', '.join(FUNCTIONS)}")
        if tree.keywords:
            raise self._error(tree, f"'{name}' takes no named arguments")
        n_arguments, several = len(tree.args), name in WITH_SEVERAL_ARGUMENTS
        if n_arguments != 1 if not several else n_arguments < 2:
            expected = "two arguments or more" if several else "one argument"
            raise self._error(tree, f"'{name}' takes {expected}, got {n_arguments}")
        function, parts = self.functions[name], [self.node(part, depth + 1) for part in tree.args]
        return lambda values: function(*(part(values) for part in parts))

    def _what(self, tree: ast.expr) -> str:
        if isinstance(tree, ast.BinOp | ast.UnaryOp):
            return f"the operator of '{self._source(tree)}' (expected + - * / **)"
        return _REFUSED.get(type(tree), f"'{self._source(tree)}'")

    def _source(self, tree: ast.expr) -> str:
        return ast.get_source_segment(self.text, tree) or type(tree).__name__

    def _error(self, tree: ast.expr, message: str) -> ExpressionError:
        return ExpressionError(f"'{self.text}', character {tree.col_offset + 1}: {message}")


def _constant(value: float) -> Evaluation:
    return lambda _: value
