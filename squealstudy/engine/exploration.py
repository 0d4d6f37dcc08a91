"""Makes the page in which results are explored, to save or to show in a notebook."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from squealstudy.files import write_text

NOTEBOOK_HEIGHT = 900  # px


@dataclass(frozen=True)
class Exploration:
    """A page in which results are explored; a notebook shows it.

    Attributes
    ----------
    html : str
        The page.
    """

    html: str = field(repr=False)

    def save(self, path: str | Path) -> Path:
        """Write the page, over an existing file; returns its path."""
        write_text(Path(path), self.html)
        return Path(path)

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{NOTEBOOK_HEIGHT}px;border:1px solid #ccc"
        return f'<iframe title="results" style="{style}" srcdoc="{escape(self.html)}"></iframe>'
