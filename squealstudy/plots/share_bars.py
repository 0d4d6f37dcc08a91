"""Stacked bars: which modes have the energy at each design point of a line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.run_classes import LASTING, UNDECIDED
from squealstudy.plots.modal_energies import PALETTE

STACKED = 6  # modes with a colour of their own
LEAST = 0.02  # energy share somewhere of a mode that has one
FILL = 0.8  # of the least distance between design points that a bar takes
OTHERS, OUTSIDE = "other sensed modes", "outside the sensed modes"
PALE = {OTHERS: "#C8C8C8", OUTSIDE: "white"}


def share_bars(
    axes: Axes, x: np.ndarray, line: pd.DataFrame, modes: pd.DataFrame, log: bool
) -> None:
    """Energy shares of the main modes, a bar at each point that keeps vibrating.

    Parameters
    ----------
    x : ndarray (n,)
        Where the points are drawn, on a logarithmic axis if `log`.
    line : DataFrame (n rows)
        Their rows of the points table.
    modes : DataFrame
        The modes table.
    """
    lasting = line["class"].isin(LASTING).to_numpy(bool)
    table = stacked_shares(line[lasting], modes)
    axes.set_ylim(0.0, 100.0)
    if not len(table):
        style: dict[str, Any] = {"ha": "center", "color": "0.4"}
        open_ = (line["class"] == UNDECIDED).any()
        text = "undecided whether a vibration lasts" if open_ else "no vibration lasts"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, **style)
        return
    start, width = bar_places(x, log)
    base = np.zeros(len(table))
    for k, name in enumerate(table.columns):
        height = 100 * table[name].to_numpy()
        axes.bar(
            start[lasting],
            height,
            width[lasting],
            base,
            align="edge",
            color=PALE.get(name, PALETTE[k % len(PALETTE)]),
            edgecolor="0.4",
            linewidth=0.5,
            label=name,
        )
        base = base + height


def bar_places(x: np.ndarray, log: bool) -> tuple[np.ndarray, np.ndarray]:
    """Left edges and widths (n,) of bars about `x`, as wide as each other on the axis."""
    place = np.log(x) if log else x
    half = 0.5 * FILL * float(np.diff(np.unique(place)).min(initial=np.inf))
    half = half if np.isfinite(half) else 0.5 * FILL
    edges = place - half, place + half
    left, right = (np.exp(edge) for edge in edges) if log else edges
    return left, right - left


def stacked_shares(line: pd.DataFrame, modes: pd.DataFrame) -> pd.DataFrame:
    """Shares of the main modes, of the others and outside, a row each of `line`, named to show."""
    own = modes[modes["point_id"].isin(line["point_id"])]
    wide = own.pivot_table("energy_share", "point_id", "mode", aggfunc="first")
    wide = wide.reindex(line["point_id"]).fillna(0.0)
    mean, peak = wide.mean(), wide.max()
    main = list(peak[peak >= LEAST].sort_values(ascending=False, kind="stable").index[:STACKED])
    main = sorted(main, key=lambda mode: -mean[mode])
    frequency = own.groupby("mode")["frequency_hz"].mean()
    table = wide[main].rename(columns=lambda mode: f"R{mode}  {in_digits(frequency[mode])} Hz")
    table[OTHERS] = wide.drop(columns=main).sum(axis=1)
    table[OUTSIDE] = line["energy_outside_share"].fillna(0.0).to_numpy(dtype=float)
    return table
