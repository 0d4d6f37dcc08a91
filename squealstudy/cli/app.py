"""The `squealstudy` command: its arguments; the work is imported when a command runs."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import sys
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

from squealstudy import faults
from squealstudy.errors import ResultsError, SquealstudyError
from squealstudy.machine import InterruptedRun, cut_lifeline, interruptible

NAME, DEBUG = "squealstudy", "SQUEALSTUDY_DEBUG"
DONE, FAULT, USAGE_ERROR = 0, 1, 2  # exit codes: studies/running.md
UsageError: type[Any] = typer.BadParameter.mro()[1]

app = typer.Typer(
    help="Which modes of a brake squeal, why, and which design change silences them.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

StudyPath = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).")]
ResultsPath = Annotated[Path, typer.Argument(metavar="RESULTS", help="Results directory.")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, help="Worker processes; default: cores.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Solve on a cluster of dask: its scheduler's address, tcp://host:8786, or file.",
    ),
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Results directory; default results/NAME.")
]
By = Annotated[
    str,
    typer.Option(
        help="share, growth, damping, threshold, frequency, energy_<component>; of random designs "
        "probability, worst, mean_growth."
    ),
]
Top = Annotated[int | None, typer.Option(min=1, help="Number of modes listed.")]
Csv = Annotated[bool, typer.Option("--csv", help="Print all columns as CSV.")]
Where = Annotated[
    str | None, typer.Option(help="Condition on table columns, e.g. 'pressure < 1e6'.")
]


@app.callback()
def extended(
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="File of Python with a law, a model, a kind or a plot of your own, executed "
            "first; a study names its own. Before the command; may be repeated.",
        ),
    ] = None,
) -> None:
    """Which modes of a brake squeal, why, and which design change silences them."""
    if extension:
        from squealstudy.extensions import load_extension

        for path in extension:
            load_extension(path)


@app.command()
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
) -> None:
    """Run a study, or what is left of it; print the ranking and where the tables are."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside, summary

    _expect_one_place(jobs, scheduler)
    results = face.run(face.read_study(study), output, jobs, yes, screen.warning, fresh, scheduler)
    screen.show(*results.screen.findings(results), *outside(results), "")
    drawn = (results.drawn or results.draw()) if pictures else []
    screen.show(screen.facts(summary(results, drawn)))


def _expect_one_place(jobs: int | None, scheduler: str | None) -> None:
    """Raise a usage error for workers of this machine and of a cluster."""
    if jobs is not None and scheduler is not None:
        raise typer.BadParameter("--jobs is of this machine, --scheduler of a cluster: give one")


@app.command()
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
        held, whole = check_results(path)
        screen.show(screen.facts(held))
        raise typer.Exit(DONE if whole else FAULT)
    _expect_one_place(jobs, scheduler)
    with usable_cache(screen.warning):
        found = checked(face.read_study(path), output, jobs, build, mesh_error, scheduler)
    screen.show(screen.facts(found))


@app.command()
def rank(
    results: ResultsPath,
    by: By = "share",
    top: Top = None,
    where: Where = None,
    csv: Csv = False,
    names: Annotated[
        bool,
        typer.Option(
            "--names",
            help="Name each mode by its shape (nodal diameters, component modes, rigid pads); the "
            "first time a structure is expanded for it.",
        ),
    ] = False,
    why: Annotated[
        bool,
        typer.Option(
            "--why",
            help="Split the growth of each mode, where it grows fastest, into friction by pad and "
            "damping by component and layer.",
        ),
    ] = False,
) -> None:
    """Which modes are unstable: how widely, how strongly, from where on, in which component."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside

    found = face.open_results(results)
    if names or why:
        from squealstudy.cli.shape import names as named
        from squealstudy.cli.shape import reasons
        from squealstudy.engine.kind import LISTED
        from squealstudy.paths import usable_cache

        with usable_cache(screen.warning):
            tracks = found.rank(by, top or LISTED, where)["track"]
            told = (reasons if why else named)(found, tracks)
        screen.show(screen.facts(told))
        return
    if csv:
        screen.show_csv(found.rank(by, top, where))
        return
    screen.show(*found.screen.ranking(found, by, top, where))
    screen.show(*outside(found, "of the whole study: " if where else ""))


@app.command()
def robust(
    results: ResultsPath,
    top: Top = None,
    csv: Csv = False,
    indices: Annotated[
        bool, typer.Option("--indices", help="Print the Sobol indices alone.")
    ] = False,
) -> None:
    """Probability of instability of a random design, and its Sobol indices."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside
    from squealstudy.engine.kind import LISTED
    from squealstudy.kinds.complex_modes import random_screen
    from squealstudy.study.sweeps import SOBOL_INDICES

    found = face.open_results(results)
    if csv:
        screen.show_csv(found.sobol_indices(top) if indices else found.robust())
        return
    kept, sampled, names = top or LISTED, found.design == SOBOL_INDICES, found.track_names
    if not indices:
        table = found.robust().iloc[: kept + 1]
        screen.show(*random_screen.probabilities(table, sampled, names))
        screen.show(*([""] if sampled else []))
    if indices or sampled:
        screen.show(*random_screen.indices(found.sobol_indices(kept), names))
    screen.show(*outside(found))


