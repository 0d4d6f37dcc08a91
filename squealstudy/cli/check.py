"""Text that `squealstudy check` and `squealstudy schema` print."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from squealstudy.cli.run import fidelity
from squealstudy.engine.forecast import Estimate, estimate, run_seconds
from squealstudy.engine.forecast_by_size import SizeForecast
from squealstudy.engine.key_tables import key_tables
from squealstudy.engine.kind import as_kind
from squealstudy.engine.manifest import check_owner, outdated
from squealstudy.engine.model_kind import as_model_kind
from squealstudy.engine.parameter_units import units_of_study
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.schema import schema_of
from squealstudy.engine.store import Store
from squealstudy.engine.structures import (
    build_structure,
    build_task,
    check_component_modes,
    check_model_file,
    check_shapes,
)
from squealstudy.engine.validity import parameter_reasons, points_by_rule
from squealstudy.engine.workers import worker_count
from squealstudy.errors import SquealstudyError
from squealstudy.face import Study
from squealstudy.kinds.complex_modes.boundary import most_points
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES
from squealstudy.laws.registry import LawDefinition
from squealstudy.machine.resources import available_memory_mb
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import (
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    PRESSURE,
    SLIDING_SPEED,
)
from squealstudy.models.parameter import ParameterTable
from squealstudy.models.parameter_names import parse_parameter
from squealstudy.progress import progress
from squealstudy.screen import Rows, warning
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sweeps import RANDOM_DESIGNS, Sweep
from squealstudy.study.tabled import knots_between
from squealstudy.tables.validity import broken_rules
from squealstudy.wording import amount, duration, knots_text, plural, setting

if TYPE_CHECKING:
    from squealstudy.engine.cluster import Worker
    from squealstudy.kinds.methods import MethodsPlan

MAX_FORECAST_POINTS = 1_000_000  # most design points that `check` makes beyond the limit of `run`


def check(
    study: Study,
    output: Path | None,
    jobs: int | None,
    build: bool,
    of_mesh: bool,
    scheduler: str | None,
) -> Rows:
    """Describe a study before it runs; SquealstudyError where it is not valid."""
    path, directory = study.source.path, output or study.directory
    manifest = check_owner(directory, study.owner)
    members = _members(scheduler)
    jobs = len(members) or worker_count(jobs, manifest, warning)
    resolved = study.resolved
    if not isinstance(resolved, ResolvedStudy):
        if of_mesh:
            raise SquealstudyError(
                f"{path}: --mesh-error is of a study's design points, which a study of methods "
                "has not: check the study that it varies"
            )
        name, kind, _ = study.owner
        runs = cast("MethodsPlan", study.plan())
        return [("study", f"{name}: {kind}, valid"), *runs.facts, *_cluster(members)]
    count = as_kind(resolved.kind).n_points(resolved)
    if count > max(MAX_FORECAST_POINTS, resolved.definition.design.limit):
        return _without_forecast(resolved, count)
    plan, facts = cast("Plan", study.plan()), None
    if resolved.definition.fidelity is not None:
        from squealstudy.fidelity.run import resolve

        with progress() as tell:
            chosen = resolve(resolved, jobs, tell)
        plan, facts = chosen.plan, chosen.facts
    if manifest and manifest.get("basis_enriched"):  # with the basis of earlier runs
        plan = Plan(plan.study, plan.swept, True)
    if text := check_shapes(plan):
        warning(text)
    for text in check_model_file(plan):
        warning(text)
    if build or not has_mesh(plan.study):
        _, reason = build_structure(build_task(plan, plan.tasks[0], 1 if members else jobs))
        if reason:
            raise SquealstudyError(f"{path}: {reason}")
    check_component_modes(plan)
    solver = as_model_kind(plan.kind)
    solver.check(plan)
    store = Store(directory)
    plan = solver.extended_plan(plan, store)
    missing = len(plan.tasks)
    if len(done := store.finished_points(solver.schema)):  # ids are computed only to compare them
        missing -= int(np.isin(plan.tasks.ids, done).sum())
    rows = [*_facts(plan, directory, missing, jobs, estimate(plan), members), *_cluster(members)]
    rows += _mesh_error(plan, jobs) if of_mesh else []
    if text := outdated(directory, manifest):
        warning(f"{text}; all design points will be solved again")
    for text in [*plan.study.doubts, *solver.warnings(plan)]:
        warning(text)
    return [*rows, *fidelity(facts)]


def _without_forecast(study: ResolvedStudy, count: int) -> Rows:
    """Describe a study that `run` refuses, with too many design points to forecast its time."""
    kind = study.definition.study.kind
    text = f"{count:,} points{_refused(study)}; what they take is not looked at beyond "
    return [
        ("study", f"{study.name}: {kind} on {study.model.name}, its file is valid"),
        ("design", f"{text}{MAX_FORECAST_POINTS:,} points unless that limit allows them"),
        *_ranges(study),
    ]


def _facts(
    plan: Plan,
    directory: Path,
    missing: int,
    jobs: int,
    cost: Estimate,
    members: Sequence[Worker],
) -> Rows:
    """Rows on the study, its design points, and the time and memory that a run takes."""
    study, solver = plan.study, as_model_kind(plan.kind)
    kind = study.definition.study.kind
    bound = "; runs end once their outcome is known" if solver.may_end_early(plan) else ""
    bound += f"; {more} come on top" if (more := solver.solves(plan).not_in_it) else ""
    rows = [
        ("study", f"{study.name}: {kind} on {study.model.name}, valid"),
        ("design", _design(plan, missing, directory)),
        *_ranges(study),
        *_constant(study),
        _structures(plan, cost),
        *solver.settings(plan),
        *_validity(plan),
    ]
    if cost.n_coordinates is not None:
        model = "model" if isinstance(study.model, FamilyDefinition) else "reduced model"
        rows.append((model, f"{cost.n_coordinates} degrees of freedom"))
    if not missing:
        return [*rows, ("time", "nothing is left to solve")]
    if cost.by_size is not None:
        free_gb = available_memory_mb() / 1024
        time = _by_size(plan, cost, cost.by_size, missing, jobs)
        return [*rows, ("time", time), ("memory", cost.by_size.memory_text(free_gb))]
    if cost.point_s is None:
        return [*rows, ("estimate", f"time and memory cannot be told: {cost.reason}")]
    workers = min(jobs, missing)
    growing = plan.study.grows and missing
    max_points = missing + most_points(plan.study) - len(plan.tasks) if growing else None
    shortest, longest = run_seconds(plan, cost, missing, jobs, max_points)
    return [
        *rows,
        (
            "time",
            f"{_from_to(shortest, longest)} without pictures: an exact point takes "
            f"{cost.point_s:.2g} s on one core, {plural(workers, 'worker')}{bound}",
        ),
        *_refinement(plan, cost.point_s, jobs),
        ("memory", _memory((cost.memory_mb or 0) / 1024, workers, members)),
    ]


def _by_size(plan: Plan, cost: Estimate, size: SizeForecast, missing: int, jobs: int) -> str:
    """Text with bounds on the time of a study that has no reduction in the cache yet."""
    count = cost.n_missing_structures
    ends = [
        run_seconds(plan, replace(cost, structure_s=r, point_s=p), missing, jobs)
        for r, p in zip(size.reduction_s, size.point_s, strict=True)
    ]
    each = " to ".join(map(duration, size.reduction_s))
    text = f"{plural(count, 'reduction')} of {size.n_dof:,} degrees of freedom, factors by "
    text += f"{size.factors}, {each}"
    text += f"{' each' * (count > 1)}, {size.by}"
    first = "--build makes the first one and times design points"
    if not as_model_kind(plan.kind).points_are_modes:
        return f"{text}; what follows cannot be told before: {first}"
    low, high = ends[0][0], ends[1][1]
    middle = duration(math.sqrt(low * high))
    between = f"{duration(low)} to {duration(high)}"
    return f"about {middle}, {between}, without pictures: {text}; {first}"


def _from_to(least: float, longest: float) -> str:
    """Text of two times [s], or of one where both read the same."""
    ends = dict.fromkeys(map(duration, (least, longest)))
    return " to ".join(ends) if len(ends) > 1 else f"about {next(iter(ends))}"


def _refinement(plan: Plan, point_s: float, jobs: int) -> Rows:
    """Row on the cost of points between design points, which refine tracks and onsets."""
    max_solves = as_model_kind(plan.kind).solves(plan).between
    if not max_solves:
        return []
    time = duration(max_solves * point_s / jobs)
    text = f"of tracks and onsets: up to about {max_solves:,.0f} points between those of the study"
    return [("refinement", f"{text}, {time}; mostly far fewer (refine_points of [modes])")]


def _memory(each: float, workers: int, members: Sequence[Worker]) -> str:
    """Text on the memory `each` [GB] of a process, and whether there is enough for all."""
    if members:
        limits = [m.limit_mb / 1024 for m in members if m.limit_mb]
        few = sum(limit < each for limit in limits)
        short = f", but {few} of {len(members)} workers may use less" if few else ""
        return f"about {each:.1f} GB a worker, and here{short}"
    free_gb = available_memory_mb() / 1024
    short = (
        f", but only {free_gb:.1f} GB are left: give fewer --jobs"
        if each * workers > free_gb
        else ""
    )
    return f"about {each:.1f} GB a process, {workers + 1} processes{short}"


def _members(scheduler: str | None) -> Sequence[Worker]:
    """The workers of a scheduler, () without one; MachineError where they cannot be used."""
    if scheduler is None:
        return ()
    from squealstudy.engine.cluster import connected

    with connected(scheduler, warning) as cluster:
        return cluster.members


def _cluster(members: Sequence[Worker]) -> Rows:
    """Row on a cluster's workers: number, memory, versions; none without a cluster."""
    if not members:
        return []
    limits = sorted(m.limit_mb / 1024 for m in members)
    text = f"{limits[0]:.1f} to {limits[-1]:.1f} GB" if limits[0] else "no limit of memory told"
    versions = ", ".join(f"{name} {text}" for name, text in members[0].versions.items())
    return [("cluster", f"{plural(len(members), 'worker')} of {text}; all have {versions}")]


