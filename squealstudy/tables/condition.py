"""Conditions on columns of tables as text: comparisons of arithmetic, read without running it.

``DataFrame.eval`` calls any method that a text names, and some write files. Here Python's parser
makes the syntax tree, and only listed kinds of nodes are evaluated.
"""

from __future__ import annotations

import ast
import copy
import operator
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from keyword import iskeyword
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.wording import did_you_mean

# most characters of a condition, and of its beginning in messages
MAX_CONDITION_CHARACTERS, MAX_SHOWN_CHARACTERS = 1000, 80
BARE = "numbers are in SI units (kg, m, s, Pa, Hz; angles in deg), without a unit"
UNLIKE = f"text and numbers cannot be compared; {BARE}"
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    name: getattr(np, name) for name in ("abs", "sqrt", "exp", "log", "log10", "sin", "cos", "tan")
}
OPERATORS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.And: operator.and_,
    ast.Or: operator.or_,
    ast.USub: lambda _, value: -value,
    ast.UAdd: lambda _, value: +value,
    ast.Not: lambda _, value: ~value,
    ast.Invert: lambda _, value: ~value,
}
MARK = "\u03bc{}_"  # a name that stands for a column; no text that is read has such a letter
JOINTS = {"&": " and ", "|": " or "}
# a number and a word that is none of a condition's: a unit
_WITH_UNIT = re.compile(
    r"(?<![\w.])[0-9.]+(?:e[+-]?[0-9]+)?\s*(?!(?:and|or|not|in)\b)(?:[A-Za-z]+|%\s*$)"
)
_QUOTED = r"`[^`]*`|'[^']*'|\"[^\"]*\""


@dataclass(frozen=True)
class Condition:
    """One of the conditions that ``and`` joins in a text.

    Attributes
    ----------
    tree : ast.expr
        Syntax tree of this condition.
    text : str
        The whole text, for messages.
    marked : mapping of str -> str
        Columns by the names that replace them in the tree.
    """

    tree: ast.expr
    text: str
    marked: Mapping[str, str]

    @property
    def columns(self) -> set[str]:
        """Columns that it uses; names of functions are not among them."""
        nodes = list(ast.walk(self.tree))
        called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
        names = (n.id for n in nodes if isinstance(n, ast.Name) and id(n) not in called)
        return {self.marked.get(name, name) for name in names}

    @property
    def in_pandas(self) -> str:
        """The condition as `DataFrame.query` reads it: columns with dots in backticks."""
        tree = copy.deepcopy(self.tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in self.marked:
                node.id = f"`{self.marked[node.id]}`"
        return ast.unparse(tree)

    def holds(self, table: pd.DataFrame) -> np.ndarray:
        """Mask (n_rows,) of the rows of a table for which the condition holds.

        A comparison with a missing value is neither true nor false, nor is its negation: for such a
        row the condition holds only if its other parts decide so (Kleene's logic).

        Raises
        ------
        ResultsError
            A condition that is not made of comparisons of arithmetic on columns.
        """
        try:
            with np.errstate(all="ignore"):
                satisfied = self._value(self.tree, table)
        except (TypeError, ValueError, ArithmeticError, RecursionError) as error:
            raise _unusable(self.text, str(error)) from None
        if not (isinstance(satisfied, pd.Series) and pd.api.types.is_bool_dtype(satisfied)):
            raise ResultsError(
                f"query '{self.text}' is no condition: it gives no true or false a row"
            )
        return satisfied.fillna(False).to_numpy(bool)

    def _value(self, node: ast.AST, table: pd.DataFrame) -> Any:
        """Value of a node: a column, a number, a text or a list of those."""
        match node:
            case ast.Constant(value=bool() | str() as value):
                return value
            case ast.Constant(value=int() | float() as value):
                return np.float64(value)  # whose powers overflow at once
            case ast.Name(id=name):
                column = table[self.marked.get(name, name)]
                is_boolean = pd.api.types.infer_dtype(column, skipna=True) == "boolean"
                return column.astype("boolean") if is_boolean else column
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return [self._value(part, table) for part in parts]
            case ast.Call(func=ast.Name(id=name), args=[part], keywords=[]) if name in FUNCTIONS:
                return FUNCTIONS[name](_number(self._value(part, table)))
            case ast.UnaryOp(op=op, operand=part) if type(op) in OPERATORS:
                return OPERATORS[type(op)](None, _number(self._value(part, table)))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                sides = [self._value(left, table), self._value(right, table)]
                return OPERATORS[type(op)](*map(_number, sides))
            case ast.BoolOp(op=op, values=parts):
                return reduce(OPERATORS[type(op)], (self._value(part, table) for part in parts))
            case ast.Compare(left=left, ops=ops, comparators=rest):
                sides = [self._value(part, table) for part in (left, *rest)]
                pairs = zip(sides, ops, sides[1:], strict=False)
                return reduce(operator.and_, (_compared(*pair) for pair in pairs))
        source = ast.unparse(node)
        if any(letter in source for letter in self.marked):
            source = type(node).__name__
        raise TypeError(
            f"'{_shortened(source)}' is none of numbers, columns, text in quotes, comparisons, "
            f"arithmetic, and, or, not, in, {', '.join(FUNCTIONS)}"
        )


def conditions(text: str, column_names: Collection[str]) -> list[Condition]:
    """The conditions that ``and`` joins at the outermost level of a text.

    Parameters
    ----------
    text : str
        It may have columns, numbers, text in quotes, ``+ - * / // % **``, ``< <= > >= == !=``,
        ``and or not in`` (also ``& | ~``), brackets and a few functions. Columns with dots and such
        may be in backticks.
    column_names : collection of str
        Columns of the tables.

    Raises
    ------
    ResultsError
        A text that is no condition; an unknown column.
    """
    if len(text) > MAX_CONDITION_CHARACTERS:
        raise _unusable(
            text, f"expected at most {MAX_CONDITION_CHARACTERS} characters, got {len(text)}"
        )
    if not re.sub(_QUOTED, "", text).isascii():
        raise _unusable(text, "expected plain ASCII outside quotes")
    marked: dict[str, str] = {}

    def replaced(match: re.Match[str]) -> str:
        word = match[0]
        if word in JOINTS or word[0] in "'\"":
            return JOINTS.get(word, word)
        marked[mark := MARK.format(len(marked))] = word.strip("`")
        return mark

    odd = [c for c in map(str, column_names) if not c.isidentifier() or iskeyword(c)]
    names = [rf"(?<![\w.]){re.escape(c)}(?!\w)" for c in sorted(odd, key=len, reverse=True)]
    plain = re.sub("|".join([_QUOTED, *names, "[&|]"]), replaced, text)
    try:
        tree = ast.parse(plain.strip(), mode="eval").body
        parsed = [Condition(part, _shortened(text), marked) for part in _conjuncts(tree)]
        columns = set().union(*(condition.columns for condition in parsed))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = getattr(error, "msg", None) or "nested too deeply"
        if with_unit := _WITH_UNIT.search(re.sub(_QUOTED, "''", text)):
            reason = f"{reason} at '{_shortened(with_unit[0])}'; {BARE}"
        raise _unusable(text, reason) from None
    if unknown := [*_dotted(tree, marked), *sorted(columns - set(column_names))]:
        names = list(dict.fromkeys(map(str, column_names)))
        hint = did_you_mean(unknown[0], names) or f", expected {', '.join(names)}"
        raise ResultsError(
            f"query '{_shortened(text)}' names the unknown column '{_shortened(unknown[0])}'{hint}"
        )
    return parsed


def _dotted(tree: ast.expr, marked: Mapping[str, str]) -> Iterator[str]:
    """Names with dots that are no columns; columns with dots have been replaced by marks."""
    if isinstance(tree, ast.Attribute):
        name = ast.unparse(tree)
        if not any(mark in name for mark in marked):
            yield name
        return
    for part in ast.iter_child_nodes(tree):
        if isinstance(part, ast.expr):
            yield from _dotted(part, marked)


def _conjuncts(tree: ast.expr) -> list[ast.expr]:
    if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And):
        return [part for operand in tree.values for part in _conjuncts(operand)]  # noqa: PD011 - of a tree
    return [tree]


