"""`squealstudy run` and `squealstudy check` of studies of methods, not of brakes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from squealstudy.cli import screen
from squealstudy.cli.experiment_screen import show_experiment
from squealstudy.cli.pictures import draw_pictures
from squealstudy.study.manifest import check_owner
from squealstudy.study.results import Results
from squealstudy.study.runner import default_directory, run_study


def run_experiment_command(study: Any, output: Path | None, jobs: int, pictures: bool) -> None:
    """Run, show what came out, draw, and say where everything is."""
    plan = study.kind.plan(study)
    directory = output or default_directory(plan)
    with screen.interruptible(), screen.progress_bars() as progress:
        report = run_study(plan, directory, jobs, False, progress, screen.warning)
    results = Results.open(directory)
    show_experiment(results)
    screen.console.print()
    drawn = draw_pictures(results, directory) if pictures else []
    manifest = report.manifest
    failed = f", {manifest['n_failed']} failed (see status)" if manifest["n_failed"] else ""
    screen.facts(
        [
            (plan.kind.rows_word, f"{manifest['n_points']}: {report.n_solved} made now{failed}"),
            ("time", f"{manifest['timings']['total_s']:.1f} s in the run that made them"),
            ("tables", ", ".join(str(directory / name) for name in plan.kind.tables)),
            *(("picture", str(path)) for path in drawn),
        ]
    )


def check_experiment_command(study: Any, output: Path | None) -> None:
    """Validate and count; nothing is built."""
    plan = study.kind.plan(study)
    name, word, _ = plan.owner
    check_owner(output or default_directory(plan), plan.owner)
    screen.facts([("study", f"{name}: {word}, valid"), *plan.facts])
