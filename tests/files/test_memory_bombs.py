"""Small files that claim, or are decompressed to, more than there is memory for: one sentence."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from squealstudy import array_files
from squealstudy.array_files import read_arrays
from squealstudy.engine.final_states import read_state
from squealstudy.engine.table_files import read_batches, read_chunk, read_file
from squealstudy.errors import ModelError
from squealstudy.models.matrices.files import read_matrix


@pytest.fixture
def little(monkeypatch):
    """A machine with 2 MB left."""
    monkeypatch.setattr(array_files, "available_memory_mb", lambda: 2.0)
    monkeypatch.setattr(array_files, "MAX_UNCHECKED_BYTES", 0)


def archive(path: Path, shape: tuple[int, ...], content: bytes, kind: str = "<f8") -> Path:
    header = io.BytesIO()
    told = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, told)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("q.npy", header.getvalue() + content)
    return path


@pytest.mark.parametrize("kind", ["<f8", "S0", "|O"])
def test_a_shape_that_the_file_has_not_is_refused(tmp_path, kind):
    with pytest.raises(ValueError, match=r"not as long|GB are left|pickles"):
        read_arrays(archive(tmp_path / "a.npz", (10**13,), b"", kind))
    with pytest.raises(ModelError, match=r"not as long|GB are left|pickles"):
        read_matrix(archive(tmp_path / "a.npz", (10**13,), b"", kind), "q")


@pytest.mark.usefixtures("little")
def test_an_archive_without_room_is_refused(tmp_path):
    path = archive(tmp_path / "a.npz", (10**6,), bytes(8 * 10**6))
    assert path.stat().st_size < 10**5
    with pytest.raises(ValueError, match=r"0\.008 GB of memory, and 0\.0021 GB are left"):
        read_arrays(path)


def test_arrays_that_are_there_are_read(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.arange(3.0), v=np.zeros(3), prepared_key="k", name="\xe4")
    found = read_arrays(tmp_path / "a.npz")
    assert found["q"].tolist() == [0, 1, 2]
    assert str(found["name"]) == "\xe4"


BAD_STATES = {
    "none": {},
    "no velocity": {"q": np.zeros(2)},
    "other length": {"q": np.zeros(2), "v": np.zeros(3)},
    "no numbers": {"q": np.full(2, np.nan), "v": np.zeros(2)},
    "texts": {"q": np.array(["a", "b"]), "v": np.zeros(2)},
    "one number": {"q": np.float64(1), "v": np.float64(1)},
}


@pytest.mark.parametrize("name", BAD_STATES)
def test_final_states_that_are_none_are_refused(tmp_path, name):
    whole = {"prepared_key": "k", "representation": "modal"}
    np.savez(tmp_path / "a.npz", **(whole | BAD_STATES[name]))
    with pytest.raises(ValueError, match=r"it holds no|an array"):
        read_state(tmp_path / "a.npz")


TABLES = {
    "nulls": pa.table({"a": pa.nulls(10**6, pa.float64())}),
    "one text": pa.table({"a": pa.array(["x" * 10**5] * 1000).dictionary_encode()}),
    "lists": pa.table({"a": pa.array([[0.0] * 10**6])}),
}


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize("name", TABLES)
def test_a_table_without_room_is_refused(tmp_path, name):
    path = tmp_path / "a.parquet"
    pq.write_table(TABLES[name], path, compression="zstd")
    assert path.stat().st_size < 10**5
    schema = pq.read_schema(path)
    with pytest.raises(ValueError, match="GB are left"):
        read_file(path)
    assert read_chunk(path, schema, None) is None
    if name == "nulls":  # some thousand rows at a time there is room for
        assert sum(map(len, read_batches(path, ["a"], 1000))) == 10**6
    else:
        with pytest.raises(ValueError, match="GB are left"):
            list(read_batches(path, ["a"], 1000))


def test_a_chunk_that_is_no_table_is_none(tmp_path):
    (tmp_path / "a.parquet").write_bytes(b"PAR1 and no more")
    assert read_chunk(tmp_path / "a.parquet", pa.schema([]), None) is None


def compressed(change: int) -> bytes:
    """A variable of MATLAB whose own tag says other bytes than are compressed."""
    made = io.BytesIO()
    scipy.io.savemat(made, {"A": np.eye(30)}, do_compression=True)
    data = made.getvalue()
    (size,) = struct.unpack("<I", data[132:136])
    inner = bytearray(zlib.decompress(data[136 : 136 + size]))
    (told,) = struct.unpack("<I", inner[4:8])
    inner[4:8] = struct.pack("<I", told + change)
    packed = zlib.compress(bytes(inner) + bytes(10**7))
    return data[:132] + struct.pack("<I", len(packed)) + packed


@pytest.mark.parametrize("change", [0, 2**31])
def test_a_variable_that_is_longer_than_it_says_is_refused(tmp_path, monkeypatch, change):
    monkeypatch.setattr(array_files, "available_memory_mb", lambda: 100.0)
    (tmp_path / "a.mat").write_bytes(compressed(change))
    with pytest.raises(ModelError, match=r"than its sizes say|GB are left"):
        read_matrix(tmp_path / "a.mat", "A")
