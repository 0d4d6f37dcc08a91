"""The ranking as bars: how much of the study is unstable, and where the energy sits."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.mode_ranking import (
    energy_columns,
    frequency_text,
    unstable_groups,
)
from squealstudy.plots.style import UNSTABLE, empty_figure, finish, new_figure

SHADES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
LIGHT = ("#E69F00", "#56B4E9", "#F0E442")
LEGIBLE = 8.0  # percent: narrower bars carry no number
HATCHES = ("", "//", "\\\\", "xx")  # where components outnumber shades


def ranking_bars(
    ranking: pd.DataFrame, modes: pd.DataFrame, top: int = 12, along: str | None = None
) -> Figure:
    """Unstable share of each ranked track, and mean energy shares where the model has them.

    Parameters
    ----------
    ranking : DataFrame
        As `rank_modes` gives it, in the order to show.
    modes : DataFrame
        The table that was ranked.
    top : int
        Rows to show.
    along : str or None
        Parameter of the thresholds in `ranking`, named in the title.
    """
    shown = ranking.iloc[:top]
    if not len(shown):
        return empty_figure("no unstable mode")
    energies = mean_energies(modes, shown["track"].tolist())
    figure = new_figure(10.5 if len(energies.columns) else 6.5, 1.9 + 0.38 * len(shown))
    place = np.arange(len(shown))
    if len(energies.columns):
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.25])
        _energies(right, place, energies)
    else:  # a family of matrices has no components
        left = figure.subplots()
    _shares(left, place, shown)
    left.set_yticks(place, [_name(row) for row in shown.to_dict("records")])
    left.set_ylim(len(shown) - 0.4, -0.6)
    parts = [f"first {len(shown)} of {len(ranking)} rows"] if len(ranking) > len(shown) else []
    parts += [f"largest growth rate, and the {along} from which on unstable"] if along else []
    left.set_title("; ".join(parts), fontsize=9, loc="left")
    return figure


def mean_energies(modes: pd.DataFrame, tracks: list[int]) -> pd.DataFrame:
    """Mean energy shares over the unstable points of each track, one row a track."""
    columns = energy_columns(modes)
    group = pd.Series(unstable_groups(modes), index=modes.index)
    means = modes.loc[group.isin(tracks), columns].groupby(group).mean()
    return means.reindex(tracks).rename(columns=lambda c: c.removeprefix("energy_"))


def _name(row: Mapping[Hashable, Any]) -> str:
    """Track and frequency; of modes without a track the range of these."""
    if row["kind"] == "mode":
        return f"T{row['track']}   {in_digits(row['frequency_hz'])} Hz"
    hz = frequency_text(row)
    return f"{row['kind']}   {hz} Hz" if hz else str(row["kind"])


def _shares(axes: Axes, place: np.ndarray, shown: pd.DataFrame) -> None:
    """Bars of the unstable share with growth and threshold beside them."""
    share = 100 * shown["unstable_share"].to_numpy()
    axes.barh(place, share, height=0.62, color=UNSTABLE)
    for y, x, row in zip(place, share, shown.to_dict("records"), strict=True):
        text = f"{row['max_growth_rate']:+.3g} 1/s"
        if np.isfinite(row["threshold"]):
            text += f", from {row['threshold']:.3g}"
        elif row["threshold_kind"]:
            text += f", {row['threshold_kind']}"
        axes.annotate(text, (x, y), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set_xlim(0.0, 1.55 * max(share.max(), 1.0))
    axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 100])
    finish(axes, "Share of design points where unstable [%]", "")
    axes.grid(False, axis="y")


def _energies(axes: Axes, place: np.ndarray, energies: pd.DataFrame) -> None:
    """Stacked bars, a component each; the share is written where it fits."""
    left = np.zeros(len(place))
    for k, component in enumerate(energies.columns):
        share = 100 * energies[component].fillna(0.0).to_numpy()
        shade, hatch = SHADES[k % len(SHADES)], HATCHES[k // len(SHADES) % len(HATCHES)]
        bars = axes.barh(place, share, 0.62, left, color=shade, hatch=hatch, label=component)
        texts = [f"{width:.0f}" if width >= LEGIBLE else "" for width in share]
        ink = "black" if shade in LIGHT else "white"
        axes.bar_label(bars, texts, label_type="center", fontsize=8, color=ink)
        left = left + share
    finish(axes, "Elastic energy, mean over unstable points [%]", "")
    axes.set_xlim(min(left.min(), 0.0), 100)
    axes.grid(False, axis="y")
    axes.figure.legend(loc="outside lower right", ncols=5, fontsize=9, frameon=False)
