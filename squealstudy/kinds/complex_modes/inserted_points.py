"""Bases that serve the points which tracking inserts into steps of a study.

Where many steps of a structure are in doubt, its modes at a few design points of the study, far
from each other, are made a basis. It is taken where it gives the modes of others, which are solved
already; otherwise, and where a step stays in doubt, inserted points are solved exactly.
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
    snapshot_basis,
    snapshots,
    unlikeness,
)
from squealstudy.reduction.prepared import PreparedModel

LEAST_COORDINATES = 200  # of a model: an exact solve of a smaller one takes as long as this
MOST_SHARE = 0.5  # of its coordinates that a basis may have
MOST_DIRECTIONS = 3  # parameters by which corners are counted: 3, 5 or 9 points at first
LEAST_SNAPSHOTS, MOST_SNAPSHOTS = 3, 12  # design points of a basis
CHECKED = 3  # design points at which a basis is looked at
STEPS_A_SNAPSHOT = 2  # in doubt, from which on it pays: a step takes two inserted points
TOLERANCE = 2e-3  # of `unlikeness`: pairs are told by hundredths
BAND_END_REL_DISTANCE = (
    0.01  # relative distance from the ends of the band within which a mode may be out of it
)
MOST_KEPT = 2  # models that a process holds


@dataclass(frozen=True)
class Basis:
    """A basis of a structure, handed to workers.

    Attributes
    ----------
    name : str
        Hash of what it is made from.
    key : str
        Of the prepared model in the cache.
    V : ndarray (n, r)
    band_hz : (low, high)
    """

    name: str
    key: str
    V: np.ndarray
    band_hz: tuple[float, float]

    def solver(self, near: PointNeighbourhood) -> Callable[[np.ndarray], Modes]:
        """Modes at coordinates in the neighbourhood of a design point, in this basis."""
        return partial(_modes_at, _model(self), near, known_gap(self.key, near.design))


def _modes_at(
    model: SnapshotModel, near: PointNeighbourhood, gap: np.ndarray | None, x: np.ndarray
) -> Modes:
    return model.modes(near.design_at(x).state(), gap)


def _model(basis: Basis) -> SnapshotModel:
    """The model on a basis, kept for the next call in this process."""
    if basis.name not in _snapshot_models:
        while len(_snapshot_models) >= MOST_KEPT:
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
    near : StudyNeighbourhoods
    solved : callable
        Oscillating modes of a design point of the plan, as they were solved.
    counts : ndarray (n,) of int
        How many each point has.
    workers : Workers
    """

    def __init__(
        self,
        plan: Plan,
        near: StudyNeighbourhoods,
        solved: Callable[[int], Modes],
        counts: np.ndarray,
        workers: Workers,
    ) -> None:
        self._plan, self._near, self._solved = plan, near, solved
        self._counts, self._workers = counts, workers
        self._structure = plan.tasks.structure_index
        self._made: dict[int, Basis | None] = {}

    def prepare(self, steps: Sequence[int]) -> None:
        """Make the bases of structures in which many steps, known by their ends, are in doubt."""
        structures, counts = np.unique(self._structure[np.asarray(steps, int)], return_counts=True)
        for structure, count in zip(structures.tolist(), counts.tolist(), strict=True):
            if structure not in self._made and count >= STEPS_A_SNAPSHOT * LEAST_SNAPSHOTS:
                self._made[structure] = self._basis(structure, count // STEPS_A_SNAPSHOT)

    def of(self, point: int) -> Basis | None:
        """The basis of a point's structure, where there is one."""
        return self._made.get(int(self._structure[point]))

    def _basis(self, structure: int, most: int) -> Basis | None:
        """A basis of a structure, of as many design points at most as pay; None without a good one.

        The corners of the design and its middle come first, more where these are not enough.
        """
        points = np.flatnonzero((self._structure == structure) & (self._counts > 0))
        first = self._near.of(int(points[0]))
        if first.stacked or first.rung != DENSE:
            return None
        prepared = prepared_any(first.structure.key)
        if not isinstance(prepared, PreparedModel) or prepared.model.n < LEAST_COORDINATES:
            return None
        key, band_hz, n = first.structure.key, first.structure.band_hz, prepared.model.n
        x = self._plan.coordinates[points]
        chosen = points[far_apart(x, MOST_SNAPSHOTS + CHECKED)].tolist()
        near = [self._near.of(i) for i in chosen]
        blocks: list[np.ndarray] = []
        varied = int((np.ptp(x, axis=0) > 0).sum())
        used, count = 0, 2 ** min(varied, MOST_DIRECTIONS) + 1
        while used < count <= min(MOST_SNAPSHOTS, most) and count < len(chosen):
            snapshot_blocks = self._workers.each(snapshot_task, list(enumerate(near[used:count])))
            blocks += [block for _, block in sorted(snapshot_blocks, key=itemgetter(0))]
            used = count
            V = snapshot_basis(blocks)
            if not 0 < V.shape[1] <= MOST_SHARE * n:
                return None
            names = [at.design.point_id for at in near[:used]]
            basis = Basis(content_hash([key, band_hz, names]), key, V, band_hz)
            last = slice(used, used + CHECKED)
            checks = zip(near[last], map(self._solved, chosen[last]), strict=True)
            tasks = [CheckTask(basis, at, solved) for at, solved in checks]
            if max(self._workers.each(check_task, tasks)) <= TOLERANCE:
                return basis
            count += CHECKED
        return None


def far_apart(x: np.ndarray, count: int) -> np.ndarray:
    """Some of the points x (n, p): one next to the middle, then the farthest from all before.

    Each coordinate counts by its range.

    Returns
    -------
    ndarray (m,) of int
        Places of points that differ from each other, `count` at most.
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
    """Number of a task, and the snapshots (n, m) of its design point; none where that fails."""
    number, near = task
    key = near.structure.key
    prepared, gap = load_prepared(key), known_gap(key, near.design)
    try:
        return number, snapshots(prepared, near.design.state(), near.structure.band_hz, gap)
    except FAILURES:
        return number, np.zeros((prepared.model.n, 0))


@dataclass(frozen=True)
class CheckTask:
    """A solved design point at which a worker looks at a basis."""

    basis: Basis
    near: PointNeighbourhood
    solved: Modes


def check_task(task: CheckTask) -> float:
    """Unlikeness of the modes of a design point, in a basis and solved; infinite if it fails."""
    low, high = task.basis.band_hz
    try:
        modes_in_basis = task.basis.solver(task.near)(task.near.x)
    except FAILURES:
        return np.inf
    return unlikeness(
        task.solved, modes_in_basis, (2 * np.pi * low, 2 * np.pi * high), BAND_END_REL_DISTANCE
    )
