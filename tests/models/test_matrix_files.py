"""Damaged, unusual and absurd files of matrices: a message that says where, or the right matrix."""

from __future__ import annotations

import bz2
import gzip
import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.matrices.files import read_matrix, read_recovery

BANNER = "%%MatrixMarket matrix {} {} {}\n"
EXPECTED = np.array([[4.0, 0.0, -1.5], [0.0, 250.0, 0.0], [2.0, 0.0, 1.0]])
ENTRIES = "1 1 4\n1 3 -1.5\n2 2 2.5e2\n3 1 2.\n3 3 1\n"


def market(body: str, layout="coordinate", kind="real", symmetry="general") -> str:
    return BANNER.format(layout, kind, symmetry) + body


def read(folder: Path, name: str, content: str | bytes, variable: str | None = None) -> np.ndarray:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_matrix(path, variable).toarray()


def said(folder: Path, name: str, content: str | bytes, variable: str | None = None) -> str:
    with pytest.raises(ModelError) as caught:
        read(folder, name, content, variable)
    message = str(caught.value)
    assert message.startswith(str(folder / name))
    return message.removeprefix(str(folder / name)).lstrip(", :").removeprefix("cannot be read: ")


# -- Matrix Market ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (market("3 3 5\n" + ENTRIES).replace("\n", "\r\n"), "CRLF"),
        ("\ufeff" + market("3 3 5\n" + ENTRIES), "byte-order mark"),
        (market("% a comment\n\n  \n3 3 5\n" + ENTRIES + "\n\n"), "comments and blank lines"),
        (market("3 3 5\n" + ENTRIES.replace("2.5e2", "2.5D+02")), "Fortran's exponent"),
        (market("3 3 6\n" + ENTRIES.replace("1 1 4", "1 1 3\n1 1 1")), "one place twice: a sum"),
        (market("3 3 6\n2 1 0.0\n" + ENTRIES), "a zero entry"),
        (market("3 3 5\n" + ENTRIES).replace("MatrixMarket matrix", "matrixmarket MATRIX"), "case"),
        (market("3 3\n4\n0\n2\n0\n250\n0\n-1.5\n0\n1\n", "array"), "all values by columns"),
    ],
    ids=lambda value: value if len(value) < 30 else "",
)
def test_what_may_be_written_otherwise(content, what, tmp_path):
    np.testing.assert_array_equal(read(tmp_path, "a.mtx", content), EXPECTED, err_msg=what)


def test_one_triangle_makes_both(tmp_path):
    lower, values = "1 1 4\n3 1 2\n3 2 -7\n", "4\n0\n2\n0\n-7\n0\n"
    upper = "1 1 4\n1 3 2\n2 3 -7\n"
    S = np.array([[4.0, 0, 2], [0, 0, -7], [2, -7, 0]])
    Z = np.array([[0.0, 0, -2], [0, 0, 7], [2, -7, 0]])
    for body in (lower, upper):
        found = read(tmp_path, "s.mtx", market("3 3 3\n" + body, symmetry="symmetric"))
        np.testing.assert_array_equal(found, S)
    found = read(tmp_path, "s.mtx", market("3 3\n" + values, "array", symmetry="symmetric"))
    np.testing.assert_array_equal(found, S)
    skew = market("3 3 2\n" + lower.removeprefix("1 1 4\n"), symmetry="skew-symmetric")
    np.testing.assert_array_equal(read(tmp_path, "z.mtx", skew), Z)
    packed = market("3 3\n0\n2\n-7\n", "array", "integer", "skew-symmetric")
    np.testing.assert_array_equal(read(tmp_path, "z.mtx", packed), Z)


