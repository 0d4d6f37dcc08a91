"""squealstudy: batch parametric studies of brake squeal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from squealstudy.study.results import Results

__version__ = "0.2.0"
__all__ = ["__version__", "open_results"]


def open_results(path: Any) -> Results:
    """Open a results directory: ``.points`` and ``.modes`` tables, ``.rank()``.

    Imported on first use, so that ``import squealstudy`` stays light.
    """
    from squealstudy.study.results import Results

    return Results.open(path)
