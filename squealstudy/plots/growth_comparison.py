"""Growth rates predicted by complex modes against those fitted in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from squealstudy.plots.style import COLOURS, DARK, GREY, empty_figure, finish, new_figure, plural

SMALL = 0.05  # of the fastest growth: below, a relative deviation does not set the scale
KINDS: dict[str, dict[str, Any]] = {  # of a fitted growth rate, and how it is drawn
    "expressed in the limit cycle": {"color": COLOURS[0], "marker": "o"},
    "not expressed": {"color": COLOURS[1], "marker": "s", "markerfacecolor": "white"},
    "stable point": {"color": COLOURS[2], "marker": "^"},
    "point failed later": {"color": DARK, "marker": "x"},
}


def growth_comparison(growth: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Fitted growth rates over predicted ones with 95 % bounds, their deviation beneath.

    Parameters
    ----------
    growth, points : DataFrame
        Tables of a transient study. Of points without an unstable mode, the decay is shown that
        the points table has.
    """
    table = growth_pairs(growth, points)
    if not len(table):
        failed = int((points["status"] != "ok").sum()) if len(points) else 0
        why = f"; {failed} of {plural(len(points), 'point')} failed" if failed else ""
        return empty_figure(f"no growth rate was fitted{why}")
    figure = new_figure(7.6, 7.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 1.0])
    for kind, style in KINDS.items():
        own = table[(table["kind"] == kind).to_numpy()]
        if len(own):
            _bars(upper, own, ("fitted", "low", "high"), style, f"{kind} ({len(own)})")
    _diagonal(upper, table)
    _deviations(lower, table)
    figure.suptitle(_title(table, growth), fontsize=9.5)
    figure.legend(loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return figure


def growth_pairs(growth: pd.DataFrame, points: pd.DataFrame) -> pd.DataFrame:
    """Predicted and fitted rates [1/s] with bounds, and what kind of motion each is of."""
    unstable = pd.DataFrame(
        {
            "predicted": growth["growth_rate"].astype(float),
            "fitted": growth["fitted_growth_rate"].astype(float),
            "low": growth["fitted_low"].astype(float),
            "high": growth["fitted_high"].astype(float),
            "kind": np.where(growth["expressed"].to_numpy(bool), *list(KINDS)[:2]),
        }
    )
    failed = growth["point_id"].isin(points.loc[points["status"] != "ok", "point_id"])
    unstable["kind"] = unstable["kind"].mask(failed, list(KINDS)[3])
    calm = points[((points["status"] == "ok") & (points["n_unstable"] == 0)).to_numpy(bool)]
    stable = pd.DataFrame(
        {
            "predicted": calm["predicted_growth_rate"].astype(float),
            "fitted": calm["growth_rate"].astype(float),
            "low": calm["growth_rate_low"].astype(float),
            "high": calm["growth_rate_high"].astype(float),
            "kind": list(KINDS)[2],
        }
    )
    table = pd.concat([t for t in (unstable, stable) if len(t)] or [unstable], ignore_index=True)
    table = table[(table["predicted"].notna() & table["fitted"].notna()).to_numpy()]
    table["deviation"] = 100 * (table["fitted"] / table["predicted"] - 1)
    for bound in ("low", "high"):
        table[f"deviation_{bound}"] = 100 * (table[bound] / table["predicted"] - 1)
    return table[np.isfinite(table["deviation"]).to_numpy()]


def _bars(
    axes: Axes, own: pd.DataFrame, names: tuple[str, str, str], style: dict[str, Any], label: str
) -> None:
    value, low, high = (own[n].to_numpy(dtype=float) for n in names)
    reach = np.nan_to_num(np.abs([value - low, high - value]))
    axes.errorbar(
        own["predicted"],
        value,
        reach,
        linestyle="",
        markersize=5.5,
        elinewidth=1.1,
        capsize=2.5,
        label=label,
        **style,
    )


def _diagonal(axes: Axes, table: pd.DataFrame) -> None:
    """The line of equal rates, through all that is shown."""
    values = table[["predicted", "fitted"]].to_numpy()
    largest = float(np.abs(values).max())
    bounds = np.clip(table[["low", "high"]].fillna(values[0, 0]), -1.5 * largest, 1.5 * largest)
    low, high = float(np.append(values, bounds).min()), float(np.append(values, bounds).max())
    margin = max(0.08 * (high - low), 0.05 * largest)
    ends = [low - margin, high + margin]
    axes.plot(ends, ends, color=GREY, linewidth=1.0, zorder=1, label="equal")
    if low < 0 < high:
        axes.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
        axes.axvline(0.0, color="0.75", linewidth=0.8, zorder=0)
    predicted = table["predicted"].to_numpy()
    room = 0.06 * (np.ptp(predicted) or abs(float(predicted[0])) or 1.0)
    axes.set_xlim(float(predicted.min()) - room, float(predicted.max()) + room)
    axes.set_ylim(*ends)
    finish(axes, "", "Fitted growth rate [1/s]")


def _deviations(axes: Axes, table: pd.DataFrame) -> None:
    """Relative deviation; of small growth, what lies beyond the scale is a caret at its edge."""
    size = table["predicted"].abs()
    sizeable = table[(size >= SMALL * size.max()).to_numpy()]
    bounds = sizeable[["deviation", "deviation_low", "deviation_high"]].abs().to_numpy()
    limit = max(1.15 * float(np.nanmax(bounds)), 0.5)
    for kind, style in KINDS.items():
        own = table[(table["kind"] == kind).to_numpy() & (table["deviation"].abs() <= limit)]
        if len(own):
            _bars(axes, own, ("deviation", "deviation_low", "deviation_high"), style, "_")
    beyond = table[(table["deviation"].abs() > limit).to_numpy()]
    for row in beyond.to_dict("records"):
        above = row["deviation"] > 0
        marker: dict[str, Any] = {"marker": "^" if above else "v", "clip_on": False, "color": DARK}
        axes.plot(row["predicted"], limit if above else -limit, markersize=6, **marker)
    axes.axhline(0.0, color=GREY, linewidth=1.0, zorder=1)
    axes.set_ylim(-limit, limit)
    axes.yaxis.set_major_locator(MaxNLocator(6))
    finish(axes, "Predicted growth rate [1/s]", "Deviation [%]")


def _title(table: pd.DataFrame, growth: pd.DataFrame) -> str:
    """How many, how far off, and what has no fit."""
    deviation = table["deviation"].abs()
    text = f"{plural(len(table), 'fitted growth rate')}, deviation {deviation.median():.2g} % "
    text += f"(median), {deviation.max():.3g} % (largest)"
    missing = int(growth["fitted_growth_rate"].isna().sum())
    return text + (f"; {missing} predicted without a fit" if missing else "")
