"""The search of a design study: scan, descent, proof; then again with the demands of the proof.

If today's design meets the goal it is proven before anything is searched. The search is replayed
from finished rows only, so that a run that was killed asks for the same designs again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from squealstudy.kinds.design.evaluated_designs import EvaluatedDesigns
from squealstudy.kinds.design.proof import AMPLITUDES, Proof
from squealstudy.kinds.design.search import Constraints, descend
from squealstudy.kinds.design.state import (
    MET,
    MET_LINEAR,
    NO_VARIABLES,
    NONE_FOUND,
    PROVEN,
    STOPPED,
    UNDECIDED,
    UNPROVEN,
    Rows,
    RowsPending,
    SearchCache,
)
from squealstudy.kinds.design.study import DesignStudy
from squealstudy.kinds.design.targets import Realisation, nearest, part_of
from squealstudy.models.parameter_names import ModeParameter

SCAN_DESIGNS_PER_VARIABLE = 16  # designs in the scan for each variable, if none costs a reduction
MOST_CORNERS = 6  # most variables of a box whose corners are in the scan
SCAN_POINTS = 6  # operating points at which designs of the scan are solved
# up to so many operating points are all active; if there are more, so many of the worst are
MAX_POINTS_ALL_SEARCHED, N_WORST_POINTS_SEARCHED = 16, 12
MIN_START_DISTANCE = 0.15  # least distance between starts, in units of the ranges
MAX_ROUNDS = 10  # rounds of search and proof
# most rounds after the first proof, in which demands that runs in time had raised are reduced
RELAXATION_ROUNDS = 4
MIN_REL_COST_SAVING = 0.01  # least relative saving of cost in these rounds


class DesignSearch(EvaluatedDesigns):
    """The search of a design study as far as its finished rows go.

    Parameters are those of `EvaluatedDesigns`.

    Attributes
    ----------
    pending : list of Evaluation
        Evaluations that are needed next; empty at the end.
    """

    def __init__(
        self,
        study: DesignStudy,
        rows: Rows,
        reduced: bool,
        has_cycles: bool,
        cache: SearchCache,
    ) -> None:
        super().__init__(study, rows, reduced, has_cycles, cache)
        of_modes = [isinstance(v.parameter, ModeParameter) for v in study.variables]
        # which variables (d,) are targets for modes, which nobody can build
        self.targets = np.array(of_modes, dtype=bool)
        self.both = bool(self.targets.any() and not self.targets.all())
        self.whole, self.kept = self.box, np.ones(len(self.ranges), dtype=bool)
        try:
            self._run()
        except RowsPending:
            self.pending = list(dict.fromkeys(self.pending))

    def _run(self) -> None:
        """Search and check designs in rounds; RowsPending where results are still missing."""
        state, today = self.state, self.study.nominal
        self.register_design(today, "today")
        constraints = self.constraints(today, range(state.n_matrix))
        if self.pending:
            raise RowsPending
        worst = self.by_margin(today, range(state.n_matrix))
        if state.n_matrix > MAX_POINTS_ALL_SEARCHED:
            state.active_points = sorted(worst[:N_WORST_POINTS_SEARCHED])
        good, fixed = constraints is not None and constraints.worst >= 0.0, not self.study.variables
        if good or fixed:  # nothing costs less than no change
            state.chosen, state.outcome = today, self._proven(today) if good else NO_VARIABLES
            if fixed or state.outcome != UNPROVEN:
                return
        starts = self._realised(worst) if self.both else self._starts(worst)
        last = MAX_ROUNDS
        best: tuple[np.ndarray, str] | None = None
        while state.round < last:
            state.round += 1
            starts = self._search(starts, "search")
            chosen = self._cheapest()
            if best is not None and (chosen is None or not self._saves(chosen, best[0])):
                break
            if chosen is None:
                self._judge_nearest()
                return
            state.chosen = chosen
            state.outcome = self._proven(chosen)
            if state.outcome != UNPROVEN:
                last = last if best is not None else state.round + RELAXATION_ROUNDS
                best = chosen, state.outcome
                state.demands = [e.reduced() for e in state.demands]
                if state.outcome not in PROVEN or all(e.is_settled for e in state.demands):
                    break
            elif best is not None and not self._holds(best[0]):
                best, last = None, MAX_ROUNDS
            if len(state.designs) > self._limit():
                state.outcome = STOPPED
                break
            starts = self._distinct([*starts, self.change(chosen)])
        if best is not None:
            state.chosen, state.outcome = best
            state.demands = [e.at_proven_level for e in state.demands]

    def _judge_nearest(self) -> None:
        """Choose the design of largest margin where none allows for scatter: samples decide."""
        state, nearest = self.state, self._nearest()
        outcome = UNDECIDED if state.failure else NONE_FOUND
        if state.safety and not state.failure:
            state.safety = 0.0  # first order says less than the samples
            outcome = self._proven(nearest)
            outcome = NONE_FOUND if outcome == UNPROVEN else outcome
        state.chosen, state.outcome = nearest, outcome

    def _holds(self, proven: np.ndarray) -> bool:
        """Whether a proven design meets the demands that were shown for other designs."""
        pending_demands, self.state.demands = (
            self.state.demands,
            [e.at_proven_level for e in self.state.demands],
        )
        constraints = self.constraints(proven, self.state.active_points, None)
        self.state.demands = pending_demands
        return constraints is not None and constraints.worst >= 0.0

    def _saves(self, design: np.ndarray, proven: np.ndarray) -> bool:
        """Whether a design costs less than one that is proven."""
        cost, before = (self.box.price(self.change(x)) for x in (design, proven))
        return cost < (1.0 - MIN_REL_COST_SAVING) * before

    def _proven(self, design: np.ndarray) -> str:
        """Outcome of the proof of a design."""
        state = self.state
        if not Proof(self).passed(design):
            return UNPROVEN
        checks = [c for c in state.checks if c.round == state.round]
        if not all(c.passed for c in checks):
            return UNDECIDED
        return MET if any(c.kind in AMPLITUDES for c in checks) else MET_LINEAR

    def _realised(self, worst: Sequence[int]) -> list[np.ndarray]:
        """Starts of the search over what can be built, that nearest to the best targets first."""
        today = self.study.nominal
        self._move(self.targets)
        self._search(self._starts(worst), "target")
        cheapest = self._cheapest()
        target = self._nearest() if cheapest is None else cheapest
        self._move(~self.targets)
        rows = [self.rows[self.evaluation(p, today)] for p in self.state.active_points]
        names = [v.name for v in self.study.variables]
        z, matched = nearest(rows, names, self.ranges, self.change(target), self.box)
        begun = self.values(z)
        self.state.realisation = Realisation(target, cheapest is not None, begun, matched)
        return self._distinct([self.change(begun), *self._starts(worst)])

    def _move(self, is_varied: np.ndarray) -> None:
        """Search over the variables in a mask (d,) from here on; the others stay as today."""
        self.kept, self.box = is_varied, part_of(self.whole, is_varied)

    def _limit(self) -> int:
        first = self.both and bool(self.kept[self.targets].all())  # the others need designs, too
        return self.goal.designs // (2 if first else 1) + self._scanned()

    def _scanned(self) -> int:
        if self.goal.scan is not None:
            return self.goal.scan
        moving = [v for v, kept in zip(self.study.variables, self.kept, strict=True) if kept]
        costly = self.reduced and any(v.parameter.structural for v in moving)
        return 0 if costly else SCAN_DESIGNS_PER_VARIABLE * len(moving)

    def _starts(self, worst: Sequence[int]) -> list[np.ndarray]:
        """Today's design, and the best designs of a scan that are not near each other."""
        today, count = np.zeros(len(self.ranges)), self._scanned()
        if not count or self.goal.starts == 1:
            return [today]
        from scipy.stats import qmc

        rng = np.random.default_rng(self.goal.seed)
        unit = qmc.Sobol(len(self.ranges), scramble=True, seed=rng)
        z = unit.random_base2((count - 1).bit_length())[:count]
        z = np.vstack([self._corners(), self.box.low + z * (self.box.high - self.box.low)])
        looked = [p for p in worst if p in self.state.active_points][:SCAN_POINTS]
        designs = [self.values(scaled) for scaled in z]
        constraints = []
        for design in designs:
            self.register_design(design, "scan")
            constraints.append(self.constraints(design, looked, self.plain))
        if self.pending:
            raise RowsPending
        weight = 1e2 * float(self.box.cost.sum())
        merits = [
            np.inf if j is None else self.box.price(self.change(x)) + weight * max(0.0, -j.worst)
            for x, j in zip(designs, constraints, strict=True)
        ]
        ordered = [self.change(designs[i]) for i in np.argsort(merits, kind="stable")]
        signs: dict[bytes, np.ndarray] = {}  # the cost has no kink where signs do not change
        for scaled in ordered:
            signs.setdefault(np.sign(scaled).tobytes(), scaled)
        return self._distinct([today, *signs.values(), *ordered])

    def _corners(self) -> np.ndarray:
        """Corners (2^d, d) of the box without today's design; none if it has too many."""
        d = len(self.ranges)
        if d > MOST_CORNERS:
            return np.zeros((0, d))
        ends = np.column_stack([self.box.low, self.box.high])
        corners = np.unique(np.array(list(itertools.product(*ends))), axis=0)
        return corners[np.abs(corners).max(axis=1) > 0]

    def _distinct(self, designs: Iterable[np.ndarray]) -> list[np.ndarray]:
        """The first designs that are not near each other, `starts` of the goal at most."""
        distinct: list[np.ndarray] = []
        for z in designs:
            if all(np.abs(z - other).max() >= MIN_START_DISTANCE for other in distinct):
                distinct.append(z)
        return distinct[: self.goal.starts]

    def _search(self, starts: Sequence[np.ndarray], role: str) -> list[np.ndarray]:
        """Designs at which the searches from all starts end; RowsPending if rows are missing."""
        ends, max_designs = [], self._limit()
        for number, start in enumerate(starts, start=1):
            run = descend(self.box, start, self.margin, self.cache.steps)
            trial = next(run)
            try:
                while True:
                    design = self.values(trial)
                    if design.tobytes() not in self.state.designs:
                        if len(self.state.designs) >= max_designs:
                            ends.append(trial)
                            break
                        self.register_design(design, f"{role} {number}")
                    constraints = self.constraints(design, self.state.active_points)
                    active = self.state.active_points
                    if any(self.evaluation(p, design) not in self.rows for p in active):
                        break  # the search goes on when these are solved
                    trial = run.send(constraints)
            except StopIteration as end:
                ends.append(end.value)
        if self.pending:
            raise RowsPending
        return ends

    def _evaluated(self) -> list[tuple[np.ndarray, Constraints]]:
        """Designs that are solved at all active points and differ in moving variables only."""
        fixed = self.study.nominal[~self.kept]
        same_fixed = [
            x for x in self.state.designs.values() if np.array_equal(x[~self.kept], fixed)
        ]
        judged = ((x, self.constraints(x, self.state.active_points, None)) for x in same_fixed)
        return [(x, constraints) for x, constraints in judged if constraints is not None]

    def _cheapest(self) -> np.ndarray | None:
        """The design of least cost that meets all demands at the active points, or None."""
        good = [x for x, j in self._evaluated() if j.worst >= 0.0]
        return min(good, key=lambda x: self.box.price(self.change(x)), default=None)

    def _nearest(self) -> np.ndarray:
        """The design of largest margin at the active points."""
        best = max(self._evaluated(), key=lambda item: item[1].worst, default=None)
        if best is not None:
            return best[0]
        solved = (self.finished_modes(p, self.study.nominal) for p in self.state.active_points)
        failed = (
            finished[1]
            for finished in solved
            if finished is not None and finished[1]["status"] != "ok"
        )
        self.state.failure = next((str(row["message"] or row["status"]) for row in failed), "")
        return self.study.nominal
