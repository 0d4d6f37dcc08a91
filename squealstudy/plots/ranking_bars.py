"""Picture of the ranking: how often each track is unstable, and where its energy is."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.engine.pictures import register_plot
from squealstudy.plots.style import (
    UNSTABLE,
    empty_figure,
    figure_at,
    finish,
    head,
    joined,
    labelled,
    legend_below,
    name_rows,
    signed,
    track_name,
    whole_figure,
)
from squealstudy.tables.mode_ranking import (
    energy_columns,
    frequency_text,
    unstable_groups,
)
from squealstudy.tables.stability import INEXACT
from squealstudy.wording import amount

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

COLUMNS_OF_GROUPS = (
    "track",
    "unstable",
    "overdamped",
    "frequency_hz",
)  # what sorts modes into the rows of the ranking
COMPONENT_COLOURS = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E00",
    "#F0E442",
    "#000000",
)
LIGHT_COLOURS = ("#E69F00", "#56B4E9", "#F0E442")  # numbers on these bars are black, else white
MIN_NUMBERED_BAR_PERCENT = 8.0  # percent: narrower bars carry no number
LONGEST_NAME = 44  # characters of a line
HATCHES = ("", "//", "\\\\", "xx")  # of components beyond the number of colours


@register_plot(points=("status",), modes=("track", "unstable", "overdamped"))
def ranking(results: Results, by: str = "share", top: int = 12, ax: Axes | None = None) -> Figure:
    """Unstable share of each ranked track, and mean energy shares where the model has them.

    Parameters
    ----------
    results : Results
        Of a complex-mode study.
    by : str
        Order of the rows, as in ``Results.rank``.
    top : int
        Number of rows to show.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        For an unknown `by`.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter").with_(friction=[0.2, 0.4, 0.5])
    >>> results = sq.run(study)
    >>> results.plot.ranking().savefig("ranking.png")
    """
    table, along = results.rank(by), results.along
    shown = table.iloc[:top]
    if not len(shown):
        is_solved = (results.points["status"] == "ok").any()
        return empty_figure("no unstable mode" if is_solved else "no design point is solved", ax)
    columns = [*COLUMNS_OF_GROUPS, *energy_columns(results.columns("modes"))]
    unstable = results.rows("modes", columns, lambda modes: modes["unstable"].to_numpy(bool))
    energies = mean_energies(unstable, shown["track"].tolist())
    figure = figure_at(ax, 10.5 if len(energies.columns) else 6.5, 1.9 + 0.38 * len(shown))
    if len(energies.columns):
        left_axes, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.25])
        _energies(right, energies)
        legend_below(figure, labelled(right), 5, "right")
    else:  # a family of matrices has no components
        left_axes = figure.subplots()
    _shares(left_axes, shown, results.units.get(along or "", ""))
    names = results.track_names
    name_rows(left_axes, [_name(row, names) for row in shown.to_dict("records")])
    head(
        left_axes,
        joined(
            f"first {len(shown)} of {len(table)} rows" if len(table) > len(shown) else "",
            f"largest growth rate, and the {along} from which on unstable" if along else "",
        ),
    )
    return whole_figure(figure)


def mean_energies(modes: pd.DataFrame, tracks: list[int]) -> pd.DataFrame:
    """Mean energy shares over the unstable points of each track, a row for each track."""
    columns = energy_columns(modes.columns)
    group = pd.Series(unstable_groups(modes), index=modes.index)
    means = modes.loc[group.isin(tracks), columns].groupby(group).mean()
    return means.reindex(tracks).rename(columns=lambda c: c.removeprefix("energy_"))


def _name(row: Mapping[Hashable, Any], names: Mapping[int, tuple[str, bool]]) -> str:
    """Number or name of a track with its frequency; for untracked modes their frequency range."""
    if row["kind"] == "mode":
        return track_name(row["track"], row["frequency_hz"], names, LONGEST_NAME)
    hz = frequency_text(row)
    return f"{row['kind']}   {hz} Hz" if hz else str(row["kind"])


def _shares(axes: Axes, shown: pd.DataFrame, unit: str) -> None:
    """Draw bars of the unstable share, and write growth rate and onset [unit] beside each."""
    share, positions = 100 * shown["unstable_share"].to_numpy(), np.arange(len(shown))
    axes.barh(positions, share, height=0.62, color=UNSTABLE)
    for y, x, row in zip(positions, share, shown.to_dict("records"), strict=True):
        text = f"{signed(row['max_growth_rate'])} 1/s"
        if np.isfinite(row["threshold"]):
            mark = "*" * bool(row["taken_over"]) + INEXACT.get(row["threshold_kind"], "")
            text += f", from {mark}{amount(row['threshold'], unit, digits=3)}"
        elif row["threshold_kind"]:
            text += f", {row['threshold_kind']}"
        axes.annotate(text, (x, y), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set_xlim(0.0, 1.55 * max(share.max(), 1.0))
    axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 100])
    finish(axes, "Share of design points where unstable [%]", "")


def _energies(axes: Axes, energies: pd.DataFrame) -> None:
    """Draw stacked bars, one for each component; shares are written where they fit."""
    positions, bar_starts = np.arange(len(energies)), np.zeros(len(energies))
    for k, component in enumerate(energies.columns):
        share = 100 * energies[component].fillna(0.0).to_numpy()
        n_colours = len(COMPONENT_COLOURS)
        shade, hatch = COMPONENT_COLOURS[k % n_colours], HATCHES[k // n_colours % len(HATCHES)]
        bars = axes.barh(
            positions, share, 0.62, bar_starts, color=shade, hatch=hatch, label=component
        )
        texts = [f"{width:.0f}" if width >= MIN_NUMBERED_BAR_PERCENT else "" for width in share]
        ink = "black" if shade in LIGHT_COLOURS else "white"
        axes.bar_label(bars, texts, label_type="center", fontsize=8, color=ink)
        bar_starts = bar_starts + share
    finish(axes, "Elastic energy, mean over unstable points [%]", "")
    axes.set_xlim(min(bar_starts.min(), 0.0), 100)
    axes.grid(False, axis="y")
