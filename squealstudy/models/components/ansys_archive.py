"""Blocks of an archive of ANSYS, read by `mapdl_archive` in a process of its own."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.matrices.text import TextFile

PROGRAM = Path(__file__).with_name("archive_process.py")
FORMAT = re.compile(r"\s*\((.*)\)\s*")
FIELD = re.compile(r"\s*(\d{1,2})[ieg](\d{1,2})(?:\.\d+(?:e\d+)?)?\s*", re.I)  # 3i9, 6e21.13e3
BLOCKS = ("NBLOCK", "EBLOCK", "CMBLOCK")
MAX_COMMAND_CHARACTERS = 640  # of a command line, as in ANSYS
MOST_FIELDS, WIDEST = 40, 40  # fields of a line of a block; characters of a field
MOST_SECONDS = 600.0  # an archive of 5 million elements takes about a minute


class ArchiveBlocks(NamedTuple):
    """Nodes, elements and components of an archive, as `mapdl_archive` reads them.

    Attributes
    ----------
    nnum : ndarray (n,) of int
        Numbers of the nodes.
    nodes, node_angles : ndarray (n, 3)
        Coordinates, in the unit of the file, and rotations of the nodal axes [deg].
    elem : list of ndarray of int
        Each element: ten fields, then its node numbers.
    node_components, element_components : dict of str -> ndarray of int
        Numbers of the nodes and elements of each component.
    """

    nnum: np.ndarray
    nodes: np.ndarray
    node_angles: np.ndarray
    elem: list[np.ndarray]
    node_components: Mapping[str, np.ndarray]
    element_components: Mapping[str, np.ndarray]


def read_blocks(text: TextFile) -> ArchiveBlocks:
    """Read the blocks of an archive.

    Raises
    ------
    ModelError
        `mapdl_archive` is not installed; the format of a block cannot be read, or a line is longer
        than it allows (with the line); the reader fails, crashes or takes too long.
    """
    if find_spec("mapdl_archive") is None:
        raise ModelError(
            f"{text.path}: archives of ANSYS need mapdl-archive: pip install 'squealstudy[ansys]'"
        )
    _check_widths(text)
    with tempfile.TemporaryDirectory(prefix="squealstudy-archive-") as folder:
        blocks_file = Path(folder) / "blocks.npz"
        command = [sys.executable, "-I", str(PROGRAM), str(text.path.resolve()), str(blocks_file)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=MOST_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise _unreadable(text, f"no answer within {MOST_SECONDS:g} s") from None
        last_line = (done.stderr.decode(errors="replace").strip().splitlines() or [""])[-1]
        if done.returncode < 0 or (done.returncode and not last_line):
            raise _unreadable(text, "its reader crashed, as damaged files make it")
        if done.returncode or not blocks_file.is_file():
            raise _unreadable(text, last_line)
        with np.load(blocks_file, allow_pickle=False) as arrays:
            return ArchiveBlocks(
                nnum=arrays["nnum"],
                nodes=arrays["nodes"],
                node_angles=arrays["node_angles"],
                elem=np.split(arrays["elem"], arrays["elem_ends"][:-1])
                if len(arrays["elem"])
                else [],
                node_components=_components(arrays, "node_component:"),
                element_components=_components(arrays, "element_component:"),
            )


def _components(arrays: Mapping[str, np.ndarray], start: str) -> dict[str, np.ndarray]:
    return {key.removeprefix(start): arrays[key] for key in arrays if key.startswith(start)}


def _unreadable(text: TextFile, reason: str) -> ModelError:
    return ModelError(f"{text.path} cannot be read as an archive: {reason}")


def _check_widths(text: TextFile) -> None:
    """Raise ModelError for a line of a block that is longer than the format above it allows."""
    widest = MAX_COMMAND_CHARACTERS
    for line_number, line in enumerate(text.lines):
        command = line.split(",")[0].strip().upper()
        if command in BLOCKS:
            widest = _width(text, line_number + 1)
        elif command[:1].isalpha() or command[:1] in ("/", "*", "!"):
            widest = MAX_COMMAND_CHARACTERS
        elif (length := len(line.rstrip())) > widest and not FORMAT.fullmatch(line):
            what = f"expected at most {widest} characters by the block's format, found {length}"
            raise text.error(line_number, what)


def _width(text: TextFile, line_number: int) -> int:
    """Characters of a data line by the format that a line states, such as ``(3i9,6e21.13e3)``."""
    line = text.line(line_number)
    match = FORMAT.fullmatch(line)
    fields = [FIELD.fullmatch(part) for part in match[1].split(",")] if match else []
    sizes = [(int(field[1]), int(field[2])) for field in fields if field]
    if (
        not sizes
        or len(sizes) < len(fields)
        or any(n > MOST_FIELDS or w > WIDEST for n, w in sizes)
    ):
        raise text.error(
            line_number, f"expected the format of a block, (19i9), found '{line[:40]}'"
        )
    return sum(n * w for n, w in sizes)
