"""Sparse matrices from files of the formats that finite-element codes write."""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from squealstudy.array_files import expect_room
from squealstudy.errors import ModelError
from squealstudy.files import read_whole
from squealstudy.models.matrices.dmig import SYMMETRIC, read_dmig
from squealstudy.models.matrices.entries import TRIANGLES_REL_TOLERANCE, check_size
from squealstudy.models.matrices.harwell_boeing import read_harwell_boeing
from squealstudy.models.matrices.labelled import LabelledMatrix, read_abaqus, read_calculix
from squealstudy.models.matrices.matlab import HDF5, MATLAB_5, Variable, variables, version_of
from squealstudy.models.matrices.matrix_market import read_matrix_market

Reader = Callable[[Path, str | None], Any]
ResultT = TypeVar("ResultT")
ABAQUS, NASTRAN = ".mtx", (".pch", ".bdf", ".dat", ".nas", ".blk")
INDEX_ARRAYS = ("indices", "indptr", "row", "col", "offsets")  # arrays of whole numbers of SciPy
MOST_ROWS_OP2 = 20_000  # a larger matrix takes more than 3.2 GB, as its reader stores all zeros
FORM_IN_TRAILER = 3  # of a matrix of OUTPUT2, from 0
NOT_STORED = (3, 8)  # forms of Nastran whose zeros are no zeros: diagonal, identity
MAX_LISTED_VARIABLES = 12  # most variables of a file in a message


def read_matrix(path: Path, variable: str | None = None) -> sp.csr_matrix:
    """Read a square real matrix from a file, whose ending says the format.

    ``.mtx`` (also ``.mtx.gz``, ``.mtx.bz2``) Matrix Market, ``.mat`` MATLAB up to version 7,
    ``.rb .hb .rsa .rua .psa .matrix`` and the like Harwell-Boeing, ``.sti .mas`` CalculiX,
    ``.op4`` and ``.op2`` Nastran (the extra ``op4``), ``.npz`` SciPy's `save_npz` or arrays by
    NumPy's `savez`.
    Symmetric storage is expanded. Entries at the same place are added up.

    Parameters
    ----------
    path : Path
    variable : str or None
        Which of several matrices; needed only if a MATLAB, NumPy or Nastran file has several.

    Returns
    -------
    csr_matrix (n, n) of float64

    Raises
    ------
    ModelError
        The file does not exist or is damaged; its ending or the variable is unknown; the matrix is
        empty or not square, or has complex or non-finite values.
    """
    reader = _reader(path)

    def matrix() -> sp.csr_matrix:
        with warnings.catch_warnings():  # SciPy's of sparse arrays to come: `_checked` takes both
            warnings.simplefilter("ignore", DeprecationWarning)
            return _checked(reader(path, variable))

    return _guarded(path, matrix)


def read_component_matrix(path: Path, name: str | None = None) -> sp.csr_matrix | LabelledMatrix:
    """A symmetric matrix of a component, as by `read_matrix`, or with nodes named in the file.

    The latter are ``.mtx`` of Abaqus, which do not begin as Matrix Market, and DMIG cards in
    ``.pch``, ``.bdf``, ``.dat``, ``.nas`` and ``.blk`` of Nastran. `name` is which of several.
    """
    ending = path.suffix.lower()
    if ending in NASTRAN:
        return _guarded(path, lambda: read_dmig(path, name))
    if ending == ABAQUS and not _guarded(path, lambda: _is_matrix_market(path)):
        _only_one(path, name)
        return _guarded(path, lambda: read_abaqus(path))
    return read_matrix(path, name)


def read_term_matrix(path: Path, name: str | None = None) -> sp.csr_matrix | LabelledMatrix:
    """A square matrix of a whole model, as by `read_matrix`, or DMIG cards, which name nodes.

    DMIG of a square form need not be symmetric: friction, for example, is a ``K2PP``.
    """
    if path.suffix.lower() in NASTRAN:
        return _guarded(path, lambda: read_dmig(path, name, square=True))
    return read_matrix(path, name)


def read_recovery(path: Path, name: str | None = None) -> sp.csr_matrix:
    """A real matrix of any shape from a ``.npz`` or ``.mat`` file; errors as in `read_matrix`."""
    reader = RECTANGULAR.get(path.suffix.lower())
    if reader is None:
        raise ModelError(f"{path}: expected a file {' or '.join(RECTANGULAR)}")
    return _guarded(path, lambda: _checked(reader(path, name, square=False), square=False))


