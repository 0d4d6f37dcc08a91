"""Arguments and options that several commands have, and exit codes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DONE, FAULT, USAGE_ERROR = 0, 1, 2  # exit codes: docs/reference/errors.md

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
