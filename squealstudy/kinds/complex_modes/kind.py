"""The kind of complex-mode studies, as the runner and the screens use it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.batches import stacks
from squealstudy.engine.cache import is_prepared, load_any
from squealstudy.engine.checked_points import checked_points
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import source_hash
from squealstudy.engine.model_kind import ModelKind, Solves
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.result_names import REFERENCES
from squealstudy.engine.store import MODES, ONSETS, POINTS, Store
from squealstudy.engine.structures import with_files
from squealstudy.engine.workers import Progress, Solved, Workers
from squealstudy.errors import StudyFileError
from squealstudy.kinds.complex_modes import rows
from squealstudy.kinds.complex_modes.batch import (
    BatchTask,
    batch_tasks,
    seconds_a_point,
    solve_batch,
)
from squealstudy.kinds.complex_modes.problems import (
    SweptStructure,
    make_basis,
    problem_of,
    swept_structures,
)
from squealstudy.kinds.complex_modes.reduction_errors import is_reduced, sample_points
from squealstudy.kinds.complex_modes.refinement_budget import RefinementBudget
from squealstudy.kinds.complex_modes.rows import read_roots
from squealstudy.kinds.complex_modes.solve_tasks import (
    SolveTask,
    solve_points,
    solve_tasks,
    whole_box,
)
from squealstudy.mechanics.failures import FAILURES
from squealstudy.modes.rung import Rung
from squealstudy.modes.rungs import AUTO, rung_named
from squealstudy.study.design import DesignPoint

if TYPE_CHECKING:
    import pandas as pd


# factors on the forecast time for its least and its longest value: exact modes; reanalysis
EXACT_TIME_FACTORS, REANALYSIS_TIME_FACTORS = (0.9, 1.1), (0.5, 1.5)
# largest number of exact solves for tracking and onsets, for each design point of the study
MAX_EXTRA_SOLVES_PER_POINT = 1.5
# cost of a sample point of the reduction's error, at which two models are solved, in exact solves
REDUCTION_SAMPLE_COST = 3.0
SOURCES = ("kinds/complex_modes",)
FULL_ORDER = 60.0  # cost of a full-order solve, about, in exact solves of a reduced brake


class ComplexModes(ModelKind):
    """Working point and complex modes of every design point; full-order checks of some."""

    name = "complex_modes"
    description = "complex modes"
    tables: tuple[str, ...] = (POINTS, MODES, ONSETS)
    schema: pa.Schema = rows.SCHEMA
    chooses_rung = True
    has_fidelity = True
    points_are_modes = True
    needs_contact = False

    def stacks(self, plan: Plan) -> bool:
        """Whether points are solved in batches: small models, exactly, by this class's `solve`."""
        return type(self).solve is ComplexModes.solve and stacks(plan)

    def check(self, plan: Plan) -> None:
        """Check that each basis holds the modes of the assembly that parameters name."""
        if not plan.first.assembly_parameters() or plan.method.rung.unreduced:
            return
        if plan.stacked:
            plan.check_assembly_modes(plan.first.assembly().n_dof)
            return
        for key in plan.structures:
            if is_prepared(key):
                plan.check_assembly_modes(load_any(key).model.n)

    def identity(self, plan: Plan) -> list[Any]:
        """Hash of this kind's code, which decides on boxes, charts and the tolerance of a basis."""
        return [source_hash(SOURCES)]

    def warnings(self, plan: Plan) -> list[str]:
        """A warning of a method that keeps no tolerance."""
        if plan.method.rung.keeps_tolerance:
            return []
        return [
            f"{plan.method.name} is a method to compare others with: it keeps no tolerance, and "
            "its points are 'ok' whatever errors the modes table estimates"
        ]

    def accurate(self, plan: Plan, failures: Mapping[str, str], workers: Workers) -> Plan:
        """The plan, with an enriched basis where the reduction errs by more than the tolerance.

        No rung can lower the error of the reduction, so it is lowered once for all points. A basis
        that the study chooses itself, by any key of [reduction] but shared_basis, stays as it is.
        """
        keys = plan.study.definition.reduction.model_fields_set
        if plan.enriched or keys - {"shared_basis"}:
            return plan
        from squealstudy.kinds.complex_modes.reduction_errors import make_samples

        samples = make_samples(plan, failures, workers)
        worst = max((sample.worst for _, sample in samples), default=0.0)
        return Plan(plan.study, plan.swept, True) if worst > plan.method.largest_error else plan

    def prepare(self, plan: Plan, report: Progress) -> None:
        """Make the sweep bases, where the method needs them."""
        if plan.method.rung.over_a_basis:
            with threadpool_limits(1):  # matrices are small: more threads wait for each other
                for structure in swept_structures(plan):
                    if is_prepared(structure.key):
                        self._make_basis(plan, structure, report)

    @staticmethod
    def _make_basis(plan: Plan, structure: SweptStructure, report: Progress) -> None:
        """Make the sweep basis of a structure; where it cannot be made, its points are exact."""
        chosen, rung = plan.study.definition.modes.method != AUTO, plan.method.rung
        if structure.refusal and not chosen:
            return
        try:
            make_basis(structure, rung, lambda done, most: report("sweep basis", done, most))
        except StudyFileError:
            raise
        except FAILURES as error:
            if not chosen:  # all its points are then exact
                structure.refuse(str(error))
                return
            raise plan.study.error(
                ("modes", "method"),
                f"no sweep basis for {rung.name} can be made over this box ({error}): "
                f'method = "{plan.method.exact}" solves point by point',
            ) from error

    def reads_meshes(self, plan: Plan) -> bool:
        """Whether the method solves the unreduced model."""
        return plan.method.rung.unreduced

    def tasks(
        self, plan: Plan, points: DesignPoints, workers: Workers
    ) -> Iterator[SolveTask | BatchTask]:
        """Batches, boxes of neighbouring points, or chunks of consecutive ones."""
        if plan.stacked:
            return batch_tasks(plan, points, workers.jobs)
        self.prepare(plan, workers.report)
        return solve_tasks(plan, points, workers)

    def solve(self, task: SolveTask | BatchTask) -> Solved:
        """Solve the points of a task in a worker."""
        if isinstance(task, BatchTask):
            return solve_batch(task)
        return solve_points(task)

    def extended_plan(self, plan: Plan, store: Store) -> Plan:
        """The plan with the nodes of a boundary design that are to be solved next."""
        if not plan.study.grows:
            return plan
        from squealstudy.kinds.complex_modes.boundary import extended_plan

        return extended_plan(plan, store)

    def manifest(self, plan: Plan) -> dict[str, Any]:
        """Facts of any model, with the grid of a boundary design and how much of it is solved."""
        facts = super().manifest(plan)
        if not plan.study.grows:
            return facts
        from squealstudy.kinds.complex_modes.boundary import map_facts

        return facts | {"boundary": map_facts(plan)}

    def verify(
        self, plan: Plan, store: Store, failures: Mapping[str, str], workers: Workers
    ) -> list[dict[str, Any]]:
        """Solve chosen points at full order where that was not done; the checks of all of them."""
        from squealstudy.kinds.complex_modes.full_order_check import (
            FullOrderTask,
            at_once,
            check_reference,
            forget,
        )

        chosen = [plan.tasks[i] for i in checked_points(plan)]
        present = store.references()
        unchecked = [t for t in chosen if t.point_id not in present]
        roots_of = read_roots(store, [t.point_id for t in unchecked], overdamped=True)
        tasks = [
            FullOrderTask(
                _of_its_structure(plan, t),
                lam,
                plan.settings,
                plan.band_hz,
                plan.stacked,
                plan.study.definition.modes.stability_tolerance,
            )
            for t in unchecked
            if t.structure not in failures and (lam := roots_of.get(t.point_id)) is not None
        ]
        workers = with_files(plan, workers)
        if workers.cluster is None:  # workers of a cluster each have a memory of their own
            workers = replace(workers, jobs=min(workers.jobs, at_once(tasks)))
        for check in workers.each(check_reference, tasks, "full-order check"):
            store.write_json(f"{REFERENCES}/{check['point_id']}.json", check)
        if not plan.method.rung.unreduced:  # nothing that follows needs it
            forget()
        ids = {t.point_id for t in chosen}
        return [r for i, r in store.references().items() if i in ids]

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write the tables of points, modes and onsets; the points' table, and facts."""
        from squealstudy.kinds.complex_modes.errors import audited
        from squealstudy.kinds.complex_modes.reduction_errors import make_samples
        from squealstudy.kinds.complex_modes.tables import build_tables

        if plan.study.definition.modes.track:  # which solves points in between
            self.prepare(plan, workers.report)
        unbuilt = () if plan.stacked else plan.structures
        built = {key: "" for key in unbuilt if not is_prepared(key)}
        samples = make_samples(plan, built, workers)
        points, facts = build_tables(plan, store, workers, samples)
        served = {str(k): int(n) for k, n in points["method"].value_counts().items() if k}
        if plan.study.definition.modes.audit:
            ids = [plan.tasks[i].point_id for i in checked_points(plan)]
            facts["audit"] = audited(store, ids, store.references(), plan.band_hz)
        reason = plan.method.reason
        for structure in swept_structures(plan) if plan.method.rung.over_a_basis else ():
            if structure.refusal and not structure.has_basis:
                reason += f"; no basis, all points are exact: {structure.refusal}"
                break
        method = {"chosen": plan.method.name, "reason": reason, "points": served}
        if len(left_over := points.loc[(points["status"] == "ok") & (points["message"] != "")]):
            method["left_over"] = {"points": len(left_over), "first": left_over["message"].iloc[0]}
        return points, {**facts, "method": {**method, "tolerance": plan.method.tolerance}}

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """The method, and why it was chosen."""
        rung = plan.method.rung
        tolerance_text = (
            f", to {plan.method.tolerance:g}" if rung.keeps_tolerance and not rung.exact else ""
        )
        return [("method", f"{plan.method.name}{tolerance_text}: {plan.method.reason}")]

    def solves(self, plan: Plan) -> Solves:
        """Cost of the study's solves by its method."""
        return mode_solves(plan)

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of a design point by the exact method (in a batch if small); None if it fails."""
        if plan.stacked:
            return seconds_a_point(plan)
        method = plan.method
        rung = method.rung if method.rung.exact else rung_named(method.exact)
        structure = next(s for s in swept_structures(plan) if s.key == task.structure)
        problem = problem_of(structure, rung)
        started = time.perf_counter()
        with threadpool_limits(1):
            try:
                list(rung.solve(problem, [task], whole_box(structure)))
            except FAILURES:
                return None
        return time.perf_counter() - started


def _of_its_structure(plan: Plan, point: DesignPoint) -> DesignPoint:
    """A design point with the key of its own structure, which points of a batch do not have."""
    return replace(point, structure=plan.structure_key(point)) if plan.stacked else point


def mode_solves(plan: Plan) -> Solves:
    """Cost of a study in exact solves.

    A point of reanalysis costs a share of an exact one, after a basis for each structure. Tracking
    and onsets solve points in between; points checked at full order and sample points of the
    reduction's error come on top.
    """
    rung, share = plan.method.rung, point_share(plan, plan.method.rung)
    shortest, longest = EXACT_TIME_FACTORS if share is None else REANALYSIS_TIME_FACTORS
    modes = plan.study.definition.modes
    refines = modes.track and (modes.refine_tracking or modes.refine_onsets)
    between = 0.0
    if plan.study.sweeps and refines:
        count = len(plan.tasks)
        between = min(MAX_EXTRA_SOLVES_PER_POINT * count, RefinementBudget.of(modes, count).total)
        longest += between / count if share is None else 0.0
    bases = 0
    if rung.over_a_basis:
        bases = sum(not structure.has_basis for structure in swept_structures(plan))
    meshed = has_mesh(plan.study) and not rung.unreduced
    checks = len(checked_points(plan)) * (FULL_ORDER if meshed else 1.0)
    samples = len(sample_points(plan)) if is_reduced(plan) else 0
    return Solves(
        point=1.0 if share is None else share,
        shared=bases * rung.setup_solves,
        checks=checks + samples * REDUCTION_SAMPLE_COST,
        between=between,
        least=shortest,
        longest=longest,
    )


def point_share(plan: Plan, rung: Rung) -> float | None:
    """Cost of a point by a rung over that of an exact one; None for an exact rung."""
    if rung.exact:
        return None
    varied = sum(not sweep.parameter.structural for sweep in plan.study.sweeps)
    return rung.relative_cost(len(plan.tasks) // len(plan.structures), varied)


KIND = ComplexModes()
