"""The kind of studies in time, as the runner and the screens use it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import is_prepared
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.model_kind import OFTEN_CHANGED, Columns, ModelKind, Solves
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import GROWTH, MODES, POINTS, WINDOWS, Store
from squealstudy.engine.workers import Progress, Solved, Workers
from squealstudy.errors import ParameterError
from squealstudy.kinds.transient import preparation
from squealstudy.kinds.transient.batch import (
    BatchTask,
    batch_size,
    batch_task,
    mode_keys,
    sensed_modes,
    shared_reference,
    truncated_choice,
)
from squealstudy.kinds.transient.plan_facts import KEY as START
from squealstudy.kinds.transient.plan_facts import (
    check_model,
    motion_identity,
    regularisation_of,
    slowest_speed,
    start_of,
)
from squealstudy.kinds.transient.preparation import make_training_runs
from squealstudy.kinds.transient.schedules import schedules_of
from squealstudy.kinds.transient.section import TransientDefinition
from squealstudy.kinds.transient.tables import SCHEMA, build_tables, lost_row, simulated_time
from squealstudy.kinds.transient.worker import solve_batch
from squealstudy.mechanics.regularisation import with_speed
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.motion.settings import steps_between_rows
from squealstudy.motion.warmup import begin_warming
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint

if TYPE_CHECKING:
    import pandas as pd


class Transient(ModelKind):
    """Motion in time of every design point, about its steady sliding.

    Nothing is checked at full order.
    """

    name = "transient"
    description = "motion in time"
    section = "transient"
    definition = TransientDefinition
    tables: tuple[str, ...] = (POINTS, MODES, GROWTH, WINDOWS)
    schema: pa.Schema = SCHEMA
    tells_reduction = False
    has_fidelity = True
    begins_with: Mapping[str, float] = {"damping_ratio": 0.01}  # so that stable runs decay visibly
    start: Mapping[str, Any] = {"sweep": {"num": 4}}
    short: Mapping[str, Sequence[str]] = {
        **OFTEN_CHANGED,
        "transient": ("duration", "step", "perturbation", "save_every"),
    }

    def resolver(self, study: ResolvedStudy) -> Callable[[Columns], Columns]:
        """A function that fills in the automatic regularisation speed, by the slowest point."""
        return partial(with_speed, slowest=slowest_speed(study))

    def identity(self, plan: Plan) -> list[Any]:
        """All that runs depend on, beside the parameters of their design points."""
        return motion_identity(plan)

    def table_identity(self, plan: Plan) -> list[Any]:
        """The setting of the slope pilot, which changes tables but no run."""
        return [plan.study.section.slope_pilot]

    def manifest(self, plan: Plan) -> dict[str, Any]:
        """Facts of any model, with settings of runs, friction's slope and the unit of torques."""
        facts = super().manifest(plan)
        facts["units"] |= {"torque": plan.study.model.torque_unit}
        settings = motion_identity(plan)[0]
        return facts | {"transient": settings, "regularisation": regularisation_of(plan)}

    def check(self, plan: Plan) -> None:
        """Check that sensors, perturbed modes and a continued state fit every structure."""
        section = plan.study.section
        if REGULARISATION_SPEED.name in plan.study.shown_parameters and not regularisation_of(plan):
            raise plan.error(
                REGULARISATION_SPEED.name,
                f"every design point has a {SLOPE.name} of its own, which this would not change: "
                "give one of the two",
            )
        try:
            steps_between_rows(section.save_every, section.step, plan.band_hz[1])
        except ValueError as error:
            raise plan.study.error(("transient", "save_every"), str(error)) from None
        if (start := start_of(plan)) is not None:
            reason = check_model(start, set(plan.structures), section)
            if reason:
                raise plan.study.error(START, reason)
        for key in plan.structures:
            if not is_prepared(key):
                continue
            basis = truncated_choice(plan)
            try:
                reference = shared_reference(key, plan.nominal, mode_keys(plan), basis)
            except ParameterError as error:
                raise plan.study.error(("transient", error.key), error.message) from None
            if section.pressure is not None and not len(reference.load):
                raise plan.study.error(
                    ("transient", "pressure"),
                    f"springs of model '{plan.study.model.name}' are there in vibration only "
                    "(in_static = false): a change of the pressure would press against them, too",
                )
            omega2 = reference.system.omega2[: reference.n_exact]
            try:
                sensed_modes(section, omega2, plan.band_hz)
            except ValueError as error:
                raise plan.study.error(("transient", "sensors"), str(error)) from None
            plan.check_assembly_modes(reference.n_exact)
            if max(section.perturb_modes, default=1) > reference.n_exact:
                raise plan.study.error(
                    ("transient", "perturb_modes"),
                    f"the assembly has modes 1 to {reference.n_exact} in this basis",
                )

    def warnings(self, plan: Plan) -> list[str]:
        """Warnings of growth above the band, and of friction too stiff for the step."""
        return preparation.warnings(plan)

    def begin(self, plan: Plan) -> None:
        """Begin to compile the kernels before workers start."""
        section = plan.study.section
        if section.representation == "modal":
            begin_warming(section.storage == "single")

    def prepare(self, plan: Plan, report: Progress) -> None:
        """Compile the kernels, and make the training runs that a POD basis needs."""
        preparation.warm(plan.study.section)
        make_training_runs(plan, report)

    def reads_meshes(self, plan: Plan) -> bool:
        """Whether finite elements are needed: the hybrid representation takes layers of them."""
        return plan.study.section.representation == "hybrid"

    def tasks(self, plan: Plan, points: DesignPoints, workers: Workers) -> Iterator[BatchTask]:
        """Batches of points of one structure, of even size over the workers."""
        self.prepare(plan, workers.report)
        size = max(1, min(batch_size(plan), math.ceil(len(points) / workers.jobs)))
        return (
            batch_task(plan, tuple(points.at(rows[i : i + size])))
            for _, rows in points.of_structures()
            for i in range(0, len(rows), size)
        )

    def solve(self, task: BatchTask) -> Solved:
        """Integrate one batch in a worker."""
        return solve_batch(task)

    def failed_row(self, point_id: str, status: str, message: str) -> dict[str, Any]:
        """Chunk row of a point that could not be solved."""
        return lost_row(point_id, status, message)

    def build_tables(
        self, plan: Plan, store: Store, workers: Workers
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Write points, modes, growth and windows; facts on the slope pilot and time saved."""
        points = build_tables(plan, store)
        section = plan.study.section
        facts: dict[str, Any] = {}
        if (regularisation := regularisation_of(plan)) is not None:
            from squealstudy.kinds.transient.slope_pilot import slope_pilot  # of all kinds of study

            facts["regularisation"] = regularisation | {
                "pilot": slope_pilot(plan, store, points, workers.report)
            }
        if section.stop != "end":
            facts["simulated_time"] = simulated_time(points, section.duration)
        return points, facts

    def solves(self, plan: Plan) -> Solves:
        """Cost in points, which are timed from their first steps; some runs may end early."""
        return Solves(least=0.0) if self.may_end_early(plan) else Solves()

    def may_end_early(self, plan: Plan) -> bool:
        """Whether runs end once their outcome is known."""
        return bool(plan.study.section.stop != "end")

    def settings(self, plan: Plan) -> list[tuple[str, str]]:
        """The integrator, the speed from which slopes of friction follow, and schedules."""
        from squealstudy.kinds.transient.screen import regularisation

        section = plan.study.section
        slope = regularisation(self.manifest(plan).get("regularisation"))
        return [
            (
                "method",
                f"{section.integrator.name}, contact iteration to {section.balance_tolerance:g}",
            ),
            *slope,
            *([("over time", schedules.text)] if (schedules := schedules_of(plan)) else []),
        ]

    def time_point(self, plan: Plan, task: DesignPoint) -> float | None:
        """Seconds of one design point alone, extrapolated from its first steps."""
        preparation.warm(plan.study.section)
        started = time.perf_counter()
        with threadpool_limits(1):
            timed = preparation.time_steps(batch_task(plan, (task,), truncated_choice(plan)))
        rest = time.perf_counter() - started - timed.loading_s - timed.seconds
        return rest + timed.seconds * timed.total / timed.steps


KIND = Transient()