def test_no_entries_are_a_matrix_of_zeros(tmp_path):
    assert not read(tmp_path, "a.mtx", market("3 3 0\n")).any()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1 3 -1.5", "1 3 -1,5", "line 4: expected row and column and a value, found '1 3 -1,5'"),
        ("1 3 -1.5", "1 3 0x10", "line 4: expected row"),
        ("1 3 -1.5", "1 3 -1.5abc", "line 4: expected row"),
        ("1 3 -1.5", "1 3", "line 4: expected row"),
        ("1 3 -1.5", "1 3 -1.5 7", "line 4: expected row"),
        ("1 3 -1.5", "1.0 3 -1.5", "line 4: expected row"),
        ("1 3 -1.5", "% 1 3 -1.5", "line 4: expected row"),
        ("1 3 -1.5", "1 3 nan", "line 4: expected a finite value, found '1 3 nan'"),
        ("1 3 -1.5", "1 3 1e400", "line 4: expected a finite value, found '1 3 1e400'"),
        ("1 3 -1.5", "0 3 -1.5", "line 4: expected a row from 1 to 3, found 0"),
        ("1 3 -1.5", "1 -3 -1.5", "line 4: expected a column from 1 to 3, found -3"),
        ("1 3 -1.5", "1 4294967299 -1.5", "line 4: expected a column from 1 to 3, found 429496729"),
        ("1 3 -1.5\n", "", "line 2: the header says 5 entries, 4 lines follow"),
        ("1 1 4\n", "1 1 4\n1 1 4\n", "line 2: the header says 5 entries, 6 lines follow"),
        ("3 3 5", "3 3 -5", "line 2: expected rows, columns and entries, found '3 3 -5'"),
        ("3 3 5", "3 3 1000000000000", "line 2: the header says 1,000,000,000,000 entries, 5"),
        ("3 3 5", "3 4 5", "expected a square matrix, found 3 x 4"),
        ("3 3 5", "0 0 0", "expected a square matrix, found 0 x 0"),
        (
            "3 3 5",
            "1000000000000 1000000000000 5",
            "expected at most 10,000,000 rows, found 1,000,",
        ),
        ("3 3 5", "3 3", "line 2: expected rows, columns and entries"),
        ("real", "pattern", "line 1: a pattern without values"),
        ("real", "complex", "line 1: expected real values, found complex general ones"),
        ("general", "hermitian", "line 1: expected real values, found real hermitian ones"),
        ("real", "integer", "line 4: expected row and column and an integer, found '1 3 -1.5'"),
        ("general", "symmetric", "line 6: a symmetric file stores one triangle, and this is in"),
        (
            "general",
            "skew",
            "line 1: expected general or symmetric or skew-symmetric, found 'skew'",
        ),
        ("coordinate", "array", "line 2: expected rows and columns, found '3 3 5'"),
        ("%%MatrixMarket", "%%Matrix", "line 1: expected %%MatrixMarket matrix, layout"),
    ],
)
def test_matrix_market_errors_name_the_line(old, new, message, tmp_path):
    content = market("3 3 5\n" + ENTRIES)
    assert content.count(old) == 1 or old in ("1 1 4\n", "3 3 5", "real", "general")
    assert said(tmp_path, "a.mtx", content.replace(old, new, 1)).startswith(message)


def test_absurd_sizes_of_full_matrices_take_no_memory(tmp_path):
    message = said(tmp_path, "a.mtx", market("1000000 1000000\n1\n", "array"))
    assert message == "line 2: the header says 1,000,000,000,000 values, 1 lines follow"


def test_compressed_files_that_are_cut_or_damaged(tmp_path):
    content = market("3 3 5\n" + ENTRIES).encode()
    for ending, packed in (
        (".mtx.gz", gzip.compress(content)),
        (".mtx.bz2", bz2.compress(content)),
    ):
        np.testing.assert_array_equal(read(tmp_path, f"a{ending}", packed), EXPECTED)
        assert said(tmp_path, f"a{ending}", packed[:-9])
        broken = bytes([*packed[:40], packed[40] ^ 0x5A, *packed[41:]])
        assert said(tmp_path, f"a{ending}", broken)
    assert "gzip" in said(tmp_path, "a.mtx.gz", gzip.compress(content) + b"more")


# -- Harwell-Boeing -----------------------------------------------------------------------------


def boeing(kind="RUA", pointers="(4I8)", indices="(8I5)", values="(3E12.4)") -> str:
    """EXPECTED by columns, fields as wide as the formats say."""
    return (
        f"{'A test':72}TEST    \n{5:14}{1:14}{1:14}{2:14}{0:14}\n"
        f"{kind:14}{3:14}{3:14}{5:14}{0:14}\n"
        f"{pointers:16}{indices:16}{values:20}\n"
        f"{1:8}{3:8}{4:8}{6:8}\n{1:5}{3:5}{2:5}{1:5}{3:5}\n"
        f"{'4.0000E+00':>12}{'2.0000E+00':>12}{'2.5000E+02':>12}\n{'-1.5000E+00':>12}{'1.0':>12}\n"
    )


