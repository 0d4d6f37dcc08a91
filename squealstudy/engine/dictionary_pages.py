"""The longest text in the dictionary of a column chunk of a Parquet file, without decoding it.

A dictionary page is a header in Thrift's compact protocol, then its entries, compressed. Each entry
is four bytes with its length, then its bytes.
"""

from __future__ import annotations

import re
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

NUMBER = rb"([\x80-\xff]{0,4}[\x00-\x7f])"  # in a header: seven bits a byte, the lowest first
HEADER = re.compile(  # of a dictionary page of plain entries: two sizes, count, maybe order
    rb"\x15\x04\x15" + NUMBER + rb"\x15" + NUMBER + rb"\x4c\x15" + NUMBER + rb"\x15\x00[\x11\x12]?"
    rb"\x00\x00"
)
LONGEST_HEADER = 32  # bytes
LENGTH_BYTES = 4
MOST_COMPRESSED = 2**28  # bytes of a page: longer ones are left to the reader of tables


def longest_entry(handle: IO[bytes], part: pq.ColumnChunkMetaData, little: float) -> float | None:
    """Bytes of the longest text in the dictionary of a column chunk, or an upper bound.

    It is the size of the page where that is at most `little` bytes. None where it is not known: the
    page has an unusual form, or texts of different lengths. `handle` reads the file.
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
    """The uncompressed entries; None where these do not have `size` bytes."""
    if compression == "UNCOMPRESSED":
        return page if len(page) == size else None
    try:
        return pa.Codec(compression.lower()).decompress(page, decompressed_size=size)
    except (OSError, ValueError):
        return None


def _longest_entry(entries: Any, count: int) -> float | None:
    """Bytes of the longest of `count` entries; None unless all have the same length."""
    if entries is None:
        return None
    each, rest = divmod(len(entries), count) if count else (0, 1)
    if rest or each < LENGTH_BYTES:
        return None
    entry = np.dtype({"names": ["length"], "formats": ["<u4"], "itemsize": each})
    stated_lengths = np.frombuffer(entries, entry)["length"]
    return float(each - LENGTH_BYTES) if (stated_lengths == each - LENGTH_BYTES).all() else None
