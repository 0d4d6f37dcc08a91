"""Files that commands open are in the table of the page `trust`, which says who wrote them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import pytest
from own_blocks import STUDY, write_blocks

HERE = Path(__file__).parents[1]
PAGE = HERE.parent / "docs" / "reference" / "trust.md"
EXTENSION = "own.py"
OWN = """\
from matplotlib.figure import Figure
from squealstudy import register_plot


@register_plot(modes=("frequency_hz",))
def own(results):
    \"\"\"Nothing.\"\"\"
    return Figure()
"""
SCATTER = """\
[study]
name = "scatter"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
distribution = "normal"
mean = 0.4
std = 0.1
[design]
type = "sobol"
samples = 8
[modes]
band = [1.0, 1000.0]
"""
MODES = """\
[study]
name = "modes"
kind = "complex_modes"
[model]
name = "belt"
[[sweep]]
parameter = "sliding_speed"
values = [0.6, 1.3]
[modes]
band = [10.0, 1000.0]
"""
BELT = MODES.replace('"modes"\nkind = "complex_modes"', '"belt"\nkind = "transient"') + (
    "[transient]\nduration = 0.05\nstep = 1e-4\nperturbation = 1e-3\nsave_every = 5\n"
)


def rows() -> list[str]:
    """The first cells of the table of files of others and of one's own."""
    table = PAGE.read_text(encoding="utf-8").split("| file | who may have written it |")[1]
    return [line.split("|")[1] for line in table.split("\n\n")[0].splitlines()[2:]]


def patterns() -> list[str]:
    """Names of files, in backticks, of all rows."""
    return [pattern for row in rows() for pattern in re.findall(r"`([^`]+)`", row)]


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> list[str]:
    """Files outside Python and the package that commands opened, whole paths."""
    folder = tmp_path_factory.mktemp("opened")
    extended = STUDY.replace("[model]", f'extensions = ["{EXTENSION}"]\n\n[model]')
    write_blocks(folder, study=extended)
    (folder / EXTENSION).write_text(OWN)
    for name, text in {"scatter": SCATTER, "modes": MODES, "belt": BELT}.items():
        (folder / f"{name}.toml").write_text(text)
    environment = {**os.environ, "SQUEALSTUDY_CACHE": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, HERE / "opened_files.py", folder],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


def is_told(path: str) -> bool:
    return any(fnmatch(path, p if p.startswith("/") else f"*/{p}") for p in patterns())


@pytest.mark.full_size  # a dozen commands in a process of their own
def test_every_file_that_is_opened_is_in_the_table(opened):
    assert not [path for path in opened if not is_told(path)]


@pytest.mark.full_size
def test_what_a_table_of_all_files_must_have_is_opened(opened):
    """The commands open what they are about: the list is a real one."""
    names = {Path(path).name for path in opened}
    assert {"manifest.json", "journal.jsonl", "points.parquet", "modes.parquet"} <= names
    assert {"plate.inp", "blocks.toml", "study.toml", "own.py", "meta.json"} <= names
    assert not [path for path in opened if path.endswith("own.cpython-311.pyc")]
