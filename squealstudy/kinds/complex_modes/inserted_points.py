"""Bases in which tracking solves the points that it inserts between those of a study.

Where many steps of a structure are in doubt, its modes at a few design points of the study, far
from each other, span a basis. It is used if it reproduces the modes of other solved points.
Otherwise, and where a step stays in doubt, inserted points are solved exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter

import numpy as np

from squealstudy.engine.cache import known_gap, load_prepared, prepared_any
from squealstudy.engine.keys import content_hash
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.neighbourhood import PointNeighbourhood, StudyNeighbourhoods
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.point import DENSE
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.modes.tracking.snapshot_model import (
    SnapshotModel,
    largest_mode_error,
    snapshot_basis,
    snapshots,
)
from squealstudy.reduction.prepared import PreparedModel

MIN_COORDINATES = 200  # smaller models are solved exactly as fast as in a basis
MAX_BASIS_SHARE = 0.5  # largest number of vectors of a basis, over the number of coordinates
# a basis begins with 2^p + 1 points; p is the number of varied parameters, at most this
MAX_CORNER_PARAMETERS = 3
MIN_SNAPSHOTS, MAX_SNAPSHOTS = 3, 12  # design points of a basis
N_CHECKED_POINTS = 3  # design points at which a basis is compared with exact modes
STEPS_PER_SNAPSHOT = 2  # steps in doubt that pay for a snapshot: each takes two inserted points
MAX_UNLIKENESS = 2e-3  # allowed at checked points; tracking tells pairs apart by hundredths
# relative distance from an end of the band within which a mode may be in it or not
BAND_END_REL_DISTANCE = 0.01
MAX_MODELS_IN_MEMORY = 2  # models on a basis that a process holds


@dataclass(frozen=True)
class Basis:
    """A basis of a structure, handed to workers.

    Attributes
    ----------
    name : str
        Hash of what the basis is made from.
    key : str
        Key of the prepared model in the cache.
    V : ndarray (n, r)
        Basis vectors in the coordinates of the prepared model.
    band_hz : (low, high)
        Frequency band of the modes, Hz.
    """

    name: str
    key: str
    V: np.ndarray
    band_hz: tuple[float, float]

    def solver(self, neighbourhood: PointNeighbourhood) -> Callable[[np.ndarray], Modes]:
        """A function that gives the modes at coordinates near a design point, in this basis."""
        return partial(
            _modes_at, _model(self), neighbourhood, known_gap(self.key, neighbourhood.design)
        )


def _modes_at(
    model: SnapshotModel, neighbourhood: PointNeighbourhood, gap: np.ndarray | None, x: np.ndarray
) -> Modes:
    return model.modes(neighbourhood.design_at(x).state(), gap)


def _model(basis: Basis) -> SnapshotModel:
    """The model on a basis, kept for the next call in this process."""
    if basis.name not in _snapshot_models:
        while len(_snapshot_models) >= MAX_MODELS_IN_MEMORY:
            _snapshot_models.pop(next(iter(_snapshot_models)))
        _snapshot_models[basis.name] = SnapshotModel(
            load_prepared(basis.key), basis.V, basis.band_hz
        )
    return _snapshot_models[basis.name]


_snapshot_models: dict[str, SnapshotModel] = {}


class Bases:
    """The bases of a study's structures, made where they pay.

    Parameters
    ----------
    plan : Plan
        Plan of the study.
    neighbourhoods : StudyNeighbourhoods
        Neighbourhoods of the plan's points.
    solved : callable
        Returns the oscillating modes of a design point of the plan, as they were solved.
    counts : ndarray (n,) of int
        Number of these modes at each point.
    workers : Workers
        Workers that solve and check points.
    """

    def __init__(
        self,
        plan: Plan,
        neighbourhoods: StudyNeighbourhoods,
        solved: Callable[[int], Modes],
        counts: np.ndarray,
        workers: Workers,
    ) -> None:
        self._plan, self._near, self._solved = plan, neighbourhoods, solved
        self._counts, self._workers = counts, workers
        self._structure = plan.tasks.structure_index
        self._basis_of_structure: dict[int, Basis | None] = {}

    def prepare(self, steps: Sequence[int]) -> None:
        """Make a basis for each structure with many steps in doubt.

        `steps` has one design point of each step.
        """
        structures, counts = np.unique(self._structure[np.asarray(steps, int)], return_counts=True)
        for structure, count in zip(structures.tolist(), counts.tolist(), strict=True):
            if (
                structure not in self._basis_of_structure
                and count >= STEPS_PER_SNAPSHOT * MIN_SNAPSHOTS
            ):
                self._basis_of_structure[structure] = self._basis(
                    structure, count // STEPS_PER_SNAPSHOT
                )

    def of(self, point: int) -> Basis | None:
        """The basis of a point's structure; None where there is none."""
        return self._basis_of_structure.get(int(self._structure[point]))

    def _basis(self, structure: int, max_points: int) -> Basis | None:
        """A basis of a structure from at most `max_points` design points; None if none is good.

        The first points are the middle of the design and those far from it; more are added while
        the checks fail.
        """
        points = np.flatnonzero((self._structure == structure) & (self._counts > 0))
        neighbourhood_of_first = self._near.of(int(points[0]))
        if neighbourhood_of_first.stacked or neighbourhood_of_first.rung != DENSE:
            return None
        prepared = prepared_any(neighbourhood_of_first.structure.key)
        if not isinstance(prepared, PreparedModel) or prepared.model.n < MIN_COORDINATES:
            return None
        key, band_hz, n = (
            neighbourhood_of_first.structure.key,
            neighbourhood_of_first.structure.band_hz,
            prepared.model.n,
        )
        x = self._plan.coordinates[points]
        chosen = points[far_apart(x, MAX_SNAPSHOTS + N_CHECKED_POINTS)].tolist()
        neighbourhoods = [self._near.of(i) for i in chosen]
        blocks: list[np.ndarray] = []
        varied = int((np.ptp(x, axis=0) > 0).sum())
        n_used, n_next = 0, 2 ** min(varied, MAX_CORNER_PARAMETERS) + 1
        while n_used < n_next <= min(MAX_SNAPSHOTS, max_points) and n_next < len(chosen):
            snapshot_blocks = self._workers.each(
                snapshot_task, list(enumerate(neighbourhoods[n_used:n_next]))
            )
            blocks += [block for _, block in sorted(snapshot_blocks, key=itemgetter(0))]
            n_used = n_next
            V = snapshot_basis(blocks)
            if not 0 < V.shape[1] <= MAX_BASIS_SHARE * n:
                return None
            names = [neighbourhood.design.point_id for neighbourhood in neighbourhoods[:n_used]]
            basis = Basis(content_hash([key, band_hz, names]), key, V, band_hz)
            checked = slice(n_used, n_used + N_CHECKED_POINTS)
            checks = zip(neighbourhoods[checked], map(self._solved, chosen[checked]), strict=True)
            tasks = [CheckTask(basis, neighbourhood, solved) for neighbourhood, solved in checks]
            if max(self._workers.each(check_task, tasks)) <= MAX_UNLIKENESS:
                return basis
            n_next += N_CHECKED_POINTS
        return None