def _validity(plan: Plan) -> Rows:
    """Row on design points whose parameters break assumptions, before their results are known."""
    broken_by_rule = parameter_reasons(plan)
    if not broken_by_rule:
        return []
    outside = len(np.unique(np.concatenate([broken.rows for broken in broken_by_rule])))
    text = f"{outside} of {len(plan.tasks)} points will be outside: "
    return [("validity", text + broken_rules(points_by_rule(broken_by_rule)))]


def _mesh_error(plan: Plan, jobs: int) -> Rows:
    """Solve one design point on two meshes: a row on how results change with the finer mesh."""
    from squealstudy.engine.forecast import mesh_error

    difference = mesh_error(plan, jobs)
    mesh, finer = difference.meshes
    text = f"{mesh} against {finer} at the values of [parameters], in the band: "
    if len(difference.frequency):
        text += (
            f"frequencies differ by {100 * difference.frequency.max():.2f} % at most "
            f"({100 * np.median(difference.frequency):.2f} % in the median), damping ratios by "
            f"{100 * difference.damping.max():.3f} % of critical at most, over "
            f"{plural(len(difference.frequency), 'mode')} of |damping| < 5 %; "
        )
    if difference.unpaired:
        text += f"{plural(difference.unpaired, 'more mode')} of {finer} without a counterpart; "
    text += f"unstable are {difference.unstable[0]} on {mesh}, {difference.unstable[1]} on {finer}"
    coarse_time, fine_time = map(duration, difference.seconds)
    return [("mesh error", f"{text} ({coarse_time} on {mesh}, {fine_time} on {finer})")]


