"""Picture of a work-precision study: error over cost of each method, a panel for each quantity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.over_time import friction_label
from squealstudy.plots.style import (
    MARKERS,
    figure_at,
    finish,
    labelled,
    legend_below,
    whole_figure,
)
from squealstudy.tables.method_quality import at_tolerances, cost_of, on_front, usable

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

LOG_AXIS_FLOOR = 1e-16  # smaller errors are drawn as zero
VALUE_POINTS = 32.0, 12.0  # points: width and height that the value of a setting needs
NAMES = {
    "frequency": "frequency, light modes [relative]",
    "damping_ratio": "damping ratio, light modes [absolute]",
    "unstable_frequency": "frequency, unstable modes [relative]",
    "unstable_damping_ratio": "damping ratio, unstable modes [absolute]",
    "growth_rate": "growth rate [relative]",
    "onset": "onset of instability [relative]",
    "torque_mean": "mean {friction} [relative]",
    "torque_rms": "{friction} RMS [relative]",
    "dominant_frequency": "dominant frequency [relative]",
    "energy_share": "energy shares [absolute]",
}


@register_plot(measurements=("method", "cost"))
def work_precision(results: Results, ax: Axes | None = None) -> Figure:
    """Largest error over cost of each measurement, with the front of the best ones.

    No measurement has both a smaller error and a lower cost than one on the front.
    There is a panel for each quantity. The reference is a line at its cost. Measurements with
    failed points, or with missed or spurious instabilities, are crosses at the top, as their errors
    mean nothing. Bars are bounds of errors. A tick across a bar is the difference of two results
    that their 95 % intervals explain: an error below the tick may be chance.

    Parameters
    ----------
    results : Results
        Of a work-precision study.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("integrators_hoffmann")[0])
    >>> changes = {"method": study.tables["method"][:2], "work_precision.points": 1}
    >>> results = sq.run(study.with_(changes))
    >>> results.plot.work_precision().savefig("precision.png")
    """
    measurements, facts = results.measurements, results.manifest
    quantities, tolerance = facts["quantities"], facts["tolerance"]
    friction, _ = friction_label(results.units)
    rows = -(-len(quantities) // 2) if len(quantities) > 1 else 1
    columns = 2 if len(quantities) > 1 else 1
    figure = figure_at(ax, 6.4 * columns + 0.8, 4.6 * rows + 1.2)
    shared = "onset" not in quantities  # an onset costs a whole line of design points
    panels = figure.subplots(rows, columns, squeeze=False, sharex=shared).ravel()
    methods = measurements[~measurements["reference"].to_numpy(bool)]
    reference = measurements[measurements["reference"].to_numpy(bool)]
    styles = _styles(methods)
    for axes, quantity in zip(panels, quantities, strict=False):
        axes.axhline(tolerance, color=DARK, lw=1.0, ls=(0, (5, 3)), zorder=1)
        for cost in cost_of(reference, quantity):
            axes.axvline(cost, color=GREY, lw=1.0, ls=":", zorder=1)
        _panel(axes, methods, quantity, styles)
        name = NAMES.get(quantity, quantity)
        finish(axes, _cost_label(quantity, facts), name.format(friction=friction))
    for axes in panels[len(quantities) :]:
        axes.set_axis_off()
    for axes in panels[max(0, len(quantities) - columns) : len(quantities)]:
        axes.xaxis.set_tick_params(which="both", labelbottom=True)
    best = at_tolerances(measurements, quantities, (tolerance,)).iloc[-1]["cheapest"]
    within = f"cheapest within {tolerance:g} in all: {best or 'none'}"
    lines = f"largest error against {facts['reference']} (its cost: dotted); grey: front"
    figure.suptitle(f"{within}\n{lines}; dashed: tolerance", fontsize=9.5)
    handles = labelled(panels[0])
    if any(methods[f"within_{q}"].any() for q in quantities):
        tick: dict[str, Any] = {"marker": "_", "ms": 10, "mew": 1.6, "color": DARK}
        handles.append(Line2D([], [], ls="", label="what 95 % bounds explain", **tick))
    legend_below(figure, handles, min(4, len(handles)))
    return whole_figure(figure)


def _minor_tick(value: float, _: int) -> str:
    """Labels of minor ticks: 2 and 5 in each decade."""
    digit = value / 10 ** np.floor(np.log10(value) + 1e-9)
    return f"{value:g}" if round(digit) in (2, 5) else ""


def _cost_label(quantity: str, facts: Mapping[str, Any]) -> str:
    """Label of the axis of cost."""
    what = "an onset with its line" if quantity == "onset" else "a design point"
    return f"seconds {what}, one core; set-up shared by {facts['over']:,}"


def _styles(methods: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Colour, marker and lines of each method; those of the default one are heavier."""
    names = list(dict.fromkeys(methods["method"]))
    default = set(methods.loc[methods["default"].to_numpy(bool), "method"])
    return {
        name: {
            "color": COLOURS[k % len(COLOURS)],
            "marker": MARKERS[(k + k // len(COLOURS)) % len(MARKERS)],
            "lw": 2.4 if name in default else 1.1,
            "ms": 8 if name in default else 5.5,
            "ls": "-" if k < len(COLOURS) else "--",
        }
        for k, name in enumerate(names)
    }


def _panel(
    axes: Axes, methods: pd.DataFrame, quantity: str, styles: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw the measurements of all methods for one quantity."""
    good = usable(methods)
    all_errors = methods[f"error_{quantity}"].to_numpy(float)
    error = np.maximum(all_errors, _least_shown(all_errors[good]))
    cost = cost_of(methods, quantity)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(FuncFormatter(_minor_tick))
    for name, style in styles.items():
        is_of_method = (methods["method"] == name).to_numpy(bool)
        shown = is_of_method & good & np.isfinite(error)
        order = np.flatnonzero(shown)  # in the order of the file: along the setting that is varied
        axes.plot(cost[order], error[order], label=name, **style)
        _bounds(axes, methods.iloc[order], quantity, str(style["color"]))
    front = on_front(cost, np.where(good, error, np.nan))
    order = np.flatnonzero(front)[np.argsort(cost[front])]
    axes.plot(cost[order], error[order], color=GREY, lw=7, alpha=0.35, zorder=0)
    named = np.flatnonzero(good & (front | methods["default"].to_numpy(bool)))
    named = named[np.argsort(cost[named], kind="stable")]
    exact = pd.Series(all_errors == 0.0, methods.index)
    texts = methods["value"].astype(str).where(~exact, "error 0").iloc[named]
    _knob_values(axes, methods.iloc[named].assign(value=texts), cost[named], error[named], styles)
    _failures(axes, methods[~good], cost[~good], styles)


def _least_shown(errors: np.ndarray) -> float:
    """Where the axis puts errors of zero: a decade below the smallest other one."""
    others = errors[errors > LOG_AXIS_FLOOR]
    return 0.1 * float(others.min()) if len(others) else LOG_AXIS_FLOOR


def _knob_values(
    axes: Axes,
    measurements: pd.DataFrame,
    cost: np.ndarray,
    error: np.ndarray,
    styles: Mapping[str, Mapping[str, Any]],
) -> None:
    """Write the value of the varied setting beside each measurement, by ascending cost.

    Of neighbours that are close every other text stands below its measurement.
    """
    axes.autoscale_view()
    pixels_a_point = axes.figure.figure.dpi / 72.0
    positions = axes.transData.transform(np.column_stack([cost, error])) / pixels_a_point
    above = True
    for k, (text, name) in enumerate(
        zip(measurements["value"], measurements["method"], strict=True)
    ):
        across, up = np.abs(positions[k] - positions[k - 1]) if k else (np.inf, np.inf)
        above = not above if across < VALUE_POINTS[0] and up < VALUE_POINTS[1] else True
        axes.annotate(
            text,
            (cost[k], error[k]),
            xytext=(5, 4) if above else (5, -10),
            textcoords="offset points",
            fontsize=7,
            color=styles[name]["color"],
        )


def _bounds(axes: Axes, measurements: pd.DataFrame, quantity: str, colour: str) -> None:
    """Draw bars between the bounds of errors, and ticks at differences that intervals explain."""
    low, high = (measurements[f"{k}_{quantity}"].to_numpy(float) for k in ("low", "high"))
    error, cost = measurements[f"error_{quantity}"].to_numpy(float), cost_of(measurements, quantity)
    wide = np.isfinite(low) & (high > low) & (error > 0)
    if wide.any():
        down = error[wide] - np.maximum(low[wide], 0.05 * error[wide])
        axes.errorbar(
            cost[wide],
            error[wide],
            [down, high[wide] - error[wide]],
            fmt="none",
            ecolor=colour,
            elinewidth=0.7,
            alpha=0.3,
        )
    within = wide & measurements[f"within_{quantity}"].to_numpy(bool)
    chance = measurements[f"chance_{quantity}"].to_numpy(float)
    axes.plot(cost[within], chance[within], "_", color=colour, ms=12, mew=1.6)


def _failures(
    axes: Axes, failed: pd.DataFrame, cost: np.ndarray, styles: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw crosses at the top at their cost; at the right edge if that is not known."""
    for method, seconds in zip(failed["method"], cost, strict=True):
        has_cost = np.isfinite(seconds)
        axes.plot(
            [seconds if has_cost else 0.985],
            [0.97],
            "x",
            color=styles[method]["color"],
            ms=9,
            mew=2.2,
            transform=axes.get_xaxis_transform() if has_cost else axes.transAxes,
            clip_on=False,
        )
