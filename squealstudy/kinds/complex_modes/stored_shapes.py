"""Mode shapes of all points of a study, one after the other in one file: they may be many."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import FileIO
from pathlib import Path

import numpy as np
import pyarrow as pa

from squealstudy.faults import named
from squealstudy.files import temporary_name

SHAPES = "shapes"  # column of chunk files: (m, k) complex64 by rows, as bytes
BYTES_PER_ENTRY = np.dtype(np.complex64).itemsize
IN_MEMORY = 2**27  # bytes of shapes that are held at once


@dataclass(frozen=True)
class ShapeFile:
    """Shapes of all points in one file, read as they are asked for: they may exceed the memory.

    Attributes
    ----------
    path : Path
    offset, size : ndarray (n,) of int
        Place of each point's shapes in the file, bytes.
    count : ndarray (n,) of int
        Modes of each point.
    """

    path: Path
    offset: np.ndarray
    size: np.ndarray
    count: np.ndarray

    def read(self, point: int) -> np.ndarray:
        """Shapes (m, k) complex64 of a point."""
        count = int(self.count[point])
        if not count:
            return np.zeros((0, 1), dtype=np.complex64)
        return self.stack(np.array([point]), count)[0]

    def width(self, points: np.ndarray) -> np.ndarray:
        """Coordinates k of a shape of each of some points with modes (r,)."""
        coordinates: np.ndarray = self.size[points] // (BYTES_PER_ENTRY * self.count[points])
        return coordinates

    def stack(self, points: np.ndarray, count: int) -> np.ndarray:
        """First `count` shapes (r, count, k) complex64 of points, all of as many coordinates."""
        k = int(self.width(points[:1])[0])
        if self._held is not None:
            start = self.offset[points] // BYTES_PER_ENTRY
            return self._held[start[:, None] + np.arange(count * k)].reshape(-1, count, k)
        shapes = np.empty((len(points), count, k), dtype=np.complex64)
        for row, offset in zip(shapes, self.offset[points].tolist(), strict=True):
            self._file.seek(offset)
            self._file.readinto(row.view(np.uint8).data)
        return shapes

    @cached_property
    def _held(self) -> np.ndarray | None:
        """All of a small file."""
        small = self.path.stat().st_size <= IN_MEMORY
        return np.fromfile(self.path, np.complex64) if small else None

    @cached_property
    def _file(self) -> FileIO:
        return FileIO(self.path)

    def remove(self) -> None:
        """Delete the file of shapes."""
        if "_file" in self.__dict__:
            self._file.close()
        self.path.unlink(missing_ok=True)


class ShapeWriter:
    """Puts the shapes of chunk files one after the other."""

    def __init__(self, directory: Path) -> None:
        self._path = temporary_name(directory / SHAPES)
        self._file = self._path.open("wb")
        self._sizes = [np.zeros(0, dtype=np.int32)]

    def write(self, column: pa.ChunkedArray) -> None:
        """Append the bytes of a binary column as they stand."""
        with self._whole_or_gone():
            for part in column.chunks:
                _, ends, values = part.buffers()
                places = np.frombuffer(ends, np.int32)[part.offset : part.offset + len(part) + 1]
                self._sizes.append(np.diff(places))
                if len(part):
                    self._file.write(values[int(places[0]) : int(places[-1])])

    def discard(self) -> None:
        """Close the unfinished file and delete it."""
        with contextlib.suppress(OSError):  # a full disk refuses what is left to write
            self._file.close()
        self._path.unlink()

    @contextlib.contextmanager
    def _whole_or_gone(self) -> Iterator[None]:
        """Leave no part of the file on a disk that is full."""
        try:
            with named(self._path.parent):
                yield
        except OSError:
            self.discard()
            raise

    def close(self, order: np.ndarray, counts: np.ndarray) -> ShapeFile:
        """The file, its points in `order`, each with its number of modes."""
        with self._whole_or_gone():
            self._file.close()
        size = np.concatenate(self._sizes).astype(np.int64)
        offset = np.cumsum(size) - size
        return ShapeFile(path=self._path, offset=offset[order], size=size[order], count=counts)
