"""Errors of the brake's meshes over their degrees of freedom, a panel a component."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.plots.style import finish, new_figure

ASKED = {"coarse": 3.0, "medium": 1.0, "fine": 0.3}  # %
START = "medium 1x1x1"
SPLITS = {
    "medium 2x1x1": ("medium, r halved", ">"),
    "medium 1x2x1": ("around halved", "v"),
    "medium 1x1x2": ("z halved", "D"),
    "medium 2x2x2": ("all halved", "s"),
}
POINTS = {8: (COLOURS[1], "8 points"), 27: (COLOURS[0], "27 points")}
LEAST = 0.01  # %, errors below are drawn there: references are no better


def mesh_chart(table: pd.DataFrame) -> Figure:
    """The largest error of the elastic free modes below 6 kHz.

    Parameters
    ----------
    table : DataFrame
        geometry, component, mesh, points, dof, low, high: a row for each mesh, errors in percent.
    """
    table = table.assign(error=table[["low", "high"]].abs().max(axis=1).clip(lower=LEAST))
    figure = new_figure(11.0, 4.6)
    panels = figure.subplots(1, 3, sharey=True)
    for axes, component in zip(panels, ("disc", "inner_pad", "caliper"), strict=True):
        own = table[table["component"] == component]
        _densities(axes, own[own["mesh"].isin(list(ASKED))])
        _splits(axes, own[own["geometry"] == "default"])
        axes.set(xscale="log", yscale="log", title=component.removeprefix("inner_"))
        finish(axes, "degrees of freedom", "")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panels[0].set_ylabel("largest error of a free mode below 6 kHz [%]")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=5, frameon=False)
    return figure


def _densities(axes: Axes, own: pd.DataFrame) -> None:
    """Lines from coarse to fine, the default geometry in front, and what is asked of each."""
    for geometry, rows in own.sort_values("dof").groupby("geometry"):
        front = geometry == "default"
        look = {"color": DARK, "lw": 2.0, "ms": 6} if front else {"color": GREY, "lw": 0.9, "ms": 3}
        axes.plot(rows["dof"], rows["error"], "o-", zorder=3 if front else 2, **look)
    for density, rows in own.groupby("mesh"):
        low, high = rows["dof"].min() / 1.25, rows["dof"].max() * 1.25
        axes.hlines(ASKED[str(density)], low, high, color=COLOURS[2], lw=2.0)


def _splits(axes: Axes, own: pd.DataFrame) -> None:
    """The medium mesh with divided cells, by points of integration."""
    for points, (colour, _) in POINTS.items():
        rows = own[own["points"] == points].set_index("mesh")
        for mesh, (_, marker) in SPLITS.items():
            if {START, mesh} <= set(rows.index):
                both = rows.loc[[START, mesh]]
                line = {"color": colour, "lw": 0.7, "ms": 6, "markevery": [1]}
                axes.plot(both["dof"], both["error"], marker=marker, **line)


def _legend() -> list[Line2D]:
    return [
        Line2D([], [], color=DARK, lw=2.0, marker="o", label="coarse, medium, fine"),
        Line2D([], [], color=GREY, lw=0.9, marker="o", ms=3, label="at other geometries"),
        Line2D([], [], color=COLOURS[2], lw=2.0, label="asked of each"),
        *(Line2D([], [], color=c, lw=3.0, label=f"stiffness by {t}") for c, t in POINTS.values()),
        *(Line2D([], [], color=DARK, lw=0, marker=m, label=t) for t, m in SPLITS.values()),
    ]
