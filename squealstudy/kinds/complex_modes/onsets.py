"""Finds where tracks turn unstable along a parameter, and stable again."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.batch_onsets import BatchOnsets, Brackets
from squealstudy.kinds.complex_modes.neighbourhood import OnsetTask, refine_onsets
from squealstudy.kinds.complex_modes.refinement_budget import RefinementBudget
from squealstudy.kinds.complex_modes.study_tracks import Follower
from squealstudy.kinds.complex_modes.track_crossings import TrackCrossings
from squealstudy.modes.judged_roots import damping_ratios
from squealstudy.modes.tracking.labels import Tracks
from squealstudy.modes.tracking.onsets import NO_CROSSING, Onset, cubic_onsets
from squealstudy.modes.tracking.refinement import Modes
from squealstudy.study.parameters import ONSET_PARAMETER
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.families import NOT_LOCATED, RENUMBERED
from squealstudy.tables.mode_ranking import line_codes, parameter_columns
from squealstudy.tables.stability import (
    BELOW_RANGE,
    BRACKETED,
    BROKEN,
    CUBIC,
    FIRST_SEEN,
    INTERPOLATED,
    INTO,
    LEFT_BAND,
    REFINED,
)

ONSET_TOLERANCE = 1e-4  # a share of the parameter's range; absolute for friction and logarithms
WITHIN_ERROR = "within_error"  # status of an onset put at a point that grows by less than its error
UNKNOWN_REL_ERROR = 1e6  # largest relative error of a root, finite in place of infinite
UNREFINED = {BELOW_RANGE: "below_range", FIRST_SEEN: "first_seen"}  # status in the table
UNREFINED |= {kind: kind for kind in (BRACKETED, BROKEN, LEFT_BAND)}
EXPECTED_SOLVES_PER_ONSET = 8  # design points
BRACKETS_PER_BATCH = 4096  # brackets of small models that are refined together as arrays
BRACKETS_PER_ROUND = 32  # handed to workers at once; fixed, as results must not depend on workers

Cells = dict[str, np.ndarray]  # columns of the table of onsets while it is made


class OnsetSearch:
    """Finds the onsets of a study.

    Parameters
    ----------
    plan : Plan
        Plan of the study.
    follower : Follower
        Follows the modes of the study between its design points.
    tracks : Tracks
        Tracks of the modes. Where a mode turns out to change its number between two points it is
        marked ambiguous at both.
    points : DataFrame
        The points' table.
    along : str
        The parameter, one of the swept ones.
    lam : ndarray (N,) complex
        Oscillating roots of all points as they are judged (`settled`), rad/s.
    error : ndarray (N,)
        Their estimated errors, rad/s; NaN, which counts as zero, where there is none.

    Attributes
    ----------
    seconds : float
        Time spent on refining onsets so far, s.
    """

    def __init__(
        self,
        plan: Plan,
        follower: Follower,
        tracks: Tracks,
        points: pd.DataFrame,
        along: str,
        lam: np.ndarray,
        error: np.ndarray,
    ) -> None:
        self._plan, self._follower, self._points, self._along = plan, follower, points, along
        self.seconds = 0.0
        self._tolerance = plan.study.definition.modes.stability_tolerance
        self._column = [s.name for s in plan.study.sweeps].index(along)
        lams = follower.lams
        self._judged = lams.with_flat(lam)
        rel_error = np.nan_to_num(error, posinf=np.inf) / np.maximum(np.abs(lam), 1e-300)
        self._error = np.minimum(rel_error, UNKNOWN_REL_ERROR)
        self._point = lams.owner
        self._place = np.arange(len(lam)) - lams.starts[self._point]
        self._track = tracks.labels.flat
        self._ambiguous = tracks.ambiguous.flat
        self._lam, self._zeta = lam, damping_ratios(lam)
        self._has_unstable = np.zeros(len(lams), dtype=bool)  # for each point
        self._has_unstable[self._point[self._zeta < -self._tolerance]] = True
        self._neutral = (damping_ratios(lams.flat) < -self._tolerance) & (lam.real == 0)
        self._line = line_codes(points, along)
        ok = (points["status"] == "ok").to_numpy(bool)
        begins = plan.study.definition.design.type not in RANDOM_DESIGNS
        self._crossings = TrackCrossings(follower, tracks, points, along, begins)
        self._ok = ok[self._point]  # for each mode: whether its point is

    def table(
        self, refine: bool, budget: RefinementBudget, spent: int, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """The table of onsets, and a summary of how they were found.

        `spent` is the number of design points of the `budget` that are used already. The summary
        counts onsets by status, evaluations, and onsets ``left`` unrefined.

        Columns: ``track``, the other varied parameters, ``onset``, ``bracket_low``,
        ``bracket_high`` (values at both ends), ``frequency_hz``, ``direction`` as the parameter
        ascends ("in" or "out" of instability; "leaves" the band unstable), ``status``,
        ``error_estimate`` of the onset (by the method and the roots; NaN where not known),
        ``evaluations``, ``point_before``, ``point_after``. A line with a single design point has no
        onsets. What a status means: docs/reference/words-in-tables.md. Beyond that: the bracket of
        "within_error" reaches to the next point whose growth is not within its error, NaN where
        there is none. "failed" keeps its value from before, "bracketed" has the unstable end.
        """
        events = self._crossings.events(self._zeta, self._tolerance)
        table = self._unrefined(events)
        self._place_neutral(events, table)
        n_unrefined = 0
        if refine and len(events):
            self._interpolate(events, table)
            started = time.perf_counter()
            n_unrefined = self._refine(events, table, budget, spent, workers)
            self.seconds += time.perf_counter() - started
            renumbered = events[table["status"] == RENUMBERED]
            self._ambiguous[renumbered[["before", "after"]].to_numpy().ravel()] = True
        names, counts = np.unique(table["status"].astype(str), return_counts=True)
        often = np.argsort(-counts, kind="stable")
        summary = {
            "along": self._along,
            "evaluations": int(table["evaluations"].sum()),
            "left": n_unrefined,
            **{str(names[k]): int(counts[k]) for k in often},
        }
        return pd.DataFrame(table), summary

    def _unrefined(self, events: pd.DataFrame) -> Cells:
        """Columns of the table of onsets, before anything is refined."""
        points, x = self._points, self._points[self._along].to_numpy()
        before, after, below, above = events[["before", "after", "low", "high"]].to_numpy().T
        crossing = before >= 0
        p0, p1 = self._point[np.where(crossing, before, after)], self._point[after]
        span = x[p1] - x[p0]  # without one the value is that of the end
        to_value = np.where(span != 0, events["value"].to_numpy() - x[p0], 1.0)
        part = to_value / np.where(span != 0, span, 1.0)
        low, high = self._lam[np.where(crossing, before, after)], self._lam[after]
        ids = points["point_id"].to_numpy()
        table = {"track": events["track"].to_numpy(dtype=np.int32)}
        for name in parameter_columns(points, varied=True):
            if name != self._along:
                table[name] = points[name].to_numpy()[p1]
        unknown = events["kind"].isin([BELOW_RANGE, BROKEN, LEFT_BAND]).to_numpy()
        table["onset"] = np.where(unknown, np.nan, events["value"].to_numpy())
        table["bracket_low"] = np.where(below >= 0, x[below], np.nan)
        table["bracket_high"] = x[above]
        table["frequency_hz"] = np.abs(low + part * (high - low)) / (2 * np.pi)
        table["direction"] = events["direction"].to_numpy(object)
        table["status"] = events["kind"].map(UNREFINED).fillna(INTERPOLATED).to_numpy(object)
        table["error_estimate"] = np.full(len(events), np.nan)
        table["evaluations"] = np.zeros(len(events), dtype=np.int32)
        table["point_before"] = np.where(below >= 0, ids[below], "")
        table["point_after"] = ids[above]
        return table

    def _place_neutral(self, events: pd.DataFrame, table: Cells) -> None:
        """Put a crossing at its stable end if the growth there is within its error."""
        into = (events["direction"] == INTO).to_numpy()
        before, after = (events[end].to_numpy() for end in ("before", "after"))
        stable = np.where(into, before, after)
        rows = np.flatnonzero((before >= 0) & self._neutral[np.where(before >= 0, stable, 0)])
        if not len(rows):
            return
        x = self._plan.coordinates[:, self._column][self._point]
        values = self._points[self._along].to_numpy()[self._point]
        track_before, track_after = self._neighbours()
        stable_end, inwards = stable[rows], into[rows]
        end = stable_end
        while (neutral := (end >= 0) & self._neutral[end]).any():
            further = np.where(inwards, track_before[end], track_after[end])
            end = np.where(neutral, further, end)
        inside = self._shift(before[rows], after[rows])
        has_end = end >= 0
        error = np.where(has_end, np.maximum(inside, np.abs(x[end] - x[stable_end])), np.nan)
        self._enter_value(table, rows, x[stable_end], error)
        table["status"][rows] = WITHIN_ERROR
        for bracket, side in (("bracket_low", inwards), ("bracket_high", ~inwards)):
            table[bracket][rows[side]] = np.where(has_end, values[end], np.nan)[side]

    def _interpolate(self, events: pd.DataFrame, table: Cells) -> None:
        """Enter crossings that a cubic through neighbouring points locates precisely enough."""
        crossing = self._open(events, table)
        ends = events[["before", "after"]].to_numpy()[crossing]
        before, after = self._neighbours()
        inner = np.column_stack([before[ends[:, 0]], ends, after[ends[:, 1]]])
        near = self._follower.near
        has_neighbours = (inner >= 0).all(axis=1) & near.joined(*self._point[inner[:, [0, -1]]].T)
        crossing, inner = crossing[has_neighbours], inner[has_neighbours]
        rows = np.column_stack([before[inner[:, 0]], inner, after[inner[:, 3]]])
        missing = (rows < 0) | ~near.joined(self._point[rows], self._point[inner[:, :1]])
        x = self._plan.coordinates[:, self._column][self._point[rows]]
        zeta = np.where(missing, np.nan, self._zeta[rows] + self._tolerance)
        onset, error = cubic_onsets(np.where(missing, np.nan, x), zeta)
        sure = ~(self._ambiguous[rows] & ~missing).any(axis=1)
        good = (error <= self._precision()) & sure
        error += self._shift(ends[:, 0], ends[:, 1])[has_neighbours]
        self._enter_value(table, crossing[good], onset[good], error[good])
        table["status"][crossing[good]] = CUBIC

    def _open(self, events: pd.DataFrame, table: Cells) -> np.ndarray:
        """Rows of crossings that no method has located yet."""
        is_settled = np.isfinite(table["error_estimate"]) | (table["status"] == WITHIN_ERROR)
        rows: np.ndarray = np.flatnonzero((events["before"] >= 0).to_numpy() & ~is_settled)
        return rows

    def _neighbours(self) -> tuple[np.ndarray, np.ndarray]:
        """Row of each mode's track at the point before and after on its line, -1 where none."""
        x = self._plan.coordinates[:, self._column][self._point]
        line = self._line[self._point]
        order = np.lexsort((x, line, self._track))
        order = order[self._ok[order]]
        same = (np.diff(self._track[order]) == 0) & (np.diff(line[order]) == 0)
        same &= np.diff(x[order]) > 0
        before, after = np.full((2, len(x)), -1)
        before[order[1:][same]] = order[:-1][same]
        after[order[:-1][same]] = order[1:][same]
        return before, after

    def _enter_value(
        self, table: Cells, rows: np.ndarray, value: np.ndarray, error: np.ndarray
    ) -> None:
        """Write onsets and their errors, in coordinates, to their rows."""
        log = self._follower.near.logarithmic(self._column)
        value = np.exp(value) if log else value
        table["onset"][rows] = value
        table["error_estimate"][rows] = error * value if log else error

    def _refine(
        self,
        events: pd.DataFrame,
        table: Cells,
        budget: RefinementBudget,
        spent: int,
        workers: Workers,
    ) -> int:
        """Refine crossings within the budget; return how many are left.

        Those with no unstable mode at one end come first, then the first of each track.
        """
        brackets = self._brackets(events, table)
        bounding = self._bounding(events)
        bounds = [rows for rows in brackets if rows[0] in bounding]
        others = [rows for rows in brackets if rows[0] not in bounding]
        n_unrefined = 0
        for max_solves, rows in ((budget.bounds, bounds), (budget.onsets, others)):
            max_solves = min(max_solves, budget.total - spent)
            used, unrefined = self._refine_within(max_solves, rows, events, table, workers)
            spent, n_unrefined = spent + used, n_unrefined + unrefined
        return n_unrefined

    def _bounding(self, events: pd.DataFrame) -> set[int]:
        """Rows of crossings that have unstable modes at one end only."""
        ends = events[events["before"] >= 0]
        before, after = (self._has_unstable[self._point[ends[end]]] for end in ("before", "after"))
        return set(ends.index[before != after].tolist())

    def _refine_within(
        self,
        budget: int,
        brackets: list[list[int]],
        events: pd.DataFrame,
        table: Cells,
        workers: Workers,
    ) -> tuple[int, int]:
        """Refine brackets in order until about `budget` points are solved; these and rows left.

        The budget may be exceeded by what solving the last brackets takes beyond expectation.
        """
        spent = done = 0
        batch_size = BRACKETS_PER_BATCH if self._plan.stacked else BRACKETS_PER_ROUND
        while done < len(brackets) and spent < budget:
            workers.report("onsets", done, len(brackets))
            batch: list[list[int]] = []
            expected_points = 0
            for rows in brackets[done : done + batch_size]:
                expected_points += EXPECTED_SOLVES_PER_ONSET * len(rows)
                if spent + expected_points > budget and batch:
                    break
                batch.append(rows)
            remaining = batch
            if self._plan.stacked:
                remaining, used = self._refine_batch(batch, events, table)
                spent += used
            tasks = [self._task(events, rows) for rows in remaining]
            for results in workers.each(refine_onsets, tasks):
                for row, onset in results:
                    spent += self._enter(table, row, onset, events)
            done += len(batch)
        if done:
            workers.report("onsets", done, done)
        return spent, sum(map(len, brackets[done:]))

    def _refine_batch(
        self, brackets: list[list[int]], events: pd.DataFrame, table: Cells
    ) -> tuple[list[list[int]], int]:
        """Refine crossings of small models as arrays; return brackets left and points solved."""
        rows = np.array([row for bracket_rows in brackets for row in bracket_rows], dtype=int)
        before, after = (events[end].to_numpy()[rows] for end in ("before", "after"))
        batch = BatchOnsets(
            plan=self._plan,
            follower=self._follower,
            judged=self._judged,
            column=self._column,
            tolerance=self._tolerance,
            precision=self._precision(),
        )
        points = self._point[before], self._point[after]
        onsets = batch.refine(Brackets(points, (self._place[before], self._place[after])))
        unrefined, spent = set(), 0
        for row, onset in zip(rows.tolist(), onsets, strict=True):
            if onset is None:
                unrefined.add(row)
            else:
                spent += self._enter(table, row, onset, events)
        remaining = [[row for row in bracket_rows if row in unrefined] for bracket_rows in brackets]
        return [bracket_rows for bracket_rows in remaining if bracket_rows], spent

    def _brackets(self, events: pd.DataFrame, table: Cells) -> list[list[int]]:
        """Rows of crossings in the order to refine them, one list for each pair of points."""
        rows = self._open(events, table)
        crossing = events.iloc[rows]
        a, b = (self._point[crossing[end].to_numpy()] for end in ("before", "after"))
        into = (crossing["direction"] == INTO).to_numpy()
        order = crossing["value"].groupby([crossing["track"], into]).rank(method="first")
        urgent = np.where(into, order, order + 0.5)
        ordered = np.lexsort((crossing["track"], urgent))
        ordered = ordered[self._follower.near.joined(a, b)[ordered]]
        rows_between: dict[tuple[int, int], list[int]] = {}
        for row, *ends in np.column_stack([rows, a, b])[ordered].tolist():
            rows_between.setdefault((ends[0], ends[1]), []).append(row)
        return list(rows_between.values())

    def _task(self, events: pd.DataFrame, rows: list[int]) -> OnsetTask:
        before, after = (events[end].to_numpy()[rows] for end in ("before", "after"))
        a, b = int(self._point[before[0]]), int(self._point[after[0]])
        x, follower = self._plan.coordinates[:, self._column], self._follower
        return OnsetTask(
            rows=rows,
            places=list(
                zip(self._place[before].tolist(), self._place[after].tolist(), strict=True)
            ),
            between=follower.near.of(a),
            column=self._column,
            end=float(x[b]),
            low=Modes(self._judged[a], follower.raw(a)),
            high=Modes(self._judged[b], follower.raw(b)),
            tolerance=self._tolerance,
            precision=self._precision(),
        )

    def _precision(self) -> float:
        """Half the promised tolerance, in coordinates: Brent's method may err by twice its own."""
        if self._follower.near.logarithmic(self._column) or self._along == ONSET_PARAMETER:
            return ONSET_TOLERANCE / 2
        return ONSET_TOLERANCE / 2 * float(np.ptp(self._plan.coordinates[:, self._column]))

    def _shift(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """How far errors of roots move crossings (n,) between two rows each, in coordinates."""
        x = self._plan.coordinates[:, self._column]
        change = self._zeta[after] - self._zeta[before]
        step = x[self._point[after]] - x[self._point[before]]
        worse = np.maximum(self._error[before], self._error[after])
        shift: np.ndarray = np.abs(worse * step / np.where(change == 0, np.inf, change))
        return np.minimum(shift, np.abs(step))

    def _enter(self, table: Cells, row: int, onset: Onset | str, events: pd.DataFrame) -> int:
        """Write a refined onset, or why there is none, to its row; return its evaluations."""
        if isinstance(onset, str):
            renumbered = onset == NO_CROSSING
            table["status"][row] = RENUMBERED if renumbered else NOT_LOCATED
            if renumbered:
                table["onset"][row] = np.nan
            return 0
        rows = np.array([row])
        ends = (events[end].to_numpy()[rows] for end in ("before", "after"))
        error = 2.0 * self._precision() + self._shift(*ends)
        self._enter_value(table, rows, np.array([onset.value]), error)
        table["frequency_hz"][row] = onset.frequency_hz
        table["status"][row] = REFINED
        table["evaluations"][row] = onset.evaluations
        return onset.evaluations
