"""The generated brake at its smallest: a tenth of what the coarse one costs, and it squeals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from squealstudy.models.catalogue.disc_brake.solids import COARSE, DENSITIES, Interval

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


@contextmanager
def tiny_meshes(cache: Path) -> Iterator[pytest.MonkeyPatch]:
    """In place of the coarse ones in this process, with a cache that others do not read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SQUEALSTUDY_CACHE", str(cache))
        patch.setitem(DENSITIES, "coarse", TINY)
        yield patch
