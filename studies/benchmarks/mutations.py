"""Small changes of a source file, each of which should make a test fail.

Left out are docstrings, texts, annotations, imports, decorators and what is raised.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

OPERATORS: dict[type, tuple[type, ...]] = {
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.FloorDiv: (ast.Mult,),
    ast.Mod: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
PAIRS = (("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("any", "all"))
PAIRS += (("real", "imag"), ("sin", "cos"), ("zeros", "ones"), ("floor", "ceil"))
NAMES = dict(PAIRS) | {b: a for a, b in PAIRS}
REMOVED = (ast.AugAssign, ast.Raise, ast.Continue, ast.Break, ast.Delete)


@dataclass(frozen=True)
class Mutant:
    """One change: bytes `start` to `end` of a file become `new`."""

    file: str  # from the project's folder
    line: int
    statement: int  # line where the statement of `line` begins
    called: bool  # in a function: what stands outside is run by whoever imports the file first
    start: int
    end: int
    new: bytes
    text: str

    @property
    def place(self) -> str:
        return f"{self.file}:{self.line}"

    def applied(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.new + source[self.end :]


def mutants_of(path: Path, root: Path) -> list[Mutant]:
    """All changes of a file, in the order of its lines."""
    source = path.read_bytes()
    begins = [0]
    for line in source.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))
    found = []
    for node, (statement, called), new in _changes(ast.parse(source)):
        start = begins[node.lineno - 1] + node.col_offset
        end = begins[node.end_lineno - 1] + node.end_col_offset
        old = " ".join(source[start:end].decode().split())
        text = new if isinstance(node, ast.expr) else new.strip()
        written = f"({new})" if isinstance(node, ast.expr) else new
        file = str(path.relative_to(root))
        shown = f"{old[:60]}  ->  {text[:60]}"
        found.append(
            Mutant(file, node.lineno, statement, called, start, end, written.encode(), shown)
        )
    return sorted(found, key=lambda m: (m.start, m.end, m.new))


def _changes(tree: ast.AST) -> Iterator[tuple[ast.AST, tuple[int, bool], str]]:
    """Nodes, where they stand, and what may stand in their place."""
    for node, place in _counted(tree, (1, False)):
        for new in (*_other_expressions(node), *_other_statements(node)):
            yield node, place, new


def _counted(node: ast.AST, place: tuple[int, bool]) -> Iterator[tuple[ast.AST, tuple[int, bool]]]:
    """The nodes whose change could make a difference to a number or a decision.

    With the line where the statement begins, and whether it is in a function.
    """
    statement, called = place
    if isinstance(node, ast.stmt):
        statement = node.lineno
    yield node, (statement, called)
    left_out = {"annotation", "returns", "decorator_list", "type_params", "exc", "cause", "msg"}
    for name, value in ast.iter_fields(node):
        within = called or (name == "body" and isinstance(node, ast.FunctionDef | ast.Lambda))
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and name not in left_out and not _is_text(child):
                yield from _counted(child, (statement, within))


def _is_text(node: ast.AST) -> bool:
    if isinstance(node, ast.Call) and ast.unparse(node.func) in ("warnings.warn", "TypeVar"):
        return True
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True  # a docstring
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        return True
    return isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom)


def _other_expressions(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.BinOp():
            for other in OPERATORS.get(type(node.op), ()):
                yield ast.unparse(ast.BinOp(node.left, other(), node.right))
        case ast.BoolOp():
            (other,) = OPERATORS[type(node.op)]
            yield ast.unparse(ast.BoolOp(other(), node.values))
        case ast.Compare():
            for k, operator in enumerate(node.ops):
                for other in OPERATORS[type(operator)]:
                    ops = [*node.ops[:k], other(), *node.ops[k + 1 :]]
                    yield ast.unparse(ast.Compare(node.left, ops, node.comparators))
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert()):
            yield ast.unparse(node.operand)
        case ast.Constant(value=bool()):
            yield str(not node.value)
        case ast.Constant(value=int() | float() | complex()):
            yield repr(node.value + 1)
            if node.value != 0:
                yield "0"
        case ast.IfExp():
            yield ast.unparse(ast.IfExp(node.test, node.orelse, node.body))
        case ast.Attribute(ctx=ast.Load()) if node.attr in NAMES:
            yield ast.unparse(ast.Attribute(node.value, NAMES[node.attr], node.ctx))
        case ast.Name(ctx=ast.Load()) if node.id in NAMES:
            yield NAMES[node.id]


def _other_statements(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.AugAssign() if type(node.op) in OPERATORS:
            for other in OPERATORS[type(node.op)]:
                yield ast.unparse(ast.AugAssign(node.target, other(), node.value))
        case ast.Return(value=ast.expr()):
            yield "return None"
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]) | ast.Expr():
            yield "pass"
    if isinstance(node, REMOVED):
        yield "pass"
