"""Error against time per point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from squealstudy.engine.pictures import save_figure
from squealstudy.plots.style import COLOURS, MARKERS, finish, new_figure

Mark = tuple[str, float, float]  # rung, ms, error


def draw(marks: Sequence[Mark], title: str, error: str, path: Path) -> None:
    """A mark for each rung; rungs of a family, by the first word, share a colour."""
    figure = new_figure()
    axes = figure.subplots()
    families = list(dict.fromkeys(_family(name) for name, _, _ in marks))
    for number, family in enumerate(families):
        own = sorted((ms, max(e, 1e-16)) for name, ms, e in marks if _family(name) == family)
        style = {"color": COLOURS[number % 8], "marker": MARKERS[number % 8]}
        axes.plot(*zip(*own, strict=True), label=family, linewidth=1, **style)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title(title)
    axes.legend(fontsize=8)
    finish(axes, "time per point, ms", error)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


def _family(name: str) -> str:
    words = name.split()
    return " ".join(words[:2]) if words[0] in ("windows", "POD", "two-sided") else words[0]