def _design(plan: Plan, missing: int, directory: Path) -> str:
    """Text on the number of design points, and on how many a growing design may have."""
    text = f"{plural(len(plan.tasks), 'point')}, {missing:,} of them not yet in {directory}"
    if len(plan.swept) > plan.study.definition.design.limit:
        text += _refused(plan.study)
    if plan.study.grows and missing:
        text += f"; more where stability changes, {most_points(plan.study):,} at most (full grid)"
    return text


def _refused(study: ResolvedStudy) -> str:
    """End of a text: the study has too many points to run without --yes."""
    limit = study.definition.design.limit
    return f"; `run` refuses more than design.limit = {limit:,} without --yes"


def _ranges(study: ResolvedStudy) -> Rows:
    """The swept ranges, one row for each sweep."""
    return [(f"  {sweep.name}", _range(study, sweep)) for sweep in study.sweeps]


def _constant(study: ResolvedStudy) -> Rows:
    """Rows on constant parameters (operating point, and those given), on laws and on tables."""
    constant = study.constant
    operating = [p for p in (FRICTION, PRESSURE, SLIDING_SPEED, DAMPING) if p.name in study.values]
    set_there = [parse_parameter(name, study.model) for name in study.definition.parameters]
    unit_of = units_of_study(study)
    constants = [p for p in (*operating, *set_there) if p.name in constant]
    units = {p.name: unit_of.get(p.name, p.unit) for p in constants}
    texts = [setting(name, constant[name], unit) for name, unit in units.items()]
    for option, laws in ((CONTACT_OPTION, CONTACT_LAWS), (FRICTION_OPTION, FRICTION_CURVES)):
        if option.name in study.options:
            law = laws[str(study.options[option.name])]
            tabled = any(_without_slope(table) for table in study.model.tables)
            switched_off = "" if tabled else _reduced_law(law, study, constant)
            texts.append(f"{option.name} = {law.name}{switched_off}")
    rows = [("  constant", ", ".join(texts))] if texts else []
    rows += [("  follows", _followed(table)) for table in study.model.tables]
    knots = knots_text(knots_between(study.model.tables, study.sweeps), unit_of)
    rows += [("  knots", knots)] if knots else []
    if isinstance(study.model, FileDefinition):
        from squealstudy.study.preparations import preparations  # meshes are slow to load

        rows += [("  model file", text) for text in preparations(study)]
    return rows


