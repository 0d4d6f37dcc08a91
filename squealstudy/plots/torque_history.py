"""Braking torque over time with its phases, contact states and normal force beneath."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.engine.pictures import register_plot
from squealstudy.plots.over_time import (
    MS,
    column,
    friction_label,
    histories,
    number,
    outline,
    own_rows,
    point_row,
)
from squealstudy.plots.style import (
    COLOURS,
    DARK,
    empty_figure,
    finish,
    head,
    joined,
    labelled,
    legend_below,
    new_figure,
)
from squealstudy.wording import GROWING, STABLE, UNDECIDED, in_digits

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

PERIODS = 10  # of the dominant frequency that the zoom shows
STATES = {"stick": COLOURS[0], "slip": COLOURS[1], "open": COLOURS[2]}
SHADES = {"growth": COLOURS[4], "saturation": COLOURS[3], "limit cycle": COLOURS[2]}


@dataclass(frozen=True)
class Phase:
    """A part of a run, from `start` to `stop` [s]."""

    kind: str
    name: str
    start: float
    stop: float


@register_plot(histories, points=("class",), growth=("fit_start", "fit_stop"))
def torque_history(results: Results, point: str | int = 0) -> Figure:
    """Torque (or friction force), contact states and normal force of one run.

    Its last periods stand beside them.

    Parameters
    ----------
    results : Results
        Of a transient study.
    point : str or int
        Design point, as of ``Results.history``.

    Raises
    ------
    ResultsError
        Where there is no such point, or its history was not kept.
    """
    history, (row, title) = results.history(point), point_row(results, point)
    growth, units = results.growth, results.units
    if len(history) < 2:
        return empty_figure(f"no history of this design point{_status(row, '; ')}")
    figure = new_figure(11.5, 7.4)
    axes = figure.subplots(
        3, 2, sharex="col", sharey="row", width_ratios=[2.3, 1.0], height_ratios=[2.2, 1.0, 0.8]
    )
    found = phases(history, row, growth)
    for place, part in enumerate((history, _last_periods(history, row))):
        named = place == 0  # in the legend
        _torque(axes[0, place], part, row, named, units)
        _states(axes[1, place], part, named)
        _force(axes[2, place], part)
        axes[2, place].set_xlim(*_limits(part))
    for axis in axes[:, 0]:
        _shade(axis, found, axis is axes[0, 0])
    for axis in axes[:, 1]:
        axis.tick_params(labelleft=False)
        axis.set_ylabel("")
    _zoom_title(axes[0, 1], row, friction_label(units)[1])
    figure.suptitle(joined(title, _growth_text(row), by="\n"), fontsize=9.5)
    legend_below(figure, [handle for panel in axes[:, 0] for handle in labelled(panel)])
    return figure


def phases(history: pd.DataFrame, row: pd.Series, growth: pd.DataFrame) -> list[Phase]:
    """Exponential growth, saturation and limit cycle, as far as the run got."""
    end = float(column(history, "time")[-1])
    start, stop = _fit_window(row, growth)
    settled = number(row, "settled_time") if number(row, "settled") == 1 else np.nan
    found = []
    if np.isfinite(start) and stop > start:
        kind = "decay" if number(row, "growth_rate") < 0 else "growth"
        text = f"exponential {kind}, {MS * start:.3g} to {MS * stop:.3g} ms"
        found.append(Phase("growth", text, start, stop))
    until = settled if np.isfinite(settled) else end
    if np.isfinite(stop) and until > stop and row.get("class") != GROWING:
        text = f"saturation, to {MS * until:.3g} ms" if np.isfinite(settled) else "not settled"
        text = UNDECIDED if row.get("class") == UNDECIDED else text
        found.append(Phase("saturation", text, stop, until))
    if np.isfinite(settled) and settled < end and row.get("class") != STABLE:
        found.append(Phase("limit cycle", f"settled from {MS * settled:.3g} ms", settled, end))
    return found


def _fit_window(row: pd.Series, growth: pd.DataFrame) -> tuple[float, float]:
    """Start and end [s] of the fit of the fastest mode that has one; NaN without."""
    own = own_rows(growth, row)
    own = own[own["fitted_growth_rate"].notna().to_numpy()].sort_values("mode", kind="stable")
    if not len(own):
        return np.nan, np.nan
    return number(own.iloc[0], "fit_start"), number(own.iloc[0], "fit_stop")


def _last_periods(history: pd.DataFrame, row: pd.Series) -> pd.DataFrame:
    """The rows of the last periods; where no frequency is known, the last twentieth."""
    time, f = column(history, "time"), number(row, "dominant_frequency_hz")
    length = PERIODS / f if f > 0 else (time[-1] - time[0]) / 20
    return history[time >= time[-1] - length]


def _torque(
    axes: Axes,
    history: pd.DataFrame,
    row: pd.Series,
    named: bool,
    units: Mapping[str, str],
) -> None:
    what, unit = friction_label(units)
    time, torque = column(history, "time"), column(history, "torque")
    axes.plot(*outline(MS * time, torque), color=COLOURS[1], linewidth=0.8)
    mean = ("torque_mean", f"mean {what}", "--", "black")
    lines = (mean, ("torque_static", "static", "-.", DARK))
    for name, text, style, colour in lines:
        if np.isfinite(value := number(row, name)):
            label = f"{text} {value:.4g} {unit}" if named else None
            axes.axhline(value, linestyle=style, color=colour, linewidth=1.1, label=label)
    axes.ticklabel_format(axis="y", useOffset=False)
    name = "Braking torque" if what == "torque" else "Friction force"
    finish(axes, "", f"{name} [{unit}]")


def _states(axes: Axes, history: pd.DataFrame, named: bool) -> None:
    time = MS * column(history, "time")
    for name, colour in STATES.items():
        share = 100 * column(history, name)
        label = name if named else None
        axes.plot(*outline(time, share), color=colour, linewidth=0.9, label=label)
    axes.set_ylim(-3, 103)
    finish(axes, "", "Contact area [%]")


def _force(axes: Axes, history: pd.DataFrame) -> None:
    time, force = MS * column(history, "time"), column(history, "normal_force") / 1e3
    axes.plot(*outline(time, force), color=DARK, linewidth=0.8)
    axes.ticklabel_format(axis="y", useOffset=False)
    finish(axes, "Time [ms]", "Normal force [kN]")


def _limits(history: pd.DataFrame) -> tuple[float, float]:
    time = MS * column(history, "time")
    return float(time[0]), float(time[-1]) if time[-1] > time[0] else float(time[0]) + 1.0


def _shade(axes: Axes, found: list[Phase], named: bool) -> None:
    """Coloured spans of the phases, named once, above the torque."""
    for phase in found:
        style: dict[str, Any] = {"alpha": 0.16, "linewidth": 0, "zorder": 0}
        style |= {"color": SHADES[phase.kind], "label": phase.name if named else None}
        axes.axvspan(MS * phase.start, MS * phase.stop, **style)


def _zoom_title(axes: Axes, row: pd.Series, unit: str) -> None:
    f = number(row, "dominant_frequency_hz")
    text = f"last {PERIODS} periods of {in_digits(f)} Hz" if f > 0 else "the end"
    rms = number(row, "torque_rms")
    text += f"; RMS {rms:.3g} {unit}" if np.isfinite(rms) else ""
    head(axes, text)


def _growth_text(row: pd.Series) -> str:
    """Growth rates, class and what failed, in one line."""
    f, predicted = (number(row, f"predicted_{n}") for n in ("frequency_hz", "growth_rate"))
    fitted, low, high = (number(row, f"growth_rate{n}") for n in ("", "_low", "_high"))
    parts = [_class_text(row)] if row.get("class") else []
    if np.isfinite(predicted):
        parts.append(
            f"growth rate predicted {predicted:.4g} 1/s (complex mode at {in_digits(f)} Hz)"
        )
    if np.isfinite(fitted):
        bounds = f" ({low:.4g} to {high:.4g})" if np.isfinite(low) and np.isfinite(high) else ""
        parts.append(f"fitted {fitted:.4g} 1/s{bounds}")
    return ", ".join(parts) + _status(row, "; ")


def _class_text(row: pd.Series) -> str:
    """The class; of an undecided run with the duration that would decide."""
    until = number(row, "undecided_until")
    more = f" (a duration of {until:.3g} s would decide)" if np.isfinite(until) else ""
    return str(row["class"]).replace("_", " ") + more


def _status(row: pd.Series, before: str) -> str:
    """Why a point failed; empty where it did not."""
    status, message = row.get("status", "ok"), str(row.get("message", "") or "")
    if status == "ok":
        return ""
    return f"{before}{status}{f': {message}' if message else ''}"
