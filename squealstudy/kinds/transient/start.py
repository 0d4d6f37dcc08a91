"""Where a run starts: the steady sliding state, or the final state of an earlier run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pyarrow.parquet as pq

from squealstudy.engine.store import POINTS, STATES, read_manifest
from squealstudy.errors import ResultsError
from squealstudy.kinds.transient.section import TransientSection
from squealstudy.study.source import SourceText

KEY = ("transient", "start")
POINT_KEY = ("transient", "start_point")


@dataclass(frozen=True)
class StartState:
    """A final state of an earlier run: its design point, its model, its file."""

    point_id: str
    prepared_key: str
    representation: str
    path: Path

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Deviation from steady sliding and velocity (n,) in component-mode coordinates."""
        with np.load(self.path) as data:
            return data["q"], data["v"]


def state_file(
    point_id: str, prepared_key: str, representation: str, q: np.ndarray, v: np.ndarray
) -> dict[str, dict[str, Any]]:
    """The final state of a design point by its path; component-mode coordinates (n,)."""
    content = {"q": q, "v": v, "prepared_key": prepared_key, "representation": representation}
    return {f"{STATES}/{point_id}.npz": content}


def find_start(section: TransientSection, source: SourceText) -> StartState | None:
    """The state a study continues; None where it starts from steady sliding.

    Raises
    ------
    StudyFileError
        Results that are missing, of another kind, or without that point's final state.
    """
    if not section.continued:
        return None
    directory = Path(section.start)
    try:
        manifest = read_manifest(directory)
    except ResultsError as error:
        raise source.error(KEY, str(error)) from None
    if manifest is None:
        raise source.error(
            KEY,
            f"expected 'working_point' or a results directory of a transient study, "
            f"'{section.start}' is none",
        )
    if manifest.get("kind") != "transient":
        raise source.error(
            KEY, f"'{section.start}' holds a {manifest.get('kind')} study, which has no final state"
        )
    known = _finished(directory)
    files = sorted((directory / STATES).glob("*.npz"))
    states = {path.stem: path for path in files if known is None or path.stem in known}
    path = _chosen(section, source, states)
    try:
        return _read(path)
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise source.error(KEY, f"{path} is no final state ({error})") from None


def _finished(directory: Path) -> set[str] | None:
    """Design points of the table that reached their end; None before there is a table."""
    if not (directory / POINTS).is_file():
        return None
    table = pq.read_table(directory / POINTS, columns=["point_id", "status"]).to_pylist()
    return {row["point_id"] for row in table if row["status"] == "ok"}


def _chosen(section: TransientSection, source: SourceText, states: dict[str, Path]) -> Path:
    wanted = section.start_point
    if not states:
        raise source.error(KEY, f"no design point of '{section.start}' has reached its end")
    if wanted is None and len(states) == 1:
        return next(iter(states.values()))
    if wanted is None:
        raise source.error(
            KEY,
            f"'{section.start}' has {len(states)} final states: name one by start_point, "
            f"for example '{next(iter(states))}'",
        )
    found = [path for name, path in states.items() if name.startswith(wanted)]
    if len(found) != 1:
        what = "is not unique" if found else "is not finished, failed, or is unknown"
        raise source.error(POINT_KEY, f"point '{wanted}' of '{section.start}' {what}")
    return found[0]


def _read(path: Path) -> StartState:
    with np.load(path) as data:
        return StartState(path.stem, str(data["prepared_key"]), str(data["representation"]), path)


def check_model(start: StartState, prepared_keys: set[str], section: TransientSection) -> str:
    """Why a state does not fit the models of a study; empty where it does."""
    if prepared_keys != {start.prepared_key}:
        return (
            f"'{section.start}' is of another model, basis, nominal point or pressure range "
            f"(reduction {start.prepared_key}, this study has {', '.join(sorted(prepared_keys))})"
        )
    if start.representation != section.representation:
        return f"'{section.start}' is {start.representation}, this study {section.representation}"
    return ""
