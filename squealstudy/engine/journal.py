"""The journal of a results directory: which files are finished, with their sizes and hashes.

It has lines of JSON, which the only writer appends after a file is whole on disk. Files of one line
belong together, such as a chunk and the histories of its points. A file in no line was never
finished. A line that cannot be read, such as the last one of a killed run, is ignored; so is a line
with a file that no run writes, or that lies outside the directory because of a link.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from squealstudy.engine.result_names import FINISHED, leads_out
from squealstudy.errors import ResultsError, printable
from squealstudy.faults import named
from squealstudy.files import (
    UnusableFileError,
    expect_room,
    file_hash,
    is_plain_file,
    write_bytes,
    write_text,
)
from squealstudy.wording import listed

JOURNAL = "journal.jsonl"
Owner = tuple[str, str, str]  # name, kind and model of the study
MAX_LINE_BYTES = 2**26  # bytes of a line; 4,096 points with their files need 2**20
# bytes of a journal; a million points with histories and states need 2**28
MOST_BYTES = 2**29
MEMORY_RATIO = 12.0  # bytes of memory needed for each byte of the journal
MOST_NAMED = 4  # refused names that a message shows
MAX_NAME_LETTERS = 100  # most letters of such a name that a message shows
DAMAGED, MISSING, UNFINISHED = "damaged", "missing", "in no journal"


class Line(BaseModel):
    """Content of one line: the directory's study, finished files, and files no longer valid."""

    model_config = ConfigDict(extra="forbid")  # any other key means damage

    owner: Owner | None = None
    files: dict[str, tuple[int, str]] = {}
    gone: list[str] = []


@dataclass(frozen=True)
class Entry:
    """A finished file: bytes, SHA-256, and names of all files of its line, its own included."""

    size: int
    sha256: str
    group: frozenset[str]


class Journal:
    """Reads the lines of a journal, and appends to them; names are paths below the directory.

    Attributes
    ----------
    owner : tuple of str or None
        Name, kind and model of the study that began it; None without a journal, or where the line
        with its owner is lost.
    entries : dict of str -> Entry
        Finished files by name.
    unreadable : int
        Number of lines that are ignored: they cannot be read, or have a name that is `refused`.
    refused : list of str
        Names whose lines are ignored: no run writes such a file, or a link leads out of the
        directory.
    """

    def __init__(self, directory: Path) -> None:
        self._directory, self._path = directory, directory / JOURNAL
        self.owner: Owner | None = None
        self.entries: dict[str, Entry] = {}
        self.unreadable = 0
        self.refused: list[str] = []
        self._leads_out: dict[str, bool] = {}  # whether a folder leads out, by its name
        for line in _read(self._path):
            if line is None:
                self.unreadable += 1
            elif refused := self._refused(line):
                self.unreadable += 1
                self.refused += refused
            else:
                self._apply(line)

    def _refused(self, line: Line) -> list[str]:
        """The names in a line that no run writes, or that lead out of the directory."""
        names = [*line.files, *line.gone]
        return [n for n in names if not FINISHED.fullmatch(n) or self._is_outside(n)]

    def _is_outside(self, name: str) -> bool:
        folder = name.rpartition("/")[0]
        if folder not in self._leads_out:
            self._leads_out[folder] = bool(folder) and leads_out(self._directory, folder)
        return self._leads_out[folder]

    def _apply(self, line: Line) -> None:
        """Change owner and entries as a line says."""
        self.owner = line.owner or self.owner
        for name in line.gone:
            self.entries.pop(name, None)
        for name, (size, sha256) in line.files.items():
            self.entries[name] = Entry(size, sha256, frozenset(line.files))

    @property
    def begun(self) -> bool:
        """Whether there is a journal: results of earlier versions have none."""
        return is_plain_file(self._path)

    def begin(self, owner: Owner) -> None:
        """Record the study that owns the directory, unless the journal has it already."""
        if self.owner != owner:
            self._append(Line(owner=owner))

    def restart(self, owner: Owner) -> None:
        """Begin the journal anew, with no file."""
        write_text(self._path, _text(Line(owner=owner)))
        self.owner, self.entries, self.unreadable, self.refused = owner, {}, 0, []

    def add(self, names: Sequence[str]) -> None:
        """Record files that are whole on disk and belong together."""
        paths = {name: self._directory / name for name in names}
        facts = {name: (path.stat().st_size, file_hash(path)) for name, path in paths.items()}
        self._append(Line(files=facts))

    def withdraw(self, names: Sequence[str]) -> None:
        """Record that files will be replaced or removed; those not recorded are passed over."""
        if recorded := [name for name in names if name in self.entries]:
            self._append(Line(gone=recorded))

    def _append(self, line: Line) -> None:
        """Write a line to the file so that it survives a crash, then apply it."""
        # a backup of hard links shares the file, and must not change: go on with a copy
        if self._path.exists() and self._path.stat().st_nlink > 1:
            write_bytes(self._path, self._path.read_bytes())
        with named(self._path), self._path.open("ab+") as handle:
            if handle.tell():
                handle.seek(-1, os.SEEK_END)
                if handle.read(1) != b"\n":  # the last line was cut short
                    handle.write(b"\n")
            handle.write(_text(line).encode())
            handle.flush()
            os.fsync(handle.fileno())
        self._apply(line)

    def fault(self, name: str, thoroughly: bool = True) -> str:
        """Fault of a file: DAMAGED, MISSING or UNFINISHED; empty where it is as it was written.

        Only the size is compared, not the hash, unless `thoroughly`.
        """
        entry, path = self.entries.get(name), self._directory / name
        if entry is None:
            return UNFINISHED
        try:
            state = path.lstat()
        except OSError:
            return MISSING
        is_file = stat.S_ISREG(state.st_mode)  # a link is none
        if not is_file or state.st_size != entry.size:
            return DAMAGED
        if thoroughly and _hash_of(path, state) != entry.sha256:
            return DAMAGED
        return ""


