"""Other code paths of the same processor, by environment variables, and whether they are in effect.

    env $(python tests/code_paths.py generic nehalem baseline) python -m pytest

Round-off differs there as it does on another processor. Every process of such a run asserts that
each path that was asked for is in effect (`conftest.py`).
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable

import numba
import numpy as np
import scipy.linalg  # loads SciPy's BLAS  # noqa: F401
import threadpoolctl

try:
    from numpy._core import _multiarray_umath as umath
except ImportError:  # numpy 1
    from numpy.core import _multiarray_umath as umath

ASKED = "SQUEALSTUDY_CODE_PATHS"
THREADS = 4


def dispatched() -> list[str]:
    """Features that numpy chooses kernels by at run time, of those that this processor has."""
    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]


def environment(path: str) -> dict[str, str]:
    """The variable that asks for a code path."""
    return {
        "generic": {"NUMBA_CPU_NAME": "generic"},
        "nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
        "baseline": {"NPY_DISABLE_CPU_FEATURES": ",".join(dispatched())},
        "threads": {"OMP_NUM_THREADS": str(THREADS)},
    }[path]


def numba_is_generic() -> bool:
    """Whether compiled loops keep to the registers that every processor of this kind has."""

    @numba.njit(fastmath=True)
    def dot(a, b):
        total = 0.0
        for x, y in zip(a, b):  # noqa: B905  (numba has no strict)
            total += x * y
        return total

    assert dot(np.ones(3), np.ones(3)) == 3.0
    (assembly,) = dot.inspect_asm().values()
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return numba.config.CPU_NAME == "generic"
    return "xmm" in assembly and "ymm" not in assembly and "zmm" not in assembly


def openblas() -> list[dict[str, object]]:
    """Every OpenBLAS of this process, as threadpoolctl sees it."""
    return [x for x in threadpoolctl.threadpool_info() if x["internal_api"] == "openblas"]


def openblas_is_nehalem() -> bool:
    """Of numpy and of SciPy."""
    return {x["architecture"] for x in openblas()} == {"Nehalem"}


def numpy_is_baseline() -> bool:
    """Whether every feature named is switched off, and there is one."""
    names = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").split(",")
    return bool(umath.__cpu_dispatch__) and not dispatched() and names != [""]


def blas_had_threads() -> bool:
    """Whether BLAS began with as many threads as asked for; it takes no more than processors."""
    most = min(THREADS, len(os.sched_getaffinity(0)))
    return {x["num_threads"] for x in STARTED} == {most}


STARTED = openblas()  # before conftest.py limits them
IN_EFFECT: dict[str, Callable[[], bool]] = {
    "generic": numba_is_generic,
    "nehalem": openblas_is_nehalem,
    "baseline": numpy_is_baseline,
    "threads": blas_had_threads,
}


def missing() -> list[str]:
    """Paths that the environment asks for and that are not in effect in this process."""
    asked = os.environ.get(ASKED, "")
    return [path for path in asked.split(",") if path and not IN_EFFECT[path]()]


if __name__ == "__main__":
    asked = sys.argv[1:]
    values = {ASKED: ",".join(asked)}
    for path in asked:
        values |= environment(path)
    print(*(f"{name}={value}" for name, value in values.items()))  # noqa: T201
