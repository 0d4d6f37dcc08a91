"""The longest text of a dictionary, told from its page: against the texts themselves."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from squealstudy import array_files
from squealstudy.engine import table_files
from squealstudy.engine.dictionary_pages import longest_entry

IDS = [f"{number:016x}" for number in range(3000)]
LONG = [*IDS, "x" * 5000]


def told(path, little=0.0):
    with pq.ParquetFile(path) as file, path.open("rb") as handle:
        parts = [file.metadata.row_group(g).column(0) for g in range(file.num_row_groups)]
        return [longest_entry(handle, part, little) for part in parts]


@pytest.mark.parametrize("compression", ["zstd", "snappy", "gzip", "none"])
def test_texts_of_one_length_are_told_without_decoding(tmp_path, compression):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": IDS * 2}), path, compression=compression, row_group_size=len(IDS))
    assert told(path) == [16.0, 16.0]
    assert told(path, 10**6) == [20 * len(IDS)] * 2  # what the page holds, with lengths


@pytest.mark.parametrize("texts", [LONG, ["", "a"]])
def test_texts_of_several_lengths_are_not_taken_for_one(tmp_path, texts):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": pa.array(texts, pa.string())}), path, compression="zstd")
    assert set(told(path)) <= {None}


def test_a_column_without_dictionary_has_no_page(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": LONG}), path, use_dictionary=False)
    assert told(path) == [None]


def test_a_page_that_is_changed_is_never_believed(tmp_path):
    """Whatever one byte of it is: no length that another reader of the page does not find."""
    path, changed = tmp_path / "a.parquet", tmp_path / "b.parquet"
    pq.write_table(pa.table({"a": IDS[:40] * 3}), path, compression="none")
    data, rng = path.read_bytes(), np.random.default_rng(5)
    with pq.ParquetFile(path) as file:
        part = file.metadata.row_group(0).column(0)
    begin, end, believed = part.dictionary_page_offset, part.data_page_offset, 0
    for place in [*range(begin, begin + 24), *rng.integers(begin + 24, end, 150)]:
        one = bytearray(data)
        one[place] ^= 1 << rng.integers(8)
        changed.write_bytes(one)
        with changed.open("rb") as handle:
            length = longest_entry(handle, part, 0.0)
        if length is None:
            continue
        believed += 1
        try:
            found = pq.read_table(changed)["a"].cast(pa.binary()).to_pylist()
        except (OSError, ValueError):
            continue
        assert max(map(len, found)) <= length
    assert believed > 50  # changed letters are letters all the same


@pytest.mark.parametrize("texts", [LONG, IDS])
def test_letters_of_a_table_are_no_fewer_than_it_has(tmp_path, monkeypatch, texts):
    monkeypatch.setattr(array_files, "MAX_UNCHECKED_BYTES", 0)
    monkeypatch.setattr(array_files, "available_memory_mb", lambda: 0.0)
    path, asked = tmp_path / "a.parquet", []
    pq.write_table(pa.table({"a": texts * 3}), path, compression="zstd")
    monkeypatch.setattr(table_files, "expect_memory", asked.append)
    found = table_files.read_file(path)["a"].to_pylist()
    assert found == texts * 3
    assert sum(map(len, found)) + 24 * len(found) <= max(asked)
    assert max(asked) <= 3 * len(texts) * (24 + max(map(len, texts))) + 10**6


def test_few_texts_are_read_as_they_were_written(tmp_path):
    """They are decoded once, not a row: nulls, dictionaries that differ, names that clash."""
    rng, path, n = np.random.default_rng(2), tmp_path / "a.parquet", 900
    words = pa.array([None, "", "ok", "failed: \u00e4"])
    one = words.take(pa.array(rng.integers(0, 4, n)))
    columns = {
        "status": one,
        "large": one.cast(pa.large_string()),
        "ids": pa.array(IDS[:n]),
        "new in each part": pa.array([f"{i // 300}" for i in range(n)]),
        "s": pa.StructArray.from_arrays([one], ["a"]),
        "s.a": one,
        "lists": pa.array([[w] for w in one.to_pylist()]),
        "bytes": one.cast(pa.binary()),
        "coded": one.dictionary_encode(),
        "x": pa.array(rng.random(n)),
    }
    table = pa.table(columns).replace_schema_metadata({b"a": b"b"})
    pq.write_table(table, path, compression="zstd", row_group_size=300)
    found = table_files.read_file(path)
    assert found.equals(pq.ParquetFile(path).read(), check_metadata=True)
    assert found.schema.types[:-2] == table.schema.types[:-2]
    some = table_files.read_file(path, ["x", "status"])
    assert some.select(["status", "x"]).equals(found.select(["status", "x"]))
    twice = pa.Table.from_arrays([one, one], names=["a", "a"])
    pq.write_table(twice, path)
    assert table_files.read_file(path).equals(twice)


def test_few_texts_are_not_decoded_row_by_row(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"few": ["ok", "failed"] * 3000, "many": LONG[:3000] * 2}), path)
    with pq.ParquetFile(path) as file:
        assert table_files._of_few_texts(file) == ["few"]