@app.command()
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
        found = face.open_results(path)
    else:
        study = face.read_study(path).sensitivities()
        found = face.run(study, jobs=jobs, warn=screen.warning)
    if csv:
        screen.show_csv(rank_sensitivities(mode_sensitivities(found.sensitivities, mode), top))
        return
    screen.show(*sensitivities(found, mode, top), *outside(found))


@app.command()
def plot(
    results: ResultsPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory of the pictures.")
    ] = None,
) -> None:
    """Draw every picture that the tables of the results allow."""
    from squealstudy import face, screen

    screen.show(*map(str, face.open_results(results).draw(output)))


@app.command()
def shape(
    results: ResultsPath,
    point: Annotated[
        str | None,
        typer.Option(
            help="Design point: its row of the points table, from 0, or its point_id. Default: "
            "where the mode grows fastest."
        ),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(
            help="Modes by their numbers at the point, as in the modes table (12 or 12,14), "
            "'unstable' or 'all'. Default: the one that grows fastest."
        ),
    ] = None,
    track: Annotated[
        int | None, typer.Option(min=0, help="Instead: the mode by its number in 'rank'.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; default RESULTS/shapes.")
    ] = None,
    picture: Annotated[bool, typer.Option(help="Write a picture (PNG) of each mode.")] = True,
    page: Annotated[bool, typer.Option(help="Write a page (HTML) in which the modes move.")] = True,
    vtu: Annotated[bool, typer.Option("--vtu", help="Write VTU and PVD for ParaView.")] = False,
    uff: Annotated[
        bool, typer.Option("--uff", help="Write universal files (15, 2412, 55).")
    ] = False,
) -> None:
    """What modes, or ends of runs, look like: a picture, a page, files for other programs."""
    from squealstudy import face, screen
    from squealstudy.cli.shape import shapes
    from squealstudy.paths import usable_cache

    with usable_cache(screen.warning):
        kinds = (picture, page, vtu, uff)
        found = shapes(face.open_results(results), point, mode, track, output, kinds)
    screen.show(screen.facts(found))


@app.command()
def compare(
    frequency: Annotated[Path, typer.Argument(metavar="FREQ_RESULTS", help="Complex modes.")],
    time: Annotated[Path, typer.Argument(metavar="TIME_RESULTS", help="Transient results.")],
    csv: Csv = False,
) -> None:
    """Predicted against fitted growth, and which predicted instabilities express themselves."""
    from squealstudy import face, screen
    from squealstudy.cli.compare import comparison
    from squealstudy.cli.run import outside
    from squealstudy.engine.comparison import in_order
    from squealstudy.engine.manifest import outdated

    found = in_order(face.open_results(frequency), face.open_results(time))
    for results in found:
        if text := outdated(results.directory, results.manifest):
            screen.warning(f"{text}; run that study again")
    table = found[0].compare(found[1])
    if csv:
        screen.show_csv(table)
        return
    screen.show(*comparison(table, found[0].track_names))
    for name, results in zip(("frequency", "time"), found, strict=True):
        screen.show(*outside(results, f"{name} study: "))


@app.command()
def inspect(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Model file (TOML).")],
    picture: Annotated[
        Path | None, typer.Option("--picture", "-p", help="Picture to draw, .png or .svg.")
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            help="Universal file with measured modes of a free component, to be compared with its "
            "own: pairs with MAC and frequency; the picture is then the matrix of MAC."
        ),
    ] = None,
    component: Annotated[str | None, typer.Option(help="Which component was measured.")] = None,
    unit: Annotated[str, typer.Option(help="Of lengths measured, where the file has none.")] = "m",
    tolerance: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="How far a measured point may be from its node, as '3 mm'; default 2 % of the "
            "component's length.",
        ),
    ] = None,
) -> None:
    """What a model file was understood as: parts, contact, rotation, loads, and doubts.

    Exit code 1 where something is in doubt.
    """
    if (measured is None) != (component is None):
        raise typer.BadParameter("--measured needs --component, and --component --measured")
    if measured is not None and component is not None:
        from squealstudy.cli.measured import inspected as compared

        if compared(model, component, measured, unit, tolerance, picture):
            raise typer.Exit(FAULT)
        return
    from squealstudy import screen
    from squealstudy.cli.inspect import shown
    from squealstudy.study.components import inspected, read_model

    read = read_model(model)
    found, geometry = inspected(read)
    facts, parameters = shown(read, found)
    screen.show(screen.facts(facts))
    if parameters:
        screen.show("\nparameters", screen.facts(parameters))
    if picture is not None:
        from squealstudy.cli.inspect import draw

        draw(geometry, picture)
        screen.show(f"\npicture: {picture}")
    for text in found.doubts:
        screen.warning(text)
    if found.doubts:
        raise typer.Exit(FAULT)