def far_apart(x: np.ndarray, count: int) -> np.ndarray:
    """Choose points of x (n, p): the nearest to the middle, then always the farthest from those.

    Distances are those of coordinates divided by their ranges.

    Returns
    -------
    ndarray (m,) of int
        Indices of points that differ from each other, `count` at most.
    """
    span = np.ptp(x, axis=0)
    scaled = (x - x.min(axis=0)) / np.where(span > 0, span, 1.0)
    chosen = [int(((scaled - (span > 0) / 2) ** 2).sum(axis=1).argmin())]
    distance = ((scaled - scaled[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < count and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((scaled - scaled[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def snapshot_task(task: tuple[int, PointNeighbourhood]) -> tuple[int, np.ndarray]:
    """Number of a task, and the snapshots (n, m) of its design point; (n, 0) where that fails."""
    number, neighbourhood = task
    key = neighbourhood.structure.key
    prepared, gap = load_prepared(key), known_gap(key, neighbourhood.design)
    try:
        return number, snapshots(
            prepared, neighbourhood.design.state(), neighbourhood.structure.band_hz, gap
        )
    except FAILURES:
        return number, np.zeros((prepared.model.n, 0))


@dataclass(frozen=True)
class CheckTask:
    """A design point and its exact modes `solved`, to compare with those in a basis."""

    basis: Basis
    neighbourhood: PointNeighbourhood
    solved: Modes


def check_task(task: CheckTask) -> float:
    """How far the modes of a design point in the basis are from exact ones; inf if it fails."""
    low, high = task.basis.band_hz
    try:
        modes_in_basis = task.basis.solver(task.neighbourhood)(task.neighbourhood.x)
    except FAILURES:
        return np.inf
    return largest_mode_error(
        task.solved, modes_in_basis, (2 * np.pi * low, 2 * np.pi * high), BAND_END_REL_DISTANCE
    )
