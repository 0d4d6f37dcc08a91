"""Braking torque over time with its phases; contact states and normal force beneath."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.over_time import (
    MS_PER_S,
    Run,
    finish_time,
    friction_label,
    histories,
    outline,
    run_of,
)
from squealstudy.plots.style import (
    empty_figure,
    figure_at,
    finish,
    head,
    joined,
    labelled,
    legend_below,
    whole_figure,
)
from squealstudy.wording import GROWING, LIMIT_CYCLE, STABLE, UNDECIDED, in_digits

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

ZOOMED_PERIODS = 10  # periods of the motion that are shown beside the whole run
FEW_ROWS = 40  # rows in a period of the torque's line; fewer miss its peaks by 0.3 % or more
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
def torque_history(results: Results, point: str | int = 0, ax: Axes | None = None) -> Figure:
    """Torque (or friction force), contact states and normal force of one run.

    Its last periods are shown beside them.

    Parameters
    ----------
    results : Results
        Of a transient study.
    point : str or int
        ``point_id`` of a design point, or its row of `points`, counted from 0.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        Where there is no such point, or no history of it was kept.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("hoffmann_flutter")[0])
    >>> results = sq.run(study.with_({"transient.duration": 0.5}, friction=[0.8]))
    >>> results.plot.torque_history(point=0).savefig("torque.png")
    """
    run = run_of(results, point)
    if len(run.history) < 2:
        return empty_figure(f"no history of this design point{_failure(run)}", ax)
    figure = figure_at(ax, 11.5, 7.4)
    axes = figure.subplots(
        3, 2, sharex="col", sharey="row", width_ratios=[2.3, 1.0], height_ratios=[2.2, 1.0, 0.8]
    )
    run_phases = phases(run)
    for column, part in enumerate((run, _last_periods(run))):
        named = column == 0  # in the legend
        _torque(axes[0, column], part, named)
        _states(axes[1, column], part, named)
        _force(axes[2, column], part)
        axes[2, column].set_xlim(*part.limits)
    for axis in axes[:, 0]:
        _shade(axis, run_phases, axis is axes[0, 0])
    for axis in axes[:, 1]:
        axis.tick_params(labelleft=False)
        axis.set_ylabel("")
    _zoom_title(axes[0, 1], run)
    figure.suptitle(joined(run.title, _growth_text(run), by="\n"), fontsize=9.5)
    legend_below(figure, [handle for panel in axes[:, 0] for handle in labelled(panel)])
    return whole_figure(figure)


def phases(run: Run) -> list[Phase]:
    """Phases of exponential growth or decay, saturation and limit cycle, as far as a run got."""
    end, class_name = float(run.column("time")[-1]), run.row.get("class")
    start, stop = _fit_window(run.growth)
    settled = run.number("settled_time") if run.number("settled") == 1 else np.nan
    phase_list = []
    if np.isfinite(start) and stop > start:
        kind = "decay" if run.number("growth_rate") < 0 else "growth"
        text = f"exponential {kind}, {_from_to(run, start, stop)}"
        phase_list.append(Phase("growth", text, start, stop))
    until = settled if np.isfinite(settled) else end
    if np.isfinite(stop) and until > stop and class_name != GROWING:
        text = f"saturation, to {run.moment(until)}" if np.isfinite(settled) else "not settled"
        text = UNDECIDED if class_name == UNDECIDED else text
        phase_list.append(Phase("saturation", text, stop, until))
    if np.isfinite(settled) and settled < end and class_name != STABLE:
        early = settled * run.number("frequency_hz") < 1.0  # before its first period is over
        text = f"settled from {'its start' if early else run.moment(settled)}"
        phase_list.append(Phase("limit cycle", text, settled, end))
    return phase_list


def _from_to(run: Run, start: float, stop: float) -> str:
    """Two times of a run, the unit once."""
    return f"{run.moment(start).partition(' ')[0]} to {run.moment(stop)}"


def _fit_window(growth: pd.DataFrame) -> tuple[float, float]:
    """Start and end [s] of the fit of growth of the first mode that has one; NaN if none has."""
    fitted = growth[growth["fitted_growth_rate"].notna().to_numpy()]
    if not len(fitted):
        return np.nan, np.nan
    first = fitted.sort_values("mode", kind="stable").iloc[0]
    return float(first["fit_start"]), float(first["fit_stop"])


def _last_periods(run: Run) -> Run:
    """The run over its last periods, or its last twentieth if no frequency is known."""
    time, f = run.column("time"), _frequency(run)
    length = ZOOMED_PERIODS / f if f > 0 else (time[-1] - time[0]) / 20
    return replace(run, history=run.history[time >= time[-1] - length])


def _frequency(run: Run) -> float:
    """Frequency [Hz] of the motion, or of the torque's strongest line if it does not repeat."""
    motion_hz = run.number("frequency_hz")
    return motion_hz if np.isfinite(motion_hz) else run.number("torque_line_hz")


