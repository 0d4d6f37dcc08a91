"""The project's numba decorators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

REORDER = {"reassoc", "contract", "nsz", "arcp"}  # sums may be vectorised; NaN and inf keep meaning


def kernel(function: F) -> F:
    """Compile `function` with a disk cache, numpy's error model and full IEEE NaN handling.

    No ``fastmath``: several kernels detect NaN and inf to report a failed iteration.
    """
    compiled: F = numba.njit(cache=True, error_model="numpy")(function)
    return compiled


def fast_kernel(function: F) -> F:
    """`kernel` whose sums may be reordered and contracted, so that they vectorise.

    The fast-math flags that assume finite values are left out: a NaN still arrives as NaN.
    """
    compiled: F = numba.njit(cache=True, error_model="numpy", fastmath=REORDER)(function)
    return compiled