def _compared(left_operand: Any, op: ast.cmpop, right_operand: Any) -> Any:
    """A comparison of numbers with numbers, or text with text; TypeError for others."""
    if isinstance(op, ast.In | ast.NotIn):
        if not isinstance(left_operand, pd.Series) or not isinstance(right_operand, list):
            raise TypeError("expected a column before 'in' and a list in brackets after it")
        if any(_is_text(left_operand) != _is_text(member) for member in right_operand):
            raise TypeError(UNLIKE)
        satisfied = left_operand.isin(right_operand).astype("boolean").mask(left_operand.isna())
        return satisfied if isinstance(op, ast.In) else ~satisfied
    if (
        type(op) not in OPERATORS
        or isinstance(left_operand, list)
        or isinstance(right_operand, list)
    ):
        raise TypeError("a list stands after 'in' alone")
    if _is_text(left_operand) != _is_text(right_operand):
        raise TypeError(UNLIKE)
    satisfied = OPERATORS[type(op)](left_operand, right_operand)
    if not isinstance(satisfied, pd.Series):
        return satisfied
    return satisfied.astype("boolean").mask(pd.isna(left_operand) | pd.isna(right_operand))


def _number(value: Any) -> Any:
    """The value, where it can be computed with; TypeError for text and lists."""
    if isinstance(value, list) or _is_text(value):
        raise TypeError("text and lists have no arithmetic")
    return value


def _is_text(value: Any) -> bool:
    if isinstance(value, pd.Series):
        return not pd.api.types.is_numeric_dtype(value)  # which booleans are too
    return isinstance(value, str)


def _unusable(text: str, reason: str) -> ResultsError:
    return ResultsError(f"query '{_shortened(text)}' cannot be used: {reason}")


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 3] + "..."
