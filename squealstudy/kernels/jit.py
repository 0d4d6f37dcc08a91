"""The project's numba decorators, and the cache of compiled kernels."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, TypeVar

import numba

from squealstudy.kernels.law_set import SOURCES
from squealstudy.paths import compiled_base

F = TypeVar("F", bound=Callable[..., Any])


def compiled_directory() -> Path:
    """Cache of compiled kernels, named by a hash of all sources of kernels and laws.

    numba recompiles a kernel when its own file changes, not when one that it calls does: a hash
    of them all never meets stale code, and works where the package cannot be written to.
    """
    digest = hashlib.sha256(repr(SOURCES).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return compiled_base() / digest.hexdigest()[:16]


numba.config.CACHE_DIR = str(compiled_directory())

REORDER = {"reassoc", "contract", "nsz", "arcp"}  # sums may be vectorised; NaN and inf keep meaning


def kernel(function: F) -> F:
    """Compile `function` with a disk cache, numpy's error model and full IEEE NaN handling.

    No ``fastmath``: several kernels detect NaN and inf to report a failed iteration.
    """
    return _compiled(function)


def entry_kernel(function: F) -> F:
    """Like `kernel`, for long runs: other threads of Python go on meanwhile."""
    return _compiled(function, nogil=True)


def fast_entry_kernel(function: F) -> F:
    """The same with `fast_kernel`'s freedom, for a kernel whose parts may have it."""
    return _compiled(function, REORDER, nogil=True)


def lean_entry_kernel(function: F) -> F:
    """Like `fast_entry_kernel`, for a kernel that makes no arrays and counts no references."""
    return _compiled(function, REORDER, nogil=True, _nrt=False)


# those below have no wrappers for Python, which would take most of the time to compile
def exact_kernel(function: F) -> F:
    """For functions that only other kernels call and whose order of operations must stay.

    Products and sums may be contracted to one rounding.
    """
    return _compiled(function, {"contract"}, no_cpython_wrapper=True)


def fast_kernel(function: F) -> F:
    """For functions that only other kernels call and whose sums may be reordered.

    The fast-math flags that assume finite values are left out: a NaN still arrives as NaN.
    References to arrays are not counted: each view of one would cost two atomic additions, most of
    a step of few degrees of freedom. Arrays cannot be made (`room_kernel`).
    """
    return _compiled(function, REORDER, no_cpython_wrapper=True, _nrt=False)


def hot_kernel(function: F) -> F:
    """Like `fast_kernel`, for what every evaluation or step does: always a part of its callers.

    A call would pass tuples of arrays as some 250 numbers on the stack, which was half of a step
    of few degrees of freedom.
    """
    return _compiled(function, REORDER, no_cpython_wrapper=True, _nrt=False, forceinline=True)


def room_kernel(function: F) -> F:
    """Like `fast_kernel`, for a function that makes arrays."""
    return _compiled(function, REORDER, no_cpython_wrapper=True)


def part_kernel(function: F) -> F:
    """Like `fast_kernel`, for a function of one caller, of which it becomes a part.

    Every function is optimised by itself, and again in each kernel that calls it.
    """
    return _compiled(function, REORDER, no_cpython_wrapper=True, inline="always", _nrt=False)


def _compiled(function: F, fastmath: Collection[str] = (), **options: bool | str) -> F:
    compiled: F = numba.njit(
        cache=True,
        error_model="numpy",
        fastmath=set(fastmath),
        no_cfunc_wrapper=True,
        **options,
    )(function)
    return compiled
