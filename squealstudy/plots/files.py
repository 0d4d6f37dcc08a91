"""Figures to files."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 130


def save_figure(figure: Figure, path: Path) -> None:
    """Write a PNG under a temporary name beside `path`, then rename: never half a picture.

    Missing directories are made. OSError where the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        figure.set_dpi(DPI)
        FigureCanvasAgg(figure).print_png(temporary)  # draws once; `savefig` draws twice
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
