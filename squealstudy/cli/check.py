"""`squealstudy check` and `squealstudy schema`."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path

import numpy as np

from squealstudy.analysis.tables.validity import BETWEEN, rule_counts
from squealstudy.cli import fidelity_screen, screen, transient_screen
from squealstudy.errors import SquealstudyError
from squealstudy.models.matrix_family import FamilyDefinition
from squealstudy.study import chunks
from squealstudy.study.definition import load_any
from squealstudy.study.estimate import Estimate, estimate, run_seconds
from squealstudy.study.kinds import kind_named, kind_names
from squealstudy.study.manifest import check_owner, outdated
from squealstudy.study.model_kind import build_first, check_component_modes, check_shapes
from squealstudy.study.plan import Plan, has_mesh
from squealstudy.study.rounds import grown, grows, most_points
from squealstudy.study.runner import default_directory
from squealstudy.study.sampling import check_limit
from squealstudy.study.schema import methods_schema, study_schema
from squealstudy.study.validity import parameter_reasons
from squealstudy.wording import plural


def check_command(
    path: Path, output: Path | None, jobs: int | None, build: bool, of_mesh: bool = False
) -> None:
    """Validate, count, estimate; exit code 2 and one message where the study is not valid."""
    loaded = load_any(path)
    if loaded.kind.of_methods:
        from squealstudy.cli.experiment import check_experiment_command

        if of_mesh:
            raise SquealstudyError(
                f"{path}: --mesh-error is of a study's design points, which a study of methods "
                "has not: check the study that it varies"
            )
        check_experiment_command(loaded, output)
        return
    plan, facts = Plan(loaded), None
    if loaded.definition.fidelity is not None:
        from squealstudy.study.fidelity.run import resolve

        with screen.progress_bars() as progress:
            resolved = resolve(loaded, jobs or os.cpu_count() or 1, progress)
        plan, facts = resolved.plan, resolved.facts
    check_limit(plan.study, yes=True)
    directory = output or default_directory(plan)
    found = check_owner(directory, plan.owner)
    if found and found.get("basis_enriched"):  # as it was solved
        plan = Plan(plan.study, plan.swept, True)
    jobs = jobs or os.cpu_count() or 1
    if text := check_shapes(plan):
        screen.warning(text)
    if build or not has_mesh(plan.study):
        reason = build_first(plan, jobs)
        if reason:
            raise SquealstudyError(f"{path}: {reason}")
    check_component_modes(plan)
    kind = plan.kind
    kind.check(plan)
    plan = grown(plan, directory) if directory.is_dir() else plan
    done = chunks.finished_points(directory, kind.schema) if directory.is_dir() else set()
    missing = sum(t.point_id not in done for t in plan.tasks)
    rows = _facts(plan, directory, missing, jobs, estimate(plan))
    rows += _mesh_error(plan, jobs) if of_mesh else []
    screen.facts([*rows, *fidelity_screen.facts(facts)])
    if text := outdated(directory, found):
        screen.warning(f"{text}; all design points will be solved again")
    for text in kind.warnings(plan):
        screen.warning(text)


def _facts(
    plan: Plan, directory: Path, missing: int, jobs: int, cost: Estimate
) -> list[tuple[str, str]]:
    study = plan.study
    rows = [
        ("study", f"{study.name}: {study.definition.study.kind} on {study.model.name}, valid"),
        ("design", _design(plan, missing, directory)),
        *((f"  {s.name}", _range(plan, i)) for i, s in enumerate(study.sweeps)),
        _structures(plan, cost),
        *_method(plan),
        *transient_screen.regularisation(plan.kind.manifest(plan).get("regularisation")),
        *_validity(plan),
    ]
    if cost.n_coordinates is not None:
        rows.append((_model_word(plan), f"{cost.n_coordinates} degrees of freedom"))
    if cost.point_s is None:
        return [*rows, ("estimate", f"time and memory cannot be told: {cost.reason}")]
    if not missing:
        return [*rows, ("time", "nothing is left to solve")]
    workers = min(jobs, missing)
    growing = grows(plan.study) and missing
    most = missing + most_points(plan.study) - len(plan.tasks) if growing else None
    least, longest = run_seconds(plan, cost, missing, jobs, most)
    return [
        *rows,
        (
            "time",
            f"{_duration(least)} to {_duration(longest)} without pictures: an exact point takes "
            f"{cost.point_s:.2g} s on one core, {plural(workers, 'worker')}{_bound(plan)}",
        ),
        (
            "memory",
            f"about {(cost.memory_mb or 0) / 1024:.1f} GB a process, {workers + 1} processes",
        ),
    ]


def _method(plan: Plan) -> list[tuple[str, str]]:
    """How design points are solved, and why so."""
    if plan.kind.name == "transient":
        section = plan.study.section
        return [("method", f"{section.integrator.name}, contact iteration to {section.balance:g}")]
    if not plan.kind.chooses_rung:
        return []
    method = plan.method
    rung = method.rung
    kept = f", to {method.tolerance:g}" if rung.keeps_tolerance and not rung.exact else ""
    return [("method", f"{method.name}{kept}: {method.reason}")]


def _validity(plan: Plan) -> list[tuple[str, str]]:
    """Design points whose parameters break an assumption; what only their results tell is open."""
    reasons = [BETWEEN.join(found) for found in parameter_reasons(plan) if found]
    if not reasons:
        return []
    text = f"{len(reasons)} of {len(plan.tasks)} points will be outside: "
    return [("validity", text + screen.broken_rules(rule_counts(reasons)))]


def _mesh_error(plan: Plan, jobs: int) -> list[tuple[str, str]]:
    """What the next finer mesh changes; it is solved for this."""
    from squealstudy.study.mesh_error import mesh_error

    found = mesh_error(plan, jobs)
    mesh, finer = found.meshes
    text = f"{mesh} against {finer} at the values of [parameters], in the band: "
    if len(found.frequency):
        text += (
            f"frequencies differ by {100 * found.frequency.max():.2f} % at most "
            f"({100 * np.median(found.frequency):.2f} % in the median), damping ratios by "
            f"{100 * found.damping.max():.3f} % of critical at most, over "
            f"{plural(len(found.frequency), 'mode')} of |damping| < 5 %; "
        )
    if found.unpaired:
        text += f"{plural(found.unpaired, 'more mode')} of {finer} without a counterpart; "
    text += f"unstable are {found.unstable[0]} on {mesh}, {found.unstable[1]} on {finer}"
    cost = f"{_duration(found.seconds[0])} on {mesh}, {_duration(found.seconds[1])} on {finer}"
    return [("mesh error", f"{text} ({cost})")]


def _bound(plan: Plan) -> str:
    """Runs that may end early are timed as if they did not."""
    return "; runs end once their outcome is known" if plan.kind.may_end_early(plan) else ""


def _design(plan: Plan, missing: int, directory: Path) -> str:
    """Number of points; of a design that grows also what it may come to."""
    text = f"{plural(len(plan.tasks), 'point')}, {missing} of them not yet in {directory}"
    if grows(plan.study) and missing:
        text += f"; more where stability changes, {most_points(plan.study):,} at most (full grid)"
    return text


def _range(plan: Plan, index: int) -> str:
    sweep = plan.study.sweeps[index]
    values = sweep.values
    scatter = "random" if sweep.distribution is None else sweep.distribution.text
    count = plural(len(values), "value") if values else scatter
    unit = f" {sweep.parameter.unit}" if sweep.parameter.unit else ""
    if sweep.low == sweep.high:
        return f"{sweep.low:g}{unit}, {count}"
    return f"{sweep.low:g} to {sweep.high:g}{unit}, {count}"


def _model_word(plan: Plan) -> str:
    return "model" if isinstance(plan.study.model, FamilyDefinition) else "reduced model"


def _structures(plan: Plan, cost: Estimate) -> tuple[str, str]:
    """Reductions to make, or the files of a family, which is never reduced here."""
    if isinstance(plan.study.model, FamilyDefinition):
        n = len(plan.study.model.sources)
        return "matrices", f"{n} terms read, parameters {', '.join(plan.study.values) or 'none'}"
    total = len(plan.structures)
    text = f"{total} needed, {cost.n_missing_structures} not in the cache"
    if total > 1:
        text += "; a swept mass or stiffness costs one reduction a value"
    if cost.n_missing_structures and cost.structure_s:
        text += f" ({_duration(cost.structure_s)} each)"
    return "reductions", text


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.0f} s" if seconds >= 1 else f"{seconds:.2f} s"
    return f"{math.ceil(seconds / 60)} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def schema_command(kind: str | None) -> None:
    """Print the JSON Schema of study files, or of those of an experiment."""
    of_methods = [name for name in kind_names() if kind_named(name).of_methods]
    if kind is not None and kind not in of_methods:
        raise SquealstudyError(f"kind '{kind}': expected {' or '.join(of_methods)}")
    found = study_schema() if kind is None else methods_schema(kind)
    json.dump(found, sys.stdout, indent=2)
    sys.stdout.write("\n")
