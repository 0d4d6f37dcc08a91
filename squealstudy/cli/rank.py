"""`squealstudy rank`."""

from __future__ import annotations

import sys
from pathlib import Path

from squealstudy.cli import mode_screen, transient_screen
from squealstudy.study.results import Results


def rank_command(path: Path, by: str, top: int | None, where: str | None, csv: bool) -> None:
    """Print the ranking of a results directory."""
    results = Results.open(path)
    table = results.rank(by, top, where)
    if csv:
        table.to_csv(sys.stdout, index=False)
        return
    if results.kind == "transient":
        transient_screen.ranking(table)
    else:
        unit = results.manifest["units"].get(results.along, "")
        mode_screen.ranking(table, results.along, unit, mode_screen.Scope.of(results, where))
    mode_screen.outside_validity(results.points, "of the whole study: " if where else "")
