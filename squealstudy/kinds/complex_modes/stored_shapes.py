"""Mode shapes of all points of a study in one file, as they may exceed the memory."""

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
IN_MEMORY = 2**27  # bytes; smaller files are read as a whole


@dataclass(frozen=True)
class ShapeFile:
    """Shapes of all points in one file; those of a large file are read as they are asked for.

    Attributes
    ----------
    path : Path
        The file.
    offset, size : ndarray (n,) of int
        Position of each point's shapes in the file and their length, bytes.
    count : ndarray (n,) of int
        Number of modes of each point.
    """

    path: Path
    offset: np.ndarray
    size: np.ndarray
    count: np.ndarray

    def read(self, point: int) -> np.ndarray:
        """Shapes (m, k) complex64 of a point; (0, 1) where it has no modes."""
        count = int(self.count[point])
        if not count:
            return np.zeros((0, 1), dtype=np.complex64)
        return self.stack(np.array([point]), count)[0]

    def width(self, points: np.ndarray) -> np.ndarray:
        """Number of coordinates k (r,) of a shape at each of the points, which must have modes."""
        coordinates: np.ndarray = self.size[points] // (BYTES_PER_ENTRY * self.count[points])
        return coordinates

    def stack(self, points: np.ndarray, count: int) -> np.ndarray:
        """First `count` shapes (r, count, k) complex64 of points whose shapes all have length k."""
        k = int(self.width(points[:1])[0])
        if self._in_memory is not None:
            start = self.offset[points] // BYTES_PER_ENTRY
            return self._in_memory[start[:, None] + np.arange(count * k)].reshape(-1, count, k)
        shapes = np.empty((len(points), count, k), dtype=np.complex64)
        for row, offset in zip(shapes, self.offset[points].tolist(), strict=True):
            self._file.seek(offset)
            self._file.readinto(row.view(np.uint8).data)
        return shapes

    @cached_property
    def _in_memory(self) -> np.ndarray | None:
        """All numbers of the file; None where it is larger than IN_MEMORY."""
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
    """Copies the shapes of chunk files, one after the other, to a temporary file."""

    def __init__(self, directory: Path) -> None:
        self._path = temporary_name(directory / SHAPES)
        self._file = self._path.open("wb")
        self._sizes = [np.zeros(0, dtype=np.int32)]

    def write(self, column: pa.ChunkedArray) -> None:
        """Append the bytes of a binary column."""
        with self._deleted_on_error():
            for part in column.chunks:
                _, ends, values = part.buffers()
                offsets = np.frombuffer(ends, np.int32)[part.offset : part.offset + len(part) + 1]
                self._sizes.append(np.diff(offsets))
                if len(part):
                    self._file.write(values[int(offsets[0]) : int(offsets[-1])])

    def discard(self) -> None:
        """Close the unfinished file and delete it."""
        with contextlib.suppress(OSError):  # a full disk refuses to write the last bytes
            self._file.close()
        self._path.unlink()

    @contextlib.contextmanager
    def _deleted_on_error(self) -> Iterator[None]:
        """Delete the file if writing it fails, as on a full disk."""
        try:
            with named(self._path.parent):
                yield
        except OSError:
            self.discard()
            raise

    def close(self, order: np.ndarray, counts: np.ndarray) -> ShapeFile:
        """Finish the file; the result has its points in `order`, `counts` modes at each."""
        with self._deleted_on_error():
            self._file.close()
        size = np.concatenate(self._sizes).astype(np.int64)
        offset = np.cumsum(size) - size
        return ShapeFile(path=self._path, offset=offset[order], size=size[order], count=counts)
