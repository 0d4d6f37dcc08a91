"""The manifest's file: read and written whole."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from squealstudy.engine.files import write_json
from squealstudy.errors import ResultsError

FILE = "manifest.json"


def read_manifest(directory: Path) -> dict[str, Any] | None:
    """The manifest of a results directory, None where there is none; ResultsError if damaged."""
    path = directory / FILE
    if not path.is_file():
        return None
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: not a readable manifest ({error})") from error
    if not isinstance(content, dict) or not {"name", "kind", "model"} <= set(content):
        raise ResultsError(f"{path}: not a manifest of squealstudy")
    return content


def version_of(manifest: dict[str, Any]) -> str:
    """The version of squealstudy that wrote it."""
    return str(manifest.get("versions", {}).get("squealstudy", "0"))


def write_manifest(directory: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest atomically."""
    write_json(directory / FILE, manifest)
