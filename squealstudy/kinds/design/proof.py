"""The proof of a design: the matrix, points between, full order, limit cycles, runs, scatter.

A check that fails adds a demand, or an active point, for the next search.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from squealstudy.cycles.trials import DECAYS, LASTS
from squealstudy.kinds.design.evaluated_designs import EvaluatedDesigns
from squealstudy.kinds.design.in_time import TODAY
from squealstudy.kinds.design.plan import CYCLES, FULL, IN_TIME, ROOTS, Evaluation, evaluation
from squealstudy.kinds.design.state import Check, DampingDemand
from squealstudy.tables.robustness import probability_interval
from squealstudy.wording import IF_KICKED, NO_CYCLE, SQUEALS, plural

N_POINTS_REFINED = 6  # points of least margin that get new points beside them, in each pass
# least part of a gap of the matrix between points; factor for round-off
GRID_STEP_SUBDIVISIONS, ROUND_OFF_FACTOR = 8, 1.001
CYCLE_POINTS = 4  # operating points for limit cycles by default, if the model is not reduced
MAX_POINTS_ADDED = 6  # most points that become active in the search at once
# factor on the damping that a check finds missing, in the next search's demand
SHORTFALL_FACTOR = 1.1
LEAST_LACK = 1e-4  # least missing damping ratio in a demand
# factor on the scatter that the search allows for, after a proof that failed by scatter
SCATTER_INCREASE = 1.25
PROBABILITY_CONFIDENCE = 0.95
LIMIT_CYCLES = "limit_cycles"  # name of the check
AMPLITUDES = (LIMIT_CYCLES, IN_TIME)  # checks of large motions


class Proof:
    """The checks of designs; outcomes, demands and points are added to the state of the search.

    Parameters
    ----------
    designs : EvaluatedDesigns
    """

    def __init__(self, designs: EvaluatedDesigns) -> None:
        self.designs = designs

    def passed(self, design: np.ndarray) -> bool:
        """Whether a design passes all checks; a failed check adds to the demands."""
        steps = (
            self._matrix,
            self._refined,
            self._full_order,
            self._cycles,
            self._in_time,
            self._scatter,
        )
        return all(step(design) for step in steps)

    def _told(
        self,
        kind: str,
        design: np.ndarray,
        evaluations: Sequence[Evaluation],
        passed: bool | None,
        value: float,
        text: str,
    ) -> None:
        """Add a check of a design, with its result, to the state."""
        self.designs.state.checks.append(
            Check(self.designs.state.round, kind, design, tuple(evaluations), passed, value, text)
        )

    def _over(self, kind: str, design: np.ndarray, points: Sequence[int]) -> bool:
        """Whether a design meets all demands at some points; the worst others become active."""
        evaluations = [self.designs.margin_evaluation(p, design) for p in points]
        rows = self.designs.rows_of(evaluations)
        constraints = [
            self.designs.constraints(design, [p], a.analysis)
            for p, a in zip(points, evaluations, strict=True)
        ]
        excess = np.array([-1.0 if j is None else j.worst for j in constraints])
        damping_ratios = np.array([r["min_damping_ratio"] for r in rows if r["status"] == "ok"])
        bad = [points[i] for i in np.argsort(excess, kind="stable") if excess[i] < 0]
        text = f"{len(points) - len(bad)} of {len(points)} operating points meet all demands"
        least_excess = (
            float(np.nanmin(damping_ratios)) if np.isfinite(damping_ratios).any() else np.nan
        )
        self._told(kind, design, evaluations, not bad, least_excess, text)
        self.designs.state.active_points = sorted(
            {*self.designs.state.active_points, *bad[:MAX_POINTS_ADDED]}
        )
        return not bad

    def _matrix(self, design: np.ndarray) -> bool:
        return self._over("matrix", design, range(self.designs.state.n_matrix))

    def _refined(self, design: np.ndarray) -> bool:
        """Check midpoints between the points of least margin and their neighbours, in passes.

        A mode may grow between two operating points at which it does not. Midpoints with little
        margin get midpoints of their own in the next pass, until gaps are small.
        """
        state = self.designs.state
        matrix = np.array(state.points[: state.n_matrix]).reshape(state.n_matrix, -1)
        while True:
            refined = range(state.n_matrix, len(state.points))
            if len(refined) and not self._over("refined", design, refined):
                return False
            existing = np.array(state.points).reshape(len(state.points), -1)
            new: dict[bytes, np.ndarray] = {}
            for p in self._worst(design, N_POINTS_REFINED):
                new |= {m.tobytes(): m for m in midpoints(existing, p, matrix)}
            new = {key: m for key, m in new.items() if not (existing == m).all(axis=1).any()}
            if not new:
                return True
            if len(refined):
                state.checks.pop()  # one check at the end covers all passes
            state.points += new.values()

    def _worst(self, design: np.ndarray, count: int) -> list[int]:
        return self.designs.by_margin(design, range(len(self.designs.state.points)))[:count]

    def _full_order(self, design: np.ndarray) -> bool:
        """Check a design at its worst points with the unreduced model."""
        if not self.designs.reduced or not self.designs.goal.full_order:
            return True
        points = self._worst(design, self.designs.goal.full_order)
        evaluations = [self.designs.evaluation(p, design, FULL) for p in points]
        rows = self.designs.rows_of(evaluations)
        good: bool | None = True
        least_damping, lost = np.inf, ""
        for p, row in zip(points, rows, strict=True):
            if row["status"] != "ok":
                good, lost = None if good else good, f"; {row['message']}"
                continue
            reduced, full = (
                self.designs.rows[self.designs.margin_evaluation(p, design)]["min_damping_ratio"],
                row["min_damping_ratio"],
            )
            least_damping = min(least_damping, full)
            if full < self.designs.margin:
                good = False
                self.designs.state.demands.append(
                    DampingDemand(p, self.designs.margin + SHORTFALL_FACTOR * (reduced - full))
                )
                self.designs.state.active_points = sorted({*self.designs.state.active_points, p})
        is_known = np.isfinite(least_damping)
        damping_text = f"{100 * least_damping:.3g} %" if is_known else "not known"
        text = f"least damping {damping_text} at {plural(len(points), 'operating point')}{lost}"
        self._told("full_order", design, evaluations, good, least_damping, text)
        return good is not False

    def _cycles(self, design: np.ndarray) -> bool:
        """Check by limit cycles that no mode lacks damping at any amplitude."""
        by_default = 0 if self.designs.reduced else CYCLE_POINTS
        count = by_default if self.designs.goal.cycles is None else self.designs.goal.cycles
        if not self.designs.has_cycles or not count:
            return True
        points = self._worst(design, count)
        evaluations = [self.designs.evaluation(p, design, CYCLES) for p in points]
        rows = self.designs.rows_of(evaluations)
        verdicts: dict[str, int] = {}
        most_missing, good = -np.inf, True
        for p, row in zip(points, rows, strict=True):
            name = row["verdict"] if row["status"] == "ok" else "failed"
            verdicts[name] = verdicts.get(name, 0) + 1
            missing = row["missing_damping"]
            if row["status"] != "ok" or not np.isfinite(missing):
                continue
            most_missing = max(most_missing, missing)
            if missing > 0 or name in (SQUEALS, IF_KICKED):
                good = False
                hz = float(row["frequency_hz"])
                small_motion_damping = self._damping_near(
                    self.designs.rows[self.designs.margin_evaluation(p, design)], hz
                )
                lack = max(missing, LEAST_LACK)
                beyond = max(
                    lack + min(small_motion_damping, 0.0), LEAST_LACK
                )  # the part that small motions lack is known exactly
                more = small_motion_damping + lack + (SHORTFALL_FACTOR - 1.0) * beyond
                self.designs.state.demands.append(DampingDemand(p, more, hz))
                self.designs.state.active_points = sorted({*self.designs.state.active_points, p})
        is_decided = good and set(verdicts) <= {NO_CYCLE}
        text = ", ".join(
            f"{name.replace('_', ' ')} at {plural(n, 'point')}" for name, n in verdicts.items()
        )
        if NO_CYCLE in verdicts:
            text += " (on the curves searched; others are not excluded)"
        if most_missing > 0:
            percent = f"{100 * most_missing:.2g} %"
            text += f"; some motions last for want of up to {percent} of critical damping"
        self._told(
            LIMIT_CYCLES,
            design,
            evaluations,
            is_decided or (None if good else False),
            most_missing,
            text,
        )
        return good

    def _in_time(self, design: np.ndarray) -> bool:
        """Check that all runs decay, from today's vibration and from kicks."""
        designs = self.designs
        if not designs.has_cycles or not designs.goal.in_time:
            return True
        of_design = self._worst(design, designs.goal.in_time)
        was = designs.by_margin(designs.study.nominal, range(designs.state.n_matrix))
        both = dict.fromkeys(p for pair in zip(of_design, was, strict=False) for p in pair)
        points = list(both)[: designs.goal.in_time]
        evaluations = [designs.evaluation(p, design, IN_TIME) for p in points]
        rows = designs.rows_of(evaluations)
        good, ok = True, [r for r in rows if r["status"] == "ok"]
        for p, row in zip(points, rows, strict=True):
            if row["status"] != "ok" or row["verdict"] != LASTS:
                continue
            good, hz = False, float(np.nan_to_num(row["frequency_hz"]))
            nearby_damping = self._damping_near(
                designs.rows[designs.margin_evaluation(p, design)], hz
            )
            of_runs = [e for e in designs.state.demands if e.point == p and np.isfinite(e.lasts)]
            before = next((e for e in of_runs if e.near(hz)), DampingDemand(p, 0.0, hz))
            designs.state.demands = [e for e in designs.state.demands if e is not before]
            designs.state.demands.append(before.increased(nearby_damping))
            designs.state.active_points = sorted({*designs.state.active_points, p})
        is_decided = len(ok) == len(rows) and all(r["verdict"] == DECAYS for r in rows)
        runs = sum(r["n_modes"] for r in ok)
        decayed = runs - sum(r["n_unstable"] for r in ok)
        today = sum(TODAY in r["reason"] for r in ok)
        text = (
            f"{decayed} of {plural(runs, 'run')} decay, from kicks at "
            f"{plural(len(ok), 'operating point')}, from today's vibration at {today} of them"
        )
        others = [t for r in ok for t in r["reason"].split("; ") if not t.endswith(f": {DECAYS}")]
        text += f"; {others[0]}" if others else ""
        if len(ok) < len(rows):
            lost = next(r["message"] for r in rows if r["status"] != "ok")
            text += f"; {plural(len(rows) - len(ok), 'point')} could not be run: {lost}"
        share = decayed / runs if runs else np.nan
        self._told(
            IN_TIME, design, evaluations, is_decided or (None if good else False), share, text
        )
        return good

    @staticmethod
    def _damping_near(row: Mapping[str, Any], hz: float) -> float:
        """Least damping ratio of the modes near a frequency."""
        about = DampingDemand(0, 0.0, hz)
        ratios_near = [m["damping_ratio"] for m in row["modes"] if about.near(m["frequency_hz"])]
        return float(min(ratios_near, default=row["min_damping_ratio"]))

    def _scatter(self, design: np.ndarray) -> bool:
        """Check the share of samples that meet the margin at the points of least margin."""
        probability = self.designs.goal.margin.probability
        if probability is None:
            return True
        points, scatter = self._worst(design, self.designs.goal.sampled), self._samples(probability)
        evaluations = [
            [
                evaluation(self.designs.study, self.designs.state.points[p], design, ROOTS, u)
                for p in points
            ]
            for u in scatter
        ]
        rows = self.designs.rows_of(a for of_sample in evaluations for a in of_sample)
        damping_ratios = np.array([r["min_damping_ratio"] for r in rows])
        moved_out = [
            self.designs.modes_moved_out(p, r)
            for p, r in zip(points * len(scatter), rows, strict=True)
        ]
        ok = np.array([r["status"] == "ok" and not m for r, m in zip(rows, moved_out, strict=True)])
        met = ok & ~(
            damping_ratios < self.designs.margin
        )  # without a mode in the band none misses it
        good = int(met.reshape(len(scatter), -1).all(axis=1).sum())
        low, high = probability_interval(good, len(scatter), PROBABILITY_CONFIDENCE)
        text = (
            f"{good} of {len(scatter)} samples meet the margin at {len(points)} operating points: "
            f"probability {low:.4g} to {high:.4g}, {probability:g} asked"
        )
        flat = [a for of_sample in evaluations for a in of_sample]
        passed = low >= probability
        self._told("scatter", design, flat, passed, good / len(scatter), text)
        if not passed:
            self.designs.state.safety = max(self.designs.state.safety, 1.0) * SCATTER_INCREASE
        return passed

    def _samples(self, probability: float) -> np.ndarray:
        """Sampled values (n, k) of the scattered parameters."""
        from scipy.stats import qmc

        enough = int(np.ceil(np.log((1 - PROBABILITY_CONFIDENCE) / 2) / np.log(probability)))
        count = self.designs.goal.samples or enough
        rng = np.random.default_rng(self.designs.goal.seed + 1)
        unit = qmc.Sobol(len(self.designs.study.uncertain), scramble=True, seed=rng)
        u = unit.random_base2((count - 1).bit_length())[:count]
        columns = [
            s.distribution.quantiles(column)
            for s, column in zip(self.designs.study.uncertain, u.T, strict=True)
            if s.distribution is not None
        ]
        return np.column_stack(columns)


def midpoints(points: np.ndarray, number: int, matrix: np.ndarray) -> list[np.ndarray]:
    """Points (k,) halfway from one of some points (m, k) to the next value of each parameter.

    Gaps are not halved if they are 1 / GRID_STEP_SUBDIVISIONS or less of the gap of the matrix
    (n, k) that they are in.
    """
    middles = []
    coordinates = points[number]
    for k in range(points.shape[1]):
        values, ends = np.unique(points[:, k]), np.unique(matrix[:, k])
        for side in (values[values < coordinates[k]][-1:], values[values > coordinates[k]][:1]):
            for neighbour in side:
                middle = coordinates.copy()
                middle[k] = float(f"{(coordinates[k] + neighbour) / 2:.9g}")
                after = int(np.searchsorted(ends, middle[k]))
                if (
                    abs(neighbour - coordinates[k])
                    > (ends[after] - ends[after - 1]) * ROUND_OFF_FACTOR / GRID_STEP_SUBDIVISIONS
                ):
                    middles.append(middle)
    return middles
