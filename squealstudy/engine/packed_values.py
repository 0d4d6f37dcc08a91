"""Values of the cache as JSON and named arrays, and back; only the classes of CLASSES."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

# classes of values; a cache may be shared, and its content must not create any others
CLASSES = {
    f"squealstudy.{name}"
    for name in (
        "kinds.complex_modes.reduction_errors.ReductionErrors",
        "models.matrices.expression.Expression",
        "models.matrices.family.FamilyTerm",
        "models.matrices.family.MatrixFamily",
        "modes.reanalysis.polynomials.CollocatedSystem",
        "modes.reanalysis.polynomials.ExpandedWeights",
        "modes.reanalysis.sweep_basis.SweepBasis",
        "motion.shared_modes.Training",
        "reduction.cmt.Expansion",
        "reduction.cmt.ReducedModel",
        "reduction.contact_space.ContactRows",
        "reduction.contact_space.ContactSpace",
        "reduction.hybrid.HybridBasis",
        "reduction.hybrid.HybridModel",
        "reduction.hybrid.Superelement",
        "reduction.prepared.PreparedFamily",
        "reduction.prepared.PreparedModel",
        "reduction.shared_basis.SharedBasis",
    )
}
CSR = ("data", "indices", "indptr")
MOST_INLINE = 64  # larger arrays are not in the JSON; those of minimal models are smaller
INLINE_CODES = {"float64": "f8", "int64": "i8", "int32": "i4", "bool": "?"}


def packed(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """A value as JSON; its large arrays are put into `arrays` under their names."""
    if isinstance(value, np.ndarray):
        code = INLINE_CODES.get(value.dtype.name)
        if code and value.size <= MOST_INLINE and np.isfinite(value).all():
            return {"entries": value.ravel().tolist(), "type": code, "shape": value.shape}
        arrays[name] = value
        return {"array": name}
    if sp.issparse(value):
        parts = [packed(getattr(value, part), f"{name}.{part}", arrays) for part in CSR]
        return {"csr": parts, "shape": value.shape}
    if is_dataclass(value) or hasattr(value, "_fields"):
        kind = type(value)
        names = [f.name for f in fields(value)] if is_dataclass(value) else value._fields
        start = f"{name}." if name else ""
        content = {n: packed(getattr(value, n), f"{start}{n}", arrays) for n in names}
        return {"class": f"{kind.__module__}.{kind.__qualname__}", "fields": content}
    if isinstance(value, tuple):
        return {"tuple": [packed(v, f"{name}.{i}", arrays) for i, v in enumerate(value)]}
    if isinstance(value, Mapping):
        return {"mapping": {str(k): packed(v, f"{name}.{k}", arrays) for k, v in value.items()}}
    return value.item() if isinstance(value, np.generic) else value


def check_classes(content: Any) -> None:
    """Raise ValueError where packed content names a class that no value may have."""
    if isinstance(content, dict):
        if "class" in content and content["class"] not in CLASSES:
            raise ValueError(f"{content['class']} is not a class of the cache's values")
        content = list(content.values())
    if isinstance(content, list):
        for part in content:
            check_classes(part)


def array_names(content: Any) -> set[str]:
    """Names of the array files that packed content refers to."""
    if isinstance(content, dict):
        own_name = {f"{content['array']}.npy"} if "array" in content else set()
        return own_name.union(*map(array_names, content.values()))
    return set().union(*map(array_names, content)) if isinstance(content, list) else set()


def unpacked(packed: Any, folder: Path, thoroughly: bool = False) -> Any:
    """The value of packed content; `thoroughly`: indices of sparse matrices are checked."""
    inner = partial(unpacked, folder=folder, thoroughly=thoroughly)
    if not isinstance(packed, dict):
        return packed
    if "array" in packed:
        path = folder / f"{packed['array']}.npy"
        return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
    if "entries" in packed:
        return _inline_array(packed["entries"], packed["type"], packed["shape"])
    if "csr" in packed:
        matrix = sp.csr_matrix(tuple(map(inner, packed["csr"])), shape=packed["shape"])
        if thoroughly:  # compiled code uses indices unchecked
            matrix.check_format(full_check=True)
        return matrix
    if "tuple" in packed:
        return tuple(map(inner, packed["tuple"]))
    if "mapping" in packed:
        return {k: inner(v) for k, v in packed["mapping"].items()}
    module, _, name = packed["class"].rpartition(".")
    kind = getattr(import_module(module), name)
    return kind(**{n: inner(v) for n, v in packed["fields"].items()})


def _inline_array(entries: Any, code: Any, shape: Any) -> np.ndarray:
    """An array from the JSON, read-only like memory maps; ValueError for another type."""
    if code not in INLINE_CODES.values():
        raise ValueError(f"{code} is no type of arrays in a value's JSON")
    array: np.ndarray = np.array(entries, dtype=code).reshape(tuple(shape))
    array.flags.writeable = False
    return array
