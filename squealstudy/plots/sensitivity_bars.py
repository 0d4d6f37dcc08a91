"""Sensitivities of one mode as bars: first-order change of growth beside the finite one."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.sensitivity_ranking import rank_sensitivities
from squealstudy.plots.style import COLOURS, UNSTABLE, empty_figure, finish, new_figure

HEIGHT = 0.36
HATCH = "////"
PREDICTED = "predicted_growth_change"


def sensitivity_bars(mode: pd.DataFrame, top: int = 20, title: str = "") -> Figure:
    """Predicted and finite change of the growth rate at each parameter's step, largest first.

    Parameters
    ----------
    mode : DataFrame
        Rows of one mode, `analysis.tables.sensitivity_ranking.mode_sensitivities`.
    top : int
        Parameters to show.
    title : str
        Second line, of the design point.
    """
    if not len(mode):
        return empty_figure("no mode, no sensitivities")
    shown = rank_sensitivities(mode, top)
    figure = new_figure(10.0, 1.9 + 0.36 * len(shown))
    axes = figure.add_subplot()
    place = np.arange(len(shown), dtype=float)
    hatches = [HATCH if near else "" for near in shown["near_coalescence"]]
    for offset, column, colour in (
        (-HEIGHT / 2, PREDICTED, COLOURS[1]),
        (HEIGHT / 2, "finite_growth_change", UNSTABLE),
    ):
        bars = axes.barh(place + offset, shown[column], height=HEIGHT, color=colour)
        for bar, hatch in zip(bars, hatches, strict=True):
            if hatch and column == PREDICTED:
                bar.set_hatch(hatch)
                bar.set_edgecolor("white")
    axes.axvline(0.0, color="0.2", linewidth=1.0)
    names = [f"{parameter_text(r)}   {step_text(r)}" for r in shown.to_dict("records")]
    axes.set_yticks(place, names)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    finish(axes, "Change of the growth rate [1/s]", "")
    axes.grid(False, axis="y")
    first = shown.iloc[0]
    head = f"mode at {in_digits(first['frequency_hz'])} Hz, growth rate "
    head += f"{in_digits(first['growth_rate'], 1)} 1/s, "
    head += f"condition {first['condition']:.1f}"
    if len(mode) > len(shown):
        head += f"; first {len(shown)} of {len(mode)} parameters"
    axes.set_title("\n".join(t for t in (head, title) if t), fontsize=9.5, loc="left")
    _legend(figure, any(hatches))
    return figure


def _legend(figure: Figure, hatched: bool) -> None:
    handles = [
        Patch(color=COLOURS[1], label="first order, from left and right vectors"),
        Patch(color=UNSTABLE, label="reanalysis"),
    ]
    if hatched:
        label = "near coalescence: the derivative means nothing"
        handles.append(Patch(facecolor=COLOURS[1], edgecolor="white", hatch=HATCH, label=label))
    figure.legend(handles=handles, loc="outside lower right", ncols=3, fontsize=9, frameon=False)


def parameter_text(row: Mapping[Hashable, Any]) -> str:
    """A parameter, with the frequency of its component mode."""
    name, frequency = str(row["parameter"]), float(row["component_frequency_hz"])
    return f"{name} ({in_digits(frequency)} Hz)" if np.isfinite(frequency) else name


def step_text(row: Mapping[Hashable, Any]) -> str:
    """A step in percent of the value; of damping ratios and from zero as it is."""
    change, value = float(row["change"]), float(row["value"])
    if value and not str(row["parameter"]).endswith("damping_ratio"):
        return f"{100 * change / abs(value):+.3g} %"
    return f"{change:+.3g} {row['unit']}".rstrip()
