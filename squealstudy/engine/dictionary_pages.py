"""The longest text in the dictionary of a part of a Parquet file, without the part being decoded.

A dictionary page is a header in Thrift's compact protocol, then its entries, compressed: of each
four bytes with its length, and its letters.
"""

from __future__ import annotations

import re
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

NUMBER = rb"([\x80-\xff]{0,4}[\x00-\x7f])"  # of a header: seven bits a byte, the lowest first
HEADER = re.compile(  # of a dictionary page of plain entries, alone; sizes, count, order
    rb"\x15\x04\x15" + NUMBER + rb"\x15" + NUMBER + rb"\x4c\x15" + NUMBER + rb"\x15\x00[\x11\x12]?"
    rb"\x00\x00"
)
LONGEST_HEADER = 32  # bytes
LENGTH_BYTES = 4
MOST_COMPRESSED = 2**28  # bytes of a page: a longer one is looked at by the reader of tables


def longest_entry(handle: IO[bytes], part: pq.ColumnChunkMetaData, little: float) -> float | None:
    """Letters of the longest text in the dictionary of a part.

    A bound where the size of the page tells that it is `little`, in letters; None where the page is
    not of the usual form, and nothing is known. `handle` reads the file of the part.
    """
    if not part.has_dictionary_page or part.dictionary_page_offset is None:
        return None
    handle.seek(part.dictionary_page_offset)
    header = HEADER.match(handle.read(LONGEST_HEADER))
    if header is None:
        return None
    size, compressed, count = (_number(digits) // 2 for digits in header.groups())
    if size <= little:
        return size
    if max(compressed, size) > MOST_COMPRESSED or size < LENGTH_BYTES:
        return None
    handle.seek(part.dictionary_page_offset + header.end())
    return _longest_entry(_unpacked(handle.read(compressed), part.compression, size), count)


def _number(digits: bytes) -> int:
    return sum((digit & 0x7F) << (7 * position) for position, digit in enumerate(digits))


def _unpacked(page: bytes, compression: str, size: int) -> Any:
    """The entries; None where they are no page of this size."""
    if compression == "UNCOMPRESSED":
        return page if len(page) == size else None
    try:
        return pa.Codec(compression.lower()).decompress(page, decompressed_size=size)
    except (OSError, ValueError):
        return None


def _longest_entry(entries: Any, count: int) -> float | None:
    """The longest of so many entries; None unless all are of the length of the first."""
    if entries is None:
        return None
    each, rest = divmod(len(entries), count) if count else (0, 1)
    if rest or each < LENGTH_BYTES:
        return None
    entry = np.dtype({"names": ["length"], "formats": ["<u4"], "itemsize": each})
    stated_lengths = np.frombuffer(entries, entry)["length"]
    return float(each - LENGTH_BYTES) if (stated_lengths == each - LENGTH_BYTES).all() else None
