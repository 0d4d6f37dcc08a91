"""Prepared families of matrices on disk, beside prepared models of assemblies."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.models.expression import parse_expression
from squealstudy.models.matrix_family import FamilyTerm, MatrixFamily
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.study.cache import load_prepared, prepared_path, read_scalars, store

Prepared = PreparedModel | PreparedFamily
COEFFICIENTS = "coefficients"  # stored for families alone
CSR = ("data", "indices", "indptr")


def save_family(key: str, prepared: PreparedFamily) -> Path:
    """Store a prepared family; the directory appears whole or not at all."""
    terms = prepared.model.terms
    arrays = {f"{i}.{part}": getattr(t.matrix, part) for i, t in enumerate(terms) for part in CSR}
    scalars: dict[str, object] = {
        "timings": dict(prepared.timings),
        "n_roots": prepared.n_roots,
        "orders": [term.order for term in terms],
        COEFFICIENTS: [term.coefficient.text for term in terms],
    }
    return store(key, scalars, arrays | {"scale": prepared.scale, "shapes": prepared.shape_basis})


def load_family(key: str) -> PreparedFamily:
    """Read a prepared family; arrays are read-only memory maps shared by all workers."""
    scalars = read_scalars(key)

    def array(name: str) -> np.ndarray:
        found: np.ndarray = np.load(prepared_path(key) / f"{name}.npy", mmap_mode="r")
        return found

    scale = array("scale")
    shape = (len(scale), len(scale))
    terms = tuple(
        FamilyTerm(
            order,
            sp.csr_matrix(tuple(array(f"{i}.{part}") for part in CSR), shape=shape),
            parse_expression(text),
        )
        for i, (order, text) in enumerate(
            zip(scalars["orders"], scalars[COEFFICIENTS], strict=True)
        )
    )
    return PreparedFamily(
        MatrixFamily(terms), scale, array("shapes"), scalars["n_roots"], scalars["timings"]
    )


def load_any(key: str) -> Prepared:
    """The prepared model of a key, of an assembly or of a family."""
    return load_family(key) if COEFFICIENTS in read_scalars(key) else load_prepared(key)


@lru_cache(maxsize=4)
def prepared_any(key: str) -> Prepared:
    """The same, read once a process."""
    return load_any(key)
