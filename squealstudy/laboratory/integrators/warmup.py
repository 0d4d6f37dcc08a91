"""Compile the kernels of the compared integrators into the cache, before workers start."""

from __future__ import annotations

import time
from collections.abc import Iterable

from squealstudy.motion.integrator import integrator, integrators
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.warmup import alone, smallest


def warm_integrators(names: Iterable[str] | None = None) -> float:
    """Compile what integrators need, all by default, or load it from the cache; seconds it took.

    One process at a time, as transient.warmup.

    Raises
    ------
    ParameterError
        An unknown name.
    """
    began = time.perf_counter()
    system, design = smallest()
    with alone():
        for name in integrators() if names is None else names:
            settings = MotionSettings(2e-6, 1e-6, save_every=1, integrator=integrator(name))
            simulate(system, [design], settings)
    return time.perf_counter() - began