def _rows_a_period(run: Run) -> float:
    time, f = run.column("time"), run.number("torque_line_hz")
    return len(time) / (f * (time[-1] - time[0])) if f > 0 and time[-1] > time[0] else np.nan


def _torque(axes: Axes, run: Run, named: bool) -> None:
    """Draw the torque over time with its mean and its value in steady sliding."""
    what, unit = friction_label(run.units)
    low, high = run.column("torque_min")[1:], run.column("torque_max")[1:]
    if _rows_a_period(run) < FEW_ROWS and np.isfinite([*low, *high]).all():
        label = "extremes of all steps between rows kept" if named else None
        band: dict[str, Any] = {"color": COLOURS[1], "alpha": 0.3, "linewidth": 0}
        axes.fill_between(run.milliseconds[1:], low, high, step="pre", label=label, **band)
    axes.plot(*outline(run.milliseconds, run.column("torque")), color=COLOURS[1], linewidth=0.8)
    mean = ("torque_mean", f"mean {what}", "--", "black")
    lines = (mean, ("torque_static", "steady sliding", "-.", DARK))
    for name, text, style, colour in () if run.changes else lines:  # levels of one speed
        if np.isfinite(level := run.number(name)):
            label = f"{text} {level:.4g} {unit}" if named else None
            axes.axhline(level, linestyle=style, color=colour, linewidth=1.1, label=label)
    axes.ticklabel_format(axis="y", useOffset=False)
    name = "Braking torque" if what == "torque" else "Friction force"
    finish(axes, "", f"{name} [{unit}]")


def _states(axes: Axes, run: Run, named: bool) -> None:
    for name, colour in STATES.items():
        share = 100 * run.column(name)
        label = name if named else None
        axes.plot(*outline(run.milliseconds, share), color=colour, linewidth=0.9, label=label)
    axes.set_ylim(-3, 103)
    finish(axes, "", "Contact area [%]")


def _force(axes: Axes, run: Run) -> None:
    force = run.column("normal_force")
    unit, factor = ("N", 1.0) if np.nanmax(np.abs(force), initial=0.0) < 1e3 else ("kN", 1e-3)
    axes.plot(*outline(run.milliseconds, factor * force), color=DARK, linewidth=0.8)
    axes.ticklabel_format(axis="y", useOffset=False)
    finish_time(axes, run, f"Normal force [{unit}]")


def _shade(axes: Axes, phases: list[Phase], named: bool) -> None:
    """Shade the spans of the phases in colours; `named` ones are in the legend."""
    for phase in phases:
        style: dict[str, Any] = {"alpha": 0.16, "linewidth": 0, "zorder": 0}
        style |= {"color": SHADES[phase.kind], "label": phase.name if named else None}
        axes.axvspan(MS_PER_S * phase.start, MS_PER_S * phase.stop, **style)


def _zoom_title(axes: Axes, run: Run) -> None:
    f, rms = _frequency(run), run.number("torque_rms")
    text = f"last {ZOOMED_PERIODS} periods of {in_digits(f)} Hz" if f > 0 else "the end"
    text += f"; RMS {rms:.4g} {friction_label(run.units)[1]}" if np.isfinite(rms) else ""
    head(axes, text)


def _growth_text(run: Run) -> str:
    """Class, growth rates and failure of a run, in one line."""
    f, predicted = (run.number(f"predicted_{n}") for n in ("frequency_hz", "growth_rate"))
    fitted, low, high = (run.number(f"growth_rate{n}") for n in ("", "_low", "_high"))
    parts = [_class_text(run)] if run.row.get("class") else []
    if np.isfinite(predicted) and not run.changes:
        parts.append(
            f"growth rate predicted {predicted:.4g} 1/s (complex mode at {in_digits(f)} Hz)"
        )
    if np.isfinite(fitted):
        bounds = f" ({low:.4g} to {high:.4g})" if np.isfinite(low) and np.isfinite(high) else ""
        parts.append(f"fitted {fitted:.4g} 1/s{bounds}")
    return ", ".join(parts) + _failure(run)


def _class_text(run: Run) -> str:
    """The class of a run, in words; for an undecided run with the duration that would decide."""
    until = run.number("undecided_until")
    more = f" (a duration of {until:.3g} s would decide)" if np.isfinite(until) else ""
    more = " (no longer run is known to decide)" if until == np.inf else more
    name = str(run.row["class"])
    if run.changes and not more:
        first, last = run.column("sliding_speed")[[0, -1]]
        more = f": sliding speed from {first:.3g} to {last:.3g} m/s" if first != last else ""
    repeats = "frequency_hz" not in run.row or np.isfinite(run.number("frequency_hz"))
    if name == LIMIT_CYCLE and not repeats:
        more = " of several frequencies, whose peaks differ from period to period"
    return name.replace("_", " ") + more


def _failure(run: Run) -> str:
    """Why the point failed, to follow other text; empty if it did not."""
    status, message = str(run.row["status"]), str(run.row["message"] or "")
    return "" if status == "ok" else f"; {joined(status, message, by=': ')}"
