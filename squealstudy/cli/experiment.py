"""`squealstudy run` and `squealstudy check` of experiments: studies of methods, not of brakes."""

from __future__ import annotations

from pathlib import Path

from squealstudy.cli import screen
from squealstudy.cli.experiment_screen import show_experiment
from squealstudy.cli.pictures import draw_pictures
from squealstudy.study.experiments.definition import Experiment
from squealstudy.study.experiments.kinds import experiment_kind
from squealstudy.study.experiments.runner import run_experiment
from squealstudy.study.manifest import check_owner
from squealstudy.study.results import TABLES, Results


def run_experiment_command(
    experiment: Experiment, output: Path | None, jobs: int, pictures: bool
) -> None:
    """Run, show what came out, draw, and say where everything is."""
    directory = output or Path("results") / experiment.owner[0]
    with screen.interruptible(), screen.progress_bars() as progress:
        report = run_experiment(experiment, directory, jobs, progress, screen.warning)
    results = Results.open(directory)
    show_experiment(results)
    screen.console.print()
    drawn = draw_pictures(results, directory) if pictures else []
    manifest = report.manifest
    failed = f", {manifest['n_failed']} failed (see status)" if manifest["n_failed"] else ""
    screen.facts(
        [
            ("runs", f"{manifest['n_points']}: {report.n_solved} made now{failed}"),
            ("time", f"{manifest['timings']['total_s']:.1f} s in the run that made them"),
            ("tables", ", ".join(str(directory / name) for name in TABLES[experiment.owner[1]])),
            *(("picture", str(path)) for path in drawn),
        ]
    )


def check_experiment_command(experiment: Experiment, output: Path | None) -> None:
    """Validate and count; nothing is built."""
    kind = experiment_kind(experiment)
    name, word, _ = experiment.owner
    check_owner(output or Path("results") / name, experiment.owner)
    screen.facts([("study", f"{name}: {word}, valid"), *kind.facts()])
