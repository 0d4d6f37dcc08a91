"""Stores the names of tracks in a file beside the tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import BaseModel

from squealstudy.engine.store import Store
from squealstudy.files import (
    OF_JSON,
    file_hash,
    is_plain_file,
    read_whole,
    sealed,
    unsealed,
    write_text,
)

if TYPE_CHECKING:
    import pandas as pd

FILE = "names.json"


def keep_track_names(store: Store, table: pd.DataFrame) -> None:
    """Add names of tracks to the file beside the tables, for the legends of pictures."""
    named = {str(track): [str(r["name"]), bool(r["changes"])] for track, r in table.iterrows()}
    names_before = {str(t): list(v) for t, v in read_track_names(store).items()}
    content = {"modes": _identity(store), "tracks": names_before | named}
    write_text(store.directory / FILE, sealed(content))


class KeptNames(BaseModel):
    """Content of the file of names, checked.

    Attributes
    ----------
    modes : list of str
        Hashes of the table of modes.
    tracks : dict of int -> (str, bool)
        Name of each track, and whether it changes along the track.
    """

    modes: list[str]
    tracks: dict[int, tuple[str, bool]]


def read_track_names(store: Store) -> dict[int, tuple[str, bool]]:
    """Name of each track that has one, and whether it changes; empty where the modes are others."""
    path = store.directory / FILE
    if not is_plain_file(path):
        return {}
    try:
        content = KeptNames.model_validate(unsealed(read_whole(path, OF_JSON)))
    except ValueError:
        return {}  # damaged: it is written again with the next names
    return content.tracks if content.modes == _identity(store) else {}


def _identity(store: Store) -> list[str]:
    """Hashes of the table of modes, which numbers the tracks."""
    entries = store.journal.entries
    names = store.parts("modes.parquet")
    return sorted(  # results of earlier versions have no journal, a damaged journal lacks lines
        entries[name].sha256 if name in entries else file_hash(store.directory / name)
        for name in names
    )
