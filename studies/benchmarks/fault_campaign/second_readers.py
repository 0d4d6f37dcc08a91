"""Second readers of matrix files: slow, plain, sharing nothing with the package's.

Each gives the matrix that a file holds, or None where the file is not as its format has it.
"""

from __future__ import annotations

import bz2
import gzip
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

REAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([EeDd][+-]?[0-9]+)?")
SMALL = 1000  # rows that the campaign's files have at most

Matrix = np.ndarray | None


def real(word: str) -> float:
    """A number, of Fortran too; ValueError for anything else."""
    if not REAL.fullmatch(word):
        raise ValueError(word)
    value = float(word.upper().replace("D", "E"))
    if not np.isfinite(value):
        raise ValueError(word)
    return value


def whole(word: str) -> int:
    """A whole number; ValueError for anything else."""
    if not re.fullmatch(r"[+-]?[0-9]+", word):
        raise ValueError(word)
    return int(word)


def filled(entries: list[tuple[int, int, float]], n: int, symmetry: str) -> np.ndarray:
    """The matrix of entries whose places count from 1."""
    A = np.zeros((n, n))
    sides = {i < j for i, j, _ in entries if i != j}
    if symmetry != "general" and len(sides) > 1:
        raise ValueError("both triangles")
    for i, j, value in entries:
        if not (1 <= i <= n and 1 <= j <= n):
            raise ValueError("outside")
        A[i - 1, j - 1] += value
        if symmetry == "symmetric" and i != j:
            A[j - 1, i - 1] += value
        if symmetry == "skew-symmetric":
            if i == j and value:
                raise ValueError("diagonal")
            A[j - 1, i - 1] -= value if i != j else 0.0
    return A


def market(path: Path, _: str | None) -> Matrix:
    """Matrix Market, compressed or not."""
    opener: Any = {".gz": gzip.open, ".bz2": bz2.open}.get(path.suffix, open)
    with opener(path, "rb") as handle:
        text = handle.read().decode("utf-8-sig", errors="replace")
    lines = [line.strip() for line in re.split(r"\r\n|\r|\n", text)]
    try:
        banner = lines[0].lower().split()
        if banner[0] not in ("%%matrixmarket", "%matrixmarket") or banner[1] != "matrix":
            return None
        layout, kind, symmetry = banner[2:]
        at = 1
        while not lines[at] or lines[at].startswith("%"):
            at += 1
        sizes = [whole(word) for word in lines[at].split()]
        body = [line.split() for line in lines[at + 1 :] if line]
        number = whole if "integer" in kind else real
        if sizes[0] != sizes[1] or sizes[0] > SMALL or kind in ("pattern", "complex"):
            return None
        if layout == "coordinate":
            if len(sizes) != 3 or len(body) != sizes[2]:
                return None
            entries = [(whole(i), whole(j), float(number(value))) for i, j, value in body]
        else:
            after = {"general": -sizes[0], "symmetric": 0, "skew-symmetric": 1}[symmetry]
            places = [
                (i + 1, j + 1) for j in range(sizes[0]) for i in range(max(0, j + after), sizes[0])
            ]
            if len(sizes) != 2 or len(body) != len(places):
                return None
            entries = [
                (*place, float(number(value))) for place, (value,) in zip(places, body, strict=True)
            ]
        return filled(entries, sizes[0], symmetry)
    except (ValueError, IndexError, KeyError):
        return None


def harwell_boeing(path: Path, _: str | None) -> Matrix:
    """Harwell-Boeing as SciPy writes it: numbers apart from each other."""
    lines = path.read_text(errors="replace").split("\n")
    try:
        cards = [whole(word) for word in lines[1].split()[:4]]
        kind, words = lines[2][:3].upper(), lines[2][3:].split()
        symmetry = {"RUA": "general", "RSA": "symmetric", "RZA": "skew-symmetric"}[kind]
        rows, columns, entries = (whole(word) for word in words[:3])
        blocks, at = [], 4
        for taken in cards[1:]:
            blocks.append(" ".join(lines[at : at + taken]).split())
            at += taken
        pointers, indices = ([whole(word) for word in block] for block in blocks[:2])
        values = [real(word) for word in blocks[2]]
        counts = (len(pointers), len(indices), len(values))
        if (
            rows != columns
            or counts != (columns + 1, entries, entries)
            or "".join(lines[at:]).strip()
        ):
            return None
        if pointers[0] != 1 or pointers[-1] != entries + 1 or sorted(pointers) != pointers:
            return None
        places = [j + 1 for j in range(columns) for _ in range(pointers[j], pointers[j + 1])]
        return filled(list(zip(indices, places, values, strict=True)), rows, symmetry)
    except (ValueError, IndexError, KeyError):
        return None


def matlab(path: Path, variable: str | None) -> Any:
    """By SciPy, which may end the process."""
    try:
        return scipy.io.loadmat(path, variable_names=[variable])[variable]
    except Exception:
        return None


def archive(path: Path, variable: str | None) -> Matrix:
    """NumPy's archives: dense, or the arrays of a sparse matrix put together one by one."""
    try:
        with np.load(path, allow_pickle=False) as content:
            if variable is not None:
                return np.array(content[variable])
            return _put_together({name: content[name] for name in content.files})
    except Exception:
        return None


def _put_together(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """The matrix of the arrays of any of SciPy's formats; any exception where they do not fit."""
    kind, (n, m) = arrays["format"].item().decode(), arrays["shape"].tolist()
    A, data = np.zeros((n, m)), arrays["data"]
    if kind == "coo":
        for i, j, value in zip(arrays["row"], arrays["col"], data, strict=True):
            if min(i, j) < 0:
                raise ValueError("negative")
            A[i, j] += value
    elif kind == "dia":
        for offset, diagonal in zip(arrays["offsets"].tolist(), data, strict=True):
            for j, value in enumerate(diagonal):
                if 0 <= j - offset < n and j < m:
                    A[j - offset, j] += value
    else:
        _compressed(A, kind, arrays)
    return A


def _compressed(A: np.ndarray, kind: str, arrays: dict[str, np.ndarray]) -> None:
    """Add the entries of a csr, csc or bsr matrix."""
    data, indices, pointers = (arrays[name] for name in ("data", "indices", "indptr"))
    high, wide = data.shape[1:] if kind == "bsr" else (1, 1)
    lines = A.shape[1] if kind == "csc" else A.shape[0] // high
    if len(pointers) != lines + 1 or pointers[0] or len(indices) != len(data):
        raise ValueError("sizes")
    if pointers[-1] != len(indices) or (np.diff(pointers) < 0).any():
        raise ValueError("pointers")
    for line in range(lines):
        for k in range(pointers[line], pointers[line + 1]):
            if indices[k] < 0:
                raise ValueError("negative")
            i, j = (indices[k], line) if kind == "csc" else (line * high, indices[k] * wide)
            if i >= A.shape[0] or j >= A.shape[1]:
                raise ValueError("outside")
            A[i : i + high, j : j + wide] += data[k]


SECOND_READERS: dict[str, Callable[[Path, str | None], Any]] = {
    "mtx": market,
    "gz": market,
    "bz2": market,
    "rua": harwell_boeing,
    "mat": matlab,
    "npz": archive,
}