def test_harwell_boeing_as_fortran_writes_it(tmp_path):
    np.testing.assert_array_equal(read(tmp_path, "a.rua", boeing()), EXPECTED)
    touching = boeing(values="(3E10.4)").replace("  2.0000E+00  2.5", "2.0000E+002.5")
    touching = touching.replace("\n  4.0000E+00", "\n4.0000E+00")
    assert "4.0000E+002.0000E+002.5000E+02\n" in touching
    np.testing.assert_array_equal(read(tmp_path, "a.rua", touching), EXPECTED)
    no_letter = boeing().replace("2.5000E+02", "2.500E-103").replace("2.500E-103", "  2.5-103 ")
    assert read(tmp_path, "a.rua", no_letter)[1, 1] == 2.5e-103


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("RUA", "CUA", "line 3: expected a real assembled matrix"),
        ("RUA", "RUE", "line 3: expected a real assembled matrix"),
        ("RUA", "PUA", "line 3: a pattern without values"),
        ("RUA", "RSA", "line 6: a symmetric file stores one triangle"),
        ("(4I8)", "(4A8)", "line 4: expected a format like 10I8"),
        ("(8I5)", "(8E5.1)", "line 4: expected formats of whole numbers"),
        ("       3       4       6\n", "       5       4       6\n", "line 5: expected pointers"),
        (
            "       4       6\n",
            "       4       7\n",
            "line 5: expected pointers that ascend",
        ),
        ("\n    1    3    2", "\n    1    3    4", "line 6: expected a row from 1 to 3, found 4"),
        ("\n    1    3    2", "\n    1   -3    2", "line 6: expected a row from 1 to 3, found -3"),
        ("2.5000E+02", "2,5000E+02", "line 7: expected a number with a decimal point in field 3"),
        ("2.5000E+02", " 25000E+02", "line 7: expected a number with a decimal point in field 3"),
        ("         1.0\n", "\n", "line 8: expected a number with a decimal point in field 2"),
        ("1.0\n", "1.0 7.0\n", "line 8: expected 2 numbers, found '7.0' behind them"),
        ("1.0\n", "1.0\n7.0\n", "line 9: expected the end, found '7.0'"),
        ("(3E12.4)", "(9E12.4)", "line 2: 2 lines of (9E12.4) cannot hold 5 numbers"),
        ("(3E12.4)", "(1P,3F12.4)", "line 8: expected a number with a decimal point in field 2"),
    ],
)
def test_harwell_boeing_errors_name_the_line(old, new, message, tmp_path):
    assert old in boeing()
    assert said(tmp_path, "a.rua", boeing().replace(old, new, 1)).startswith(message)


def test_absurd_sizes_of_harwell_boeing_take_no_memory(tmp_path):
    huge = boeing().replace(f"{3:14}{3:14}{5:14}", f"{10**12:14}{10**12:14}{5:14}")
    assert said(tmp_path, "a.rua", huge).endswith(
        "at most 10,000,000 rows, found 1,000,000,000,000"
    )


# -- MATLAB -------------------------------------------------------------------------------------


def saved(content: dict[str, object], **options: object) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, content, **options)
    return buffer.getvalue()


@pytest.mark.parametrize("packed", [False, True])
def test_matlab_types_and_orders(packed, tmp_path):
    whole = EXPECTED.round().astype(np.int16)
    content = {"A": sp.csc_matrix(EXPECTED), "B": whole, "C": EXPECTED > 0, "D": EXPECTED}
    content["E"] = sp.csc_matrix(EXPECTED > 0)
    data = saved(content, do_compression=packed)
    for name, matrix in content.items():
        dense = matrix.toarray() if sp.issparse(matrix) else matrix
        np.testing.assert_array_equal(read(tmp_path, "a.mat", data, name), dense.astype(float))
    np.testing.assert_array_equal(
        read(tmp_path, "a.mat", saved({"A": EXPECTED}, format="4")), EXPECTED
    )


def test_damaged_matlab_files_do_not_end_the_process(tmp_path):
    """An element's type, size and place: SciPy's reader follows the first out of its tables."""
    data = saved({"A": EXPECTED})
    at = data.index(struct.pack("<II", 9, EXPECTED.nbytes))

    def changed(place: int, *numbers: int) -> bytes:
        new = struct.pack(f"<{len(numbers)}I", *numbers)
        return data[:place] + new + data[place + len(new) :]

    assert said(tmp_path, "a.mat", changed(at, 1000)).endswith("found an element of type 1000")
    assert "ends within an element" in said(tmp_path, "a.mat", changed(at + 4, 2**32 - 1))
    assert "no whole number of values" in said(tmp_path, "a.mat", changed(at + 4, 70))
    assert "expected 9 values, found 8" in said(tmp_path, "a.mat", changed(at + 4, 64))
    assert "ends within an element" in said(tmp_path, "a.mat", data[:-16])
    assert "found an element of type 77" in said(tmp_path, "a.mat", changed(128, 77))
    sizes = data.index(struct.pack("<IIII", 5, 8, 3, 3)) + 8
    assert "at most 10,000,000 rows" in said(tmp_path, "a.mat", changed(sizes, *[10**9] * 2))
    assert "found 3 x 2" in said(tmp_path, "a.mat", changed(sizes, 3, 2))
    assert "without a valid size" in said(tmp_path, "a.mat", changed(sizes, 2**32 - 1, 3))
    assert "unknown version 65" in said(tmp_path, "a.mat", data[:125] + b"A" + data[126:])
    assert "No reader for class code" in said(tmp_path, "a.mat", changed(0, 5))  # a header of 4
    packed = saved({"A": EXPECTED}, do_compression=True)
    assert "ends within an element" in said(tmp_path, "a.mat", packed[:-9])
    more = zlib.compress(zlib.decompress(packed[136:]) + b"\0" * 8)
    padded = packed[:128] + struct.pack("<II", 15, len(more)) + more
    assert "more data than its sizes say" in said(tmp_path, "a.mat", padded)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ((0, 1, 3, 4), (0, 3, 1, 4), "4 column pointers that ascend from 0"),
        ((0, 1, 3, 4), (0, 1, 3, 9), "expected 9 entries, found 4"),
        ((0, 1, 2, 2), (0, 1, 2, 3), "indices must be < 3"),
        ((0, 1, 2, 2), (0, -1, 2, 2), "indices must be >= 0"),
    ],
)
def test_sparse_matlab_with_places_that_are_none(old, new, message, tmp_path):
    matrix = sp.csc_matrix(([1.0, 2, 3, 4], [0, 1, 2, 2], [0, 1, 3, 4]), (3, 3))
    data = saved({"A": matrix})
    assert data.count(struct.pack("<4i", *old)) == 1
    broken = data.replace(struct.pack("<4i", *old), struct.pack("<4i", *new))
    assert message in said(tmp_path, "a.mat", broken)