def refused_names(journal: Journal) -> str:
    """Text with the first names whose lines are ignored."""
    return listed([printable(name)[:MAX_NAME_LETTERS] for name in journal.refused], MOST_NAMED)


_hashes: dict[Path, tuple[tuple[int, int], str]] = {}  # size and time of files, and their hashes
# ns since its last change from which the hash of a file is remembered: before, a further change
# may leave its time as it is
MIN_TIMESTAMP_AGE_NS = 10**9


def _hash_of(path: Path, state: os.stat_result) -> str:
    """SHA-256 of a file, which is read only once while its size and time stay the same."""
    size_and_time = state.st_size, state.st_mtime_ns
    hashed_state, sha256 = _hashes.get(path, ((0, 0), ""))
    if hashed_state != size_and_time or not sha256:
        sha256 = file_hash(path)
        if time.time_ns() - state.st_mtime_ns > MIN_TIMESTAMP_AGE_NS:
            _hashes[path] = size_and_time, sha256
    return sha256


def _text(line: Line) -> str:
    return line.model_dump_json(exclude_defaults=True) + "\n"


def _read(path: Path) -> Iterator[Line | None]:
    """Yield lines of a journal; None for one that cannot be read."""
    if not is_plain_file(path):
        return
    size = path.stat().st_size
    try:
        if size > MOST_BYTES:
            raise UnusableFileError(f"{size:,} bytes")
        expect_room(MEMORY_RATIO * size)
    except OSError as error:
        raise ResultsError(f"{path}: too long for a journal: {error}") from None
    with path.open("rb") as handle:
        while line := handle.readline(MAX_LINE_BYTES):
            if len(line) == MAX_LINE_BYTES:  # too long: what follows of it is no JSON
                yield None
            elif line := line.rstrip(b"\n"):
                try:
                    yield Line.model_validate_json(line, strict=True)
                except ValueError:
                    yield None
