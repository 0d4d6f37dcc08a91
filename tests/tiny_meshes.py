"""The generated brake at its smallest: a tenth of what the coarse one costs, and it squeals."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import SHARED

from squealstudy.engine import cache, mode_shapes, reduced
from squealstudy.kinds.complex_modes import full_order_check, problems
from squealstudy.kinds.design import in_time
from squealstudy.kinds.transient import batch
from squealstudy.mechanics import structures
from squealstudy.models.catalogue.disc_brake.solids import COARSE, DENSITIES, Density, Interval

IN_MEMORY = (  # by the key of a structure, which does not know whose meshes are the coarse ones
    *(cache.prepared_any, cache.prepared_model, cache._gaps),
    *(reduced._loaded, batch.shared_reference, in_time.vibrations),
)

CELL = Interval()
TINY = replace(  # a cell between breaks
    COARSE,
    around=12,
    disc_r=(CELL,) * 4,
    disc_z=(CELL,) * 3,
    pad_r=(CELL,),
    pad_theta=(CELL,) * 5,
    pad_z=(CELL,) * 2,
    caliper_r=(CELL,) * 3,
    caliper_z=(CELL,) * 3,
)
SMALL = replace(  # pads whose shortest modes are no mechanisms, and a disc without corners
    TINY, around=COARSE.around, pad_r=COARSE.pad_r, pad_theta=COARSE.pad_theta, pad_z=COARSE.pad_z
)


def tiny_cache() -> Path:
    """Of all files whose coarse meshes are the smallest."""
    return Path(os.environ[SHARED]) / "tiny-cache"


def forget_models() -> None:
    """What this process remembers of reductions, by keys."""
    for function in IN_MEMORY:
        function.cache_clear()
    for known in (
        problems._problems_by_key,
        full_order_check._built,
        full_order_check._stiffness_by_structure,
    ):
        known.clear()
    for known in (reduced._built, mode_shapes._last):
        known.clear()
    structures.forget()


@contextmanager
def tiny_meshes(folder: Path, density: Density = TINY) -> Iterator[pytest.MonkeyPatch]:
    """In place of the coarse ones in this process, with a cache that others do not read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SQUEALSTUDY_CACHE", str(folder))
        patch.setitem(DENSITIES, "coarse", density)
        forget_models()
        try:
            yield patch
        finally:
            forget_models()
