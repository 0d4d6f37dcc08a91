"""Reads matrices of MATLAB files of version 5 to 7, and checks every size in them.

SciPy's reader ends the process on some damaged files of these versions, but not of version 4.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from squealstudy.array_files import expect_memory
from squealstudy.models.matrices.entries import check_size

HEADER, TAG = 128, 8  # bytes of the header of a file, and of the tag before the data of an element
SMALL_TAG, MAX_SMALL_BYTES = 4, 4  # of a small element, whose data stand within eight bytes
Order = Literal["<", ">"]
ORDERS: dict[bytes, Order] = {b"IM": "<", b"MI": ">"}  # byte orders, by what the header ends with
MATLAB_5, HDF5 = 1, 2  # major versions in the header, of files of MATLAB 5 to 7 and of 7.3
# types of elements: a variable, a compressed one, letters of a name, numbers
MATRIX, COMPRESSED = 14, 15
LETTERS = (1, 2, 16)
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
# classes of variables
SPARSE, NUMERIC = 5, range(6, 16)
OTHER_CLASSES = {1: "a cell array", 2: "a structure", 3: "an object", 4: "text", 16: "a function"}
COMPLEX = 0x800  # bit of the flags of a variable
MORE_THAN_SIZES = "a variable or a compressed part holds more data than its sizes say"


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose numbers are not read yet.

    Attributes
    ----------
    name : str
    kind : int
        Class of MATLAB, such as `SPARSE`.
    complex : bool
    shape : tuple of int
    parts : Elements
        Its data.
    """

    name: str
    kind: int
    complex: bool
    shape: tuple[int, ...]
    parts: Elements

    def matrix(self, square: bool = True) -> Any:
        """An ndarray or csc_matrix; ValueError where it is no real matrix, or is damaged.

        `square` says whether it must be square.
        """
        if self.kind != SPARSE and self.kind not in NUMERIC:
            class_name = OTHER_CLASSES.get(self.kind, "something else")
            raise ValueError(f"expected a matrix of numbers, found {class_name}")
        if self.complex:
            raise ValueError("expected real values, found complex ones")
        if len(self.shape) != 2:
            kind = "square matrix" if square else "matrix"
            raise ValueError(f"expected a {kind}, found {' x '.join(map(str, self.shape))}")
        check_size(*self.shape, square=square)
        return self._sparse() if self.kind == SPARSE else self._full()

    def _full(self) -> np.ndarray:
        values = self.parts.numbers()
        if len(values) != math.prod(self.shape):
            raise ValueError(f"expected {math.prod(self.shape)} values, found {len(values)}")
        self.parts.check_end()
        return values.reshape(self.shape, order="F")

    def _sparse(self) -> sp.csc_matrix:
        """The matrix; the caller checks that its rows are within its size."""
        rows, pointers, values = (self.parts.numbers() for _ in range(3))
        self.parts.check_end()
        if rows.dtype.kind not in "iu" or pointers.dtype.kind not in "iu":
            raise ValueError("expected whole numbers as rows and column pointers")
        rows, pointers = rows.astype(np.int64), pointers.astype(np.int64)
        columns = self.shape[1]
        if len(pointers) != columns + 1 or pointers[0] or (pointers[1:] < pointers[:-1]).any():
            raise ValueError(f"expected {columns + 1} column pointers that ascend from 0")
        entries = int(pointers[-1])
        if len(rows) < entries or len(values) < entries:  # room for more may be stored
            n_read = min(len(rows), len(values))
            raise ValueError(f"expected {entries} entries, found {n_read}")
        return sp.csc_matrix((values[:entries], rows[:entries], pointers), self.shape)


