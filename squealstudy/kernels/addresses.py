"""Calls of compiled functions by their addresses, which kernels find in rows of laws."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

NUMBER, ROW, COUNT = types.float64, types.CPointer(types.float64), types.int64
NOTHING, PAIR, TRIPLE = types.void, types.UniTuple(NUMBER, 2), types.UniTuple(NUMBER, 3)
PLAIN: dict[float, Callable[..., Any]] = {}  # functions by address where nothing is compiled


def _expected(argument_type: types.Type) -> types.Type:
    """The type of an argument as functions have it: of an array its entries alone."""
    if isinstance(argument_type, types.Array):
        if (argument_type.dtype, argument_type.ndim, argument_type.layout) == (NUMBER, 1, "C"):
            return ROW
    elif isinstance(argument_type, types.Float):
        return NUMBER
    elif isinstance(argument_type, types.Integer):
        return COUNT
    raise TypingError(f"no function of a law takes {argument_type}")


def _caller(result: types.Type, count: int, *attributes: str) -> Callable[..., Any]:
    """(address, count arguments) -> result of the function at an address, a whole float."""

    def typed(typing_context: Any, address: types.Type, *arguments: types.Type) -> Any:  # noqa: ARG001
        expected = [_expected(found) for found in arguments]

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            given = zip(values[1:], signature.args[1:], expected, strict=True)
            parts = [
                context.make_array(found)(context, builder, value).data
                if kind is ROW
                else context.cast(builder, value, found, kind)
                for value, found, kind in given
            ]
            kinds = [context.get_value_type(kind) for kind in expected]
            function = ir.FunctionType(context.get_value_type(result), kinds)
            place = builder.fptosi(values[0], ir.IntType(64))
            pointer = builder.inttoptr(place, function.as_pointer())
            return builder.call(pointer, parts, attrs=("nounwind", *attributes))

        return result(address, *arguments), generate

    # each argument by a name: a tuple of them would count references to arrays
    names = ["typing_context", "address", *(f"argument_{i}" for i in range(count))]
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters = [inspect.Parameter(name, kind) for name in names]
    typed.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return intrinsic(typed)


def _called_plainly(address: float, *arguments: Any) -> Any:
    return PLAIN[address](*arguments)


CALLS = {  # by what they return and of how many arguments
    name: _called_plainly if numba.config.DISABLE_JIT else _caller(result, count, *attributes)
    for name, result, count, *attributes in (
        ("call_contact_at", PAIR, 2, "readonly"),
        ("call_potential", NUMBER, 2, "readonly"),
        ("call_pressures", NOTHING, 6),
        ("call_mean_pressures", NOTHING, 7),
        ("call_mu_at", TRIPLE, 3, "readonly"),
        ("call_resistance", NUMBER, 4, "readonly"),
        ("call_slope", NUMBER, 4, "readonly"),
        ("call_partials", TRIPLE, 4, "readonly"),
        ("call_frictions", NOTHING, 10),
    )
}
