"""Commands on study files; the work is imported when one runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer

from squealstudy.cli.options import (
    DONE,
    FAULT,
    Csv,
    Jobs,
    Output,
    Scheduler,
    StudyPath,
)
from squealstudy.errors import ResultsError


def run(
    study: StudyPath,
    output: Output = None,
    jobs: Jobs = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Accept a very large design.")] = False,
    pictures: Annotated[bool, typer.Option(help="Draw the pictures at the end.")] = True,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Remove what the study wrote there, and begin anew.")
    ] = False,
    scheduler: Scheduler = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print times and methods, too.")
    ] = False,
) -> None:
    """Run a study, or what is left of it: print what was found, how sure that is, what next."""
    from squealstudy import face, screen
    from squealstudy.cli.pulled_contacts import pulled_contacts
    from squealstudy.cli.run import blocks
    from squealstudy.tables.validity import said_first

    _expect_one_place(jobs, scheduler)
    to_run = face.read_study(study)
    results = face.run(to_run, output, jobs, yes, screen.warning, fresh, scheduler)
    first = ""
    if "points" in results.tables:
        first = said_first(results.points, pulled_contacts(to_run, results.points))
    screen.show(*([first] if first else []), *results.screen.findings(results))
    drawn = (results.drawn or results.draw()) if pictures else []
    screen.show(*blocks(results, drawn, verbose))


def _expect_one_place(jobs: int | None, scheduler: str | None) -> None:
    """Raise a usage error where both workers of this machine and a cluster are asked for."""
    if jobs is not None and scheduler is not None:
        raise typer.BadParameter("--jobs is of this machine, --scheduler of a cluster: give one")


def check(
    path: Annotated[
        Path, typer.Argument(metavar="STUDY_OR_RESULTS", help="Study file or results directory.")
    ],
    output: Output = None,
    jobs: Jobs = None,
    build: Annotated[
        bool, typer.Option("--build", help="Make and cache the first reduction, then time points.")
    ] = False,
    mesh_error: Annotated[
        bool,
        typer.Option(
            "--mesh-error",
            help="Solve the values of [parameters] on the study's mesh and on the next finer one, "
            "and state how far modes differ.",
        ),
    ] = False,
    scheduler: Scheduler = None,
) -> None:
    """Validate a study, count its points, estimate time and memory. Writes no results.

    Of a results directory: what it holds and whether it is whole; exit code 1 where it is not.
    """
    from squealstudy import face, screen
    from squealstudy.cli.check import check as checked
    from squealstudy.cli.check_results import check_results
    from squealstudy.paths import usable_cache

    if path.is_dir():
        facts, whole = check_results(path)
        screen.show(screen.facts(facts))
        raise typer.Exit(DONE if whole else FAULT)
    _expect_one_place(jobs, scheduler)
    with usable_cache(screen.warning):
        study_facts = checked(face.read_study(path), output, jobs, build, mesh_error, scheduler)
    screen.show(screen.facts(study_facts))


def sensitivity(
    path: Annotated[
        Path, typer.Argument(metavar="STUDY_OR_RESULTS", help="Study file or results directory.")
    ],
    mode: Annotated[
        float | None, typer.Option(min=0.0, help="Mode nearest this frequency, Hz.")
    ] = None,
    top: Annotated[int | None, typer.Option(min=1, help="Number of parameters listed.")] = 20,
    csv: Csv = False,
    jobs: Jobs = None,
) -> None:
    """Which component modes and parameters move the most unstable mode, beside a reanalysis."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside
    from squealstudy.kinds.sensitivity.screen import sensitivities
    from squealstudy.tables.sensitivity_ranking import (
        mode_sensitivities,
        rank_sensitivities,
    )

    if path.is_dir():
        opened = face.open_results(path)
    else:
        study = face.read_study(path).sensitivities()
        opened = face.run(study, jobs=jobs, warn=screen.warning)
    if csv:
        screen.show_csv(rank_sensitivities(mode_sensitivities(opened.sensitivities, mode), top))
        return
    screen.show(*sensitivities(opened, mode, top), *outside(opened))


def export(
    study: StudyPath,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    jobs: Jobs = None,
) -> None:
    """Write the model at a study's [parameters] for other tools: reduced matrices (.npz, .mat).

    The generated disc brake is written as a model file with its meshes, too.
    """
    from squealstudy import face, screen
    from squealstudy.engine.export import GENERATED, export_model, export_reduced
    from squealstudy.engine.plan import Plan
    from squealstudy.paths import usable_cache

    plan = cast("Plan", face.read_study(study).plan())
    if output.exists() and not output.is_dir():
        raise ResultsError(f"{output}: expected a folder to write to, found a file")
    with usable_cache(screen.warning):
        written = export_reduced(plan, output, jobs or 1, screen.warning)
    if plan.study.model.name == GENERATED:
        written += export_model(plan.study, output)
    screen.show(screen.facts([("written", f"in {output}: {', '.join(p.name for p in written)}")]))


def new(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Study file to write.")],
    model: Annotated[
        str | None, typer.Option(help="Model; 'squealstudy models' lists them.")
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            help="complex_modes, transient, limit_cycles, sensitivity, design, robust (complex "
            "modes of what scatters), work_precision (writes the study that methods are measured "
            "on, too) or method_stability (without a model)."
        ),
    ] = "complex_modes",
    whole: Annotated[
        bool, typer.Option("--all", help="Every key, not only those that matter most.")
    ] = False,
    schema_too: Annotated[
        bool,
        typer.Option(
            "--schema",
            help="Write the JSON Schema beside it and name it in the first line: editors then know "
            "every key. A schema that is there already is named without this option.",
        ),
    ] = False,
) -> None:
    """Write a commented study file to start from, which runs as it is and shows an onset."""
    from squealstudy import screen
    from squealstudy.engine.template import new_study

    written = new_study(path, kind, model, whole, schema_too)
    screen.show(f"{written}: now change it, then squealstudy check {written}", unbroken=True)


def examples(
    name: Annotated[str | None, typer.Argument(help="Study to write; without, a list.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Where to; by default here, or in a folder NAME where there are several files.",
        ),
    ] = None,
) -> None:
    """List the shipped studies, or write one with the files that it needs."""
    from squealstudy import screen
    from squealstudy.study.examples import examples as shipped
    from squealstudy.study.examples import write_example

    if name is None:
        if output is not None:
            raise typer.BadParameter("--output is of a study: name one")
        listed = ([e.name, e.kind, e.description] for e in shipped().values())
        screen.show(screen.grid("text:study", "word:kind", "text:about", rows=listed))
        screen.show("\nsquealstudy examples NAME writes one, with the files that it needs.")
        return
    written = write_example(name, output)
    first = [path for path in written if path.stem in shipped()[name].after]
    screen.show(*map(str, written), "", unbroken=True)
    screen.show(*(f"squealstudy run {path}" for path in (*first, written[0])), unbroken=True)


def schema(
    kind: Annotated[
        str | None,
        typer.Option(
            help="model_file, lumped_file, matrix_file, work_precision or method_stability; else "
            "study files."
        ),
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="Tables of all keys to read, in Markdown.")
    ] = False,
) -> None:
    """Print the JSON Schema of study or model files, for editors, or its keys as tables."""
    from squealstudy import screen
    from squealstudy.cli.check import schema as found

    screen.write(found(kind, tables))
