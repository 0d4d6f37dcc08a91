"""Tables from anybody (Parquet): read only where there is memory for what their footers claim.

A row of nulls or of one text takes nothing in a file, and its bytes in memory.
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

SIDE_BY_SIDE = b"side_by_side"  # in the metadata of a schema: its lists of one length
NUMBER_BYTES = 8  # of a value that is no text
TEXT_BYTES = 16  # of a text beside its letters: its place in a table, and in a frame
TEXT = "BYTE_ARRAY"
ColumnPart = tuple[int, int, int, pq.ColumnChunkMetaData]  # group, column, values, facts
FEW_BYTES = 2**12  # of a dictionary on disk, of a column of few texts as status or method


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise ResultsError for a table that turns out not to be one, or to be too large."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: not a readable table ({error})") from error


def read_file(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """A file of a table; OSError, ValueError where it is none or has no room."""
    with pq.ParquetFile(path) as file:
        expect_room(path, file, columns)
        few = _of_few_texts(file)
    chosen = None if columns is None else list(columns)
    with pq.ParquetFile(path, metadata=file.metadata, read_dictionary=few) as coded:
        table = coded.read(columns=chosen)
    # texts are written out only here, once a row, from those that are there: half the time
    for index, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            stored_field = file.schema_arrow.field(field.name)
            table = table.set_column(
                index, stored_field, table.column(index).cast(stored_field.type)
            )
    return table


def _of_few_texts(file: pq.ParquetFile) -> list[str]:
    """Columns whose texts stand in small dictionaries in all parts of a file."""
    named = Counter(file.schema_arrow.names)
    alone = {n for n, times in named.items() if times == 1 and "." not in n}  # of no record a part
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
    """Columns of a file of a table, so many rows at a time; errors as of `read_file`."""
    with pq.ParquetFile(path) as file:
        expect_room(path, file, columns, rows)
        for batch in file.iter_batches(rows, columns=list(columns), use_threads=False):
            yield pa.Table.from_batches([batch]).select(list(columns))


def read_chunk(path: Path, schema: pa.Schema, columns: Sequence[str] | None) -> pa.Table | None:
    """Columns of a chunk file; None of another schema, where it is none, or has no room.

    Raises
    ------
    ContradictionError
        Lists that do not fit together, though their values are as many.
    OSError
        What the machine refuses.
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
    """Whether lists that stand side by side have as many values in the file, as its footer says."""
    counts: dict[int, int] = {}
    list_columns = _side_by_side(schema)
    for _, column, values, _ in _column_parts(file, list_columns, 0) if list_columns else ():
        counts[column] = counts.get(column, 0) + values
    return len(set(counts.values())) < 2


def _fits(table: pa.Table, schema: pa.Schema) -> bool:
    """Whether they are of one length in each row."""
    list_columns = _side_by_side(schema)
    lengths = [pc.list_value_length(table[n]) for n in list_columns if n in table.column_names]
    return all(column_lengths.equals(lengths[0]) for column_lengths in lengths[1:])


def expect_room(
    path: Path, file: pq.ParquetFile, columns: Collection[str] | None = None, rows: int = 0
) -> None:
    """Raise ValueError where columns of a table, or so many rows at a time, have no room."""
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
    """Group, column, number of values and facts of each part of a column that is read."""
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
    """Letters of all texts, at most.

    Those beside a dictionary are no more than the part is large, those in it as many times its
    longest as there are values. Dictionaries are looked at only where much depends on them, and
    decoded only where they are of another form than that of names of design points.
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
    """Letters of the longest text in the dictionary of a part of a column; 0 without one."""
    for batch in coded.iter_batches(1, [group], [name], use_threads=False):
        array = batch.column(0)
        while hasattr(array, "flatten") and not hasattr(array, "dictionary"):
            array = array.flatten()
        if hasattr(array, "dictionary"):
            return float(pc.max(pc.binary_length(array.dictionary)).as_py() or 0)
        break
    return 0.0
