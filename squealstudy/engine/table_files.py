"""Parquet tables that anybody may have made: read only if memory suffices for their claims.

A column of nulls or of one text takes almost nothing in a file, but its full size in memory.
"""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from squealstudy import array_files
from squealstudy.array_files import expect_memory
from squealstudy.engine.dictionary_pages import longest_entry
from squealstudy.errors import ContradictionError, ResultsError

SIDE_BY_SIDE = b"side_by_side"  # key of a schema's metadata: columns with lists of one length
NUMBER_BYTES = 8  # bytes of a value that is no text
TEXT_BYTES = 16  # memory of a text in a table and in a frame, without its letters
TEXT = "BYTE_ARRAY"
ColumnPart = tuple[int, int, int, pq.ColumnChunkMetaData]  # group, column, values, facts
FEW_BYTES = 2**12  # most bytes on disk of the dictionary of a column with few texts, like status


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """A context that raises ResultsError where a file is no table, or too large."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: not a readable table ({error})") from error


def read_file(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Read a file of a table; OSError or ValueError where it is none, or memory is too small."""
    with pq.ParquetFile(path) as file:
        expect_room(path, file, columns)
        few = _of_few_texts(file)
    chosen = None if columns is None else list(columns)
    with pq.ParquetFile(path, metadata=file.metadata, read_dictionary=few) as coded:
        table = coded.read(columns=chosen)
    # repeated texts are copied only here, which halves the time
    for index, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            stored_field = file.schema_arrow.field(field.name)
            table = table.set_column(
                index, stored_field, table.column(index).cast(stored_field.type)
            )
    return table


def _of_few_texts(file: pq.ParquetFile) -> list[str]:
    """Columns whose texts are in small dictionaries in all parts of a file."""
    named = Counter(file.schema_arrow.names)
    alone = {n for n, times in named.items() if times == 1 and "." not in n}  # no part of a record
    fields = (field for field in file.schema_arrow if field.name in alone)
    texts, large = {f.name for f in fields if pa.types.is_string(f.type)}, set[str]()
    for _, column, _, part in _column_parts(file, texts, 0):
        if _dictionary_bytes(part) > FEW_BYTES:
            large.add(file.schema.column(column).path)
    return sorted(texts - large)


def _dictionary_bytes(part: pq.ColumnChunkMetaData) -> float:
    """Bytes of a dictionary as stored in the file; infinity where a part has none."""
    if not part.has_dictionary_page or part.dictionary_page_offset is None:
        return math.inf
    return part.data_page_offset - part.dictionary_page_offset


def read_batches(path: Path, columns: Sequence[str], rows: int) -> Iterator[pa.Table]:
    """Yield columns of a table's file, `rows` at a time; OSError or ValueError as `read_file`."""
    with pq.ParquetFile(path) as file:
        expect_room(path, file, columns, rows)
        for batch in file.iter_batches(rows, columns=list(columns), use_threads=False):
            yield pa.Table.from_batches([batch]).select(list(columns))


def read_chunk(path: Path, schema: pa.Schema, columns: Sequence[str] | None) -> pa.Table | None:
    """Columns of a chunk file; None where it has another schema, or cannot be read.

    Raises
    ------
    ContradictionError
        Where lists of a row differ in length, though they have equally many values in all.
    OSError
        Where the machine refuses to read the file.
    """
    try:
        with pq.ParquetFile(path) as file:
            if not file.schema_arrow.equals(schema) or not _counted(file, schema):
                return None
            expect_room(path, file, columns)
            chosen = None if columns is None else list(columns)
            table = file.read(columns=chosen, use_threads=False)
    except ValueError:
        return None
    except OSError as error:
        if error.errno is not None:  # pyarrow's own, of a file that is no table, has none
            raise
        return None
    if not _fits(table, schema):
        raise ContradictionError(
            f"{path}: lists of one point that differ in length, as no run writes them; --fresh "
            "makes all anew"
        )
    return table


def _side_by_side(schema: pa.Schema) -> list[str]:
    return list((schema.metadata or {}).get(SIDE_BY_SIDE, b"").decode().split())


def _counted(file: pq.ParquetFile, schema: pa.Schema) -> bool:
    """Whether columns with lists of one length have equally many values, as the footer says."""
    counts: dict[int, int] = {}
    list_columns = _side_by_side(schema)
    for _, column, values, _ in _column_parts(file, list_columns, 0) if list_columns else ():
        counts[column] = counts.get(column, 0) + values
    return len(set(counts.values())) < 2


def _fits(table: pa.Table, schema: pa.Schema) -> bool:
    """Whether these lists have one length in each row."""
    list_columns = _side_by_side(schema)
    lengths = [pc.list_value_length(table[n]) for n in list_columns if n in table.column_names]
    return all(column_lengths.equals(lengths[0]) for column_lengths in lengths[1:])


def expect_room(
    path: Path, file: pq.ParquetFile, columns: Collection[str] | None = None, rows: int = 0
) -> None:
    """Raise ValueError where memory is too small for columns of a table, or for `rows` of them."""
    needed, texts = 0.0, list[ColumnPart]()
    for group, column, values, part in _column_parts(file, columns, rows):
        needed += values * NUMBER_BYTES
        if part.physical_type == TEXT:
            texts.append((group, column, values, part))
            needed += values * TEXT_BYTES
    expect_memory(needed)
    if texts:
        expect_memory(needed + _letters(path, file, texts))


def _column_parts(
    file: pq.ParquetFile, columns: Collection[str] | None, rows: int
) -> Iterator[ColumnPart]:
    """Yield group, column, number of values and facts of each part of the columns to read."""
    metadata, schema = file.metadata, file.schema
    for column in range(len(schema)):
        leaf = schema.column(column)
        if columns is not None and leaf.path.split(".")[0] not in columns:
            continue
        for group in range(metadata.num_row_groups):
            part = metadata.row_group(group).column(column)
            plain = rows and not leaf.max_repetition_level  # a row of lists has any number
            yield group, column, min(part.num_values, rows) if plain else part.num_values, part


def _letters(path: Path, file: pq.ParquetFile, texts: Sequence[ColumnPart]) -> float:
    """Upper bound on the letters of all texts.

    Texts outside a dictionary have at most as many letters as their part has bytes. Texts in one
    have at most as many as its longest entry, each. A dictionary is read only if that matters, and
    decoded only if its form is not that of the names of design points.
    """
    letters, unknown = 0.0, list[ColumnPart]()
    with path.open("rb") as handle:
        for group, column, values, part in texts:
            size, little = (
                part.total_uncompressed_size,
                array_files.MAX_UNCHECKED_BYTES / len(texts) / max(values, 1),
            )
            longest = size if size <= little else longest_entry(handle, part, little)
            if longest is None:
                unknown.append((group, column, values, part))
            else:
                letters += size + values * longest
    if unknown:
        names = {column: file.schema.column(column).path for _, column, _, _ in unknown}
        with pq.ParquetFile(path, read_dictionary=list(names.values())) as coded:
            for group, column, values, part in unknown:
                letters += part.total_uncompressed_size
                letters += values * _length(coded, group, names[column])
    return letters


def _length(coded: pq.ParquetFile, group: int, name: str) -> float:
    """Bytes of the longest text in the dictionary of a part of a column; 0 without one."""
    for batch in coded.iter_batches(1, [group], [name], use_threads=False):
        array = batch.column(0)
        while hasattr(array, "flatten") and not hasattr(array, "dictionary"):
            array = array.flatten()
        if hasattr(array, "dictionary"):
            return float(pc.max(pc.binary_length(array.dictionary)).as_py() or 0)
        break
    return 0.0
