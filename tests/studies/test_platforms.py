"""What differs between Linux, macOS and Windows, as far as one machine can tell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import study_runs

STUDY = """
[study]
name = "flutter"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 13
[modes]
reference_points = 0
"""
# modules of one system alone: absent for the package, and for nothing else that it imports
BLOCKED = """
import builtins, sys
from pathlib import Path

imported = builtins.__import__
ABSENT = {"fcntl", "resource", "pwd", "grp", "termios", "msvcrt", "winreg"}

def without(name, globals=None, *rest, **options):
    of = (globals or {}).get("__name__", "")
    if name.partition(".")[0] in ABSENT and of.startswith("squealstudy"):
        raise ModuleNotFoundError(f"No module named '{name}'")
    return imported(name, globals, *rest, **options)

builtins.__import__ = without
for name in ("register_at_fork", "sched_getaffinity", "getppid", "fork"):
    delattr(__import__("os"), name)
import signal
for name in ("pthread_sigmask", "SIGHUP", "SIGKILL"):
    delattr(signal, name)
from squealstudy.engine import model_kind
model_kind.WORKER_START_WORTH_S = 0.0
from squealstudy.cli.app import main
main()
"""


def command(folder, *arguments, code="from squealstudy.cli.app import main; main()", **environment):
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        cwd=folder,
        env=os.environ | environment,
    )


@pytest.mark.full_size  # imports of another system
def test_nothing_of_one_system_is_needed(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    done = command(tmp_path, "run", "study.toml", "-j", "2", "--no-pictures", code=BLOCKED)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "flutter" / "modes.parquet").is_file()


def test_results_may_be_anywhere(tmp_path, monkeypatch):
    """With spaces, letters of all alphabets, and long."""
    name = "/".join(["with spaces", "Größe β 摩擦", *["long" * 20] * 3])
    folder = tmp_path / name
    folder.mkdir(parents=True)
    (folder / "my study.toml").write_text(STUDY, encoding="utf-8")
    options = ("run", Path(name) / "my study.toml", "-o", folder / "my results")
    monkeypatch.chdir(tmp_path)
    assert study_runs.command(*map(str, options), "--jobs", "1", "--no-pictures") == 0
    assert (folder / "my results" / "modes.parquet").is_file()


@pytest.mark.parametrize(
    ("what", "encoding"),
    [
        pytest.param(("run", "--no-pictures"), "cp1252", marks=pytest.mark.full_size),
        (("check",), "ascii"),
        pytest.param(("run", "--no-pictures"), "ascii", marks=pytest.mark.full_size),
        pytest.param(("check",), "cp1252", marks=pytest.mark.full_size),
    ],
)
def test_a_terminal_need_not_know_all_letters(tmp_path, encoding, what):
    """As on Windows, where output that goes to a file or a pipe is not in UTF-8."""
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    options = ("study.toml", "-o", "Größe β")
    done = command(tmp_path, *what, *options, PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    shown = "Größe β".encode(encoding, errors="backslashreplace")
    assert shown in done.stdout.replace(os.linesep.encode(), b"")
