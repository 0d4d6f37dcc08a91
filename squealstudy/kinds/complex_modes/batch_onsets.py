"""Onsets of a batch of small models, refined together: each iteration is one stacked solve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.kinds.complex_modes.study_tracks import Follower
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.tracking.lockstep import ManyModes, refine_onsets_together
from squealstudy.modes.tracking.onsets import Onset
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.stacked.modes import stacked_system


class Brackets(NamedTuple):
    """Crossings of the stability limit, each between two design points.

    Attributes
    ----------
    points : (ndarray (n,), ndarray (n,)) of int
        First and second design point of each crossing.
    places : (ndarray (n,), ndarray (n,)) of int
        Index of the mode among the oscillating ones of the first and of the second point.
    """

    points: tuple[np.ndarray, np.ndarray]
    places: tuple[np.ndarray, np.ndarray]

    def at(self, rows: np.ndarray) -> Brackets:
        """The crossings in these rows."""
        (a, b), (i, j) = self
        return Brackets((a[rows], b[rows]), (i[rows], j[rows]))


class BatchOnsets:
    """Refines crossings along a swept parameter of a plan that is solved in batches.

    Parameters
    ----------
    plan : Plan
    follower : Follower
    judged : Ragged
        Oscillating roots of all points as their stability is judged, rad/s.
    column : int
        Index of the parameter among the plan's coordinates.
    tolerance, precision : float
        Those of `refine_onsets_together`.
    """

    def __init__(
        self,
        plan: Plan,
        follower: Follower,
        judged: Ragged,
        column: int,
        tolerance: float,
        precision: float,
    ) -> None:
        self._plan, self._follower, self._judged = plan, follower, judged
        self._column, self._tolerance, self._precision = column, tolerance, precision

    def refine(self, brackets: Brackets) -> list[Onset | None]:
        """Onsets of brackets; None for a bracket that has to be refined by itself."""
        refined: list[Onset | None] = [None] * len(brackets.points[0])
        counts = [self._judged.counts[points] for points in brackets.points]
        same = np.flatnonzero((counts[0] == counts[1]) & (counts[0] > 0))
        for count in np.unique(counts[0][same]):
            rows = same[counts[0][same] == count]
            try:
                onsets = self._of_as_many(brackets.at(rows), int(count))
            except FAILURES:  # refined one by one, the row at fault reports it
                continue
            for row, onset in zip(rows.tolist(), onsets, strict=True):
                refined[row] = onset
        return refined

    def _of_as_many(self, brackets: Brackets, count: int) -> Sequence[Onset | None]:
        """Onsets in brackets whose points all have `count` modes; None where not refined."""
        x = self._plan.coordinates[:, self._column]
        modes = [self._modes(points, count) for points in brackets.points]
        onsets = refine_onsets_together(
            x=(x[brackets.points[0]], x[brackets.points[1]]),
            modes=(modes[0], modes[1]),
            mode_numbers=brackets.places,
            solve=lambda rows, at: self._solve(brackets.points[0][rows], at, count),
            tolerance=self._tolerance,
            precision=self._precision,
        )
        each = zip(*(column.tolist() for column in onsets), strict=True)
        return [None if np.isnan(onset) else Onset(onset, hz, n) for onset, hz, n in each]

    def _modes(self, points: np.ndarray, count: int) -> ManyModes:
        lam = self._judged.flat[self._judged.block(points, count)]
        return ManyModes(lam, self._follower.raw_many(points, count))

    def _solve(self, points: np.ndarray, x: np.ndarray, count: int) -> tuple[ManyModes, np.ndarray]:
        """Modes at the parameter's coordinates x (r,), and whether `count` of them oscillate."""
        part = self._plan.tasks.at(points)
        log = self._follower.near.logarithmic(self._column)
        name = self._plan.study.sweeps[self._column].name
        values = {**part.columns, name: np.exp(x) if log else x}
        system = stacked_system(part.model, part.options, part.model.followed(values), len(points))
        roots = system.roots(self._plan.band_hz)
        oscillating = (roots.lam.imag != 0) & roots.held
        width = roots.lam.shape[1]
        has_all_modes = oscillating.sum(axis=1) == count
        if width < count:
            return ManyModes(
                *_placeholder_modes(len(points), count, system.structures.n)
            ), has_all_modes
        shapes = system.shapes(roots.psi)
        return ManyModes(roots.lam[:, :count], shapes[:, :count]), has_all_modes


def _placeholder_modes(n: int, count: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    return np.ones((n, count), dtype=complex), np.zeros((n, count, k), dtype=np.complex64)
