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
    """Like `kernel`, for functions that only other kernels call and whose sums may be reordered.

    The fast-math flags that assume finite values are left out: a NaN still arrives as NaN. There
    are no wrappers for Python, which would be most of the time to compile (26 s against 11 s).
    """
    compiled: F = numba.njit(
        cache=True,
        error_model="numpy",
        fastmath=REORDER,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
    )(function)
    return compiled