def _followed(table: ParameterTable) -> str:
    """Parameters that follow tables, and slopes that design points lack for their derivatives."""
    text = f"{table.name} follows {' and '.join(table.over)} by a table"
    if not _without_slope(table):
        return text
    return f'{text}: no slope of it acts at a point; those of friction_law "table" and "map" do'


def _without_slope(table: ParameterTable) -> bool:
    """Whether a table changes friction with the operating point, without the slopes of a law."""
    return table.name == FRICTION.name and not {SLIDING_SPEED.name, PRESSURE.name}.isdisjoint(
        table.over
    )


def _reduced_law(law: LawDefinition, study: ResolvedStudy, constant: Collection[str]) -> str:
    """In brackets, the simpler law that constant parameters reduce a law to; else empty."""
    names = [parameter.name for parameter in law.parameters]
    if law.plain is None or any(name not in constant for name in names):
        return ""
    if isinstance(study.model, FileDefinition) and study.model.own_of_law.intersection(names):
        return ""
    text = law.plain(*(study.values[name] for name in names))
    return f" ({text})" if text else ""


def _range(study: ResolvedStudy, sweep: Sweep) -> str:
    """Text of a swept range with its unit and number of values."""
    values = sweep.values
    drawn = study.definition.design.type in RANDOM_DESIGNS
    scatter = "random" if drawn else "searched"  # the variables of a design study
    scatter = scatter if sweep.distribution is None else sweep.distribution.text
    count = plural(len(values), "value") if values else scatter
    unit = units_of_study(study).get(sweep.name, sweep.parameter.unit)
    largest = max(abs(sweep.low), abs(sweep.high))
    low, high = (amount(v, unit, largest, digits=6) for v in (sweep.low, sweep.high))
    if sweep.low == sweep.high:
        return f"{low}, {count}"
    return f"{low.split(' ')[0]} to {high}, {count}"


def _structures(plan: Plan, cost: Estimate) -> tuple[str, str]:
    """Row on reductions to make; of a family of matrices, which is not reduced, on its files."""
    if isinstance(plan.study.model, FamilyDefinition):
        n = len(plan.study.model.sources)
        return "matrices", f"{n} terms read, parameters {', '.join(plan.study.values) or 'none'}"
    if plan.stacked:
        return "reductions", "none: design points are solved in batches, structures and all"
    total = len(plan.structures)
    text = f"{total} needed, {cost.n_missing_structures} not in the cache"
    if plan.shared_range is not None:
        text += f"; one basis, made first for {plan.shared_range.text}, serves most structures"
    elif total > 1:
        text += "; each value of a swept structural parameter costs a reduction"
    if cost.n_missing_structures and cost.structure_s:
        text += f" ({duration(cost.structure_s)} each)"
    return "reductions", text


def schema(kind: str | None, tables: bool) -> str:
    """The JSON Schema of study files, of a kind that measures methods or of model files."""
    json_schema = schema_of(kind)
    return key_tables(json_schema) if tables else json.dumps(json_schema, indent=2) + "\n"
