"""Studies of tests: the plan of a text, its results, and the command as a user gives it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from squealstudy.cli.app import main
from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.face import read_study
from squealstudy.study.definition import parse_study


def plan_of(text: str, path: Path = Path("study.toml")) -> Plan:
    """The plan of a study's text, as if it stood in the file `path`."""
    return Plan(parse_study(text, path))


def load_plan(path: Path) -> Any:
    """The design points, or runs, of a study file of any kind."""
    return read_study(path).plan()


def solved(study: Plan | str, directory: Path, jobs: int = 1) -> Results:
    """The results of a plan or a text in a directory."""
    run_study(plan_of(study) if isinstance(study, str) else study, directory, jobs=jobs)
    return Results.open(directory)


def comparable(directory: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Points without what they took, and modes."""
    results = Results.open(directory)
    return results.points.drop(columns="wall_s"), results.modes


def command(*arguments: str) -> int:
    """The exit code of the command with these arguments, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["squealstudy", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
    code = caught.value.code
    return code if isinstance(code, int) else 0 if code is None else 1
