"""Pictures and moving pages of modes that `squealstudy shape` has written beside the results.

These files may come from anybody: only the numbers of a page are taken, never its script.
"""

from __future__ import annotations

import re
from base64 import b64encode
from pathlib import Path
from typing import TYPE_CHECKING

from squealstudy.engine.result_names import leads_out
from squealstudy.explore.points import Content
from squealstudy.shapes.page import made_again

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.results import Results

FOLDER = "shapes"
MOST_BYTES = 5_000_000  # bytes of all these files together
MOST_FILES = 1000  # files that are read
PNG = b"\x89PNG\r\n\x1a\n"
OF_A_MODE = re.compile(r"(T|mode_)(\d{1,6})(?:_[\d_e+-]+_hz)?_([0-9a-f]{16})\.(png|html)")


def shapes_content(results: Results, points: pd.DataFrame) -> tuple[Content, int]:
    """Pictures and pages by design point and mode, and the number of files without room.

    Keys are ``ROW T23``, or ``ROW 12`` for a mode without a track; ROW is an index in `points`.
    """
    shapes: Content = {}
    room, n_without_room = MOST_BYTES, 0
    row_of_point = {point_id: row for row, point_id in enumerate(points["point_id"])}
    for path in sorted((results.directory / FOLDER).glob("*.*"))[:MOST_FILES]:
        named = OF_A_MODE.fullmatch(path.name)
        if (
            named is None
            or named[3] not in row_of_point
            or leads_out(results.directory, _below(path))
        ):
            continue
        size = path.stat().st_size if path.is_file() else 0
        if size > room:
            n_without_room += 1
            continue
        text = _picture(path) if named[4] == "png" else _page(path)
        if text:
            room -= len(text)
            key = f"{row_of_point[named[3]]} {'T' if named[1] == 'T' else ''}{named[2]}"
            shapes.setdefault(key, {})[named[4]] = text
    return shapes, n_without_room


def _below(path: Path) -> str:
    return f"{FOLDER}/{path.name}"


def _picture(path: Path) -> str:
    """A picture in base64; empty if the file is no picture."""
    content = path.read_bytes()
    return b64encode(content).decode() if content.startswith(PNG) else ""


def _page(path: Path) -> str:
    return made_again(path.read_text(encoding="utf-8", errors="replace"))
