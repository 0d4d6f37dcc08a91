"""Compile the time-integration kernels once, into the cache on disk, before workers start."""

from __future__ import annotations

import gc
import logging
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numba
import numpy as np

from squealstudy.kernels.jit import compiled_directory
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.machine.locks import lock
from squealstudy.machine.processes import starting_processes
from squealstudy.motion.integrator import Integrator
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

LOG = logging.getLogger("squealstudy")
_begun: list[subprocess.Popen[bytes]] = []


def begin_warming(single_storage: bool = False) -> None:
    """Start a process that compiles the kernels; `warm_kernels` then waits for it.

    Does nothing where there are compiled kernels already: a process takes longer to start than they
    take to load.
    """
    if _begun or _is_compiled():
        return
    end = "from squealstudy.machine.processes import end_with_input; end_with_input()"
    call = f"{end}; from {__name__} import warm_kernels; warm_kernels({single_storage})"
    command, nothing = [sys.executable, "-P", "-c", call], subprocess.DEVNULL
    with starting_processes():
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=nothing, stderr=nothing)
    _begun.append(process)


def warm_kernels(single_storage: bool = False) -> float:
    """Compile the kernel, or load it from the cache; returns the seconds it took.

    Parameters
    ----------
    single_storage : bool
        Compile it for an observation matrix in single precision, too.

    Notes
    -----
    Only one process compiles at a time: numba writes its files atomically, but two processes that
    compile for different types at once may both choose the same file name.
    """
    stored = (False, True) if single_storage else (False,)
    return warm(Newmark(single_storage=single) for single in stored)


def warm(methods: Iterable[Integrator]) -> float:
    """Compile the kernels that integrators need, as `warm_kernels` does; the seconds it took."""
    began = time.perf_counter()
    if _begun or not (numba.config.DISABLE_JIT or _is_compiled()):
        LOG.info("kernels of runs in time are compiled, once: a minute or two")
    while _begun:
        process = _begun.pop()
        process.wait()
        process.communicate()  # closes its input, whose end tells the process to end
    system, design = smallest_system()
    with alone(), uncollected():
        for method in methods:
            settings = MotionSettings(duration=2e-6, step=1e-6, save_every=1, integrator=method)
            simulate(system, [design], settings)
    return time.perf_counter() - began


def _is_compiled() -> bool:
    return any(Path(numba.config.CACHE_DIR).rglob("newmark_batch*.nbi"))


@contextmanager
def uncollected() -> Iterator[None]:
    """Switch garbage collection off: it takes a seventh of the time of compiling."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def alone() -> AbstractContextManager[None]:
    """Hold the lock of the compiled kernels, which is released where the process dies."""
    return lock(compiled_directory() / "warmup.lock")


def smallest_system() -> tuple[ModalSystem, MotionPoint]:
    """One mode under one sliding point."""
    ones, row = np.ones(1), np.ones((1, 1))
    system = ModalSystem(
        omega2=ones,
        N=row,
        T1=row,
        T2=row,
        area=ones,
        frictional=ones,
        radius=ones,
        gap=0 * ones,
        k_ref=ones,
        force=np.zeros((1, 3)),
        sensed=np.array([1]),
    )
    law = contact_law("exponential", p0=1.0, lam=1.0)
    return system, MotionPoint(contact=law, friction=FrictionLaw(0.5, 1.0), speed=1.0, c=ones)
