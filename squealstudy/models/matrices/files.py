"""Sparse matrices from files of the formats that finite-element codes write."""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError

TYPE_LINE, FORMAT_LINE = 2, 3  # of the header, from 0; the first three letters are the type
SCALE_FACTOR = re.compile(r"\(\s*\d+P\s*,?", re.IGNORECASE)  # means nothing for E and D on input
SIGNS = {"s": 1.0, "z": -1.0, "u": 0.0}  # of the upper triangle: symmetric, skew, all stored


def read_harwell_boeing(path: Path) -> sp.csr_matrix:
    """A real assembled matrix (n, n); of symmetric and skew ones both triangles.

    Raises
    ------
    ModelError
        A pattern without values, a complex, Hermitian or unassembled matrix.
    ValueError, IndexError
        What SciPy's reader raises on a damaged file.
    """
    lines = path.read_text(encoding="ascii", errors="replace").splitlines(keepends=True)
    kind = lines[TYPE_LINE][:3].lower() if len(lines) > TYPE_LINE else ""
    if len(kind) != 3 or kind[0] not in "rp" or kind[1] not in SIGNS or kind[2] != "a":
        wanted = "a real assembled matrix (RSA, RUA, RZA)"
        raise ModelError(f"{path}: expected {wanted}, found type '{kind}'")
    if kind[0] == "p":
        raise ModelError(f"{path}: a pattern without values")
    lines[TYPE_LINE] = "RUA" + lines[TYPE_LINE][3:]
    numbers = "".join(lines[FORMAT_LINE:]).upper().replace("D", "E")  # Fortran's double exponent
    text = "".join(lines[:FORMAT_LINE]) + SCALE_FACTOR.sub("(", numbers)
    import scipy.io

    stored: Any = sp.csr_matrix(scipy.io.hb_read(io.StringIO(text)))
    if kind[1] == "u":
        return stored
    return (stored + SIGNS[kind[1]] * sp.tril(stored, -1).T).tocsr()


Reader = Callable[[Path, str | None], Any]
LISTED = 12  # variables of a file that a message names
UNREADABLE: tuple[type[Exception], ...] = (ValueError, TypeError, KeyError, IndexError, EOFError)
UNREADABLE += (OSError, OverflowError, NotImplementedError, zipfile.BadZipFile)


def read_matrix(path: Path, variable: str | None = None) -> sp.csr_matrix:
    """A square real matrix from a file; its ending says the format.

    ``.mtx`` (also ``.mtx.gz``, ``.mtx.bz2``) Matrix Market, ``.mat`` MATLAB up to version 7,
    ``.rb .hb .rsa .rua .psa`` and the like Harwell-Boeing, ``.npz`` SciPy's `save_npz` or arrays
    by NumPy's `savez`. Symmetric storage is expanded.

    Parameters
    ----------
    path : Path
    variable : str or None
        Which of several matrices; needed only where a MATLAB or NumPy file has several.

    Returns
    -------
    csr_matrix (n, n) of float64

    Raises
    ------
    ModelError
        An absent or damaged file, an unknown ending or variable, a matrix that is not square, has
        complex or non-finite values, or none.
    """
    if not path.is_file():
        raise ModelError(f"there is no file {path}")
    reader = _reader(path)
    try:
        with warnings.catch_warnings():  # SciPy's of sparse arrays to come: `_checked` takes both
            warnings.simplefilter("ignore", DeprecationWarning)
            found = reader(path, variable)
    except UNREADABLE as error:
        raise ModelError(f"{path} cannot be read: {error}") from error
    return _checked(found, path)


def _reader(path: Path) -> Reader:
    name = path.name.lower()
    for endings, reader in READERS.items():
        if name.endswith(endings):
            return reader
    known = " ".join(ending for endings in READERS for ending in endings)
    raise ModelError(f"{path}: unknown format '{path.suffix}', expected an ending of {known}")


def _matrix_market(path: Path, variable: str | None) -> Any:
    _only_one(path, variable)
    import scipy.io

    return scipy.io.mmread(path)


def _harwell_boeing(path: Path, variable: str | None) -> Any:
    _only_one(path, variable)
    return read_harwell_boeing(path)


def _matlab(path: Path, variable: str | None) -> Any:
    import scipy.io

    try:
        content = scipy.io.loadmat(path)
    except NotImplementedError:  # version 7.3 is HDF5
        raise ModelError(f"{path}: a MATLAB 7.3 file; save it with '-v7'") from None
    except scipy.io.matlab.MatReadError as error:
        raise ValueError(str(error)) from error
    return _chosen({k: v for k, v in content.items() if not k.startswith("__")}, path, variable)


def _npz(path: Path, variable: str | None) -> Any:
    with np.load(path, allow_pickle=False) as content:
        if "format" not in content:
            return _chosen(dict(content), path, variable)
    _only_one(path, variable)
    return sp.load_npz(path)


READERS: dict[tuple[str, ...], Reader] = {
    (".mtx", ".mtx.gz", ".mtx.bz2"): _matrix_market,
    (".mat",): _matlab,
    (".npz",): _npz,
    (".rb", ".hb", ".rsa", ".rua", ".rza", ".psa", ".pua"): _harwell_boeing,
}


def _only_one(path: Path, variable: str | None) -> None:
    if variable is not None:
        raise ModelError(f"{path} holds one matrix without a name: leave out the variable")


def _chosen(content: Mapping[str, Any], path: Path, variable: str | None) -> Any:
    """The variable asked for, or the only one."""
    listed = ", ".join(list(content)[:LISTED]) + (", ..." if len(content) > LISTED else "")
    if variable is None and len(content) != 1:
        what = f"holds {len(content)} variables" + (f" ({listed})" if content else "")
        raise ModelError(f"{path} {what}: expected the name of one")
    name = next(iter(content)) if variable is None else variable
    if name not in content:
        raise ModelError(f"{path} has no variable '{name}', its variables are {listed or 'none'}")
    return content[name]


def _checked(found: Any, path: Path) -> sp.csr_matrix:
    """`found` as csr of float64; ModelError where it is no square matrix of finite real numbers."""
    if not (sp.issparse(found) or isinstance(found, np.ndarray)) or found.dtype.kind not in "biufc":
        raise ModelError(f"{path}: expected a matrix of numbers, found {type(found).__name__}")
    if found.ndim != 2 or found.shape[0] != found.shape[1] or not found.shape[0]:
        size = " x ".join(map(str, found.shape))
        raise ModelError(f"{path}: expected a square matrix, found {size}")
    matrix = sp.csr_matrix(found)
    if np.iscomplexobj(matrix):
        raise ModelError(f"{path}: expected real values, found complex ones")
    matrix = matrix.astype(float)
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        raise ModelError(f"{path}: {int((~np.isfinite(matrix.data)).sum())} values are not finite")
    return matrix
