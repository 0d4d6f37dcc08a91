"""Prepared models on disk, named by the hash of their content, read back as memory maps."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.paths import cache_directory
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.contact_space import ContactSpace
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.study.files import write_atomic

META = "meta.json"
ARRAYS = ("shape_basis", "sensor_shapes", "nominal_gap", "nominal_tangent")
PARTS = {"space": ContactSpace, "model": ReducedModel, "finer": ReducedModel}


def prepared_path(key: str) -> Path:
    """Directory of the prepared model of that key, there or not."""
    return cache_directory() / "models" / key


def is_prepared(key: str) -> bool:
    """Whether the cache holds that model, whole: every array there in its full size."""
    path = prepared_path(key)
    try:
        sizes = json.loads((path / META).read_text(encoding="utf-8"))["files"]
        return all((path / name).stat().st_size == size for name, size in sizes.items())
    except (OSError, ValueError, KeyError):
        return False


def save_prepared(key: str, prepared: PreparedModel) -> Path:
    """Store a prepared model; the directory appears whole or not at all."""
    scalars: dict[str, object] = {"timings": dict(prepared.timings)}
    arrays = {name: getattr(prepared, name) for name in ARRAYS}
    for part in PARTS:
        value = getattr(prepared, part)
        for f in fields(value) if value is not None else ():
            item = getattr(value, f.name)
            if isinstance(item, np.ndarray):
                arrays[f"{part}.{f.name}"] = item
            else:
                scalars[f"{part}.{f.name}"] = item
    return store(key, scalars, arrays)


def store(key: str, scalars: dict[str, object], arrays: Mapping[str, np.ndarray]) -> Path:
    """Write scalars and arrays under a key; the directory appears whole or not at all."""
    target = prepared_path(key)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{key}.", dir=target.parent))
    for name, array in arrays.items():
        np.save(temporary / f"{name}.npy", array)
    scalars["files"] = {p.name: p.stat().st_size for p in sorted(temporary.iterdir())}
    (temporary / META).write_text(json.dumps(scalars), encoding="utf-8")
    try:
        temporary.rename(target)
    except OSError:  # another run was faster, or an unfinished directory is in the way
        if not is_prepared(key):
            shutil.rmtree(target, ignore_errors=True)
            temporary.rename(target)
        else:
            shutil.rmtree(temporary, ignore_errors=True)
    return target


def load_prepared(key: str) -> PreparedModel:
    """Read a prepared model; arrays are read-only memory maps shared by all workers."""
    path = prepared_path(key)
    scalars = read_scalars(key)

    def part(name: str, kind: type) -> object:
        values = {}
        for f in fields(kind):
            file = path / f"{name}.{f.name}.npy"
            stored = scalars.get(f"{name}.{f.name}")
            values[f.name] = (
                np.load(file, mmap_mode="r")
                if file.is_file()
                else tuple(stored)
                if isinstance(stored, list)
                else stored
            )
        return kind(**values)

    space, model = part("space", ContactSpace), part("model", ReducedModel)
    assert isinstance(space, ContactSpace)
    assert isinstance(model, ReducedModel)
    finer = part("finer", ReducedModel) if (path / "finer.k_el.npy").is_file() else None
    assert finer is None or isinstance(finer, ReducedModel)
    return PreparedModel(
        space,
        model,
        **{name: np.load(path / f"{name}.npy", mmap_mode="r") for name in ARRAYS},
        timings=scalars["timings"],
        finer=finer,
    )


def read_scalars(key: str) -> dict[str, Any]:
    """What is stored under a key beside arrays; every prepared model has its `timings` there."""
    scalars: dict[str, Any] = json.loads((prepared_path(key) / META).read_text(encoding="utf-8"))
    return scalars


# -- working points ------------------------------------------------------------------------------
def load_gaps(key: str) -> dict[str, np.ndarray]:
    """Known working points of a prepared model: gaps (nc,) by the hash of their parameters."""
    found: dict[str, np.ndarray] = {}
    for file in sorted((prepared_path(key) / "working_points").glob("*.npz")):
        with np.load(file) as data:
            found.update(zip(data["keys"].tolist(), data["gaps"], strict=True))
    return found


def save_gaps(key: str, name: str, gaps: dict[str, np.ndarray]) -> None:
    """Keep working points of one chunk for later studies of the same model."""
    if not gaps:
        return
    path = prepared_path(key) / "working_points" / f"{name}.npz"
    keys, values = np.array(list(gaps)), np.stack(list(gaps.values()))

    def write(temporary: Path) -> None:
        with temporary.open("wb") as handle:
            np.savez(handle, keys=keys, gaps=values)

    write_atomic(path, write)