@app.command()
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
    from squealstudy.paths import usable_cache

    plan = face.read_study(study).plan()
    if output.exists() and not output.is_dir():
        raise ResultsError(f"{output}: expected a folder to write to, found a file")
    with usable_cache(screen.warning):
        written = export_reduced(plan, output, jobs or 1, screen.warning)
    if plan.study.model.name == GENERATED:
        written += export_model(plan.study, output)
    screen.show(screen.facts([("written", f"in {output}: {', '.join(p.name for p in written)}")]))


@app.command()
def warmup(
    single: Annotated[bool, typer.Option("--single", help="Single-precision storage too.")] = False,
) -> None:
    """Compile the kernels of transient studies once, into the cache."""
    from squealstudy import screen
    from squealstudy.kernels.jit import compiled_directory
    from squealstudy.motion.warmup import warm_kernels

    seconds = warm_kernels(single)
    text = f"ready after {seconds:.1f} s, in {compiled_directory()}"
    screen.show(screen.facts([("kernels", text)]))


@app.command()
def models(
    name: Annotated[str | None, typer.Argument(help="Model to describe.")] = None,
    modes: Annotated[
        bool, typer.Option(help="Build the model and list its components' free-free modes.")
    ] = True,
) -> None:
    """List models, or one model's parameters with units and defaults, components and modes."""
    from squealstudy import face, screen
    from squealstudy.cli.models import CONTRACT, described
    from squealstudy.models.matrices.family import NAME as MATRICES

    listed = face.list_models()
    if name is None:
        screen.show(screen.facts(listed.items()))
        screen.show("\nsquealstudy models NAME lists parameters, components and modes.")
    elif name == MATRICES:
        screen.show(f"{MATRICES}: {listed[MATRICES]}\n\n{CONTRACT}")
    else:
        screen.show(*described(face.model(name), modes))


@app.command()
def new(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Study file to write.")],
    model: Annotated[str, typer.Option(help="Model; 'squealstudy models' lists them.")],
    kind: Annotated[
        str, typer.Option(help="complex_modes, transient or sensitivity.")
    ] = "complex_modes",
) -> None:
    """Write a commented study file to start from: every key with its default and meaning."""
    from squealstudy import screen
    from squealstudy.engine.template import new_study

    written = new_study(path, kind, model)
    screen.show(f"{written}: now change it, then squealstudy check {written}")


@app.command()
def schema(
    kind: Annotated[
        str | None, typer.Option(help="work_precision or method_stability, else study files.")
    ] = None,
) -> None:
    """Print the JSON Schema of study files, for editors."""
    from squealstudy import screen
    from squealstudy.cli.check import schema as found

    screen.write(found(kind) + "\n")


def main() -> None:
    """Entry point: whatever goes wrong is one message on stderr, with an exit code of its kind."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # of a terminal that may not know all letters
            stream.reconfigure(errors="backslashreplace")
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: _tell(f"warning: {message}")
        log, lines = logging.getLogger(NAME), logging.StreamHandler()  # to stderr
        log.addHandler(lines)
        log.setLevel(logging.INFO)
        code = _outcome(sys.argv[1:] or ["--help"])
        log.removeHandler(lines)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except AttributeError:  # closed from the beginning
            continue
        except OSError:  # told by now: Python would try again, and complain, at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    raise SystemExit(code)


def _outcome(arguments: list[str]) -> int:
    """Exit code of a command line; what goes wrong is told."""
    try:
        with (
            interruptible(),
            faults.told(),
            get_command(app).make_context(NAME, arguments) as context,
        ):
            context.command.invoke(context)
    except typer.Exit as error:
        return error.exit_code
    except UsageError as error:
        where = error.ctx.command_path if error.ctx else NAME
        _tell(f"{NAME}: {error.format_message()} ({where} --help says what is expected)")
        return USAGE_ERROR
    except BrokenPipeError:  # a reader such as `head` has gone
        return DONE
    except InterruptedRun as signal:
        _tell(f"{NAME}: interrupted; the same command goes on where it was")
        return signal.exit_code
    except Exception as error:
        if os.environ.get(DEBUG) and getattr(error, "exit_code", FAULT) == FAULT:
            raise
        if isinstance(error, SquealstudyError):
            _tell(f"{NAME}: {error}")
            return error.exit_code
        what = f"internal error, {type(error).__name__}: {error}"
        _tell(f"{NAME}: {what}; {DEBUG}=1 shows where")
        return FAULT
    finally:
        cut_lifeline()  # workers whose results nobody waits for would be waited for
    return DONE


def _tell(text: str) -> None:
    """Write a line to stderr, where there is one."""
    with contextlib.suppress(AttributeError, OSError):
        sys.stderr.write(text + "\n")
