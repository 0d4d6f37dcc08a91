"""What a command imports: libraries that its study does not need stay out."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

STUDY = Path(__file__).parents[2] / "studies" / "hulten_flutter.toml"
HEAVY = {"numba", "matplotlib", "skfem", "meshio", "scipy.stats", "scipy.optimize", "scipy.spatial"}
COMMAND = """
import sys
from squealstudy.cli.app import app
if {patient}:  # a machine in use is slow, and the study would get workers
    from squealstudy.engine import model_kind as structures
    structures.WORKER_START_WORTH_S = 1e6
app({arguments!r}, standalone_mode=False)
sys.stderr.write(" ".join(sys.modules))
"""


def imported(*arguments, patient=False, **environment):
    """Modules that a process has when a command is done."""
    code = COMMAND.format(arguments=list(map(str, arguments)), patient=patient)
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | environment,
    )
    return set(done.stderr.split())


def test_check_of_a_minimal_model_imports_no_heavy_library():
    found = imported("check", STUDY)
    assert "scipy.linalg" in found  # what the points need was there: the list is a real one
    assert not found & (HEAVY | {"pandas"})


def test_small_study_runs_without_workers(tmp_path):
    options = ("--output", tmp_path / "out", "--no-pictures", "--jobs", "2")
    found = imported("run", STUDY, *options, patient=True)
    assert (tmp_path / "out" / "modes.parquet").is_file()
    assert not found & (HEAVY - {"scipy.optimize", "scipy.spatial"})  # onsets, tracking


@pytest.mark.parametrize("command", [["--help"], ["models"], ["schema"]])
def test_commands_that_compute_nothing_import_no_kernels(command):
    found = imported(*command)
    assert not found & HEAVY