class Elements:
    """The elements of a part of a file, one after another.

    Parameters
    ----------
    data : memoryview
    order : str
        Byte order, ``<`` or ``>``.
    """

    def __init__(self, data: memoryview, order: Order) -> None:
        self._data, self._order, self._at = data, order, 0

    @property
    def left(self) -> bool:
        """Whether there is another element."""
        return self._at < len(self._data)

    def check_end(self) -> None:
        """Raise ValueError where bytes are left over."""
        if self.left:
            raise ValueError(MORE_THAN_SIZES)

    def next(self) -> tuple[int, memoryview]:
        """Type and content of the next element; ValueError where the data end within it."""
        if self._at + TAG > len(self._data):
            raise ValueError("the file ends within an element")
        first, size = np.frombuffer(self._data, f"{self._order}u4", 2, self._at).tolist()
        start = self._at + TAG
        if first >> 16:  # a small one: its size stands beside its type
            first, size, start = first & 0xFFFF, first >> 16, self._at + SMALL_TAG
            if size > MAX_SMALL_BYTES:
                raise ValueError(f"an element of type {first} has no valid size")
        end = start + size
        if end > len(self._data):
            raise ValueError("the file ends within an element")
        # elements begin at multiples of eight bytes, but behind a compressed one
        padded_end = end if first == COMPRESSED else -(-end // TAG) * TAG
        self._at = max(padded_end, self._at + TAG)
        return first, self._data[start:end]

    def numbers(self) -> np.ndarray:
        """The next element as numbers (m,) in the byte order of the machine."""
        kind, content = self.next()
        if kind not in TYPES:
            raise ValueError(f"expected numbers, found an element of type {kind}")
        dtype = np.dtype(TYPES[kind])
        if len(content) % dtype.itemsize:
            raise ValueError(f"{len(content)} bytes are no whole number of values")
        return np.frombuffer(content, dtype.newbyteorder(self._order)).astype(dtype)


def version_of(data: bytes) -> int | None:
    """Major version in the header of a file of version 5 or later; None for other files."""
    order = ORDERS.get(data[HEADER - 2 : HEADER])
    if order is None or 0 in data[:4]:  # version 4 has a zero in its first four bytes
        return None
    return int(np.frombuffer(data, f"{order}u2", 1, HEADER - 4)[0]) >> 8


def variables(data: bytes) -> Iterator[Variable]:
    """The named variables of a file of version 5 to 7; ValueError, zlib.error where damaged."""
    order = ORDERS[data[HEADER - 2 : HEADER]]
    elements = Elements(memoryview(data)[HEADER:], order)
    while elements.left:
        kind, content = elements.next()
        if kind == COMPRESSED:
            inner = Elements(memoryview(_inflated(content, order)), order)
            kind, content = inner.next()
            inner.check_end()
        if kind != MATRIX:
            raise ValueError(f"expected a variable, found an element of type {kind}")
        if variable := _variable(Elements(content, order)):
            yield variable


def _inflated(content: bytes | memoryview, order: Order) -> bytes:
    """The decompressed element; ValueError where its length is not that in its own tag."""
    stream = zlib.decompressobj()
    tag = stream.decompress(content, TAG)
    size = int(np.frombuffer(tag, f"{order}u4", 1, 4)[0])
    expect_memory(2 * size)  # the data, and their numbers
    inner = tag + stream.decompress(stream.unconsumed_tail, size + 1)  # a byte more is too many
    if len(inner) > TAG + size or not stream.eof:
        raise ValueError(MORE_THAN_SIZES)
    return inner


def _variable(parts: Elements) -> Variable | None:
    """The variable in an element; None if it has no name or is an object of a newer class."""
    flags = parts.numbers()
    kind = int(flags[0]) & 0xFF if len(flags) == 2 else 0
    if not kind:
        raise ValueError("a variable without a class")
    if kind > max(OTHER_CLASSES):  # objects of newer classes have no shape
        return None
    shape = parts.numbers()
    if shape.dtype.kind not in "iu" or len(shape) < 2 or (shape < 0).any():
        raise ValueError("a variable without a valid size")
    kind_of_name, letters = parts.next()
    if kind_of_name not in LETTERS:
        raise ValueError("a variable without a valid name")
    name = bytes(letters).decode("utf-8", errors="replace")
    if not name:
        return None
    sizes = tuple(int(size) for size in shape)
    return Variable(name, kind, bool(int(flags[0]) & COMPLEX), sizes, parts)
