"""Panels of the picture of levels: torque RMS, mean torque and frequency, a mark a design point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from squealstudy.analysis.tables.run_classes import LASTING
from squealstudy.plots.over_time import friction_label
from squealstudy.plots.style import COLOURS, DARK, GREY, finish

CLASSES: dict[str, dict[str, Any]] = {
    "limit_cycle": {"marker": "o", "color": COLOURS[1]},
    "irregular": {"marker": "D", "color": COLOURS[3]},
    "growing": {"marker": "^", "color": COLOURS[0]},
    "undecided": {"marker": "s", "color": GREY, "markerfacecolor": "white"},
    "stable": {"marker": "o", "color": COLOURS[2], "markerfacecolor": "white"},
}
REMARKS = {"growing": " (not saturated)", "undecided": " (may decay or last)"}


def draw_levels(
    axes: Axes, x: np.ndarray, line: pd.DataFrame, joined: bool, units: Mapping[str, str] | None
) -> None:
    """RMS of torque or friction force with bounds, marked by class.

    Joined by a line where `x` is a scale.
    """
    rms = _where_ok(line, "torque_rms")
    if joined:
        axes.plot(x, rms, color=GREY, linewidth=0.9, zorder=1)
    for name, style in CLASSES.items():
        own = (line["class"] == name).to_numpy()
        if own.any():
            bounds = line.loc[own, ["torque_rms_low", "torque_rms_high"]].to_numpy(dtype=float).T
            reach = np.maximum(np.nan_to_num([rms[own] - bounds[0], bounds[1] - rms[own]]), 0.0)
            label = name.replace("_", " ") + REMARKS.get(name, "")
            bar: dict[str, Any] = {"linestyle": "", "capsize": 3, "markersize": 6, "label": label}
            axes.errorbar(x[own], rms[own], reach, **bar, **style)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    what, unit = friction_label(units)
    finish(axes, "", f"{what.capitalize()} RMS [{unit}]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8.5, frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=5)


def draw_means(
    axes: Axes, x: np.ndarray, line: pd.DataFrame, joined: bool, units: Mapping[str, str] | None
) -> None:
    """Mean torque or friction force beside that of steady sliding."""
    static, mean = (_where_ok(line, f"torque_{n}") for n in ("static", "mean"))
    joint = {"linestyle": "-.", "linewidth": 1.0} if joined else {"linestyle": "", "marker": "_"}
    own: dict[str, Any] = {"marker": "o", "markersize": 4, "color": COLOURS[1], "label": "mean"}
    axes.plot(x, static, color=DARK, markersize=15, label="static", **joint)
    axes.plot(x, mean, linewidth=1.2, linestyle="-" if joined else "", **own)
    what, unit = friction_label(units)
    finish(axes, "", f"{what.capitalize()} [{unit}]")
    axes.legend(fontsize=8.5, frameon=False, loc="best")


def draw_frequencies(axes: Axes, x: np.ndarray, line: pd.DataFrame) -> None:
    """Dominant frequency where there is a vibration, and of the predicted instability."""
    predicted = line["predicted_frequency_hz"].where(line["n_unstable"] > 0)
    axes.plot(
        x,
        predicted.to_numpy(dtype=float),
        linestyle="",
        marker="_",
        markersize=15,
        color=DARK,
        label="fastest predicted",
    )
    for name in LASTING:
        own = (line["class"] == name).to_numpy()
        found = line.loc[own, "dominant_frequency_hz"].to_numpy(dtype=float)
        if own.any():
            label = "" if any(c.get_label() == "dominant" for c in axes.get_lines()) else "dominant"
            axes.plot(x[own], found, linestyle="", markersize=5, label=label, **CLASSES[name])
    axes.margins(y=0.2)
    finish(axes, "", "Frequency [Hz]")
    axes.legend(fontsize=8.5, frameon=False, loc="best")


def _where_ok(line: pd.DataFrame, name: str) -> np.ndarray:
    """A column (n,), NaN where a point failed: what it had until then is no level."""
    values: np.ndarray = line[name].where(line["status"] == "ok").to_numpy(dtype=float)
    return values
