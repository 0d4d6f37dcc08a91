"""The journal of a results directory: which files are finished, with their sizes and hashes.

Lines of JSON, appended by the one writer after a file is whole on disk. Files of one line belong
together: a chunk with the histories of its points. What stands in no line was never finished; a
line that cannot be read, as the last one of a killed run, counts for nothing. So does one that
names a file which no run writes, or which a link leads out of the directory.
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
MAX_LINE_BYTES = 2**26  # bytes of a line; that of 4,096 points with their files has 2**20
# bytes of a journal; that of a million points with histories and states has 2**28
MOST_BYTES = 2**29
ENTRY_ROOM = 12.0  # bytes of memory for each of the file
MOST_NAMED, MOST_SHOWN = 4, 100  # names in a message, and letters of each
DAMAGED, MISSING, UNFINISHED = "damaged", "missing", "in no journal"


class Line(BaseModel):
    """Content of one line: whose directory it is, finished files, files that are no more."""

    model_config = ConfigDict(extra="forbid")  # a key that is none of these is a damaged one

    owner: Owner | None = None
    files: dict[str, tuple[int, str]] = {}
    gone: list[str] = []


@dataclass(frozen=True)
class Entry:
    """A finished file: bytes, SHA-256, and the names that it belongs together with, its own too."""

    size: int
    sha256: str
    group: frozenset[str]


class Journal:
    """Reads the lines there are, and appends to them; names are paths below the directory.

    Attributes
    ----------
    owner : tuple of str or None
        The study that began it; None without a journal, or where that line is lost.
    entries : dict of str -> Entry
    unreadable : int
        Lines that cannot be read: what they said counts for nothing.
    refused : list of str
        Names in lines that count for nothing because no run writes such a file, or because a link
        leads out of the directory.
    """

    def __init__(self, directory: Path) -> None:
        self._directory, self._path = directory, directory / JOURNAL
        self.owner: Owner | None = None
        self.entries: dict[str, Entry] = {}
        self.unreadable = 0
        self.refused: list[str] = []
        self._leads_out: dict[str, bool] = {}  # by folder
        for line in _read(self._path):
            if line is None:
                self.unreadable += 1
            elif refused := self._refused(line):
                self.unreadable += 1
                self.refused += refused
            else:
                self._take(line)

    def _refused(self, line: Line) -> list[str]:
        """Names of a line that are those of no file of a run, or that lead out."""
        names = [*line.files, *line.gone]
        return [n for n in names if not FINISHED.fullmatch(n) or self._is_outside(n)]

    def _is_outside(self, name: str) -> bool:
        folder = name.rpartition("/")[0]
        if folder not in self._leads_out:
            self._leads_out[folder] = bool(folder) and leads_out(self._directory, folder)
        return self._leads_out[folder]

    def _take(self, line: Line) -> None:
        self.owner = line.owner or self.owner
        for name in line.gone:
            self.entries.pop(name, None)
        for name, (size, sha256) in line.files.items():
            self.entries[name] = Entry(size, sha256, frozenset(line.files))

    @property
    def begun(self) -> bool:
        """Whether there is one: results of earlier versions have none."""
        return is_plain_file(self._path)

    def begin(self, owner: Owner) -> None:
        """Say whose the directory is, where no line does."""
        if self.owner != owner:
            self._append(Line(owner=owner))

    def restart(self, owner: Owner) -> None:
        """Begin anew, with no file."""
        write_text(self._path, _text(Line(owner=owner)))
        self.owner, self.entries, self.unreadable, self.refused = owner, {}, 0, []

    def add(self, names: Sequence[str]) -> None:
        """Files that are whole on disk, and belong together."""
        paths = {name: self._directory / name for name in names}
        facts = {name: (path.stat().st_size, file_hash(path)) for name, path in paths.items()}
        self._append(Line(files=facts))

    def withdraw(self, names: Sequence[str]) -> None:
        """Files that are about to be replaced or removed; those in no line are passed over."""
        if recorded := [name for name in names if name in self.entries]:
            self._append(Line(gone=recorded))

    def _append(self, line: Line) -> None:
        if self._path.exists() and self._path.stat().st_nlink > 1:  # of a backup, or not ours
            write_bytes(self._path, self._path.read_bytes())
        with named(self._path), self._path.open("ab+") as handle:
            if handle.tell():
                handle.seek(-1, os.SEEK_END)
                torn = handle.read(1) != b"\n"
                handle.write(b"\n" if torn else b"")
            handle.write(_text(line).encode())
            handle.flush()
            os.fsync(handle.fileno())
        self._take(line)

    def fault(self, name: str, thoroughly: bool = True) -> str:
        """Fault of a file: DAMAGED, MISSING or UNFINISHED; empty where it is as it was written.

        By its size alone where not `thoroughly`.
        """
        entry, path = self.entries.get(name), self._directory / name
        if entry is None:
            return UNFINISHED
        try:
            state = path.lstat()
        except OSError:
            return MISSING
        has_stated_size = (
            stat.S_ISREG(state.st_mode) and state.st_size == entry.size
        )  # never a link
        if has_stated_size and thoroughly:
            has_stated_size = _hash_of(path, state) == entry.sha256
        return "" if has_stated_size else DAMAGED


def refused_names(journal: Journal) -> str:
    """The names that count for nothing, as much of them as fits on a line."""
    return listed([printable(name)[:MOST_SHOWN] for name in journal.refused], MOST_NAMED)


_hashes: dict[Path, tuple[tuple[int, int], str]] = {}  # of files as they were when last read
MIN_TIMESTAMP_AGE_NS = (
    10**9
)  # ns: what was changed later than this before now may change again unseen


def _hash_of(path: Path, state: os.stat_result) -> str:
    """SHA-256 of a file, read once a process while its size and its time stay as they are."""
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
    """Lines of a journal; None for one that cannot be read."""
    if not is_plain_file(path):
        return
    size = path.stat().st_size
    try:
        if size > MOST_BYTES:
            raise UnusableFileError(f"{size:,} bytes")
        expect_room(ENTRY_ROOM * size)
    except OSError as error:
        raise ResultsError(f"{path}: too long for a journal: {error}") from None
    with path.open("rb") as handle:
        while line := handle.readline(MAX_LINE_BYTES):
            if len(line) == MAX_LINE_BYTES:  # what is left of it is no line either
                yield None
            elif line := line.rstrip(b"\n"):
                try:
                    yield Line.model_validate_json(line, strict=True)
                except ValueError:
                    yield None
