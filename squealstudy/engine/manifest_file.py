"""Reads, checks and writes the file of the manifest."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from squealstudy.engine.manifest_facts import MAX_BYTES, check_facts
from squealstudy.engine.result_names import MANIFEST
from squealstudy.errors import ResultsError
from squealstudy.files import (
    OF_JSON,
    SEAL,
    is_plain_file,
    read_whole,
    sealed,
    unsealed,
    write_text,
)

PICTURES = "pictures"  # key of the manifest: names of pictures in the results directory


def read_manifest(directory: Path) -> dict[str, Any] | None:
    """The manifest of a results directory, None where there is none; ResultsError if damaged."""
    path = directory / MANIFEST
    if not is_plain_file(path):
        return None
    if path.stat().st_size > MAX_BYTES:
        raise ResultsError(f"{path}: too long for a manifest")
    try:
        text = read_whole(path, OF_JSON)
        content: dict[str, Any] = json.loads(text)
        if SEAL in content:  # manifests of older versions have none
            content = unsealed(text)
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise ResultsError(f"{path}: not a readable manifest ({error})") from error
    if not isinstance(content, dict) or not {"name", "kind", "model"} <= set(content):
        raise ResultsError(f"{path}: not a manifest of squealstudy")
    check_facts(content, path)
    return content


def version_of(manifest: dict[str, Any]) -> str:
    """The version of squealstudy that wrote a manifest."""
    return str(manifest.get("versions", {}).get("squealstudy", "0"))


def write_manifest(directory: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a results directory, whole or not at all."""
    write_text(directory / MANIFEST, sealed(manifest))
