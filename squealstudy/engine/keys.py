"""Content hashes: of a structure, of a design point, of a chunk of points."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import squealstudy

# the code whose change changes a reduction or a result
NUMERIC_PACKAGES = (
    "laws",
    "parameter.py",
    "kernels",
    "linalg",
    "models",
    "reduction",
    "system",
    "modes",
    "motion",
    "laboratory",
    "root_pairs.py",
    "study/design.py",
    "study/family.py",
    "study/parameters.py",
)
LENGTH = 16


def content_hash(content: Any) -> str:
    """Hash of plain data (dicts in any order, floats by their exact value)."""
    text = json.dumps(content, sort_keys=True, default=str, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]


@cache
def source_hash(packages: tuple[str, ...] = NUMERIC_PACKAGES) -> str:
    """Hash of the numerical code: results of another version are never taken for this one's.

    FileNotFoundError for what is not there: a folder that was renamed must not hash to nothing.
    """
    root = Path(squealstudy.__file__).parent
    digest = hashlib.sha256()
    for package in packages:
        place = root / package
        if not place.exists():
            raise FileNotFoundError(f"no source to hash: {place}")
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:LENGTH]


def point_id(model_hash: str, values: Mapping[str, float]) -> str:
    """Identity of a design point: its model and its sorted parameters."""
    return content_hash([model_hash, sorted((k, float(v).hex()) for k, v in values.items())])


def chunk_id(point_ids: Iterable[str]) -> str:
    """Identity of a chunk: the points in it (which already name their model)."""
    return content_hash(sorted(point_ids))
