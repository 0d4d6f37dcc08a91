"""Results made of tables, as pictures and screens take them, and what a picture says."""

import hashlib
import json
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from squealstudy.engine.journal import JOURNAL
from squealstudy.engine.results import Results


def made(kind="complex_modes", units=None, directory=Path("made"), history=None, **tables):
    """Results of a kind with these tables; keyword `facts` replaces entries of the manifest."""
    facts = {
        "kind": kind,
        "model": "hulten",
        "units": units or {},
        "parameters": [],
        "sweeps": [],
        "nominal": {},
        "grid_shape": [],
        "band_hz": [1.0, 8000.0],
        "n_points": 1,
    } | tables.pop("facts", {})
    results = Results(directory, facts).with_tables(**tables)
    if history is not None:
        object.__setattr__(results, "history", lambda point: history)
    return results


def drawn(figure):
    """Render as a file would be; all texts that show."""
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def enter(directory: Path, path: Path) -> None:
    """A line of the journal for a changed file, as the one who changed it can write it."""
    content = path.read_bytes()
    entry = [len(content), hashlib.sha256(content).hexdigest()]
    line = {"files": {path.relative_to(directory).as_posix(): entry}}
    with (directory / JOURNAL).open("a") as journal:
        journal.write(json.dumps(line) + "\n")
