"""Findings of design points as arrays with a leading axis, and their statuses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.mechanics.failures import reason

OK = "ok"
ResultT = TypeVar("ResultT")


def statuses(findings: Sequence[object]) -> np.ndarray:
    """``ok`` of each finding, or why there is none: (m,) of str."""
    return np.array([reason(x)[0] if isinstance(x, Exception) else OK for x in findings], object)


def messages(findings: Sequence[object]) -> np.ndarray:
    """Message of each failure: (m,) of str, empty where there is none."""
    return np.array([reason(x)[1] if isinstance(x, Exception) else "" for x in findings], object)


def stacked(
    findings: Sequence[ResultT | Exception],
    take: Callable[[ResultT], np.ndarray],
    single: bool,
    ragged: bool = False,
    nothing_of: tuple[int, ...] = (),
) -> np.ndarray:
    """An array of each finding, one after the other: (m, ...); without the axis where `single`.

    Those of failures are NaN (of whole numbers -1). `ragged` ones may differ in their last axis:
    they are filled up with NaN. `nothing_of` is the shape of each where all have failed.

    Raises
    ------
    SquealstudyError
        Shapes that differ, of structures of other sizes.
    """
    arrays = [None if isinstance(x, Exception) else np.asarray(take(x)) for x in findings]
    if single:
        assert arrays[0] is not None
        return arrays[0]
    solved = [a for a in arrays if a is not None]
    if not solved:
        return np.full((len(findings), *nothing_of), np.nan)
    shapes = {a.shape[:-1] if ragged else a.shape for a in solved}
    if len(shapes) > 1:
        raise SquealstudyError(
            "design points of these structures have arrays of other sizes: take them one by one, "
            "[point.linear for point in system]"
        )
    shape = solved[0].shape
    if ragged:
        shape = (*shape[:-1], max(a.shape[-1] for a in solved))
    kind = np.result_type(*solved)
    nothing = -1 if np.issubdtype(kind, np.integer) else np.nan
    filled = np.full((len(findings), *shape), nothing, dtype=kind)
    for number, array in enumerate(arrays):
        if array is not None:
            entries = (number, *(slice(size) for size in array.shape))
            filled[entries] = array  # type: ignore[index]
    return filled


def may_be_wrong(error: float) -> str:
    """Message for a point whose worst root has this relative error."""
    return f"a mode may be wrong by {error:.1e} of its frequency"
