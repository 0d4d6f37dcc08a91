"""A study run by the command in a process of its own, as a user runs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
from registries import EXECUTED
from study_runs import solved

import squealstudy
from squealstudy import extensions
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES
from squealstudy.laws.registry import Registry

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
    return tables_of(folder / name)


def run_here(text, folder):
    """The same in this process, far sooner; files are read where they are."""
    with laws_alone():
        solved(text.replace('extensions = ["', f'extensions = ["{HERE}/'), folder / "study")
    return tables_of(folder / "study")


@contextmanager
def laws_alone():
    """Laws that are registered within it, unlike other extensions, would stay for other files."""
    with pytest.MonkeyPatch.context() as patch:
        for laws in (CONTACT_LAWS, FRICTION_CURVES):
            patch.setattr(laws, "_known", dict(laws._known))
        patch.setattr(Registry, "shared", dict(Registry.shared))
        patch.setattr(extensions, "_read", dict(extensions._read))
        before = set(sys.modules)
        yield
        for name in {n for n in sys.modules if n.startswith(EXECUTED)} - before:
            del sys.modules[name]  # executed anew where it is read again


def tables_of(folder):
    return {path.stem: pd.read_parquet(path) for path in folder.glob("*.parquet")}
