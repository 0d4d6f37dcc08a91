"""Marks of tests whose kernels no others need, and take long to compile: one day of ten.

All tests with one of these marks run on the same day. Those that are marked `as_python` besides run
each day as well, the kernels as plain Python: motion/test_as_python.py.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

IN_SINGLE_PRECISION = pytest.mark.full_size("kernels in single precision")
OF_TRACED_ITERATIONS = pytest.mark.full_size("kernel of traced iterations")
OF_COMPARED_INTEGRATORS = pytest.mark.full_size("kernels of integrators that are compared")
OF_THE_HYBRID_MODEL = pytest.mark.full_size("kernels of the hybrid model")
COMPARED = (  # integrators with kernels of their own
    *("hht_alpha", "generalised_alpha", "discrete_gradient"),
    *("central_difference", "exponential_2", "exponential_3"),
)
OF_CASES = {  # of method_stability, by the beginning of their names
    "fixed_jacobian": OF_TRACED_ITERATIONS,
    "storage": IN_SINGLE_PRECISION,
    "explicit": OF_COMPARED_INTEGRATORS,
}


def marks_of_case(name: str) -> list[pytest.MarkDecorator]:
    """The mark of a case of method_stability, or of its map; none of most."""
    return [mark for case, mark in OF_CASES.items() if name.startswith(case)]


def by_integrator(names: Iterable[str], *more: Any, short: bool = False) -> list[Any]:
    """Parameters of a test, one a name; those of compared integrators have their mark.

    `short` marks them as what plain Python does soon.
    """
    marks = [OF_COMPARED_INTEGRATORS, *([pytest.mark.as_python] * short)]
    return [
        pytest.param(name, *more, marks=marks if name in COMPARED else [], id=name)
        for name in names
    ]
