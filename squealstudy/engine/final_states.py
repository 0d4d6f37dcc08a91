"""Stores final states of runs in time, and checks them when read: anybody may have made them.

A design point has a file of its own, named by its id, or one row of the file of a batch.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from squealstudy.array_files import read_arrays
from squealstudy.engine.keys import HASH_DIGITS, content_hash
from squealstudy.engine.result_names import STATES
from squealstudy.engine.store import Store

POINT_ID = re.compile(rf"[0-9a-f]{{{HASH_DIGITS}}}")
IDS = "point_id"  # array with the id of each row in a file of several points

# by point id: deviation from steady sliding and velocity, each (n,)
States = Mapping[str, tuple[np.ndarray, np.ndarray]]


class FinalState(NamedTuple):
    """State of a model at the end of a run.

    Attributes
    ----------
    q, v : ndarray (n,)
        Deviation from steady sliding and velocity, in the coordinates of `representation`.
    prepared_key : str
        Cache key of the prepared model.
    representation : str
        Name of the representation that the run was computed in.
    """

    q: np.ndarray
    v: np.ndarray
    prepared_key: str
    representation: str


def state_files(
    states: States, prepared_key: str, representation: str, in_own_folder: bool
) -> dict[str, dict[str, Any]]:
    """Contents of files with final states of one model, by the files' paths.

    Each state has a file of its own if `in_own_folder`; otherwise all are in one.
    """
    model = {"prepared_key": prepared_key, "representation": representation}
    if in_own_folder or len(states) < 2:
        return {f"{STATES}/{i}.npz": {"q": q, "v": v, **model} for i, (q, v) in states.items()}
    q, v = (np.array(part) for part in zip(*states.values(), strict=True))
    name = f"{STATES}/{content_hash(sorted(states))}.npz"
    return {name: {IDS: np.array(list(states)), "q": q, "v": v, **model}}


def state_names(store: Store) -> dict[str, str]:
    """Names of the files with final states by the ids of their points, which are ascending."""
    names = store.names(STATES)
    every = {i: name for name in names for i in _points_of(store.directory / name)}
    return dict(sorted(every.items()))


def _points_of(path: Path) -> list[str]:
    """Ids of the design points whose states a file should hold.

    A file that has no list of ids gives its own name; if it is damaged, `read_state` reports that.
    """
    try:
        ids = read_arrays(path)[IDS].ravel().astype(str).tolist()
    except (OSError, ValueError, KeyError):
        return [path.stem]
    return [name for name in ids if POINT_ID.fullmatch(name)]


def read_state(path: Path, point_id: str = "") -> FinalState:
    """The final state of a point in a file; OSError or ValueError where the file holds none.

    A file of a single point is read whatever the id.
    """
    arrays = read_arrays(path)
    try:
        q, v = arrays["q"], arrays["v"]
        texts = [str(arrays[name]) for name in ("prepared_key", "representation")]
    except KeyError as error:
        raise ValueError(f"it holds no {error}") from None
    expect_numbers(q, q.shape if IDS in arrays and q.ndim == 2 else (len(q),) if q.ndim else ())
    expect_numbers(v, q.shape)
    if IDS in arrays:
        rows = np.flatnonzero(arrays[IDS].ravel() == point_id)
        if not (len(rows) and q.ndim == 2 and len(q) == arrays[IDS].size):
            raise ValueError(f"it holds no state of '{point_id}'")
        q, v = q[rows[0]], v[rows[0]]
    return FinalState(q, v, *texts)


def expect_numbers(values: np.ndarray, shape: tuple[int, ...]) -> None:
    """Raise ValueError unless an array has this shape, at least one axis, and finite floats."""
    if not shape or values.shape != shape or values.dtype.kind != "f":
        raise ValueError(f"an array {values.shape} of {values.dtype}, expected numbers {shape}")
    if not np.isfinite(values).all():
        raise ValueError("an array with values that are no numbers")
