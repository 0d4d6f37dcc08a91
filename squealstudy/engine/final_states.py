"""Final states of runs in time: files of arrays, which anybody may have written."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from squealstudy.array_files import read_arrays


class FinalState(NamedTuple):
    """Deviation from steady sliding and velocity (n,), and of which model and representation."""

    q: np.ndarray
    v: np.ndarray
    prepared_key: str
    representation: str


def read_state(path: Path) -> FinalState:
    """The final state in a file; OSError, ValueError where it holds none."""
    arrays = read_arrays(path)
    try:
        q, v = arrays["q"], arrays["v"]
        texts = [str(arrays[name]) for name in ("prepared_key", "representation")]
    except KeyError as error:
        raise ValueError(f"it holds no {error}") from None
    expect_numbers(q, (len(q),) if q.ndim else ())
    expect_numbers(v, q.shape)
    return FinalState(q, v, *texts)


def expect_numbers(values: np.ndarray, shape: tuple[int, ...]) -> None:
    """Raise ValueError where an array is none of finite numbers of that shape, of some axes."""
    if not shape or values.shape != shape or values.dtype.kind != "f":
        raise ValueError(f"an array {values.shape} of {values.dtype}, expected numbers {shape}")
    if not np.isfinite(values).all():
        raise ValueError("an array with values that are no numbers")
