"""Tracks the modes of a whole study: pairs all steps, and refines doubtful ones by workers.

`Follower` sends each `RefineTask` to workers, which run `refine_task`. `CommonShapes` gives the
shapes of two points in common coordinates.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.inserted_points import Bases, Basis
from squealstudy.kinds.complex_modes.neighbourhood import PointNeighbourhood, StudyNeighbourhoods
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.kinds.complex_modes.stored_shapes import ShapeFile
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.tracking.labels import Tracks, TrackTree, join_tracks
from squealstudy.modes.tracking.pairing import HALVING_TRUST, Pairing, pair_macs
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.modes.tracking.refinement import DEPTH, Modes, Solve, StepRefinement
from squealstudy.modes.tracking.steps import Pairings
from squealstudy.modes.tracking.tree import cross_edges, tracking_tree

POINTS_A_STEP = 2  # about so many points are inserted into a step
BASIS_POINTS_A_POINT = 4  # points that a basis solves in the time of an exact point
MAX_REFINEMENT_ROUNDS = 4  # rounds of refinement: a refined step may put later ones in doubt
STEPS_PER_ROUND = 32  # steps refined together; fixed, so that results do not depend on the workers


class Follower:
    """Tracks the oscillating modes of a study.

    Parameters
    ----------
    plan : Plan
    columns : ModeColumns
        Modes of all points, read with their shapes.
    workers : Workers

    Attributes
    ----------
    lams : Ragged
        Roots of the oscillating modes of each point, rad/s.
    band : (low, high)
        Band of these roots, rad/s.
    seconds : float
        Time spent on refinement so far, s.
    """

    def __init__(self, plan: Plan, columns: ModeColumns, workers: Workers) -> None:
        if columns.shapes is None:
            raise ValueError("columns were read without shapes")
        self._plan, self._workers = plan, workers
        self.lams, self.seconds = columns.oscillating(), 0.0
        costly = [sweep.parameter.structural for sweep in plan.study.sweeps]
        parents = tracking_tree(plan.coordinates, plan.grid_shape, costly)
        self._edges = cross_edges(plan.coordinates, parents, plan.grid_shape)
        low, high = plan.band_hz
        self.band = 2 * np.pi * low, 2 * np.pi * high
        self._tree = TrackTree(parents, self.lams, plan.coordinates, self.band)
        self._shapes = CommonShapes(plan, columns.shapes, self.lams)
        self._stepper = self._tree.stepper(self._shapes)
        self.near = StudyNeighbourhoods(plan)
        self._bases = Bases(plan, self.near, self._solved, self.lams.counts, workers)

    @property
    def parents(self) -> np.ndarray:
        """The point (n,) with which each point's modes were compared, -1 for none."""
        return self._tree.parents

    def _solved(self, point: int) -> Modes:
        """Oscillating modes of a point in its own structure's coordinates."""
        return Modes(self.lams[point], self.raw(point))

    def raw(self, point: int) -> np.ndarray:
        """Shapes (m, k) of the oscillating modes of a point, as they were solved."""
        return self._shapes.raw(point)

    def raw_many(self, points: np.ndarray, count: int) -> np.ndarray:
        """Shapes (n, count, k) of points of one structure with that many oscillating modes."""
        return self._shapes.raw_many(points, count)

    def follow(self, refine: bool, budget: int = 0) -> tuple[Tracks, dict[str, Any]]:
        """Label all modes with tracks.

        Parameters
        ----------
        refine : bool
            Whether steps in doubt are refined by further points.
        budget : int
            Number of points that may be solved for this within a structure.

        Returns
        -------
        Tracks
        dict
            Numbers of: ``ambiguous_pairs`` before refinement; steps ``refined``;
            ``extra_points`` solved within a structure, where up to BASIS_POINTS_A_POINT of a
            step in a basis count as one; ``interpolated_points`` between structures, which cost far
            less than a reduction and are not limited; steps within a structure ``left`` in doubt
            when budget or rounds were spent; pairs ``still_ambiguous``, those of such steps
            included.
        """
        pairings = self._stepper.pair_all()
        before = pairings.count_unresolved()
        started = time.perf_counter()
        refined_steps = np.zeros(0, dtype=int)
        points = interpolated = 0
        for _ in range(MAX_REFINEMENT_ROUNDS if refine else 0):
            joined, crossing = self._doubtful(pairings, refined_steps)
            between, spent = self._refine(crossing, pairings, len(crossing) * 2**DEPTH)
            interpolated += spent
            self._bases.prepare(joined[: (budget - points) // POINTS_A_STEP])
            within, spent = self._refine(joined, pairings, budget - points)
            points += spent
            refined = between | within
            if not refined:
                break
            refined_steps = np.union1d(refined_steps, list(refined))
            changed = [i for i, pairing in refined.items() if self._enter(pairings, i, pairing)]
            self._stepper.pair_followers(pairings, np.array(changed, dtype=int), refined_steps)
        self.seconds += time.perf_counter() - started
        n_doubtful = len(self._doubtful(pairings, refined_steps)[0]) if refine else 0
        pairings.mark_unresolved(refined_steps)
        summary = {
            "ambiguous_pairs": before,
            "refined": len(refined_steps),
            "extra_points": points,
            "interpolated_points": interpolated,
            "left": n_doubtful,
            "still_ambiguous": int(pairings.ambiguous.flat.sum()),
        }
        tracks = self._tree.label(pairings)
        return join_tracks(tracks, self.lams, self._edges, self._shapes), summary

    def _enter(self, pairings: Pairings, point: int, pairing: Pairing) -> bool:
        """Store the refined pairing of a step to `point`; whether partners changed by it."""
        batch = Pairing(*(part[None] for part in pairing))
        return bool(pairings.enter(np.array([point]), batch, int(self.lams.counts[point]))[0])

    def _doubtful(self, pairings: Pairings, refined: np.ndarray) -> tuple[list[int], list[int]]:
        """Steps in doubt within a structure, and between two, each with the least trusted first."""
        trust = pairings.trust.least()
        trust[refined] = np.inf
        doubtful = np.flatnonzero(trust <= HALVING_TRUST)
        doubtful = doubtful[np.argsort(trust[doubtful], kind="stable")]
        joined = self.near.joined(self._tree.parents[doubtful], doubtful)
        return doubtful[joined].tolist(), doubtful[~joined].tolist()

    def _refine(
        self, doubtful: list[int], pairings: Pairings, budget: int
    ) -> tuple[dict[int, Pairing], int]:
        """Refine steps in order while the budget lasts; pairings by point, and points solved."""
        refined: dict[int, Pairing] = {}
        points = done = 0
        while done < len(doubtful):
            count = min(STEPS_PER_ROUND, (budget - points) // (2**DEPTH - 1))
            if count < 1:
                break
            self._workers.report("tracking", done, len(doubtful))
            batch = [self._refine_task(i, pairings) for i in doubtful[done : done + count]]
            for i, pairing, spent in self._workers.each(refine_task, batch):
                a, b = self._shapes.of(self._tree.parents[[i]], np.array([i]))
                refined[i] = pairing._replace(mac=pair_macs(a[0], b[0], pairing.partner))
                points += spent
            done += len(batch)
        if done:
            self._workers.report("tracking", done, done)
        return refined, points

    def _refine_task(self, i: int, pairings: Pairings) -> RefineTask:
        """The task that refines the step to point i by points between."""
        tree = self._tree
        p = int(tree.parents[i])
        goes_on = bool(tree.step[i])
        return RefineTask(
            point=i,
            start=self.near.of(p),
            end=self.near.of(i),
            a=self._solved(p),
            b=self._solved(i),
            expected=self._stepper.expected(pairings, np.array([i]))[0] if goes_on else None,
            direct=Pairing(*(part.copy() for part in pairings[i])),
            basis=self._bases.of(i),
        )


@dataclass(frozen=True)
class RefineTask:
    """A doubtful step for a worker to refine.

    Attributes
    ----------
    point : int
        Number of the point at the end of the step.
    start, end : PointNeighbourhood
        Neighbourhoods of the step's first and last point.
    a, b : Modes
        Modes of both, in the coordinates of their own structures.
    expected : ndarray or None
        Roots of `a` as they are expected at `b`, rad/s; None: they are expected not to change.
    direct : Pairing
        The pairing of both without points between, to be refined.
    basis : Basis or None
        Basis in which points between are solved; None: they are solved exactly.
    """

    point: int
    start: PointNeighbourhood
    end: PointNeighbourhood
    a: Modes
    b: Modes
    expected: np.ndarray | None
    direct: Pairing
    basis: Basis | None = None


def refine_task(task: RefineTask) -> tuple[int, Pairing, int]:
    """Refine a step: its point, refined pairing, and the number of points the budget counts.

    Where anything fails, the pairing stays as it was, and no points count.
    """
    try:
        return _refined(task)
    except FAILURES:
        return task.point, task.direct, 0


def _refined(task: RefineTask) -> tuple[int, Pairing, int]:
    """The refined pairing of a step, with its point and how many points were solved."""
    if task.start.structure.key == task.end.structure.key:
        in_basis = _refined_in_basis(task)
        pairing, points = in_basis or _refined_by(task, task.start.solve, task.a, task.b)
        return task.point, pairing, points
    way = task.start.way_to(task.end)
    pairing, points = _refined_by(task, way.solve, way.at_a(task.a), way.at_b(task.b))
    doubtful, paired = np.zeros(len(task.a.lam), dtype=bool), pairing.partner >= 0
    doubtful[paired] = way.foreign(task.b)[pairing.partner[paired]]
    pairing = pairing._replace(ambiguous=pairing.ambiguous | doubtful)
    return task.point, pairing, points


def _refined_in_basis(task: RefineTask) -> tuple[Pairing, int] | None:
    """The pairing by inserted points that are solved in a basis, and how many points they count as.

    None where there is no basis, it fails, or the pairing is still in doubt.
    """
    if task.basis is None:
        return None
    try:
        pairing, points = _refined_by(task, task.basis.solver(task.start), task.a, task.b)
    except FAILURES:
        return None
    sure = not pairing.ambiguous.any() and (pairing.trust > HALVING_TRUST).all()
    return (pairing, math.ceil(points / BASIS_POINTS_A_POINT)) if sure else None


def _refined_by(task: RefineTask, solve: Solve, a: Modes, b: Modes) -> tuple[Pairing, int]:
    """Pairing of the modes of both ends, and the number of inserted points that were solved."""
    low, high = task.start.structure.band_hz
    refinement = StepRefinement(solve, band=(2 * np.pi * low, 2 * np.pi * high))
    pairing = refinement.pair(a, b, task.start.x, task.end.x, task.expected)
    return pairing, refinement.points


MAX_CACHED_SHAPES = 8  # number of points whose shapes stay in memory


class CommonShapes:
    """Shapes of two points of a plan in coordinates in which their MAC can be taken (`Shapes`).

    Shapes of one structure have its nominal real modes as coordinates. Shapes of two structures
    are compared by their motion at corresponding places (PreparedModel.sensor_shapes), weighted by
    mass.

    Parameters
    ----------
    plan : Plan
    file : ShapeFile
    lams : Ragged
        Roots of the oscillating modes of each point; the others' shapes are left out.
    """

    def __init__(self, plan: Plan, file: ShapeFile, lams: Ragged) -> None:
        self._keys, self._structure = plan.tasks.structures, plan.tasks.structure_index
        self._file, self._counts = file, lams.counts
        self._seen = lru_cache(maxsize=MAX_CACHED_SHAPES)(self._observed)

    def raw(self, point: int) -> np.ndarray:
        """Unit shapes (m, k) of a point in the nominal modes of its own structure."""
        return self._file.read(point)[: self._counts[point]]

    def raw_many(self, points: np.ndarray, count: int) -> np.ndarray:
        """Shapes (n, count, k) of points of one structure, the first `count` of each."""
        return self._file.stack(points, count)

    def coordinate_system(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Number of coordinates (n,) of steps within a structure, -1 for those between two."""
        within = self._structure[a] == self._structure[b]
        return np.where(within, self._file.width(b), -1)

    def of(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (n, ma, k) and (n, mb, k) at both ends of steps of one sort."""
        if self._structure[a[0]] == self._structure[b[0]]:
            return self._file.stack(a, self._counts[a[0]]), self._file.stack(b, self._counts[b[0]])
        at_a, at_b = (np.stack([self._seen(int(point)) for point in points]) for points in (a, b))
        return at_a, at_b

    def _observed(self, point: int) -> np.ndarray:
        shapes = self.raw(point)
        if not len(shapes):
            return shapes
        sensors = load_prepared(self._keys[self._structure[point]]).sensor_shapes
        return shapes @ sensors.T.astype(shapes.dtype)
