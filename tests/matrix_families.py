"""Families of matrices as study files have them: a term a matrix, with its coefficient."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import scipy.sparse as sp

Terms = Mapping[str, tuple[str, object]]  # by name: matrix "M", "C" or "K", and its entries


def write_family(folder: Path, terms: Terms, coefficients: Mapping[str, str]) -> str:
    """Write the matrices into a folder; the text of the terms in a study file."""
    text = ""
    for name, (matrix, entries) in terms.items():
        sp.save_npz(folder / f"{name}.npz", sp.csr_matrix(np.atleast_2d(np.asarray(entries))))
        text += f'[[model.term]]\nmatrix = "{matrix}"\nfile = "{name}.npz"\n'
        text += f'coefficient = "{coefficients.get(name, "1")}"\n'
    return text
