"""The `squealstudy` command: its arguments; the work is imported when a command runs."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from squealstudy.errors import SquealstudyError

INTERNAL_ERROR, USAGE_ERROR = 1, 2
DEBUG = "SQUEALSTUDY_DEBUG"

app = typer.Typer(
    help="Which modes of a brake squeal, why, and which design change silences them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

StudyPath = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).")]
ResultsPath = Annotated[Path, typer.Argument(metavar="RESULTS", help="Results directory.")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, help="Worker processes; default: cores.")
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
Where = Annotated[
    str | None, typer.Option(help="Condition on table columns, e.g. 'pressure < 1e6'.")
]


@app.command()
def run(
    study: StudyPath,
    output: Output = None,
    jobs: Jobs = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Accept a very large design.")] = False,
    pictures: Annotated[bool, typer.Option(help="Draw the pictures at the end.")] = True,
) -> None:
    """Run a study, or what is left of it; print the ranking and where the tables are."""
    from squealstudy.cli.run import run_command

    run_command(study, output, jobs, yes, pictures)


@app.command()
def check(
    study: StudyPath,
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
) -> None:
    """Validate a study, count its points, estimate time and memory. Writes no results."""
    from squealstudy.cli.check import check_command

    check_command(study, output, jobs, build, mesh_error)


@app.command()
def rank(
    results: ResultsPath,
    by: By = "share",
    top: Top = None,
    where: Where = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print all columns as CSV.")] = False,
) -> None:
    """Which modes are unstable: how widely, how strongly, from where on, in which component."""
    from squealstudy.cli.rank import rank_command

    rank_command(results, by, top, where, csv)


@app.command()
def robust(
    results: ResultsPath,
    top: Top = None,
    confidence: Annotated[
        float, typer.Option(min=0.5, max=0.9999, help="Of the intervals.")
    ] = 0.95,
    csv: Annotated[
        bool, typer.Option("--csv", help="Print all columns as CSV; indices with --indices.")
    ] = False,
    indices: Annotated[
        bool, typer.Option("--indices", help="Print the Sobol indices alone.")
    ] = False,
) -> None:
    """Probability of instability of a random design, and its Sobol indices."""
    from squealstudy.cli.robust import robust_command

    robust_command(results, top, confidence, csv, indices)


@app.command()
def sensitivity(
    path: Annotated[
        Path, typer.Argument(metavar="STUDY_OR_RESULTS", help="Study file or results directory.")
    ],
    mode: Annotated[
        float | None, typer.Option(min=0.0, help="Mode nearest this frequency, Hz.")
    ] = None,
    top: Annotated[int | None, typer.Option(min=1, help="Number of parameters listed.")] = 20,
    csv: Annotated[bool, typer.Option("--csv", help="Print all columns as CSV.")] = False,
    jobs: Jobs = None,
) -> None:
    """Which component modes and parameters move the most unstable mode, beside a reanalysis."""
    from squealstudy.cli.sensitivity import sensitivity_command

    sensitivity_command(path, mode, top, csv, jobs)


@app.command()
def plot(
    results: ResultsPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory of the pictures.")
    ] = None,
    along: Annotated[str | None, typer.Option(help="Parameter of the evolution picture.")] = None,
) -> None:
    """Draw stability diagram, evolution along a parameter, stability map and ranking."""
    from squealstudy.cli.pictures import plot_command

    plot_command(results, output, along)


@app.command()
def compare(
    frequency: Annotated[Path, typer.Argument(metavar="FREQ_RESULTS", help="Complex modes.")],
    time: Annotated[Path, typer.Argument(metavar="TIME_RESULTS", help="Transient results.")],
    csv: Annotated[bool, typer.Option("--csv", help="Print all columns as CSV.")] = False,
) -> None:
    """Predicted against fitted growth, and which predicted instabilities express themselves."""
    from squealstudy.cli.compare import compare_command

    compare_command(frequency, time, csv)


@app.command()
def warmup(
    single: Annotated[bool, typer.Option("--single", help="Single-precision storage too.")] = False,
) -> None:
    """Compile the kernels of transient studies once, into the cache."""
    from squealstudy.cli.warmup import warmup_command

    warmup_command(single)


@app.command()
def models(
    name: Annotated[str | None, typer.Argument(help="Model to describe.")] = None,
    modes: Annotated[
        bool, typer.Option(help="Build the model and list its components' free-free modes.")
    ] = True,
    cutoff: Annotated[float, typer.Option(min=1.0, help="Highest frequency listed, Hz.")] = 8000.0,
) -> None:
    """List models, or one model's parameters with units and defaults, components and modes."""
    from squealstudy.cli.models import models_command

    models_command(name, modes, cutoff)


@app.command()
def schema(
    kind: Annotated[
        str | None, typer.Option(help="work_precision or method_stability, else study files.")
    ] = None,
) -> None:
    """Print the JSON Schema of study files, for editors."""
    from squealstudy.cli.check import schema_command

    schema_command(kind)


def main() -> None:
    """Entry point: every error a user can cause is one message on stderr and exit code 2."""
    try:
        app()
    except SquealstudyError as error:
        sys.stderr.write(f"squealstudy: {error}\n")
        raise SystemExit(USAGE_ERROR) from None
    except BrokenPipeError:  # a reader such as `head` has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0) from None
    except OSError as error:
        if os.environ.get(DEBUG):
            raise
        place = f"{error.filename}: " if error.filename else ""
        sys.stderr.write(f"squealstudy: {place}{error.strerror or error}\n")
        raise SystemExit(USAGE_ERROR) from None
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        sys.stderr.write(
            f"squealstudy: internal error, {type(error).__name__}: {error}; {DEBUG}=1 shows where\n"
        )
        raise SystemExit(INTERNAL_ERROR) from None
