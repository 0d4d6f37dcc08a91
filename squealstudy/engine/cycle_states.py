"""Stores limit cycles as Fourier series, from which runs in time can begin.

Series are deviations from steady sliding in component-mode coordinates; their rows have the order
of `cycles/harmonics.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.array_files import read_arrays
from squealstudy.engine.final_states import expect_numbers
from squealstudy.engine.result_names import STATES
from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError


@dataclass(frozen=True, eq=False)
class CycleSeries:
    """A limit cycle as a Fourier series.

    Attributes
    ----------
    cycle_id : str
        ``<point_id>-<mode>-<number>``.
    prepared_key : str
        Cache key of the structure of its design point.
    Q : ndarray (2 H + 1, n)
        Fourier coefficients up to harmonic H.
    omega : float
        Angular frequency of the cycle, rad/s.
    """

    cycle_id: str
    prepared_key: str
    Q: np.ndarray
    omega: float

    @property
    def point_id(self) -> str:
        """Id of its design point."""
        return self.cycle_id.partition("-")[0]


def cycle_file(
    name: str, prepared_key: str, cycles: Mapping[str, tuple[np.ndarray, float]]
) -> dict[str, dict[str, Any]]:
    """The content of a file that holds cycles, by its path in a results directory.

    `cycles` are series (2 H + 1, n) with angular frequencies [rad/s], by their ids. `name` of the
    file is as long as the id of a design point.
    """
    content: dict[str, Any] = {f"series_{k}": Q for k, (Q, _) in enumerate(cycles.values())}
    content["cycle_id"] = np.array(list(cycles), dtype=str)
    content["omega"] = np.array([omega for _, omega in cycles.values()])
    return {f"{STATES}/{name}.npz": content | {"prepared_key": prepared_key}}


def stored_cycles(store: Store) -> Iterator[CycleSeries]:
    """Yield all cycles of a results directory; ResultsError where a file is damaged."""
    for name in store.names(STATES):
        yield from _read(store, name)


def stored_cycle(store: Store, cycle_id: str) -> CycleSeries:
    """The cycle with this id; ResultsError where there is none."""
    names = store.names(STATES)
    own_file = f"{STATES}/{cycle_id.partition('-')[0]}.npz"
    for name in sorted(names, key=lambda n: n != own_file):
        for series in _read(store, name):
            if series.cycle_id == cycle_id:
                return series
    raise ResultsError(f"{store.directory}: no cycle '{cycle_id}'")


def _read(store: Store, name: str) -> list[CycleSeries]:
    """Series of limit cycles from one file of results; ResultsError for a damaged file."""
    path = store.whole(name)
    try:
        arrays = read_arrays(path)
        ids, omega = np.atleast_1d(arrays["cycle_id"]), arrays["omega"]
        expect_numbers(omega, ids.shape)
        series = [arrays[f"series_{k}"] for k in range(len(ids))]
        for Q in series:
            expect_numbers(Q, (2 * (len(Q) // 2) + 1, Q.shape[1]))
        key = str(arrays["prepared_key"])
        return [
            CycleSeries(str(cycle_id), key, Q, frequency)
            for cycle_id, Q, frequency in zip(ids, series, omega.tolist(), strict=True)
        ]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise ResultsError(f"{path}: no series of limit cycles ({error})") from error
