"""Growth rates predicted by complex modes, compared with those fitted to runs in time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.plots.style import (
    empty_figure,
    error_reach,
    figure_at,
    finish,
    labelled,
    legend_below,
    whole_figure,
)
from squealstudy.wording import CHANGING, plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MIN_REL_GROWTH = 0.05  # least growth, over the fastest, whose relative deviation counts
ENERGY = "energy"  # growth method of runs in which no complex mode is followed
AXIS_LIMIT_FACTOR = 5.0  # largest extent of the scale of deviations, over the largest deviation
EXPRESSED, NOT_EXPRESSED = "expressed in the vibration", "not expressed"
UNKNOWN, STABLE, FAILED = "not told yet", "stable mode", "point failed later"
KINDS: dict[str, dict[str, Any]] = {  # kinds of fitted growth rates, and how they are drawn
    EXPRESSED: {"color": COLOURS[0], "marker": "o"},
    NOT_EXPRESSED: {"color": COLOURS[1], "marker": "s", "markerfacecolor": "white"},
    UNKNOWN: {"color": COLOURS[4], "marker": "D", "markerfacecolor": "white"},
    STABLE: {"color": COLOURS[2], "marker": "^"},
    FAILED: {"color": DARK, "marker": "x"},
}


def _of_one_speed(results: Results) -> Iterator[tuple[str, Choices]]:
    """One picture, unless speed or pressure change in all runs."""
    if not (results.points["class"] == CHANGING).all() or not len(results.points):
        yield "", {}


@register_plot(
    _of_one_speed, points=("class", "status"), growth=("fitted_growth_rate", "expressed")
)
def growth_comparison(results: Results, ax: Axes | None = None) -> Figure:
    """Fitted growth rates over predicted ones, with 95 % bounds, and their deviation beneath.

    For points without an unstable mode the decay of the least stable mode is shown.

    Parameters
    ----------
    results : Results
        Of a transient study.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("hoffmann_flutter")[0])
    >>> results = sq.run(study.with_({"transient.duration": 0.5}, friction=[0.76, 0.8]))
    >>> results.plot.growth_comparison().savefig("growth.png")
    """
    growth, points = results.growth, results.points
    table = growth_pairs(growth, points)
    if not len(table):
        return empty_figure(_why_nothing_is_drawn(growth, points), ax)
    figure = figure_at(ax, 7.6, 7.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 1.0])
    for kind, style in KINDS.items():
        of_kind = table[(table["kind"] == kind).to_numpy()]
        if len(of_kind):
            _bars(upper, of_kind, ("fitted", "low", "high"), style, f"{kind} ({len(of_kind)})")
    _diagonal(upper, table)
    _deviations(lower, table)
    figure.suptitle(_title(table, growth), fontsize=9.5)
    legend_below(figure, labelled(upper))
    return whole_figure(figure)


def growth_pairs(growth: pd.DataFrame, points: pd.DataFrame) -> pd.DataFrame:
    """Predicted and fitted growth rates [1/s] with bounds, deviations [%], and their KINDS."""
    expressed = growth["expressed"].astype("boolean")
    kind = np.select(
        [expressed.isna(), expressed.fillna(False)], [UNKNOWN, EXPRESSED], NOT_EXPRESSED
    )
    failed = growth["point_id"].isin(points.loc[points["status"] != "ok", "point_id"])
    kind = np.select([failed, ~growth["unstable"].to_numpy(bool)], [FAILED, STABLE], kind)
    names = {"predicted": "growth_rate", "fitted": "fitted_growth_rate"}
    names |= {"low": "fitted_low", "high": "fitted_high"}
    columns = {name: growth[column].astype(float) for name, column in names.items()}
    table = pd.DataFrame(columns | {"kind": kind})
    table = table[(table["predicted"].notna() & table["fitted"].notna()).to_numpy()]
    for name, column in {"": "fitted", "_low": "low", "_high": "high"}.items():
        table[f"deviation{name}"] = 100 * (table[column] / table["predicted"] - 1)
    return table.reset_index(drop=True)


def _why_nothing_is_drawn(growth: pd.DataFrame, points: pd.DataFrame) -> str:
    """Text on why there is no fitted growth rate to show."""
    if not len(points):
        return "no growth rate was fitted\nno design points"
    failed = int((points["status"] != "ok").sum())
    unstable = int(growth["unstable"].astype(bool).sum())
    counts = points.loc[points["status"] == "ok", "class"].value_counts()
    rest = ", ".join(f"{n} {str(kind).replace('_', ' ')}" for kind, n in counts.items())
    parts = [f"{plural(unstable, 'unstable mode')} predicted"]
    parts += ["speed or pressure change: growth is not that of one state"] * (CHANGING in counts)
    parts += [f"runs: {rest}"] if rest else []
    parts += [f"{failed} of {plural(len(points), 'point')} failed"] if failed else []
    if "fit_status" in growth:  # results of earlier versions have no reasons
        why = growth.loc[growth["unstable"].astype(bool), "fit_status"].value_counts()
        why = why.drop(["ok", CHANGING], errors="ignore")
        reasons = [f"{n} {str(name).replace('_', ' ')}" for name, n in why.items()]
        parts += [f"fits: {', '.join(reasons)}"] if reasons else []
    energy = int((points["growth_method"] == ENERGY).sum()) if "growth_method" in points else 0
    parts += [f"growth of {plural(energy, 'run')} is known from energy only"] if energy else []
    return "\n".join(["no growth rate was fitted", *parts])


def sizeable(table: pd.DataFrame) -> np.ndarray:
    """Rows (n,) whose predicted rate is large enough for a relative deviation to mean something."""
    size = table["predicted"].abs().to_numpy()
    largest = float(table[["predicted", "fitted"]].abs().to_numpy().max(initial=0.0))
    large: np.ndarray = (size >= MIN_REL_GROWTH * largest) & (size > 0)
    return large


def _bars(
    axes: Axes, modes: pd.DataFrame, names: tuple[str, str, str], style: dict[str, Any], label: str
) -> None:
    """Draw fitted over predicted growth rates, with error bars."""
    fitted, low, high = (modes[n].to_numpy(dtype=float) for n in names)
    axes.errorbar(
        modes["predicted"],
        fitted,
        error_reach(fitted, low, high),
        linestyle="",
        markersize=5.5,
        elinewidth=1.1,
        capsize=2.5,
        label=label,
        **style,
    )


def _diagonal(axes: Axes, table: pd.DataFrame) -> None:
    """Draw the line of equal rates, and set limits that show all rates."""
    values = table[["predicted", "fitted"]].to_numpy()
    largest = float(np.abs(values).max()) or 1.0
    bounds = np.clip(table[["low", "high"]].fillna(values[0, 0]), -1.5 * largest, 1.5 * largest)
    low, high = float(np.append(values, bounds).min()), float(np.append(values, bounds).max())
    margin = max(0.08 * (high - low), 0.05 * largest)
    ends = [low - margin, high + margin]
    axes.plot(ends, ends, color=GREY, linewidth=1.0, zorder=1, label="equal")
    if low < 0 < high:
        axes.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axes.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
    predicted = table["predicted"].to_numpy()
    room = 0.06 * max(float(np.ptp(predicted)), largest)
    axes.set_xlim(float(predicted.min()) - room, float(predicted.max()) + room)
    axes.set_ylim(*ends)
    finish(axes, "", "Fitted growth rate [1/s]")


def _deviations(axes: Axes, table: pd.DataFrame) -> None:
    """Draw relative deviations; those beyond the scale are carets at its edge."""
    large = table[sizeable(table)]
    largest = float(large["deviation"].abs().max()) if len(large) else 0.0
    bounds = large[["deviation_low", "deviation_high"]].abs().to_numpy()
    bounds = bounds[np.isfinite(bounds)]
    limit = max(largest, min(float(bounds.max(initial=0.0)), AXIS_LIMIT_FACTOR * largest))
    limit = max(1.15 * limit, 0.5)
    for kind, style in KINDS.items():
        of_kind = table[(table["kind"] == kind).to_numpy() & (table["deviation"].abs() <= limit)]
        if len(of_kind):
            _bars(axes, of_kind, ("deviation", "deviation_low", "deviation_high"), style, "_")
    beyond = table[~(table["deviation"].abs() <= limit).to_numpy()]
    for row in beyond.to_dict("records"):
        above = row["deviation"] > 0
        marker: dict[str, Any] = {"marker": "^" if above else "v", "clip_on": False, "color": DARK}
        axes.plot(row["predicted"], limit if above else -limit, markersize=6, **marker)
    axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=1)
    axes.set_ylim(-limit, limit)
    axes.yaxis.set_major_locator(MaxNLocator(6))
    finish(axes, "Predicted growth rate [1/s]", "Deviation [%]")


def _title(table: pd.DataFrame, growth: pd.DataFrame) -> str:
    """Text on how many rates are fitted, how far they deviate, and how many have no fit."""
    deviation = table.loc[sizeable(table), "deviation"].abs()
    text = plural(len(table), "fitted growth rate")
    rest = []
    if len(deviation):
        text += (
            f", deviation {deviation.median():.2g} % (median), {deviation.max():.2g} % (largest)"
        )
    if len(deviation) < len(table):
        rest.append(f"{len(table) - len(deviation)} of these nearly neutral, not in the deviations")
    missing = int((growth["fitted_growth_rate"].isna() & growth["unstable"].astype(bool)).sum())
    rest += [f"{missing} predicted without a fit"] if missing else []
    return "\n".join([text, *(["; ".join(rest)] if rest else [])])
