"""The project's one numba decorator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` with a disk cache, numpy's error model and full IEEE NaN handling.

    No ``fastmath``: several kernels detect NaN and inf to report a failed iteration.
    """
    compiled: F = numba.njit(cache=True, error_model="numpy")(function)
    return compiled
