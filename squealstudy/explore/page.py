"""Results as a page to explore them, in one file that needs no network."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.exploration import Exploration
from squealstudy.errors import ResultsError
from squealstudy.explore.complex_modes import modes_content
from squealstudy.explore.limit_cycles import cycles_content
from squealstudy.explore.points import Content, description, points_content, study_head
from squealstudy.explore.runs import runs_content
from squealstudy.explore.shapes import shapes_content
from squealstudy.tables.ranking_query import query
from squealstudy.tables.validity import said_first
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

FOLDER = Path(__file__).parent
LIBRARY = "bokeh"
EXTRA = "explore"
MOST_POINTS = 50_000  # design points of a page
# colour maps of Matplotlib for numbers above zero, below zero, and others; dark is far from zero
ABOVE, BELOW, PLAIN = "YlOrBr", "Blues", "viridis"
SHADES = 64  # colours of a map

Contents = Callable[["Results", pd.DataFrame], tuple[Content, list[Content]]]


@dataclass(frozen=True)
class KindPage:
    """What the page of one kind of study has: its content, and the script that shows it."""

    name: str
    table: str  # the table from which a selection takes rows
    content: Contents
    script: str


KINDS = {
    "complex_modes": KindPage("complex modes", "modes", modes_content, "modes.js"),
    "limit_cycles": KindPage("limit cycles", "cycles", cycles_content, "cycles.js"),
    "transient": KindPage("runs in time", "points", runs_content, "runs.js"),
}


def explore(results: Results, where: str | None = None) -> Exploration:
    """The page of results; `where` is a query over `points` that selects design points.

    Raises
    ------
    ResultsError
        Where Bokeh is missing, the kind has no page, a query cannot be used, or design points are
        too many or none.
    """
    kind = KINDS.get(results.kind)
    if kind is None:
        names = ", ".join(kind_page.name for kind_page in KINDS.values())
        raise ResultsError(
            f"{results.directory}: results of kind {results.kind} have no page to explore, which "
            f"is of {names}; squealstudy report shows them"
        )
    if find_spec(LIBRARY) is None:
        raise ResultsError(
            f"a page to explore needs Bokeh, which is missing: pip install 'squealstudy[{EXTRA}]'"
        )
    points = _chosen(results, where)
    if len(points) > MOST_POINTS:
        raise ResultsError(
            f"{results.directory}: a page holds {MOST_POINTS} design points, these are "
            f"{len(points)}: choose some, such as --where '{points.columns[4]} < 0.5'"
        )
    kind_content, measures = kind.content(results, points)
    shapes, n_without_room = shapes_content(results, points)
    content = {
        "kind": results.kind,
        "directory": str(results.directory),
        "where": " and ".join(f"({c.in_pandas})" for c in query(where, points.columns, ())),
        "study": study_head(results),
        "table": {"name": kind.table, "columns": results.columns(kind.table)},
        "points": points_content(results, points),
        "measures": measures,
        "own": kind_content,
        "shapes": shapes,
        "notes": [*_notes(results, points, kind_content), *_shapes_without_room(n_without_room)],
        "colours": COLOURS,
        "grey": GREY,
        "dark": DARK,
        "maps": {name: _shades(name) for name in (ABOVE, BELOW, PLAIN)},
    }
    figures = importlib.import_module("squealstudy.explore.figures")  # which needs the extra
    content["figures"] = figures.figures(results.kind)
    return Exploration(_filled(results, kind, content, figures.library()))


def _chosen(results: Results, where: str | None) -> pd.DataFrame:
    """Design points that a query selects, indexed by their rows in `points`."""
    points = results.points.reset_index(drop=True)
    for condition in query(where, points.columns, ()):
        points = points[condition.holds(points)]
    if not len(points):
        raise ResultsError(f"{results.directory}: no design point fits {where!r}")
    return points


def _shades(name: str) -> list[str]:
    """Colours of a map of Matplotlib, without the palest."""
    shades = mpl.colormaps[name](np.linspace(0.0 if name == PLAIN else 0.12, 1.0, SHADES))
    return [mpl.colors.to_hex(shade) for shade in shades]


def _notes(results: Results, points: pd.DataFrame, content: Content) -> Iterator[str]:
    """Notes on what the page leaves out."""
    if len(points) < len(results.points):
        yield f"{len(points)} of {plural(len(results.points), 'design point')} are on this page."
    if content.get("lightest") is not None:
        yield (
            f"{content['n']} of {content['n_all']} modes are on this page: those that "
            f"grow, and those of a damping ratio up to {content['lightest']:.3g}."
        )
    if content.get("left"):
        histories = plural(len(content["left"]), "history", "histories")
        yield f"{histories} found no room, or cannot be read."


def _shapes_without_room(n: int) -> list[str]:
    return [f"{plural(n, 'file')} of the folder shapes found no room."] if n else []


def _filled(results: Results, kind: KindPage, content: Content, library: str) -> str:
    """The page as HTML, with texts, content and scripts in the places of its template."""
    first = said_first(results.points) if "points" in results.tables else ""
    content_json = json.dumps(content, separators=(",", ":"), allow_nan=False)
    shown: dict[str, str] = {
        "title": escape(str(results.manifest.get("name", ""))),
        "question": escape(description(results)),
        "verdict": escape(f"{first} {results.screen.verdict(results)}".strip()),
        "kind": escape(f"{kind.name} of {results.manifest.get('model', '')}"),
        "style": _file("explore.css"),
        "library": library,
        "data": content_json.replace("<", "\\u003c"),
        "parts": _file(kind.script.replace(".js", ".html")),
        "script": "\n".join(_file(name) for name in ("page.js", "map.js", kind.script)),
    }
    pieces: Any = _file("explore.html").split("@@")  # text, name, text, ...: filled in once
    pieces[1::2] = [shown[name] for name in pieces[1::2]]
    return "".join(pieces)


def _file(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")
