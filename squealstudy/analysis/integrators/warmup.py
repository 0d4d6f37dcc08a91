"""Compile the kernels of the compared integrators into the cache, before workers start."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np

from squealstudy.analysis.integrators.integrate import INTEGRATORS, integrate
from squealstudy.analysis.transient.settings import TransientSettings
from squealstudy.analysis.transient.warmup import alone, smallest


def warm_integrators(names: Iterable[str] = tuple(INTEGRATORS)) -> float:
    """Compile what the integrators `names` need, or load it from the cache; seconds it took.

    One process at a time, as transient.warmup.

    Raises
    ------
    ParameterError
        An unknown name.
    """
    began = time.perf_counter()
    system, design = smallest()
    settings = TransientSettings(duration=2e-6, step=1e-6, save_every=1)
    with alone():
        for name in names:
            integrate(name, system, design, settings, np.zeros(1), np.zeros(1), {})
    return time.perf_counter() - began
