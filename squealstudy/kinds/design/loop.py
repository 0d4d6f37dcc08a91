"""The loop of a design study: scan, search, proof, and again with what the proof has shown.

Today's design, where it meets the goal, is proven before anything is searched. The loop is replayed
from finished rows alone, so a killed run asks for the same designs again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from squealstudy.kinds.design.plan import MODES, ROOTS, Ask, ask, operating_points
from squealstudy.kinds.design.proof import AMPLITUDES, Proof
from squealstudy.kinds.design.search import Box, Judged, descend
from squealstudy.kinds.design.state import (
    MET,
    MET_LINEAR,
    NONE_FOUND,
    NOTHING,
    PROVEN,
    STOPPED,
    UNDECIDED,
    UNPROVEN,
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
from squealstudy.kinds.design.targets import Realisation, is_target, nearest, part_of

SCANNED = 16  # designs a variable, where a variable costs no reduction
MOST_CORNERS = 6  # variables of a box whose corners are in the scan
SCAN_POINTS = 6  # operating points at which the scan looks
FEW, WORKING = 16, 12  # operating points that the search has all in view; else the worst so many
APART = 0.15  # least distance between starts, in units of the ranges
ROUNDS = 10  # of search and proof
EASED = 4  # of them after one that succeeds, in which less is asked of what runs had refused
SAVED = 0.01  # of the cost: what these must save


class Loop:
    """A design study as far as its finished rows go.

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
        What is to be solved next; empty at the end.
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
        self.targets = np.array([is_target(v.parameter) for v in study.variables], dtype=bool)
        self.both = bool(self.targets.any() and not self.targets.all())
        self.whole, self.kept = self.box, np.ones(len(ranges), dtype=bool)
        self.margin = self.goal.margin.damping_ratio
        self.sigmas = {s.name: float(np.ptp(one_sigma(s))) / 2 for s in study.uncertain}
        if self.goal.margin.probability is not None:
            from scipy.stats import norm

            self.state.safety = max(float(norm.ppf(self.goal.margin.probability)), 0.0)
        self.plain = MODES if self.sigmas else ROOTS  # what scatters needs its slopes
        try:
            self._run()
        except Wanted:
            self.wanted = list(dict.fromkeys(self.wanted))

    # -- what is known ---------------------------------------------------------------------------
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

    # -- the loop --------------------------------------------------------------------------------
    def _run(self) -> None:
        state, today = self.state, self.study.nominal
        self.note(today, "today")
        judged = self.judged(today, range(state.n_matrix))
        if self.wanted:
            raise Wanted
        worst = self.by_margin(today, range(state.n_matrix))
        if state.n_matrix > FEW:
            state.view = sorted(worst[:WORKING])
        good, fixed = judged is not None and judged.worst >= 0.0, not self.study.variables
        if good or fixed:  # nothing costs less than no change
            state.chosen, state.outcome = today, self._proven(today) if good else NOTHING
            if fixed or state.outcome != UNPROVEN:
                return
        starts = self._realised(worst) if self.both else self._starts(worst)
        last = ROUNDS
        best: tuple[np.ndarray, str] | None = None
        while state.round < last:
            state.round += 1
            starts = self._search(starts, "search")
            chosen = self._cheapest()
            if best is not None and (chosen is None or not self._saves(chosen, best[0])):
                break
            if chosen is None:
                state.chosen = self._nearest()
                state.outcome = UNDECIDED if state.failure else NONE_FOUND
                return
            state.chosen = chosen
            state.outcome = self._proven(chosen)
            if state.outcome != UNPROVEN:
                last = last if best is not None else state.round + EASED
                best = chosen, state.outcome
                state.extras = [e.eased() for e in state.extras]
                if state.outcome not in PROVEN or all(e.known for e in state.extras):
                    break
            elif best is not None and not self._holds(best[0]):
                best, last = None, ROUNDS
            if len(state.designs) > self._limit():
                state.outcome = STOPPED
                break
            starts = self._distinct([*starts, self.change(chosen)])
        if best is not None:
            state.chosen, state.outcome = best
            state.extras = [e.shown for e in state.extras]

    def _holds(self, proven: np.ndarray) -> bool:
        """Whether a proven design has what others were shown to lack."""
        asked, self.state.extras = self.state.extras, [e.shown for e in self.state.extras]
        judged = self.judged(proven, self.state.view, None)
        self.state.extras = asked
        return judged is not None and judged.worst >= 0.0

    def _saves(self, design: np.ndarray, proven: np.ndarray) -> bool:
        """Whether a design costs less than one that is proven."""
        own, before = (self.box.price(self.change(x)) for x in (design, proven))
        return own < (1.0 - SAVED) * before

    def _proven(self, design: np.ndarray) -> str:
        """What the proof of a design comes to."""
        state = self.state
        if not Proof(self).passed(design):
            return UNPROVEN
        checks = [c for c in state.checks if c.round == state.round]
        if not all(c.passed for c in checks):
            return UNDECIDED
        return MET if any(c.kind in AMPLITUDES for c in checks) else MET_LINEAR

    def _realised(self, worst: Sequence[int]) -> list[np.ndarray]:
        """Starts among what can be built: nearest to the best targets first."""
        today = self.study.nominal
        self._move(self.targets)
        self._search(self._starts(worst), "target")
        found = self._cheapest()
        target = self._nearest() if found is None else found
        self._move(~self.targets)
        rows = [self.rows[self.ask(p, today)] for p in self.state.view]
        names = [v.name for v in self.study.variables]
        z, matched = nearest(rows, names, self.ranges, self.change(target), self.box)
        begun = self.values(z)
        self.state.realisation = Realisation(target, found is not None, begun, matched)
        return self._distinct([self.change(begun), *self._starts(worst)])

    def _move(self, kept: np.ndarray) -> None:
        """Search over some of the variables (d,) from here on; the others stay as today."""
        self.kept, self.box = kept, part_of(self.whole, kept)

    def _limit(self) -> int:
        first = self.both and bool(self.kept[self.targets].all())  # the others need designs, too
        return self.goal.designs // (2 if first else 1) + self._scanned()

    def _scanned(self) -> int:
        if self.goal.scan is not None:
            return self.goal.scan
        moved = [v for v, kept in zip(self.study.variables, self.kept, strict=True) if kept]
        costly = self.reduced and any(v.parameter.structural for v in moved)
        return 0 if costly else SCANNED * len(moved)

    def by_margin(self, design: np.ndarray, points: Iterable[int]) -> list[int]:
        """Points by what a design has there, least first; those that failed come first."""
        found = []
        for p in points:
            row = self.rows[self.judging(p, design)]
            ok = row["status"] == "ok" and np.isfinite(row["min_damping_ratio"])
            none = np.inf if row["status"] == "ok" else -np.inf
            found.append((row["min_damping_ratio"] if ok else none, p))
        return [p for _, p in sorted(found)]

    def _starts(self, worst: Sequence[int]) -> list[np.ndarray]:
        """Today's design, and the best of a scan that lie apart."""
        today, count = np.zeros(len(self.ranges)), self._scanned()
        if not count or self.goal.starts == 1:
            return [today]
        from scipy.stats import qmc

        rng = np.random.default_rng(self.goal.seed)
        unit = qmc.Sobol(len(self.ranges), scramble=True, seed=rng)
        z = unit.random_base2((count - 1).bit_length())[:count]
        z = np.vstack([self._corners(), self.box.low + z * (self.box.high - self.box.low)])
        looked = [p for p in worst if p in self.state.view][:SCAN_POINTS]
        designs = [self.values(own) for own in z]
        found = []
        for design in designs:
            self.note(design, "scan")
            found.append(self.judged(design, looked, self.plain))
        if self.wanted:
            raise Wanted
        weight = 1e2 * float(self.box.cost.sum())
        merits = [
            np.inf if j is None else self.box.price(self.change(x)) + weight * max(0.0, -j.worst)
            for x, j in zip(designs, found, strict=True)
        ]
        ordered = [self.change(designs[i]) for i in np.argsort(merits, kind="stable")]
        signs: dict[bytes, np.ndarray] = {}  # the cost has no kink where signs do not change
        for own in ordered:
            signs.setdefault(np.sign(own).tobytes(), own)
        return self._distinct([today, *signs.values(), *ordered])

    def _corners(self) -> np.ndarray:
        """Corners (2^d, d) of the box, none of a box that has too many."""
        d = len(self.ranges)
        if d > MOST_CORNERS:
            return np.zeros((0, d))
        ends = np.column_stack([self.box.low, self.box.high])
        found = np.unique(np.array(list(itertools.product(*ends))), axis=0)
        return found[np.abs(found).max(axis=1) > 0]

    def _distinct(self, designs: Iterable[np.ndarray]) -> list[np.ndarray]:
        """The first so many that lie apart."""
        kept: list[np.ndarray] = []
        for z in designs:
            if all(np.abs(z - other).max() >= APART for other in kept):
                kept.append(z)
        return kept[: self.goal.starts]

    def _search(self, starts: Sequence[np.ndarray], role: str) -> list[np.ndarray]:
        """Where the searches from all starts end; raises where rows are missing."""
        ends, most = [], self._limit()
        for number, start in enumerate(starts, start=1):
            run = descend(self.box, start, self.margin, self.memory.steps)
            asked = next(run)
            try:
                while True:
                    design = self.values(asked)
                    if design.tobytes() not in self.state.designs:
                        if len(self.state.designs) >= most:
                            ends.append(asked)
                            break
                        self.note(design, f"{role} {number}")
                    judged = self.judged(design, self.state.view)
                    if self._lacks(design):
                        break
                    asked = run.send(judged)
            except StopIteration as end:
                ends.append(end.value)
        if self.wanted:
            raise Wanted
        return ends

    def _lacks(self, design: np.ndarray) -> bool:
        return any(self.ask(p, design) not in self.rows for p in self.state.view)

    def _evaluated(self) -> list[tuple[np.ndarray, Judged]]:
        """Designs of the variables that move which are known at all points in view."""
        fixed = self.study.nominal[~self.kept]
        own = [x for x in self.state.designs.values() if np.array_equal(x[~self.kept], fixed)]
        known = ((x, self.judged(x, self.state.view, None)) for x in own)
        return [(x, judged) for x, judged in known if judged is not None]

    def _cheapest(self) -> np.ndarray | None:
        """The design of least cost that meets what is asked at the points in view."""
        good = [x for x, j in self._evaluated() if j.worst >= 0.0]
        return min(good, key=lambda x: self.box.price(self.change(x)), default=None)

    def _nearest(self) -> np.ndarray:
        """The design of largest margin at the points in view."""
        found = max(self._evaluated(), key=lambda item: item[1].worst, default=None)
        if found is not None:
            return found[0]
        known = (self.known(p, self.study.nominal) for p in self.state.view)
        failed = (own[1] for own in known if own is not None and own[1]["status"] != "ok")
        self.state.failure = next((str(row["message"] or row["status"]) for row in failed), "")
        return self.study.nominal
