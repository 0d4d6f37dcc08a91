"""Files without an end, sparse or much in little when unpacked; files written as a whole or not."""

from __future__ import annotations

import errno
import gzip
import os

import numpy as np
import pytest

from squealstudy import array_files, files
from squealstudy.engine.cache import META, is_whole
from squealstudy.engine.journal import MAX_LINE_BYTES, Journal
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.store import Store
from squealstudy.errors import SquealstudyError
from squealstudy.files import UnusableFileError, read_whole, text_writer, write_all
from squealstudy.models.components.free_modes import read_mode_table
from squealstudy.models.components.gmsh import read_gmsh
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.nastran import read_bdf
from squealstudy.models.matrices.files import read_component_matrix, read_matrix
from squealstudy.models.matrices.text import TextFile
from squealstudy.shapes.measured import _sets
from squealstudy.study.definition import load_study

HUGE = 2**42  # bytes: more than any memory


def hole(path):
    """A file of HUGE bytes that takes none on disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    os.truncate(path, HUGE)
    return path


READERS = {
    "a.toml": load_study,
    "a.inp": read_inp,
    "a.msh": read_gmsh,
    "a.bdf": read_bdf,
    "a.mtx": read_matrix,
    "a.pch": read_component_matrix,
    "a.mat": read_matrix,
    "a.uff": _sets,
    "a.csv": read_mode_table,
    "manifest.json": lambda path: read_manifest(path.parent),
    "journal.jsonl": lambda path: Journal(path.parent),
}


@pytest.mark.parametrize("name", list(READERS))
def test_a_file_without_end_is_one_sentence(tmp_path, name):
    """It is known by its size: before anything is read the machine's memory would be gone."""
    path = hole(tmp_path / name)
    with pytest.raises(SquealstudyError, match=name):
        READERS[name](path)


def test_what_is_made_again_is_passed_over(tmp_path):
    hole(tmp_path / "references" / "0123456789abcdef.json")
    hole(tmp_path / "cache" / META)
    assert Store(tmp_path).references() == {}
    assert not is_whole(tmp_path / "cache")


def test_compressed_text_is_unpacked_as_long_as_there_is_room(tmp_path, monkeypatch):
    path = tmp_path / "a.inp.gz"
    with gzip.open(path, "wt") as handle:
        handle.write("ab\r\nc\n" * 1000)
    assert TextFile.read(path).lines == [*["ab", "c"] * 1000, ""]
    monkeypatch.setattr(array_files, "MAX_UNCHECKED_BYTES", 1000)
    monkeypatch.setattr(array_files, "available_memory_mb", lambda: 1e-3)
    with pytest.raises(UnusableFileError, match="GB of memory"):
        TextFile.read(path)


def test_lines_are_counted_before_they_are_kept(tmp_path, monkeypatch):
    """A line of no letters takes as much memory as a short one."""
    path = tmp_path / "a.inp"
    path.write_text("\r\n\n" * 1000)
    assert len(TextFile.read(path).lines) == 2001
    monkeypatch.setattr(array_files, "MAX_UNCHECKED_BYTES", 1000)
    monkeypatch.setattr(array_files, "available_memory_mb", lambda: 0.05)
    with pytest.raises(UnusableFileError, match="GB of memory"):
        TextFile.read(path)


def test_a_line_of_a_journal_has_an_end(tmp_path):
    line = b'{"files": {"chunks/0123456789abcdef.parquet": [1, "aa"]}}\n'
    (tmp_path / "journal.jsonl").write_bytes(
        line + b"x" * (MAX_LINE_BYTES + 9) + b"\n\n" + line[:-1]
    )
    found = Journal(tmp_path)
    assert list(found.entries) == ["chunks/0123456789abcdef.parquet"]
    assert found.unreadable == 2


def test_whole_files_are_read_as_they_are(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(content := np.arange(999).tobytes())
    assert read_whole(path) == content
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="it is no file"):
        read_whole(tmp_path / "pipe")
    with pytest.raises(IsADirectoryError):
        read_whole(tmp_path)


def test_files_written_together_are_on_the_disk_before_one_of_them_has_its_name(
    tmp_path, monkeypatch
):
    flushed = []

    def flush(path):
        flushed.append(path.name)
        assert path == tmp_path or not any((tmp_path / name).exists() for name in "abc")

    monkeypatch.setattr(files, "flush", flush)
    write_all({tmp_path / name: text_writer(name) for name in "abc"})
    assert [(tmp_path / name).read_text() for name in "abc"] == ["a", "b", "c"]
    assert len(flushed) == 4
    assert flushed[-1] == tmp_path.name


def test_of_files_written_together_none_is_left_where_the_disk_refuses_one(tmp_path, monkeypatch):
    def flush(path):
        if path.name.startswith(".b."):
            raise OSError(errno.ENOSPC, "no space left on device", str(path))

    monkeypatch.setattr(files, "flush", flush)
    with pytest.raises(OSError, match=r"b'$"):
        write_all({tmp_path / name: text_writer(name) for name in "abc"})
    assert not [*tmp_path.iterdir()]
