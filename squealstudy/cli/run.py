"""`squealstudy run`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from squealstudy.cli import fidelity_screen, mode_screen, screen, transient_screen
from squealstudy.models.matrix_family import NAME as MATRICES
from squealstudy.study.definition import load_any
from squealstudy.study.manifest import check_owner
from squealstudy.study.plan import Plan
from squealstudy.study.results import TABLES, Results
from squealstudy.study.runner import RunReport, default_directory, failure_counts, run_study
from squealstudy.study.sampling import check_limit
from squealstudy.wording import plural

LISTED = 12  # modes in the ranking that a run prints
OF_MESH = "; the error of the mesh is not in it, `squealstudy check --mesh-error` tells it"


def run_command(
    study: Path, output: Path | None, jobs: int | None, yes: bool, pictures: bool
) -> None:
    """Run, rank, draw, and say where everything is."""
    loaded = load_any(study)
    jobs = jobs or os.cpu_count() or 1
    if loaded.kind.of_methods:
        from squealstudy.cli.experiment import run_experiment_command

        run_experiment_command(loaded, output, jobs, pictures)
        return
    plan = Plan(loaded)
    directory = output or default_directory(plan)
    with screen.interruptible(), screen.progress_bars() as progress:
        if loaded.definition.fidelity is None:
            report = run_study(plan, directory, jobs, yes, progress, screen.warning)
        else:
            from squealstudy.study.fidelity.run import resolve, run_resolved

            check_limit(plan.study, yes)
            check_owner(directory, plan.owner)
            chosen = resolve(loaded, jobs, progress)
            report = run_resolved(chosen, directory, yes, progress, screen.warning)
    results = Results.open(directory)
    show_findings(results)
    mode_screen.outside_validity(results.points)
    screen.console.print()
    drawn = _draw(results, directory) if pictures else []
    screen.facts([*_summary(report, results), *((("picture"), str(p)) for p in drawn)])


def _draw(results: Results, directory: Path) -> list[Path]:
    from squealstudy.cli.pictures import draw_pictures  # matplotlib

    return draw_pictures(results, directory)


def show_findings(results: Results) -> None:
    """The ranking of unstable modes, or what became of each design point in time."""
    if results.kind == "transient":
        unit = results.manifest["units"].get("torque", "N m")
        transient_screen.points(results.points, results.parameters, unit)
        screen.console.print()
        transient_screen.ranking(results.rank(top=LISTED))
        return
    if results.kind == "sensitivity":
        from squealstudy.cli import sensitivity_screen

        sensitivity_screen.show_ranking(results, None, LISTED)
        return
    if not len(results.modes):
        low, high = results.manifest["band_hz"]
        screen.console.print(f"No mode lies between {low:g} and {high:g} Hz at any design point.")
        return
    unit = results.manifest["units"].get(results.along, "")
    mode_screen.ranking(
        results.rank(top=LISTED), results.along, unit, mode_screen.Scope.of(results)
    )


def _summary(report: RunReport, results: Results) -> list[tuple[str, str]]:
    manifest = report.manifest
    failed, directory = "", report.directory
    if lost := manifest["n_failed"] + manifest.get("n_inaccurate", 0):
        why = failure_counts(results.points["status"])
        failed = f", {lost} not ok ({why}; see message in points)"
    rows = [
        (
            "points",
            f"{manifest['n_points']}: {report.n_solved} solved now, {report.n_reused} found in "
            f"{directory}{failed}",
        ),
        ("time", f"{manifest['timings']['total_s']:.1f} s in the run that solved them"),
        *transient_screen.ended_early(manifest),
        *transient_screen.regularisation(manifest.get("regularisation")),
        *fidelity_screen.facts(manifest.get("fidelity")),
        *_method(manifest),
        ("error", error_statement(report.directory, manifest)),
        ("tables", ", ".join(str(report.directory / n) for n in TABLES[manifest["kind"]])),
    ]
    if report.n_solved == 0:
        rows.insert(1, ("nothing to do", "all design points were there already"))
    return rows


def _method(manifest: dict[str, Any]) -> list[tuple[str, str]]:
    """Which rungs served the points of a complex-mode study, and what an audit of them found."""
    method = manifest.get("method")
    if not method:
        return []
    served = ", ".join(f"{rung} {count}" for rung, count in method["points"].items())
    rows = [("method", f"{method['chosen']} ({method['reason']}); points by rung: {served}")]
    audit = manifest.get("audit")
    if audit and audit["modes"]:
        text = (
            f"{audit['modes']} modes of {audit['points']} points at full order: largest error "
            f"{audit['largest_true_error']:.1e}, largest estimate {audit['largest_estimate']:.1e}, "
            f"{audit['missed_modes']} missed"
        )
        rows.append(("audit", text))
    return [*rows, *_estimates(manifest)]


def _estimates(manifest: dict[str, Any]) -> list[tuple[str, str]]:
    """Largest estimated errors, of the rung and of the reduction; the mesh's is in neither."""
    errors = manifest.get("errors")
    if not errors or errors["largest_rung"] is None:
        return []
    text = f"method {errors['largest_rung']:.1e}, "
    if not errors["reduced"]:
        return [("estimates", f"{text}no reduction: relative, of light and of growing modes")]
    reduction, tolerance = errors["largest_reduction"], manifest["method"]["tolerance"]
    if reduction is None:
        return [("estimates", f"{text}reduction not known: no sample point has modes")]
    points = plural(errors["reduction_sample_points"], "sample point")
    text += f"reduction {reduction:.1e}, from a finer model at {points}"
    if errors["reduction_widened"] > 1:
        text += f", {errors['reduction_widened']:.2g} times that for what full order showed"
    if manifest.get("basis_enriched"):
        text += "; the basis was enriched"
        if reduction > tolerance:
            text += f", which is not enough for {tolerance:g}: a smaller [reduction] tolerance is"
    return [("estimates", f"{text}: relative, of light and of growing modes, without the mesh's")]


def error_statement(directory: Path, manifest: dict[str, Any]) -> str:
    """One line on the error: against the full-order model, or of the energy balance in time."""
    if manifest["kind"] == "transient":
        points = Results.open(directory).points
        balance = points.loc[points["status"] == "ok", "energy_balance"].abs().max()
        return f"energy balance closed to {balance:.1e} of the work of friction, at the worst point"
    if manifest["kind"] == "sensitivity":
        from squealstudy.cli import sensitivity_screen

        return sensitivity_screen.agreement(Results.open(directory).sensitivities)
    asked = manifest.get("reference", [])
    checks = [c for c in asked if c.get("status") == "ok"]
    other = "a second factorisation" if manifest["model"] == MATRICES else "the full-order model"
    meshed = "mesh" in manifest.get("options", {})
    other += " of the same mesh" if meshed else ""
    if not asked:
        failed = ", or those points failed" if manifest["n_failed"] else ""
        return f"not checked against {other} ([modes] reference_points = 0{failed})"
    if not checks:
        return f"not known, {other} failed at {plural(len(asked), 'point')}: {asked[0]['message']}"
    if not any(c["full_order_modes"] for c in checks):
        return f"{other} has no mode in the band either, at {plural(len(checks), 'point')}"
    frequency = max(c["frequency_error"] for c in checks)
    damping = max(c["damping_error"] for c in checks)
    missed = sum(c["missed_modes"] for c in checks)
    return (
        f"frequency {frequency:.1e} relative, damping ratio {damping:.1e}, {missed} modes missed: "
        f"modes of |damping| < 5 % against {other} at "
        f"{plural(len(checks), 'point')}{OF_MESH if meshed else ''}"
    )
