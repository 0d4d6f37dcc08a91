"""The one cache: what can be made again, in folders that appear whole, read as memory maps.

A value is a dataclass or named tuple of arrays, sparse matrices, numbers, texts and other such
values: arrays are files of their own, all else stands in one JSON file beside them.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.engine.keys import content_hash
from squealstudy.engine.store import write_arrays
from squealstudy.paths import cache_directory
from squealstudy.reduction.prepared import PreparedFamily, PreparedModel
from squealstudy.study.design import DesignPoint

META = "meta.json"
FORMAT = 2  # of a folder: what an earlier version wrote is made again
CSR = ("data", "indices", "indptr")
Prepared = PreparedModel | PreparedFamily


# -- values in folders ---------------------------------------------------------------------------
def is_whole(folder: Path) -> bool:
    """Whether a folder holds a value, every array in its full size."""
    try:
        meta = json.loads((folder / META).read_text(encoding="utf-8"))
        sizes = meta["files"]
        return meta["format"] == FORMAT and all(
            (folder / name).stat().st_size == size for name, size in sizes.items()
        )
    except (OSError, ValueError, KeyError):
        return False


def save_value(folder: Path, value: Any) -> None:
    """Keep a value; the folder appears whole or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    arrays: dict[str, np.ndarray] = {}
    content: dict[str, Any] = {"format": FORMAT, "value": _packed(value, "", arrays)}
    for name, array in arrays.items():
        np.save(temporary / f"{name}.npy", array)
    sizes = {p.name: p.stat().st_size for p in sorted(temporary.iterdir())}
    (temporary / META).write_text(
        json.dumps({"format": FORMAT, **content, "files": sizes}), encoding="utf-8"
    )
    try:
        temporary.rename(folder)
    except OSError:  # another run was faster, or an unfinished folder is in the way
        if is_whole(folder):
            shutil.rmtree(temporary, ignore_errors=True)
        else:
            shutil.rmtree(folder, ignore_errors=True)
            temporary.rename(folder)


def load_value(folder: Path) -> Any:
    """Read a value; its arrays are read-only memory maps, which all workers share."""
    content = json.loads((folder / META).read_text(encoding="utf-8"))
    return _unpacked(content["value"], folder)


def _packed(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """A value as JSON, its arrays put aside under their names."""
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if sp.issparse(value):
        parts = [_packed(getattr(value, part), f"{name}.{part}", arrays) for part in CSR]
        return {"csr": parts, "shape": value.shape}
    if is_dataclass(value) or hasattr(value, "_fields"):
        kind = type(value)
        names = [f.name for f in fields(value)] if is_dataclass(value) else value._fields
        start = f"{name}." if name else ""
        content = {n: _packed(getattr(value, n), f"{start}{n}", arrays) for n in names}
        return {"class": [kind.__module__, kind.__qualname__], "fields": content}
    if isinstance(value, tuple):
        return {"tuple": [_packed(v, f"{name}.{i}", arrays) for i, v in enumerate(value)]}
    if isinstance(value, Mapping):
        return {"mapping": {str(k): _packed(v, f"{name}.{k}", arrays) for k, v in value.items()}}
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(found: Any, folder: Path) -> Any:
    if not isinstance(found, dict):
        return found
    if "array" in found:
        return np.asarray(np.load(folder / f"{found['array']}.npy", mmap_mode="r"))
    if "csr" in found:
        parts = tuple(_unpacked(part, folder) for part in found["csr"])
        return sp.csr_matrix(parts, shape=found["shape"])
    if "tuple" in found:
        return tuple(_unpacked(v, folder) for v in found["tuple"])
    if "mapping" in found:
        return {k: _unpacked(v, folder) for k, v in found["mapping"].items()}
    module, name = found["class"]
    kind = getattr(import_module(module), name)
    return kind(**{n: _unpacked(v, folder) for n, v in found["fields"].items()})


# -- prepared models -----------------------------------------------------------------------------
def prepared_path(key: str) -> Path:
    """Folder of the prepared model of that key, there or not."""
    return cache_directory() / "models" / key


def is_prepared(key: str) -> bool:
    """Whether the cache holds that model, whole."""
    return bool(key) and is_whole(prepared_path(key))


def save_prepared(key: str, prepared: Prepared) -> None:
    """Keep the prepared model of a structure or of a family of matrices."""
    save_value(prepared_path(key), prepared)


def load_any(key: str) -> Prepared:
    """The prepared model of a key, of an assembly or of a family of matrices."""
    prepared: Prepared = load_value(prepared_path(key))
    return prepared


def load_prepared(key: str) -> PreparedModel:
    """The prepared model of a structure; TypeError where the key is a family's."""
    prepared = load_any(key)
    if not isinstance(prepared, PreparedModel):
        raise TypeError(f"{key} is a family of matrices")
    return prepared


@lru_cache(maxsize=4)
def prepared_any(key: str) -> Prepared:
    """As `load_any`, read once a process."""
    return load_any(key)


@lru_cache(maxsize=4)
def prepared_model(key: str) -> PreparedModel:
    """As `load_prepared`, read once a process."""
    return load_prepared(key)


# -- working points, for later studies of the same model ----------------------------------------
@lru_cache(maxsize=4)
def _gaps(key: str) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for file in sorted(_gap_folder(key).glob("*.npz")):
        with np.load(file) as data:
            found.update(zip(data["keys"].tolist(), data["gaps"], strict=True))
    return found


def _gap_folder(key: str) -> Path:
    return prepared_path(key) / "working_points"


def known_gap(key: str, design: DesignPoint) -> np.ndarray | None:
    """Gaps (nc,) of the design's working point, where a study has solved it before."""
    return _gaps(key).get(working_point_key(design)) if design.has_working_point else None


class NewGaps:
    """Working points found by one chunk, to be kept for later studies."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, np.ndarray]] = {}

    def add(self, key: str, design: DesignPoint, gap: np.ndarray) -> None:
        """Remember the gaps of a design's working point, where it has one."""
        if design.has_working_point:
            self._found.setdefault(key, {})[working_point_key(design)] = gap

    def save(self, name: str) -> None:
        """Write them to the cache, under the name of the chunk."""
        for key, gaps in self._found.items():
            arrays = {"keys": np.array(list(gaps)), "gaps": np.stack(list(gaps.values()))}
            write_arrays(_gap_folder(key) / f"{name}.npz", arrays)
            _gaps(key).update(gaps)


def working_point_key(design: DesignPoint) -> str:
    """Hash of what a working point depends on beside its structure."""
    state = design.state()
    op = state.operating
    return content_hash(
        [
            [x if isinstance(x, str) else x.hex() for x in op.sliding_friction],
            float(op.brake_pressure).hex(),
            op.law.kind,
            [x.hex() for x in op.law.parameters],
            sorted((c, j, float(s).hex()) for (c, j), s in state.frequency_scale.items() if s != 1),
        ]
    )
