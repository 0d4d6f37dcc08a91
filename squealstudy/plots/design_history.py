"""Course of a design study: damping over cost of every design that was evaluated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.operating_matrix import chosen_word
from squealstudy.plots.style import figure_at, finish, labelled, legend_below, whole_figure
from squealstudy.wording import figure as figure_text
from squealstudy.wording import plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


@register_plot(designs=("cost", "min_damping_ratio", "chosen", "meets_margin", "origin"))
def design_history(results: Results, ax: Axes | None = None) -> Figure:
    """Least damping ratio over cost, and over the order in which designs were evaluated.

    Designs of the scan were solved at a few operating points only: damping is the least there.

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
    >>> results.plot.design_history().savefig("designs.png")
    """
    designs = results.table("designs")
    scan = (designs["origin"] == "scan").to_numpy(bool)
    meets = designs["meets_margin"].fillna(False).to_numpy(bool)
    chosen = designs["chosen"].to_numpy(bool)
    today = (designs["origin"] == "today").to_numpy(bool)
    damping = 100.0 * designs["min_damping_ratio"].to_numpy(float)
    facts = results.fact("design_study")
    margin, targets = 100.0 * float(facts["margin"]), designs["origin"].str.startswith("target")
    alone = targets.to_numpy(bool) & ~scan
    others = ~scan & ~alone & ~chosen & ~today  # these have marks of their own
    figure = figure_at(ax, 9.0, 6.4)
    axes = figure.subplots(2, 1)
    groups: list[tuple[np.ndarray, dict[str, Any]]] = [
        (scan, {"marker": ".", "color": GREY, "label": "scan, at few operating points"}),
        (
            others & ~meets,
            {"marker": "o", "color": COLOURS[0], "label": "does not meet the demands"},
        ),
        (others & meets, {"marker": "o", "color": COLOURS[2], "label": "meets them"}),
        (alone, {"marker": "^", "color": COLOURS[3], "label": "targets alone"}),
        (today, {"marker": "s", "color": DARK, "label": "today"}),
        (
            chosen,
            {"marker": "*", "color": COLOURS[1], "markersize": 13, "label": chosen_word(facts)},
        ),
    ]
    for panel, x in zip(axes, (designs["cost"], designs["design"]), strict=True):
        for in_group, style in groups:
            if in_group.any():
                look = {"markersize": 5, "linestyle": "", "zorder": 3, **style}
                panel.plot(x.to_numpy(float)[in_group], damping[in_group], **look)
        panel.axhline(margin, color=DARK, linewidth=0.8, linestyle="--", label="margin")
        shown = damping[~scan & np.isfinite(damping)]
        if len(shown):
            room = 0.1 * max(np.ptp([*shown, margin]), 1e-3)
            panel.set_ylim(min(*shown, margin) - room, max(*shown, margin) + room)
    finish(axes[0], "Cost", "Least damping [%]")
    finish(axes[1], "Design", "Least damping [%]")
    axes[1].xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_below(figure, labelled(axes[0]), 3)
    title = plural(len(designs), "design")
    for row in designs[chosen].to_dict("records"):
        title += f"; {chosen_word(facts)}: cost {row['cost']:.4g}"
        title += f", least damping {figure_text(100.0 * row['min_damping_ratio'], '.3g')} %"
    figure.suptitle(title, fontsize=9.5)
    return whole_figure(figure)
