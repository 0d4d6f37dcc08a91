"""What the finished rows of a design study say of designs at operating points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from squealstudy.kinds.design.plan import MODES, ROOTS, Ask, ask, operating_points
from squealstudy.kinds.design.search import Box, Judged
from squealstudy.kinds.design.state import (
    Memory,
    Row,
    Rows,
    Seen,
    State,
    Wanted,
    moved_out,
    seen_of,
)
from squealstudy.kinds.design.study import DesignStudy, one_sigma


class Evaluations:
    """Designs as far as their rows are finished, and which rows are missing.

    Parameters
    ----------
    study : DesignStudy
    rows : mapping of Ask -> row
        All that are finished.
    reduced : bool
        The model is a reduced one: there is a full order to hold it against.
    cyclic : bool
        Limit cycles and runs can be looked for.
    memory : Memory
        What was made of rows before.

    Attributes
    ----------
    state : State
    wanted : list of Ask
        What was asked for and has no row.
    """

    def __init__(
        self,
        study: DesignStudy,
        rows: Rows,
        reduced: bool,
        cyclic: bool,
        memory: Memory,
    ) -> None:
        self.study, self.rows, self.reduced, self.cyclic = study, rows, reduced, cyclic
        self.memory = memory
        self.goal = study.goal
        matrix = list(operating_points(study))
        self.state = State(matrix, len(matrix), list(range(len(matrix))))
        self.wanted: list[Ask] = []
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

    def row(self, asked: Ask) -> Mapping[str, Any] | None:
        """The row of what was asked; None, and it joins what is wanted, where there is none."""
        found = self.rows.get(asked)
        if found is None:
            self.wanted.append(asked)
        return found

    def rows_of(self, asks: Iterable[Ask]) -> list[Mapping[str, Any]]:
        """Rows of all; raises where one is missing."""
        found = [self.row(a) for a in asks]
        if self.wanted:
            raise Wanted
        return [r for r in found if r is not None]

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (d,) of the variables at a change in units of their ranges."""
        found = self.study.nominal + np.clip(z, self.box.low, self.box.high) * self.ranges
        return np.array([float(f"{v:.9g}") for v in found])

    def change(self, design: np.ndarray) -> np.ndarray:
        """The other way."""
        return (design - self.study.nominal) / self.ranges

    def ask(self, point: int, design: np.ndarray, stage: str = MODES) -> Ask:
        """One design at one of the points."""
        return ask(self.study, self.state.points[point], design, stage)

    def judging(self, point: int, design: np.ndarray) -> Ask:
        """What tells whether a design meets the margin at a point, at least cost.

        Sensitivities are for today's design, for the search, and for a scatter.
        """
        searched = point in self.state.view or np.array_equal(design, self.study.nominal)
        return self.ask(point, design, MODES if searched else self.plain)

    def known(self, point: int, design: np.ndarray) -> tuple[Ask, Mapping[str, Any]] | None:
        """A design's modes at one of the points, with sensitivities where there are any."""
        both = (self.ask(point, design, stage) for stage in (MODES, ROOTS))
        return next(((a, self.rows[a]) for a in both if a in self.rows), None)

    def note(self, design: np.ndarray, role: str) -> None:
        """Keep a design, with why it was first asked for."""
        key = design.tobytes()
        self.state.designs.setdefault(key, design)
        self.state.roles.setdefault(key, (role, self.state.round))

    def judged(
        self, design: np.ndarray, points: Iterable[int], stage: str | None = MODES
    ) -> Judged | None:
        """What a design's rows of a stage say at some points; what is missing joins the wanted.

        Without a stage, rows of any are good and nothing is wanted. None where one is missing, or a
        point of it could not be solved.
        """
        excess, slopes, whole = [], [], True
        for p in points:
            if stage is None:
                found = self.known(p, design)
            else:
                asked = self.ask(p, design, stage)
                row = self.row(asked)
                found = None if row is None else (asked, row)
            if found is None or found[1]["status"] != "ok":
                whole = False
                continue
            seen = self._seen(*found)
            needed = self.margin + self.state.safety * seen.scatter
            for extra in self.state.extras:
                if extra.point == p:
                    more = np.maximum(needed, extra.damping_ratio)
                    needed = np.where(extra.near(seen.hz), more, needed)
            gone = np.array([m["damping_ratio"] for m in self.moved_out(p, found[1])])
            excess += [seen.zeta - needed, gone - min(self.margin, 0.0)]
            slopes += [seen.slopes, np.zeros((len(gone), len(self.ranges)))]
        if not whole or not excess:
            return None
        return Judged(np.concatenate(excess), np.concatenate(slopes))

    def moved_out(self, point: int, row: Row) -> list[Mapping[str, float]]:
        """Growing modes beside the band, beyond those of today's design there, else anywhere."""
        nominal = self.study.nominal
        points = [point] if self.known(point, nominal) else range(self.state.n_matrix)
        today = [own[1] for p in points if (own := self.known(p, nominal))]
        return moved_out(row, today, self.study.definition.modes.band)

    def _seen(self, asked: Ask, row: Mapping[str, Any]) -> Seen:
        seen = self.memory.seen
        if asked not in seen:
            seen[asked] = seen_of(row, self.study, self.ranges, self.sigmas)
        return seen[asked]

    def by_margin(self, design: np.ndarray, points: Iterable[int]) -> list[int]:
        """Points by what a design has there, least first; those that failed come first."""
        found = []
        for p in points:
            row = self.rows[self.judging(p, design)]
            ok = row["status"] == "ok" and np.isfinite(row["min_damping_ratio"])
            none = np.inf if row["status"] == "ok" else -np.inf
            found.append((row["min_damping_ratio"] if ok else none, p))
        return [p for _, p in sorted(found)]
