"""Files that are whole or absent: written under a temporary name, flushed, renamed.

A sealed file is JSON with a hash of its own content; it serves for files that no journal names.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import secrets
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from squealstudy.faults import named
from squealstudy.machine.locks import flush
from squealstudy.machine.processes import is_running

SEAL = "sha256"
OF_TEXT = 4.0  # bytes of memory for each byte of a text that is decoded
OF_LINES = OF_JSON = 40.0  # the same for many short values, as in JSON and TOML: empty lists
TEMPORARY = ".*.tmp"
FLUSHES_AT_ONCE = 16  # threads that wait for the disk, a choice


def temporary_name(path: Path) -> Path:
    """A name beside `path` that no other process uses, with this machine and process in it."""
    owner = f"{_host()}-{os.getpid()}-{secrets.token_hex(4)}"
    return path.parent / f".{path.name}.{owner}.tmp"


def _host() -> str:
    return "".join(c for c in platform.node() if c.isalnum()) or "here"


def abandoned(path: Path) -> bool:
    """Whether the process that used a temporary name of this machine is gone."""
    parts = path.name.removesuffix(".tmp").rpartition(".")[2].split("-")
    is_of_this_host = len(parts) == 3 and parts[0] == _host() and parts[1].isdigit()
    return is_of_this_host and not is_running(int(parts[1]))


def write_atomic(path: Path, write: Callable[[Path], None]) -> None:
    """Call `write` on a temporary file beside `path`, flush it to disk and rename it.

    A crash leaves the old file or the new one, and at most a ``.tmp`` that readers never look at.
    """
    write_all({path: write})


def write_all(writers: Mapping[Path, Callable[[Path], None]]) -> None:
    """Write files as `write_atomic` does, in order; they are flushed to the disk in parallel."""
    temporaries: dict[Path, Path] = {}
    try:
        for path, write in writers.items():
            with named(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                temporaries[path] = temporary_name(path)
                write(temporaries[path])
        _flush_all(temporaries)
        for path, temporary in temporaries.items():
            with named(path):
                temporary.replace(path)
        _flush_all({path.parent: path.parent for path in writers})
    except BaseException:
        for temporary in temporaries.values():
            temporary.unlink(missing_ok=True)
        raise


def _flush_all(paths: Mapping[Path, Path]) -> None:
    """Flush each of `paths`; errors name its key.

    Several threads do so at once: a file system flushes many files in one go.
    """

    def flush_one(name: Path) -> None:
        with named(name):
            flush(paths[name])

    if len(paths) == 1:
        flush_one(*paths)
    else:
        from concurrent.futures import ThreadPoolExecutor  # late, as commands must start fast

        with ThreadPoolExecutor(FLUSHES_AT_ONCE) as pool:
            for _ in pool.map(flush_one, paths):
                pass


def write_bytes(path: Path, content: bytes) -> None:
    """Write bytes to a file that is whole or absent."""

    def write(temporary: Path) -> None:
        temporary.write_bytes(content)

    write_atomic(path, write)


def write_text(path: Path, text: str) -> None:
    """Write a text atomically, in UTF-8."""
    write_atomic(path, text_writer(text))


def text_writer(text: str) -> Callable[[Path], None]:
    """A function that writes a text to a path, in UTF-8."""
    content = text.encode()

    def write(path: Path) -> None:
        path.write_bytes(content)

    return write


def write_arrays(path: Path, arrays: Mapping[str, Any], compressed: bool = False) -> None:
    """Write arrays by name to an npz file atomically."""
    write_atomic(path, arrays_writer(arrays, compressed))


def arrays_writer(arrays: Mapping[str, Any], compressed: bool = False) -> Callable[[Path], None]:
    """A function that writes arrays by name to an npz file."""
    import numpy as np  # not needed by `squealstudy schema`

    save = np.savez_compressed if compressed else np.savez

    def write(path: Path) -> None:
        with path.open("wb") as handle:
            save(handle, **arrays)

    return write


def is_plain_file(path: Path) -> bool:
    """Whether a path is a regular file, not a link to one or a device that might never end."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


class UnusableFileError(OSError, ValueError):
    """A path that is no file, or a file that is too large; readers expect one base or the other."""


def read_whole(path: Path, room: float = OF_TEXT) -> bytes:
    """The bytes of a file of unknown origin, if there is memory for them and what is made of them.

    Even a file that takes nothing on the disk may claim any size.

    Parameters
    ----------
    path : Path
        The file; a link is followed.
    room : float
        Bytes of memory needed for each byte of the file.

    Raises
    ------
    OSError
        Where the file is missing or cannot be read; UnusableFileError where it is a device or pipe,
        or too large for the memory.
    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode) and not stat.S_ISDIR(state.st_mode):
        raise UnusableFileError("it is no file")
    expect_room(room * state.st_size)
    return path.read_bytes()


def expect_room(needed: float) -> None:
    """Raise UnusableFileError if fewer bytes of memory than `needed` are left."""
    from squealstudy.array_files import expect_memory  # imports numpy

    try:
        expect_memory(needed)
    except ValueError as error:
        raise UnusableFileError(str(error)) from None


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def sealed(content: Mapping[str, Any]) -> str:
    """Content as JSON with its hash; values of types that JSON does not have become text."""
    plain = json.loads(json.dumps({k: v for k, v in content.items() if k != SEAL}, default=str))
    return json.dumps(plain | {SEAL: _seal(plain)}, indent=2) + "\n"


def unsealed(text: str | bytes) -> dict[str, Any]:
    """Content that `sealed` wrote; ValueError if it was changed or never sealed."""
    try:
        content = json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(content, dict) or SEAL not in content:
        raise ValueError("it has no hash of its content")
    if content.pop(SEAL) != _seal(content):
        raise ValueError("its content is not what its hash says")
    return content


def _seal(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()