def _is_matrix_market(path: Path) -> bool:
    with path.open("rb") as handle:
        return handle.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"%")


def _guarded(path: Path, read: Callable[[], ResultT]) -> ResultT:
    """Result of a reader of a file; ModelError for any error of the reader."""
    if not path.is_file():
        raise ModelError(f"there is no file {path}")
    try:
        return read()
    except ModelError:
        raise
    except MemoryError:
        raise ModelError(f"{path} does not fit into memory") from None
    except Exception as error:  # a damaged file is whatever its reader runs into
        raise ModelError(f"{path} cannot be read: {_said(error)}") from error


def _said(error: Exception) -> str:
    """Text of an error, with the type of the error where the text alone is not clear."""
    if isinstance(error, ValueError | OSError | zipfile.BadZipFile) and str(error):
        return str(error)
    return f"{type(error).__name__} {error}".strip()


def _reader(path: Path) -> Reader:
    """The function that reads files with the ending of this one."""
    name = path.name.lower()
    for endings, reader in READERS.items():
        if name.endswith(endings):
            return reader
    endings_read = " ".join([*(ending for endings in READERS for ending in endings), *NASTRAN])
    raise ModelError(
        f"{path}: unknown format '{path.suffix}', expected an ending of {endings_read}"
    )


def _matrix_market(path: Path, variable: str | None) -> Any:
    _only_one(path, variable)
    return read_matrix_market(path)


def _harwell_boeing(path: Path, variable: str | None) -> Any:
    _only_one(path, variable)
    return read_harwell_boeing(path)


def _calculix(path: Path, variable: str | None) -> Any:
    _only_one(path, variable)
    return read_calculix(path)


def _matlab(path: Path, variable: str | None, square: bool = True) -> Any:
    """A matrix of a MATLAB file."""
    content_bytes = read_whole(path)
    version = version_of(content_bytes)
    if version is None:  # before 5
        import scipy.io

        with np.errstate(invalid="ignore"):  # of indices that are none: refused below
            content = scipy.io.loadmat(io.BytesIO(content_bytes))
        return _chosen({k: v for k, v in content.items() if not k.startswith("__")}, path, variable)
    if version == HDF5:
        raise ModelError(f"{path}: a MATLAB 7.3 file; save it with '-v7'")
    if version != MATLAB_5:
        raise ValueError(f"unknown version {version} of MATLAB's format")
    variable_of: dict[str, Variable] = {}
    for matlab_variable in variables(content_bytes):
        if matlab_variable.name in variable_of:
            raise ModelError(f"{path} has two variables '{matlab_variable.name}'")
        variable_of[matlab_variable.name] = matlab_variable
    return _chosen(variable_of, path, variable).matrix(square)


def _npz(path: Path, variable: str | None, square: bool = True) -> Any:
    """A matrix of an .npz file of NumPy or SciPy."""
    expect_room(path)
    with zipfile.ZipFile(path) as archive:
        if damaged := archive.testzip():  # NumPy reads no further than a damaged header says
            raise ValueError(f"'{damaged}' is damaged")
    with np.load(path, allow_pickle=False) as content:
        if "format" not in content:
            return _chosen(content, path, variable)
        _only_one(path, variable)
        if "shape" in content:
            n_rows, n_columns = content["shape"].tolist()
            check_size(n_rows, n_columns, square)  # before SciPy makes room for it
        for name in INDEX_ARRAYS:
            if name in content and content[name].dtype.kind not in "iu":
                raise ValueError(f"expected whole numbers in '{name}'")
        if "indptr" in content and content["indptr"][-1] != len(content["indices"]):
            raise ValueError("the last of 'indptr' is not the number of 'indices'")
    return sp.load_npz(path)


def _op4(path: Path, variable: str | None) -> Any:
    """A matrix of an OP4 file of Nastran."""
    try:
        with np.printoptions():  # which importing it changes for the whole program
            from pyyeti.nastran import op4
    except ImportError:
        raise ModelError(f"{path}: OP4 needs pyyeti: pip install 'squealstudy[op4]'") from None
    names, matrices, forms, _ = op4.load(str(path), into="list", sparse=True)
    if len(set(names)) < len(names):
        raise ModelError(f"{path} has two matrices of one name")
    small_name = (
        None if variable is None else variable.lower()
    )  # its reader's names are in small ones
    form_of = zip(matrices, forms, strict=True)
    return _of_form(*_chosen(dict(zip(names, form_of, strict=True)), path, small_name))


