"""A study run by the command in a process of its own, as a user runs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd

import squealstudy

HERE = Path(__file__).parent
COMMAND = "from squealstudy.cli.app import main; main()"


def command(*arguments, folder):
    """The finished command."""
    line = [sys.executable, "-c", COMMAND, *map(str, arguments)]
    here = os.environ | {"PYTHONPATH": str(Path(squealstudy.__file__).parents[1])}
    return subprocess.run(line, capture_output=True, text=True, cwd=folder, env=here, check=False)


def in_time(text, duration, perturbation):
    """A study of a law, in time."""
    more = f"duration = {duration}\nstep = 1e-5\nperturbation = {perturbation}\nsave_every = 5\n"
    return text + f"[transient]\n{more}"


def run(text, folder, *extensions, jobs=1, name="study"):
    """Tables of a study by their names, with files of this folder beside it."""
    for file in extensions:
        shutil.copy(HERE / file, folder / file)
    (folder / f"{name}.toml").write_text(text)
    options = ("--jobs", jobs, "--yes", "--no-pictures", "--output", name)
    done = command("run", f"{name}.toml", *options, folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.stem: pd.read_parquet(path) for path in (folder / name).glob("*.parquet")}
