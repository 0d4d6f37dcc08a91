"""Makes the content hashes that name structures, design points and chunks of points."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from squealstudy.version import PACKAGE_FOLDER

# code on which reductions and results depend
NUMERIC_PACKAGES = (
    "laws",
    "parameter.py",
    "kernels",
    "linalg",
    "models",
    "reduction",
    "system",
    "modes",
    "stacked",
    "motion",
    "mechanics",
    "laboratory",
    "root_pairs.py",
    "study/components.py",
    "study/family.py",
)
HASH_DIGITS = 16
ID_TYPE = f"S{HASH_DIGITS}"  # type of arrays of ids
HOLE = "0xhole"  # a text that no value has
IDS_PER_BLOCK = 65536  # number of ids that are made at once


def content_hash(content: Any) -> str:
    """Hash of plain data (dicts in any order, floats by their exact value)."""
    text = json.dumps(content, sort_keys=True, default=str, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]


@cache
def source_hash(packages: tuple[str, ...] = NUMERIC_PACKAGES) -> str:
    """Hash of the numerical code, so that results of another version are not taken for this one's.

    FileNotFoundError for a missing file or folder: one that was renamed must not be left out.
    """
    root = PACKAGE_FOLDER
    digest = hashlib.sha256()
    for package in packages:
        folder = root / package
        if not folder.exists():
            raise FileNotFoundError(f"no source to hash: {folder}")
        for path in [folder] if folder.is_file() else sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:HASH_DIGITS]


def point_id(model_hash: str, values: Mapping[str, float]) -> str:
    """Identity of a design point: its model and its sorted parameters."""
    return content_hash([model_hash, sorted((k, float(v).hex()) for k, v in values.items())])


def point_ids(
    model_hash: str, values: Mapping[str, float], varied: Mapping[str, np.ndarray], count: int
) -> np.ndarray:
    """Identities (count,) of design points of one model, as `point_id` gives them one by one.

    Parameters
    ----------
    model_hash : str
    values : mapping of str -> float
        Values of all parameters; those of parameters in `varied` do not matter.
    varied : mapping of str -> ndarray (count,)
        Values of the parameters that vary.
    count : int
    """
    # the text that `point_id` hashes, with a hole for each varied value
    pairs = sorted((k, HOLE if k in varied else float(v).hex()) for k, v in values.items())
    first, *others = json.dumps([model_hash, pairs]).replace("%", "%%").split(HOLE)
    columns = [varied[k] for k, v in pairs if v == HOLE]
    head, tail = hashlib.sha256((first % ()).encode()), "".join(f"%s{text}" for text in others)
    if not columns:
        return np.full(count, head.hexdigest()[:HASH_DIGITS], dtype=ID_TYPE)
    ids = np.empty(count, dtype=ID_TYPE)
    for start in range(0, count, IDS_PER_BLOCK):
        rows = slice(start, start + IDS_PER_BLOCK)
        texts = zip(*(map(float.hex, x[rows].tolist()) for x in columns), strict=True)
        ids[rows] = [_ended(head, tail % text_values) for text_values in texts]
    return ids


def _ended(head: hashlib._Hash, text: str) -> str:
    """The hash of a text that ends with `text`; `head` is the hash object of its beginning."""
    digest = head.copy()
    digest.update(text.encode())
    return digest.hexdigest()[:HASH_DIGITS]
