"""Allowed names of files in a results directory, and checks that paths stay inside it.

A directory may come from anybody. A name in its journal or manifest is used only if a run could
write it, and if no link on its path leads out of the directory.
"""

from __future__ import annotations

import re
from pathlib import Path

from squealstudy.engine.keys import HASH_DIGITS
from squealstudy.errors import ResultsError

MOST_CELLS = 4 * 10**9  # cells of a table; one of a million design points with 40 modes has 2e9
CHUNKS, HISTORIES, STATES, REFERENCES = "chunks", "histories", "states", "references"
MANIFEST = "manifest.json"
LOCK = ".lock"
SET_ASIDE = "damaged"  # folder of files whose content has changed
PART_PREFIX = "part-"  # beginning of the names of the files of a table in several parts
TABLE = r"[a-z][a-z0-9_]{0,80}\.parquet"
RUN_FILES = re.compile(
    rf"({CHUNKS}|{HISTORIES}|{STATES}|{REFERENCES})/[0-9a-f]{{{HASH_DIGITS}}}\.[a-z]{{1,10}}"
    rf"|{TABLE}/{PART_PREFIX}\d{{5}}\.parquet"
)
FINISHED = re.compile(rf"{RUN_FILES.pattern}|{TABLE}")
PICTURE = re.compile(r"[\w+][\w+.-]{0,250}\.png")
FOLDER = re.compile(r"[\w+-][\w+. -]{0,100}(/[\w+-][\w+. -]{0,100})?")  # of another study within


def leads_out(directory: Path, name: str) -> bool:
    """Whether a path below a directory, or a link on the way to it, ends outside."""
    end = end_of(directory / name)
    return end is None or not end.is_relative_to(directory.resolve())


def end_of(path: Path) -> Path | None:
    """The file or folder that a path leads to; None where its links form a circle."""
    try:
        end = path.resolve()
    except (RuntimeError, OSError):  # of a circle, up to Python 3.12
        return None
    is_circle = any(parent.is_symlink() for parent in (end, *end.parents))
    return None if is_circle else end


def expect_inside(directory: Path, name: str) -> None:
    """Raise ResultsError where a path below a results directory leads out of it."""
    if leads_out(directory, name):
        end = end_of(directory / name) or "itself"
        raise ResultsError(
            f"{directory / name}: leads to {end}, outside the results directory, where nothing is "
            "read, written or removed; put a folder in the link's place, or choose another "
            "directory with --output"
        )
