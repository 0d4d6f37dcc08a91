"""Least damping at every operating point: of today's design and of the chosen one."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.style import figure_at, finish, labelled, legend_below, whole_figure
from squealstudy.wording import plural, setting

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MOST_NAMED = 24  # operating points whose values are written beneath
CALLED = {  # name of the design that a study ends with, for outcomes without a proof
    "none_found": "comes nearest",
    "stopped": "last candidate, not proven",
    "unproven": "last candidate, not proven",
}


@register_plot(
    points=("design", "analysis", "min_damping_ratio"),
    designs=("cost", "chosen", "min_damping_ratio"),
)
def operating_matrix(results: Results, ax: Axes | None = None) -> Figure:
    """Least damping ratio at every operating point, of today's design and of the chosen one.

    Parameters
    ----------
    results : Results
        Of a design study.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("kicked_design")[0])
    >>> results = sq.run(study.with_({"variant": None}, friction=[0.5, 0.7]))
    >>> results.plot.operating_matrix().savefig("operation.png")
    """
    facts, points = results.fact("design_study"), results.points
    # where a design scatters, the analysis "roots" is of its samples
    analyses = ["modes", "roots"] if facts["probability"] is None else ["modes"]
    solved = points[points["analysis"].isin(analyses).to_numpy(bool)]
    names, number = list(facts["operating"]), int(facts["n_operating_points"])
    today = solved[(solved["design"] == facts["today"]).to_numpy(bool)].iloc[:number]
    figure = figure_at(ax, 9.0, 5.4)
    axes = figure.subplots()
    style: dict[str, Any] = {"linestyle": "", "markersize": 6}
    axes.plot(range(len(today)), _percent(today), marker="s", color=DARK, label="today", **style)
    margin = 100.0 * float(facts["margin"])
    counts = [_below(today, margin, "today")]
    if facts["chosen"] not in (None, facts["today"]):
        of_chosen = solved[(solved["design"] == facts["chosen"]).to_numpy(bool)]
        of_chosen = of_chosen.drop_duplicates(names) if names else of_chosen.iloc[:1]
        chosen = today[names].merge(of_chosen, on=names, how="left") if names else of_chosen
        look: dict[str, Any] = {"marker": "*", "color": COLOURS[1], **style, "markersize": 11}
        axes.plot(range(len(chosen)), _percent(chosen), label=chosen_word(facts), **look)
        counts.append(_below(chosen, margin, chosen_word(facts)))
    axes.axhline(margin, color=DARK, linewidth=0.8, linestyle="--", label="margin")
    if len(today) <= MOST_NAMED and names:
        texts = [_text(row, names, results) for row in today[names].to_dict("records")]
        axes.set_xticks(range(len(today)), texts, rotation=90 if len(today) > 6 else 0, fontsize=8)
    finish(axes, "Operating point" if len(today) > MOST_NAMED else "", "Least damping [%]")
    legend_below(figure, labelled(axes), 3)
    title = f"{plural(len(today), 'operating point')}, below the margin: {', '.join(counts)}"
    figure.suptitle(title, fontsize=9.5)
    return whole_figure(figure)


def chosen_word(facts: Mapping[str, Any]) -> str:
    """Name of the design that a study ends with."""
    if facts.get("failure"):  # of operating points that every design needs
        return "not judged"
    return CALLED.get(facts["outcome"], "chosen")


def _below(points: pd.DataFrame, margin: float, name: str) -> str:
    """At how many points a design's damping is below the margin [%]."""
    percent = _percent(points)
    unsolved = int(np.isnan(percent).sum())
    also = f" ({unsolved} without a value)" if unsolved else ""
    return f"{name} {int((percent < margin).sum())}{also}"


def _percent(points: pd.DataFrame) -> np.ndarray:
    percent: np.ndarray = 100.0 * points["min_damping_ratio"].to_numpy(float)
    return percent


def _text(row: Mapping[Hashable, Any], names: list[str], results: Results) -> str:
    parts = (setting(n, row[n], results.units.get(n, "")) for n in names)
    return "\n".join(parts)
