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
    """The laws of the package alone, and what is registered within it, which ends with it.

    Unlike other extensions laws would stay for other files, as theirs do for this one.
    """
    with pytest.MonkeyPatch.context() as patch:
        for laws in (CONTACT_LAWS, FRICTION_CURVES):
            of_package = {name: law for name, law in laws._known.items() if law.in_package}
            patch.setattr(laws, "_known", of_package)
        patch.setattr(Registry, "shared", dict(Registry.shared))
        patch.setattr(extensions, "_read", {})
        executed = {n: m for n, m in sys.modules.items() if n.startswith(EXECUTED)}
        for name in executed:  # executed anew where it is read
            del sys.modules[name]
        yield
        for name in [n for n in sys.modules if n.startswith(EXECUTED)]:
            del sys.modules[name]
        sys.modules.update(executed)


def tables_of(folder):
    return {path.stem: pd.read_parquet(path) for path in folder.glob("*.parquet")}
