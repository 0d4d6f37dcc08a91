"""Tracking of a whole study: lines in parallel workers, doubtful steps refined.

`Follower` hands `PairTask` and `RefineTask` to workers, which run `pair_task` and `refine_task`;
`CommonShapes` gives the shapes of two points in common coordinates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.complex_modes.neighbourhood import PointNeighbourhood, StudyNeighbourhoods
from squealstudy.kinds.complex_modes.rows import ModeColumns, ShapeFile
from squealstudy.modes.tracking.labels import (
    Tracks,
    TrackTree,
    expected_roots,
    join_tracks,
    pair_points,
)
from squealstudy.modes.tracking.pairing import DOUBTFUL, Pairing, pair_macs
from squealstudy.modes.tracking.refinement import DEPTH, Modes, StepRefinement, unresolved
from squealstudy.modes.tracking.tree import cross_edges, tracking_tree

PARALLEL = 1000  # steps from which on workers pay
PARTS_A_WORKER = 4
ROUNDS = 4  # a refined step may put its followers in doubt
LEAST_BUDGET, MOST_BUDGET = 30, 500  # extra points: as many as design points, within these
BATCH = 32  # steps refined together; fixed, so that results do not depend on the workers


class Follower:
    """Tracks the oscillating modes of a study.

    Parameters
    ----------
    plan : Plan
    columns : ModeColumns
        With shapes.
    workers : Workers
    """

    def __init__(self, plan: Plan, columns: ModeColumns, workers: Workers) -> None:
        if columns.shapes is None:
            raise ValueError("columns were read without shapes")
        self._plan, self._workers, self._file = plan, workers, columns.shapes
        self.lams = columns.oscillating()
        costly = [sweep.parameter.structural for sweep in plan.study.sweeps]
        parents = tracking_tree(plan.coordinates, plan.grid_shape, costly)
        self._edges = cross_edges(plan.coordinates, parents, plan.grid_shape)
        self._tree = TrackTree(parents.tolist(), self.lams, plan.coordinates)
        self._shapes = CommonShapes(plan, columns.shapes, self.lams)
        self.near = StudyNeighbourhoods(plan)

    def raw(self, point: int) -> np.ndarray:
        """Shapes (m, k) of the oscillating modes of a point, as they were solved."""
        return self._shapes.raw(point)

    def follow(self, refine: bool) -> tuple[Tracks, dict[str, Any]]:
        """Labels of all modes, and how they came about.

        Returns
        -------
        Tracks
        dict
            ``ambiguous_pairs`` before refinement, steps ``refined``, ``extra_points`` solved for
            it within a structure, ``interpolated_points`` between structures, which cost far less
            than a reduction and are not limited, and pairs ``still_ambiguous``.
        """
        pairings = self._pair(self._tree.groups, {})
        before = _ambiguous(map(unresolved, pairings.values()))
        known: Pairings = {}
        points = interpolated = 0
        budget = max(min(len(self._plan.tasks), MOST_BUDGET), LEAST_BUDGET)
        for _ in range(ROUNDS if refine else 0):
            joined, crossing = self._doubtful(pairings, known)
            refined, spent = self._refine(crossing, pairings, len(crossing) * 2**DEPTH)
            interpolated += spent
            within, spent = self._refine(joined, pairings, budget - points)
            points += spent
            refined |= within
            known |= refined
            groups = [g for g in self._tree.groups if not refined.keys().isdisjoint(g)]
            if not groups:
                break
            pairings |= self._pair(groups, known)
        pairings = {i: p if i in known else unresolved(p) for i, p in pairings.items()}
        summary = {
            "ambiguous_pairs": before,
            "refined": len(known),
            "extra_points": points,
            "interpolated_points": interpolated,
            "still_ambiguous": _ambiguous(pairings.values()),
        }
        low, high = self._plan.band_hz
        tracks = self._tree.label(pairings, (2 * np.pi * low, 2 * np.pi * high))
        return join_tracks(tracks, self.lams, self._edges.tolist(), self._shapes.pair), summary

    def _pair(self, groups: Sequence[list[int]], known: Pairings) -> Pairings:
        """Pairings of groups of points with their parents."""
        tree = self._tree
        steps = sum(map(len, groups))
        if self._workers.jobs == 1 or steps < PARALLEL or len(self._plan.structures) > 1:
            shapes = self._shapes.pair
            found: Pairings = {}
            for group in groups:
                found |= pair_points(group, tree.parents, tree.step, self.lams, shapes, known)
            return found
        parts = _split(groups, steps // (PARTS_A_WORKER * self._workers.jobs) + 1)
        tasks = [self._pair_task(part, known) for part in parts]
        found = {}
        for result in self._workers.each(pair_task, tasks):
            found |= result
        return found

    def _pair_task(self, groups: list[list[int]], known: Pairings) -> PairTask:
        tree = self._tree
        points = {i for group in groups for i in group}
        parents = {i: tree.parents[i] for i in points}
        parents |= {p: tree.parents[p] for p in set(parents.values()) - points}
        seen = parents.keys() | {p for p in parents.values() if p >= 0}
        return PairTask(
            groups=groups,
            parents=parents,
            step={i: float(tree.step[i]) for i in points},
            lams={i: self.lams[i] for i in seen},
            shapes=self._file,
            known={i: known[i] for i in points if i in known},
        )

    def _doubtful(self, pairings: Pairings, known: Pairings) -> tuple[list[int], list[int]]:
        """Steps in doubt within a structure, and those to another one, the least trusted first."""
        trust = {i: float(p.trust.min(initial=np.inf)) for i, p in pairings.items()}
        doubtful = [i for i in trust if trust[i] <= DOUBTFUL and i not in known]
        doubtful.sort(key=lambda i: (trust[i], i))
        joined = {i for i in doubtful if self.near.joined(self._tree.parents[i], i)}
        return [i for i in doubtful if i in joined], [i for i in doubtful if i not in joined]

    def _refine(self, doubtful: list[int], pairings: Pairings, budget: int) -> tuple[Pairings, int]:
        """Refine steps in order, as far as the budget goes; the points solved between."""
        refined: Pairings = {}
        points = done = 0
        while done < len(doubtful):
            count = min(BATCH, (budget - points) // (2**DEPTH - 1))
            if count < 1:
                break
            self._workers.report("tracking", done, len(doubtful))
            batch = [self._refine_task(i, pairings) for i in doubtful[done : done + count]]
            for i, pairing, spent in self._workers.each(refine_task, batch):
                seen = self._shapes.pair(self._tree.parents[i], i)
                refined[i] = pairing._replace(mac=pair_macs(*seen, pairing.partner))
                points += spent
            done += len(batch)
        if done:
            self._workers.report("tracking", done, done)
        return refined, points

    def _refine_task(self, i: int, pairings: Pairings) -> RefineTask:
        tree = self._tree
        p = tree.parents[i]
        before = pairings.get(p) if tree.step[i] else None
        earlier = self.lams[tree.parents[p]] if before is not None else None
        return RefineTask(
            point=i,
            start=self.near.of(p),
            end=self.near.of(i),
            a=Modes(self.lams[p], self.raw(p)),
            b=Modes(self.lams[i], self.raw(i)),
            expected=expected_roots(self.lams[p], float(tree.step[i]), earlier, before),
            direct=pairings[i],
        )


def _ambiguous(pairings: Iterable[Pairing]) -> int:
    return int(sum(p.ambiguous.sum() for p in pairings))


def _split(groups: Sequence[list[int]], size: int) -> list[list[list[int]]]:
    """Consecutive groups in parts of about `size` points."""
    parts: list[list[list[int]]] = []
    count = size
    for group in groups:
        if count >= size:
            parts.append([])
            count = 0
        parts[-1].append(group)
        count += len(group)
    return parts


Pairings = dict[int, Pairing]


@dataclass(frozen=True)
class PairTask:
    """Groups of points for a worker to pair with their parents."""

    groups: list[list[int]]
    parents: Mapping[int, int]
    step: Mapping[int, float]
    lams: Mapping[int, np.ndarray]
    shapes: ShapeFile
    known: Pairings


@dataclass(frozen=True)
class RefineTask:
    """A doubtful step for a worker to refine.

    Attributes
    ----------
    point : int
        At the end of the step.
    start, end : PointNeighbourhood
        Around both its points.
    a, b : Modes
        Of both, as they were solved.
    expected : ndarray or None
        As of `pair_modes`.
    direct : Pairing
        What is to be refined.
    """

    point: int
    start: PointNeighbourhood
    end: PointNeighbourhood
    a: Modes
    b: Modes
    expected: np.ndarray | None
    direct: Pairing


def pair_task(task: PairTask) -> Pairings:
    """Pair the groups of a task."""

    @lru_cache(maxsize=KEPT)
    def shapes(point: int) -> np.ndarray:
        return task.shapes.read(point)[: len(task.lams[point])]  # without overdamped roots

    def pair(a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        return shapes(a), shapes(b)

    found: Pairings = {}
    for group in task.groups:
        found |= pair_points(group, task.parents, task.step, task.lams, pair, task.known)
    return found


def refine_task(task: RefineTask) -> tuple[int, Pairing, int]:
    """Point, pairing with its parent, and number of intermediate points solved."""
    solve, a, b = task.start.solve, task.a, task.b
    foreign = np.zeros(len(b.lam), dtype=bool)
    if task.start.structure.key != task.end.structure.key:
        try:
            way = task.start.way_to(task.end)
        except SquealstudyError:
            return task.point, task.direct, 0
        solve, a, b, foreign = way.solve, way.at_a(a), way.at_b(b), way.foreign(b)
    refinement = StepRefinement(solve)
    pairing = refinement.pair(a, b, task.start.x, task.end.x, task.expected)
    doubtful = np.zeros(len(a.lam), dtype=bool)
    paired = pairing.partner >= 0
    doubtful[paired] = foreign[pairing.partner[paired]]
    pairing = pairing._replace(ambiguous=pairing.ambiguous | doubtful)
    return task.point, pairing, refinement.points


KEPT = 8  # shapes of points kept at hand


class CommonShapes:
    """Shapes of two points of a plan as they can be compared by their MAC.

    Points of one structure have the same nominal real modes as coordinates. Each structure has its
    own, so that two structures are compared by what is seen at the places that correspond between
    them (PreparedModel.sensor_shapes), weighted by mass.

    Parameters
    ----------
    plan : Plan
    file : ShapeFile
    lams : list of ndarray (m,)
        Roots of the oscillating modes of each point; the others' shapes are left out.
    """

    def __init__(self, plan: Plan, file: ShapeFile, lams: list[np.ndarray]) -> None:
        self._keys, self._structure = plan.tasks.structures, plan.tasks.structure_index
        self._file, self._counts = file, [len(lam) for lam in lams]
        self._seen = lru_cache(maxsize=KEPT)(self._observed)

    def raw(self, point: int) -> np.ndarray:
        """Unit shapes (m, k) of a point in the nominal modes of its own structure."""
        return self._file.read(point)[: self._counts[point]]

    def pair(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (ma, k) and (mb, k) of two points."""
        if self._structure[a] == self._structure[b]:
            return self.raw(a), self.raw(b)
        return self._seen(a), self._seen(b)

    def _observed(self, point: int) -> np.ndarray:
        shapes = self.raw(point)
        if not len(shapes):
            return shapes
        sensors = load_prepared(self._keys[self._structure[point]]).sensor_shapes
        return shapes @ sensors.T.astype(shapes.dtype)
