"""A study whose runs meet faults of the machine, and what the command has to say then."""

from __future__ import annotations

import re
import subprocess

STUDY = """[study]
name = "lockin"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 60
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
GOES_ON = "what is finished is kept, and the same command goes on from there"
RUN = ("run", "study.toml", "--jobs", "1", "--no-pictures", "-o")
BEFORE = re.compile(r"warning: the cache|[a-z ]+: (begins|.*done in )")


def is_one_sentence(done: subprocess.CompletedProcess[str], *wanted: str) -> None:
    """Exit code 1 and, after progress and warnings, one line that has all of `wanted`."""
    told = [line for line in done.stderr.splitlines() if not BEFORE.match(line)]
    assert done.returncode == 1, done.stderr
    assert len(told) == 1, done.stderr
    assert told[0].startswith("squealstudy: ")
    assert "internal error" not in told[0]
    for text in wanted:
        assert text in told[0]
