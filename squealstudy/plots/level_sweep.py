"""Level, frequency and modal energies of the vibration over a swept parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.analysis.tables.energy_ranking import transient_parameters
from squealstudy.analysis.tables.run_classes import LASTING
from squealstudy.plots.level_panels import draw_frequencies, draw_levels, draw_means
from squealstudy.plots.share_bars import share_bars
from squealstudy.plots.style import (
    Quantity,
    empty_figure,
    finish,
    new_figure,
    plural,
    quantity,
    set_ticks,
)
from squealstudy.plots.tables import describe, slice_points

NAMED = 36  # design points that have room for their names


def level_sweep(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    along: str | None = None,
    fixed: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """RMS, mean and frequency of the torque over a study, and which modes have the energy.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a transient study.
    along : str or None
        A varied parameter; None: all design points in their order, named by what they change of
        the first.
    fixed : mapping of parameter -> value or None
        The line to show; of what is left open, the line with most vibrating points is taken.
    units : mapping of parameter -> unit, or None
        ``torque`` too: N m, or N of a friction force.

    Raises
    ------
    ResultsError
        For an unknown parameter, or a value that the study does not have.
    """
    if not len(points):
        return empty_figure("no design points")
    line = points if along is None else sweep_line(points, along, fixed)
    failed = (line["status"] != "ok").to_numpy(bool)
    if failed.all():
        reasons = ", ".join(sorted(set(line["status"])))
        return empty_figure(f"{plural(len(line), 'point')}, all failed: {reasons}")
    width = 9.0 if along is not None else float(np.clip(2.0 + 0.6 * len(line), 9.0, 24.0))
    figure = new_figure(width, 9.2)
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[1.7, 1.0, 1.0, 1.7])
    shown = None if along is None else quantity(along, points[along], units)
    x = np.arange(1.0, len(line) + 1) if shown is None else shown.scaled(line[shown.name])
    log = shown is not None and shown.log
    if log:
        axes[0].set_xscale("log")
    draw_levels(axes[0], x, line, shown is not None, units)
    draw_means(axes[1], x, line, shown is not None, units)
    draw_frequencies(axes[2], x, line)
    share_bars(axes[3], x, line, modes, log)
    _failed(axes[:3], x[failed])
    _abscissa(axes[3], x, line, shown, units)
    _legend(axes[3])
    others = [n for n in transient_parameters(points, varied=True) if n != along]
    where = "" if along is None else describe(line.iloc[0], points, others, units)
    figure.suptitle(_title(where, line), fontsize=9.5)
    return figure


def sweep_line(
    points: pd.DataFrame, along: str, fixed: Mapping[str, float] | None = None
) -> pd.DataFrame:
    """Rows of the points table along a parameter, ascending; ResultsError."""
    names = transient_parameters(points)
    if len(points) == 1 and along in names:
        return points
    lasting = points.loc[points["class"].isin(LASTING), ["point_id"]].assign(unstable=True)
    chosen, _ = slice_points(points[["point_id", "status", *names]], lasting, (along,), fixed)
    return points.loc[chosen.index].sort_values(along, kind="stable")


def design_names(points: pd.DataFrame, units: Mapping[str, str] | None = None) -> list[str]:
    """What each design point changes of the first, a line a parameter."""
    names, first = transient_parameters(points, varied=True), points.iloc[0]
    texts = []
    for _, row in points.iterrows():
        changed = [n for n in names if row[n] != first[n]]
        shown = [quantity(n, points[n], units).text(row[n]) for n in changed]
        texts.append("\n".join(shown) or "as the first")
    return ["first", *texts[1:]]


def _abscissa(
    axes: Axes,
    x: np.ndarray,
    line: pd.DataFrame,
    shown: Quantity | None,
    units: Mapping[str, str] | None,
) -> None:
    """Ticks and label of what the picture is drawn over."""
    if shown is None:
        style: dict[str, Any] = {"rotation": 90, "fontsize": 7.5}
        every = -(-len(x) // NAMED)
        axes.set_xticks(x[::every], design_names(line, units)[::every], **style)
    else:
        set_ticks(axes.xaxis, shown, line[shown.name])
    if len(x) == 1 and not (shown is not None and shown.log):
        axes.set_xlim(x[0] - 1.5, x[0] + 1.5)
    finish(axes, "" if shown is None else shown.label, "Energy share [%]")
    axes.grid(False, axis="x")


def _legend(axes: Axes) -> None:
    """Names of the modes beneath all panels."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        style: dict[str, Any] = {"ncols": 4, "fontsize": 8.5, "frameon": False}
        axes.figure.legend(handles, labels, loc="outside lower center", **style)


def _failed(rows: np.ndarray, x: np.ndarray) -> None:
    """Crosses at the foot of each panel where a point failed."""
    if not len(x):
        return
    for axes in rows:
        place: dict[str, Any] = {"clip_on": False, "transform": axes.get_xaxis_transform()}
        axes.plot(x, np.zeros(len(x)), "x", color="0.2", **place)


def _title(where: str, line: pd.DataFrame) -> str:
    failed = line[(line["status"] != "ok").to_numpy()]
    reasons = ", ".join(sorted(set(failed["status"])))
    parts = [where, f"{plural(len(failed), 'point')} failed (x): {reasons}" if len(failed) else ""]
    return "; ".join(part for part in parts if part)