# -- NumPy's archives ---------------------------------------------------------------------------


def archive(**arrays: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"indptr": [0, 2, 1, 3]}, "non-decreasing"),
        ({"indptr": [0, 1, 2, 2]}, "the last of 'indptr' is not the number of 'indices'"),
        ({"indices": [0, 1, 3]}, "indices must be < 3"),
        ({"indices": [0, -1, 2]}, "indices must be >= 0"),
        ({"indices": [0.0, 1.0, 2.0]}, "expected whole numbers in 'indices'"),
        ({"shape": [10**12, 10**12]}, "at most 10,000,000 rows"),
        ({"shape": [3, 4]}, "expected a square matrix, found 3 x 4"),
        ({"data": np.array([1, 2, None], dtype=object)}, "pickles"),
        ({"data": np.array([1.0, np.inf, 3.0])}, "not finite, the first in row 2, column 2"),
        ({"data": np.array([1.0, 2.0, 3.0 + 1j])}, "expected real values, found complex ones"),
        ({"data": np.array([1.0, 2.0])}, "same size"),
        ({"format": "xyz"}, "xyz"),
    ],
)
def test_arrays_that_are_no_matrix(changes, message, tmp_path):
    arrays = {"format": "csr", "shape": [3, 3], "indptr": [0, 1, 2, 3], "indices": [0, 1, 2]}
    good = {**arrays, "data": np.array([1.0, 2.0, 3.0])}
    np.testing.assert_array_equal(
        read(tmp_path, "a.npz", archive(**{**good, "format": b"csr"})), np.diag([1.0, 2.0, 3.0])
    )
    coded = {**good, **changes}
    coded["format"] = coded["format"].encode()
    assert message in said(tmp_path, "a.npz", archive(**coded))


def test_an_archive_whose_header_is_damaged_is_no_smaller_matrix(tmp_path):
    data = archive(A=np.arange(36.0).reshape(6, 6))
    assert data.count(b"(6, 6)") == 1
    assert "'A.npy' is damaged" in said(tmp_path, "a.npz", data.replace(b"(6, 6)", b"(4, 4)"))


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("kind", [np.asarray, sp.csc_matrix])
def test_recovery_matrices_need_not_be_square(version, kind, tmp_path):
    A = np.arange(12.0).reshape(6, 2)
    scipy.io.savemat(tmp_path / "a.mat", {"R": kind(A)}, format=version)
    np.savez(tmp_path / "a.npz", R=A)
    sp.save_npz(tmp_path / "sparse.npz", sp.csr_matrix(A))
    for name in ("a.mat", "a.npz", "sparse.npz"):
        np.testing.assert_array_equal(read_recovery(tmp_path / name).toarray(), A)


@pytest.mark.parametrize("kind", [">f8", ">f4", ">i4", "<f4"])
def test_arrays_of_any_byte_order(kind, tmp_path):
    A = np.arange(9.0).reshape(3, 3)
    np.savez(tmp_path / "a.npz", K=np.asfortranarray(A.astype(kind)))
    np.testing.assert_array_equal(read_matrix(tmp_path / "a.npz").toarray(), A)


def test_what_is_no_recovery_matrix(tmp_path):
    np.savez(tmp_path / "a.npz", R=np.arange(3.0))
    with pytest.raises(ModelError, match="expected a matrix, found 3"):
        read_recovery(tmp_path / "a.npz")
    scipy.io.savemat(tmp_path / "a.mat", {"R": np.zeros((2, 0))})
    with pytest.raises(ModelError, match="expected a matrix, found 2 x 0"):
        read_recovery(tmp_path / "a.mat")
