"""``*PARAMETER`` of Abaqus: named numbers and texts, which replace ``<name>`` in lines."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.matrices.expression import RESERVED, Expression
from squealstudy.models.matrices.text import TextFile

KEYWORD = "PARAMETER"
ASSIGNMENT = re.compile(r"\s*([A-Za-z]\w*)\s*=\s*([^#]*?)\s*(?:#.*)?", re.ASCII)
QUOTED = re.compile(r"'([^']*)'|\"([^\"]*)\"")
USED = re.compile(r"<\s*([A-Za-z]\w*)\s*>", re.ASCII)


class Parameters:
    """Parameters that a deck has defined so far.

    Values are arithmetic expressions. No Python code of a file is executed.
    """

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._numbers: dict[str, float] = {}
        self._whole: set[str] = set()  # names of those that are integers
        self._copies: dict[int, tuple[TextFile, TextFile]] = {}  # files with values put in

    def define(self, line: Line) -> None:
        """Take a parameter from a line of ``*PARAMETER``; ModelError if it is no name = value."""
        if line.text.lstrip().startswith("#"):
            return
        read = ASSIGNMENT.fullmatch(line.text)
        if read is None or not read[2]:
            raise line.error("expected name = value of a parameter")
        name, text = read[1], read[2]
        if name in RESERVED:
            raise line.error(f"a parameter cannot have the name {name}, a constant or a function")
        quoted = QUOTED.fullmatch(text)
        if quoted is not None:
            self._texts[name] = quoted[1] or quoted[2] or ""
            self._numbers.pop(name, None)
            self._whole.discard(name)
            return
        try:
            expression = Expression(text)
            unknown = [n for n in expression.names if n not in self._numbers]
            if unknown:
                raise line.error(f"{name}: there is no number '{unknown[0]}' yet")
            self._check_divisions(line, text)
            number = expression.value({n: self._numbers[n] for n in expression.names})
        except ModelError as error:
            if str(line.file.path) in str(error):
                raise
            raise line.error(f"{name}: {error}") from None
        is_whole = number.is_integer() and self._is_whole(ast.parse(text, mode="eval").body)
        self._numbers[name] = number
        self._texts[name] = str(int(number)) if is_whole else repr(number)
        (self._whole.add if is_whole else self._whole.discard)(name)

    def _check_divisions(self, line: Line, text: str) -> None:
        """Raise ModelError about two integers whose quotient is none: versions of Abaqus differ."""
        for node in ast.walk(ast.parse(text, mode="eval")):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
                sides = (node.left, node.right)
                if not all(self._is_whole(side) for side in sides):
                    continue
                a, b = (self._value(ast.unparse(side)) for side in sides)
                if b and a % b:
                    raise line.error(
                        f"{ast.unparse(node)} divides integers, which versions of Abaqus "
                        "round down or not: expected a decimal point in one of them"
                    )

    def _value(self, text: str) -> float:
        expression = Expression(text)
        return expression.value({n: self._numbers[n] for n in expression.names})

    def _is_whole(self, node: ast.expr) -> bool:
        """Whether an expression of *PARAMETER has an integer as value."""
        if isinstance(node, ast.Constant):
            return isinstance(node.value, int)
        if isinstance(node, ast.Name):
            return node.id in self._whole
        if isinstance(node, ast.UnaryOp):
            return self._is_whole(node.operand)
        kinds = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
        if isinstance(node, ast.BinOp) and isinstance(node.op, kinds):
            return self._is_whole(node.left) and self._is_whole(node.right)
        return False

    def put_in(self, line: Line) -> Line:
        """The line with values in place of ``<name>``; ModelError about an undefined name."""
        if not self._texts or "<" not in line.text:
            return line
        text = line.text
        for name in dict.fromkeys(USED.findall(text)):
            if name not in self._texts:
                names = ", ".join(self._texts) or "none"
                raise line.error(f"there is no parameter <{name}> yet; there is {names}")
        text = USED.sub(lambda match: self._texts[match[1]], text)
        if text == line.text:
            return line
        _, copy = self._copies.setdefault(
            id(line.file), (line.file, TextFile(line.file.path, list(line.file.lines)))
        )
        copy.lines[line.place] = text
        return Line(copy, line.place)

    def check(self, parameters: Mapping[str, str], line: Line) -> None:
        """Raise ModelError where the keyword has parameters, such as TABLE."""
        for name in parameters:
            raise line.error(f"*PARAMETER, {name} is not supported: write its values")
