"""When chunk files close, and that nothing finished is lost."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from squealstudy.engine.chunk_rows import ChunkRows
from squealstudy.engine.chunk_writer import ChunkWriter
from squealstudy.engine.result_names import CHUNKS
from squealstudy.engine.store import Store
from squealstudy.errors import MachineError

SCHEMA = pa.schema([("point_id", pa.string())])


class Clock:
    """Seconds that pass when told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def found(first: int, count: int, wall_s: float = 0.1, **files) -> ChunkRows:
    names = [f"{i:016x}" for i in range(first, first + count)]
    return ChunkRows(pa.table({"point_id": names}, SCHEMA), files, 0, wall_s, 0.0)


def written(store: Store) -> list[int]:
    return sorted(table.num_rows for table in store.chunks(SCHEMA))


def test_a_chunk_closes_when_it_is_full(tmp_path: Path) -> None:
    store, sizes = Store(tmp_path), []
    with ChunkWriter(store, Clock()) as writer:
        for first in range(0, 10_000, 1000):
            writer.add(found(first, 1000))
            sizes.append(len(written(store)))
    assert sizes == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert written(store) == [2000, 4000, 4000]
    assert len(store.finished_points(SCHEMA)) == 10_000


def test_no_row_waits_for_five_seconds(tmp_path: Path) -> None:
    store, clock = Store(tmp_path), Clock()
    with ChunkWriter(store, clock) as writer:
        writer.add(found(0, 1, wall_s=6.0))  # the next one may be as late
        assert written(store) == [1]
        writer.add(found(1, 1, wall_s=2.0))
        clock.now = 2.0
        writer.add(found(2, 1, wall_s=2.0))
        assert written(store) == [1]
        clock.now = 3.0
        writer.add(found(3, 1, wall_s=2.0))
        assert written(store) == [1, 3]


def broken_off(store: Store, error: BaseException | None) -> None:
    """Seven rows are finished, then an error."""
    with ChunkWriter(store, Clock()) as writer:
        writer.add(found(0, 7))
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, MachineError, ValueError])
def test_what_is_finished_is_kept_whatever_ends_the_run(tmp_path: Path, error) -> None:
    store = Store(tmp_path)
    with pytest.raises(error, match="said"):
        broken_off(store, error("said"))
    assert written(store) == [7]


def test_the_error_that_ends_a_run_is_told_not_the_one_after_it(tmp_path: Path, monkeypatch):
    def full(*_):
        raise MachineError("no space")

    monkeypatch.setattr(Store, "write_chunk", full)
    with pytest.raises(KeyboardInterrupt):
        broken_off(Store(tmp_path), KeyboardInterrupt())
    with pytest.raises(MachineError, match="no space"):
        broken_off(Store(tmp_path), None)


def test_rows_with_files_of_their_own_are_written_with_them(tmp_path: Path) -> None:
    store = Store(tmp_path)
    history = pa.table({"time": [0.0]})
    with ChunkWriter(store, Clock()) as writer:
        writer.add(found(0, 1))
        writer.add(found(1, 2, **{"histories/1.parquet": history}))
        assert written(store) == [2]
        chunk = next(name for name in store.names(CHUNKS))
        assert store.journal.entries[chunk].group == {chunk, "histories/1.parquet"}
    assert written(store) == [1, 2]
