"""`squealstudy sensitivity`: which component mode, which parameter moves an unstable mode."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

from squealstudy.analysis.tables.sensitivity_ranking import mode_sensitivities, rank_sensitivities
from squealstudy.cli import mode_screen, screen
from squealstudy.cli.sensitivity_screen import show_ranking
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.study.definition import Study, load_study
from squealstudy.study.kinds import model_kind
from squealstudy.study.plan import Plan
from squealstudy.study.results import Results
from squealstudy.study.runner import default_directory, run_study

KIND = "sensitivity"


def sensitivity_command(
    path: Path, mode: float | None, top: int | None, csv: bool, jobs: int | None
) -> None:
    """Print the ranking of one mode's sensitivities; a study is run first.

    Raises
    ------
    ResultsError, StudyFileError
        Results of another kind; a study in time.
    """
    results = Results.open(path) if path.is_dir() else _run(load_study(path), jobs)
    if results.kind != KIND:
        raise ResultsError(
            f"{path}: results of kind {results.kind} have no sensitivities; give the study file, "
            f"or one of kind {KIND}"
        )
    if csv:
        chosen = mode_sensitivities(results.sensitivities, mode)
        rank_sensitivities(chosen, top).to_csv(sys.stdout, index=False)
        return
    show_ranking(results, mode, top)
    mode_screen.outside_validity(results.points)


def _run(study: Study, jobs: int | None) -> Results:
    plan = Plan(nominal_sensitivities(study))
    directory = default_directory(plan)
    with screen.progress_bars() as progress:
        run_study(plan, directory, jobs or os.cpu_count() or 1, False, progress, screen.warning)
    return Results.open(directory)


def nominal_sensitivities(study: Study) -> Study:
    """The study itself, or that of sensitivities at the [parameters] of a complex-mode study.

    The latter has no sweeps, all defaults of [sensitivity], and a name of its own.
    """
    definition = study.definition
    if definition.study.kind == KIND:
        return study
    if definition.study.kind != "complex_modes":
        raise StudyFileError(
            f"expected a study of kind {KIND} or complex_modes, got {definition.study.kind}",
            study.path,
            "study.kind",
        )
    kind = model_kind(KIND)
    named = definition.study.model_copy(update={"kind": KIND, "name": f"{study.name}_{KIND}"})
    kept = {k: getattr(definition, k) for k in ("model", "parameters", "modes", "reduction")}
    changed = kind.definition(study=named, **kept)
    return replace(study, kind=kind, definition=changed, sweeps=())
