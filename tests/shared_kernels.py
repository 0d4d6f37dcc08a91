"""Marks of tests whose kernels no others need, and take half a minute to compile: one day of ten.

All tests with one of these marks run on the same day.
"""

from __future__ import annotations

import pytest

IN_SINGLE_PRECISION = pytest.mark.full_size("kernels in single precision")
OF_TRACED_ITERATIONS = pytest.mark.full_size("kernel of traced iterations")
OF_CASES = {  # of method_stability, by the beginning of their names
    "fixed_jacobian": OF_TRACED_ITERATIONS,
    "storage": IN_SINGLE_PRECISION,
}


def marks_of_case(name: str) -> list[pytest.MarkDecorator]:
    """The mark of a case of method_stability, or of its map; none of most."""
    return [mark for case, mark in OF_CASES.items() if name.startswith(case)]
