"""What the finished rows of a design study say of designs at operating points."""

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
from squealstudy.kinds.design.study import DesignStudy, one_sigma


class EvaluatedDesigns:
    """Designs as far as their rows are finished, and which rows are missing.

    Parameters
    ----------
    study : DesignStudy
    rows : mapping of Evaluation -> row
        All that are finished.
    reduced : bool
        The model is a reduced one: there is a full order to hold it against.
    cyclic : bool
        Limit cycles and runs can be looked for.
    memory : SearchCache
        What was made of rows before.

    Attributes
    ----------
    state : State
    pending : list of Evaluation
        What was asked for and has no row.
    """

    def __init__(
        self,
        study: DesignStudy,
        rows: Rows,
        reduced: bool,
        cyclic: bool,
        memory: SearchCache,
    ) -> None:
        self.study, self.rows, self.reduced, self.cyclic = study, rows, reduced, cyclic
        self.memory = memory
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
        self.sigmas = {s.name: float(np.ptp(one_sigma(s))) / 2 for s in study.uncertain}
        if self.goal.margin.probability is not None:
            from scipy.stats import norm

            self.state.safety = max(float(norm.ppf(self.goal.margin.probability)), 0.0)
        self.plain = MODES if self.sigmas else ROOTS  # what scatters needs its slopes

    def row(self, asked: Evaluation) -> Mapping[str, Any] | None:
        """The row of what was asked; None, and it joins what is wanted, where there is none."""
        row = self.rows.get(asked)
        if row is None:
            self.pending.append(asked)
        return row

    def rows_of(self, evaluations: Iterable[Evaluation]) -> list[Mapping[str, Any]]:
        """Rows of all; raises where one is missing."""
        rows = [self.row(a) for a in evaluations]
        if self.pending:
            raise RowsPending
        return [r for r in rows if r is not None]

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (d,) of the variables at a change in units of their ranges."""
        unrounded = self.study.nominal + np.clip(z, self.box.low, self.box.high) * self.ranges
        return np.array([float(f"{v:.9g}") for v in unrounded])

    def change(self, design: np.ndarray) -> np.ndarray:
        """The other way."""
        return (design - self.study.nominal) / self.ranges

    def evaluation(self, point: int, design: np.ndarray, analysis: str = MODES) -> Evaluation:
        """One design at one of the points."""
        return evaluation(self.study, self.state.points[point], design, analysis)

    def margin_evaluation(self, point: int, design: np.ndarray) -> Evaluation:
        """What tells whether a design meets the margin at a point, at least cost.

        Sensitivities are for today's design, for the search, and for a scatter.
        """
        searched = point in self.state.active_points or np.array_equal(design, self.study.nominal)
        return self.evaluation(point, design, MODES if searched else self.plain)

    def finished_modes(
        self, point: int, design: np.ndarray
    ) -> tuple[Evaluation, Mapping[str, Any]] | None:
        """A design's modes at one of the points, with sensitivities where there are any."""
        both = (self.evaluation(point, design, analysis) for analysis in (MODES, ROOTS))
        return next(((a, self.rows[a]) for a in both if a in self.rows), None)

    def register_design(self, design: np.ndarray, role: str) -> None:
        """Keep a design, with why it was first asked for."""
        key = design.tobytes()
        self.state.designs.setdefault(key, design)
        self.state.roles.setdefault(key, (role, self.state.round))

    def constraints(
        self, design: np.ndarray, points: Iterable[int], analysis: str | None = MODES
    ) -> Constraints | None:
        """What a design's rows of an analysis say at some points; what is missing joins the wanted.

        Without an analysis, rows of any are good and nothing is wanted. None where one is missing,
        or a point of it could not be solved.
        """
        excess, slopes, whole = [], [], True
        for p in points:
            if analysis is None:
                evaluated = self.finished_modes(p, design)
            else:
                evaluation_here = self.evaluation(p, design, analysis)
                row = self.row(evaluation_here)
                evaluated = None if row is None else (evaluation_here, row)
            if evaluated is None or evaluated[1]["status"] != "ok":
                whole = False
                continue
            damping = self._seen(*evaluated)
            needed = self.margin + self.state.safety * damping.scatter
            for demand in self.state.demands:
                if demand.point == p:
                    more = np.maximum(needed, demand.damping_ratio)
                    needed = np.where(demand.near(damping.hz), more, needed)
            gone = np.array([m["damping_ratio"] for m in self.modes_moved_out(p, evaluated[1])])
            excess += [damping.zeta - needed, gone - min(self.margin, 0.0)]
            slopes += [damping.slopes, np.zeros((len(gone), len(self.ranges)))]
        if not whole or not excess:
            return None
        return Constraints(np.concatenate(excess), np.concatenate(slopes))

    def modes_moved_out(self, point: int, row: Row) -> list[Mapping[str, float]]:
        """Growing modes beside the band, beyond those of today's design there, else anywhere."""
        nominal = self.study.nominal
        points = [point] if self.finished_modes(point, nominal) else range(self.state.n_matrix)
        today = [finished[1] for p in points if (finished := self.finished_modes(p, nominal))]
        return modes_moved_out(row, today, self.study.definition.modes.band)

    def _seen(self, asked: Evaluation, row: Mapping[str, Any]) -> ModeDamping:
        remembered = self.memory.seen
        if asked not in remembered:
            remembered[asked] = mode_damping_of(row, self.study, self.ranges, self.sigmas)
        return remembered[asked]

    def by_margin(self, design: np.ndarray, points: Iterable[int]) -> list[int]:
        """Points by what a design has there, least first; those that failed come first."""
        margin_and_point = []
        for p in points:
            row = self.rows[self.margin_evaluation(p, design)]
            ok = row["status"] == "ok" and np.isfinite(row["min_damping_ratio"])
            none = np.inf if row["status"] == "ok" else -np.inf
            margin_and_point.append((row["min_damping_ratio"] if ok else none, p))
        return [p for _, p in sorted(margin_and_point)]
