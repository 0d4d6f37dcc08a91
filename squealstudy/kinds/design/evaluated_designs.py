"""Finished rows of a design study: designs at operating points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from squealstudy.kinds.design.plan import MODES, ROOTS, Evaluation, evaluation, operating_points
from squealstudy.kinds.design.search import Box, Constraints
from squealstudy.kinds.design.state import (
    ModeDamping,
    Row,
    Rows,
    RowsPending,
    SearchCache,
    State,
    mode_damping_of,
    modes_moved_out,
)
from squealstudy.kinds.design.study import DesignStudy, deviations


class EvaluatedDesigns:
    """Designs as far as their rows are finished, and which rows are missing.

    Parameters
    ----------
    study : DesignStudy
    rows : mapping of Evaluation -> row
        All finished rows.
    reduced : bool
        Whether the model is a reduced one, which can be checked at full order.
    has_cycles : bool
        Whether the model is small enough for limit cycles and runs in time.
    cache : SearchCache
        Results that earlier passes of the search computed from rows.

    Attributes
    ----------
    state : State
    pending : list of Evaluation
        Evaluations that were asked for and have no row yet.
    """

    def __init__(
        self,
        study: DesignStudy,
        rows: Rows,
        reduced: bool,
        has_cycles: bool,
        cache: SearchCache,
    ) -> None:
        self.study, self.rows, self.reduced, self.has_cycles = study, rows, reduced, has_cycles
        self.cache = cache
        self.goal = study.goal
        matrix = list(operating_points(study))
        self.state = State(matrix, len(matrix), list(range(len(matrix))))
        self.pending: list[Evaluation] = []
        self.ranges = ranges = np.array([v.range for v in study.variables], dtype=float)
        self.box = Box(
            low=np.array([v.low for v in study.variables]) / ranges,
            high=np.array([v.high for v in study.variables]) / ranges,
            cost=np.array([v.cost for v in study.variables], dtype=float),
        )
        self.margin = self.goal.margin.damping_ratio
        if self.goal.margin.probability is not None:
            from scipy.stats import norm

            self.state.safety = max(float(norm.ppf(self.goal.margin.probability)), 0.0)
        self.plain = MODES if study.uncertain else ROOTS  # scatter is judged by sensitivities

    def row(self, evaluation: Evaluation) -> Mapping[str, Any] | None:
        """The row of an evaluation; without one None, and the evaluation becomes pending."""
        row = self.rows.get(evaluation)
        if row is None:
            self.pending.append(evaluation)
        return row

    def rows_of(self, evaluations: Iterable[Evaluation]) -> list[Mapping[str, Any]]:
        """Rows of all evaluations; RowsPending where one is missing."""
        rows = [self.row(a) for a in evaluations]
        if self.pending:
            raise RowsPending
        return [r for r in rows if r is not None]

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (d,) of the variables at a change in units of their ranges."""
        unrounded = self.study.nominal + np.clip(z, self.box.low, self.box.high) * self.ranges
        return np.array([float(f"{v:.9g}") for v in unrounded])

    def change(self, design: np.ndarray) -> np.ndarray:
        """The change in units of the ranges that leads to a design (d,)."""
        return (design - self.study.nominal) / self.ranges

    def evaluation(self, point: int, design: np.ndarray, analysis: str = MODES) -> Evaluation:
        """The evaluation of a design at the operating point with an index."""
        return evaluation(self.study, self.state.points[point], design, analysis)

    def margin_evaluation(self, point: int, design: np.ndarray) -> Evaluation:
        """The cheapest evaluation that shows whether a design meets the margin at a point.

        It has sensitivities for today's design, at active points, and if parameters scatter.
        """
        searched = point in self.state.active_points or np.array_equal(design, self.study.nominal)
        return self.evaluation(point, design, MODES if searched else self.plain)

    def finished_modes(
        self, point: int, design: np.ndarray
    ) -> tuple[Evaluation, Mapping[str, Any]] | None:
        """A design's evaluation and row at a point, with sensitivities if possible; or None."""
        both = (self.evaluation(point, design, analysis) for analysis in (MODES, ROOTS))
        return next(((a, self.rows[a]) for a in both if a in self.rows), None)

    def register_design(self, design: np.ndarray, role: str) -> None:
        """Add a design, with its role in the search when it was first evaluated."""
        key = design.tobytes()
        self.state.designs.setdefault(key, design)
        self.state.roles.setdefault(key, (role, self.state.round))

    def constraints(
        self, design: np.ndarray, points: Iterable[int], analysis: str | None = MODES
    ) -> Constraints | None:
        """Constraints on a design at some points by rows of an analysis; missing rows are pending.

        Without an analysis rows of modes or roots are used, and nothing becomes pending. None where
        a row is missing, or its point could not be solved.
        """
        excess, slopes, complete = [], [], True
        for p in points:
            if analysis is None:
                evaluated = self.finished_modes(p, design)
            else:
                evaluation_here = self.evaluation(p, design, analysis)
                row = self.row(evaluation_here)
                evaluated = None if row is None else (evaluation_here, row)
            if evaluated is None or evaluated[1]["status"] != "ok":
                complete = False
                continue
            damping = self._damping(*evaluated)
            needed = self.margin + self._reserve(damping.scatter)
            for demand in self.state.demands:
                if demand.point == p:
                    more = np.maximum(needed, demand.damping_ratio)
                    needed = np.where(demand.near(damping.hz), more, needed)
            moved_out = np.array(
                [m["damping_ratio"] for m in self.modes_moved_out(p, evaluated[1])]
            )
            excess += [damping.zeta - needed, moved_out - min(self.margin, 0.0)]
            slopes += [damping.slopes, np.zeros((len(moved_out), len(self.ranges)))]
        if not complete or not excess:
            return None
        return Constraints(np.concatenate(excess), np.concatenate(slopes))

    def _reserve(self, slopes: np.ndarray) -> np.ndarray | float:
        """Damping ratios (m,) that the scatter may take, from their slopes (m, k) by it."""
        if not self.state.safety or not self.study.uncertain:
            return 0.0
        deviations_at = self.cache.deviations_at
        if self.state.safety not in deviations_at:
            deviations_at[self.state.safety] = deviations(self.study, self.state.safety)
        fall, rise = deviations_at[self.state.safety]
        losses = np.where(slopes > 0, slopes * fall, -slopes * rise)
        return np.linalg.norm(losses, axis=1)

    def modes_moved_out(self, point: int, row: Row) -> list[Mapping[str, float]]:
        """Growing modes outside the band in excess of today's design there (`modes_moved_out`).

        If today's design was not solved at the point, all its solved points count.
        """
        nominal = self.study.nominal
        points = [point] if self.finished_modes(point, nominal) else range(self.state.n_matrix)
        today = [finished[1] for p in points if (finished := self.finished_modes(p, nominal))]
        return modes_moved_out(row, today, self.study.definition.modes.band)

    def _damping(self, evaluation: Evaluation, row: Mapping[str, Any]) -> ModeDamping:
        damping_of = self.cache.damping_of
        if evaluation not in damping_of:
            damping_of[evaluation] = mode_damping_of(row, self.study, self.ranges)
        return damping_of[evaluation]

    def by_margin(self, design: np.ndarray, points: Iterable[int]) -> list[int]:
        """Points in ascending order of a design's damping there; those that failed come first."""
        margin_and_point = []
        for p in points:
            row = self.rows[self.margin_evaluation(p, design)]
            ok = row["status"] == "ok" and np.isfinite(row["min_damping_ratio"])
            none = np.inf if row["status"] == "ok" else -np.inf
            margin_and_point.append((row["min_damping_ratio"] if ok else none, p))
        return [p for _, p in sorted(margin_and_point)]
