"""Reads files of arrays (npz) of unknown origin, if sizes are as declared and fit in memory.

An archive of a few kilobytes can claim, or be decompressed to, more than any memory.
"""

from __future__ import annotations

import contextlib
import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from squealstudy.machine.resources import BYTES_PER_MB, available_memory_mb

MIN_BYTES_PER_NUMBER = 8  # memory that is expected for a number: short types may be converted
MAX_UNCHECKED_BYTES = 2**28  # arrays up to this size are read whatever memory is available
HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_arrays(source: Path | IO[bytes]) -> dict[str, np.ndarray]:
    """The arrays of an npz file, by name.

    Raises
    ------
    OSError
        Where the file is missing or cannot be read.
    ValueError
        Where the file is damaged, has pickles or arrays of another size than declared, or needs
        more memory than there is. Sizes are compared before any array is read.
    """
    try:
        expect_room(source)
        with np.load(source, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (zipfile.BadZipFile, EOFError, KeyError, NotImplementedError) as error:
        raise ValueError(str(error)) from error


def expect_room(source: Path | IO[bytes]) -> None:
    """Raise ValueError if arrays of an npz file are not of the declared size, or too large."""
    needed = 0
    with zipfile.ZipFile(source) as archive:
        for member in archive.infolist():
            with _damage_as_value_error(member.filename), archive.open(member) as handle:
                count, size = _declared_size(handle)
                if handle.tell() + size != member.file_size:
                    raise ValueError(f"'{member.filename}' is not as long as its shape says")
            needed += max(size, count * MIN_BYTES_PER_NUMBER)
    if not isinstance(source, Path):
        source.seek(0)
    expect_memory(needed)


def expect_memory(needed: float) -> None:
    """Raise ValueError if fewer bytes of memory than `needed` are available."""
    if needed > MAX_UNCHECKED_BYTES and needed > (free := available_memory_mb() * BYTES_PER_MB):
        raise ValueError(
            f"it would take {needed / 1e9:,.3g} GB of memory, and {free / 1e9:.3g} GB are left"
        )


@contextlib.contextmanager
def _damage_as_value_error(name: str) -> Iterator[None]:
    """Raise ValueError if a member of an archive is damaged."""
    try:
        yield
    except zipfile.BadZipFile:
        raise ValueError(f"'{name}' is damaged") from None


def _declared_size(handle: IO[bytes]) -> tuple[int, int]:
    """Number of elements and of bytes that the header of an array declares."""
    version = np.lib.format.read_magic(handle)
    if version not in HEADERS:
        raise ValueError(f"unknown version {version} of NumPy's format")
    shape, _, kind = HEADERS[version](handle)
    count = math.prod(shape)
    if count < 0:
        raise ValueError("a shape below zero")
    return count, count * _bytes_of(kind)


def _bytes_of(kind: np.dtype[Any]) -> int:
    """Bytes of an element; ValueError for Python objects, which are stored as pickles."""
    if kind.hasobject:
        raise ValueError("pickles are not read")
    return kind.itemsize