def _op2(path: Path, variable: str | None) -> Any:
    """A matrix of an OP2 file of Nastran."""
    try:
        with np.printoptions():  # which importing it changes for the whole program
            from pyyeti.nastran import op2
    except ImportError:
        raise ModelError(f"{path}: OP2 needs pyyeti: pip install 'squealstudy[op4]'") from None
    file = op2.OP2(str(path))
    blocks = [block for block in file.dblist if block.dbtype == 1]
    block_of = {block.name: block for block in blocks}
    if len(block_of) < len(blocks):
        raise ModelError(f"{path} has two matrices of one name")
    capital_name = None if variable is None else variable.upper()
    block = _chosen(block_of, path, capital_name)
    check_size(*block.size)  # its reader makes room for all entries, zeros among them
    if (rows := block.size[0]) > MOST_ROWS_OP2:
        raise ModelError(
            f"{path}: '{block.name}' has {rows:,} rows, expected at most {MOST_ROWS_OP2:,} in an "
            "OP2 file: write OP4"
        )
    return _of_form(file.rdop2mats([block.name])[block.name], block.trailer[FORM_IN_TRAILER])


def _of_form(A: Any, form: int) -> Any:
    """A matrix of Nastran; ValueError where it is not as stored, or not as its form says."""
    if form in NOT_STORED:
        raise ValueError(f"expected a square or symmetric matrix, found form {form}")
    if form == SYMMETRIC and A.shape[0] == A.shape[1]:
        difference, size = (abs(sp.coo_matrix(part)).max() for part in (A - A.T, A))
        if difference > TRIANGLES_REL_TOLERANCE * size:
            raise ValueError(
                f"by its form ({form}) it is symmetric, by its entries it is not: "
                "expected both triangles"
            )
    return A


READERS: dict[tuple[str, ...], Reader] = {
    (".mtx", ".mtx.gz", ".mtx.bz2"): _matrix_market,
    (".mat",): _matlab,
    (".npz",): _npz,
    (".rb", ".hb", ".rsa", ".rua", ".rza", ".psa", ".pua", ".matrix"): _harwell_boeing,
    (".sti", ".mas"): _calculix,
    (".op4",): _op4,
    (".op2",): _op2,
}


# readers of matrices that need not be square
RECTANGULAR: dict[str, Callable[..., Any]] = {".npz": _npz, ".mat": _matlab}


def _only_one(path: Path, variable: str | None) -> None:
    if variable is not None:
        raise ModelError(f"{path} holds one matrix without a name: leave out the variable")


def _chosen(content: Mapping[str, Any], path: Path, variable: str | None) -> Any:
    """The variable of a name, or the only one; ModelError where that is not possible."""
    listed = ", ".join(list(content)[:MAX_LISTED_VARIABLES]) + (
        ", ..." if len(content) > MAX_LISTED_VARIABLES else ""
    )
    if variable is None and len(content) != 1:
        what = f"holds {len(content)} variables" + (f" ({listed})" if content else "")
        raise ModelError(f"{path} {what}: expected the name of one")
    name = next(iter(content)) if variable is None else variable
    if name not in content:
        raise ModelError(f"{path} has no variable '{name}', its variables are {listed or 'none'}")
    return content[name]


def _checked(A: Any, square: bool = True) -> sp.csr_matrix:
    """`A` as csr_matrix of float64; ValueError where it is no matrix of finite real numbers."""
    if not (sp.issparse(A) or isinstance(A, np.ndarray)) or A.dtype.kind not in "biufc":
        raise ValueError(f"expected a matrix of numbers, found {type(A).__name__}")
    if A.ndim != 2:
        kind = "square matrix" if square else "matrix"
        raise ValueError(f"expected a {kind}, found {' x '.join(map(str, A.shape))}")
    check_size(A.shape[0], A.shape[1], square)
    if np.iscomplexobj(A):
        raise ValueError("expected real values, found complex ones")
    if hasattr(A, "check_format"):  # indices that SciPy would follow out of its arrays
        A.check_format(full_check=True)
    dense = isinstance(A, np.ndarray)  # SciPy takes no array of another byte order
    matrix = sp.csr_matrix(A.astype(float) if dense else A).astype(float)
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        wrong = sp.coo_matrix(matrix)
        wrong_entries = np.flatnonzero(~np.isfinite(wrong.data))
        first = f"row {wrong.row[wrong_entries[0]] + 1}, column {wrong.col[wrong_entries[0]] + 1}"
        raise ValueError(f"{len(wrong_entries)} values are not finite, the first in {first}")
    return matrix
