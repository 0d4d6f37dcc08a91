"""What `squealstudy sensitivity` prints, and the pictures of such a study."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from rich.table import Table

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.sensitivity_ranking import mode_sensitivities, rank_sensitivities
from squealstudy.cli.screen import console
from squealstudy.plots.sensitivity_bars import parameter_text, sensitivity_bars, step_text
from squealstudy.plots.tables import describe
from squealstudy.study.results import Results

MOST_PICTURES = 8  # modes that get a picture, the fastest growing first
NUMBERS = ("growth 1/s", "reanalysis", "off", "Hz", "damping %")


def show_ranking(results: Results, frequency_hz: float | None, top: int | None) -> None:
    """Print the sensitivities of one mode, largest first."""
    table = results.sensitivities
    if not len(table):
        console.print("No mode is unstable anywhere in the study: there are no sensitivities.")
        return
    mode = mode_sensitivities(table, frequency_hz)
    shown = rank_sensitivities(mode, top)
    first = shown.iloc[0]
    console.print(_headline(results, first))
    console.print(_grid(shown))
    console.print(
        f"first {len(shown)} of {len(mode)} parameters; growth, Hz, damping: change at the step, "
        "first order; reanalysis: of the growth rate; off: first order against reanalysis, in the "
        "complex plane",
        style="dim",
    )
    if shown["near_coalescence"].any():
        console.print(
            "! near coalescence: the derivative does not hold over the step, or means nothing",
            style="dim",
        )


def _headline(results: Results, first: pd.Series) -> str:
    points = results.points
    point = points[points["point_id"] == first["point_id"]].iloc[0]
    where = describe(point, points, results.parameters, results.manifest["units"])
    text = f"mode at {in_digits(first['frequency_hz'], 1)} Hz: growth rate "
    text += f"{in_digits(first['growth_rate'], 2)} 1/s, "
    text += f"damping {100 * first['damping_ratio']:.3f} %, eigenvalue condition "
    text += f"{first['condition']:.2f}, most energy in {first['main_component']}"
    return f"{text}\n{where}" if where else text


def _grid(shown: pd.DataFrame) -> Table:
    grid = Table(box=None, pad_edge=False, header_style="bold")
    grid.add_column("parameter", overflow="fold")
    for title in ("step", *NUMBERS):
        grid.add_column(title, justify="right", no_wrap=True, min_width=len(title))
    grid.add_column("", no_wrap=True)
    for row in shown.to_dict("records"):
        grid.add_row(*_cells(row))
    return grid


def _cells(row: dict[Hashable, Any]) -> list[str]:
    off = row["disagreement"]
    return [
        parameter_text(row),
        step_text(row),
        f"{row['predicted_growth_change']:+.4g}",
        _finite(row),
        f"{100 * off:.1f} %" if np.isfinite(off) else "-",
        f"{row['predicted_frequency_change']:+.3g}",
        f"{100 * row['predicted_damping_change']:+.3g}",
        "!" if row["near_coalescence"] else "",
    ]


def _finite(row: dict[Hashable, Any]) -> str:
    change = row["finite_growth_change"]
    return f"{change:+.4g}" if np.isfinite(change) else "no solution"


def sensitivity_figures(results: Results) -> Iterator[tuple[str, Figure]]:
    """Names and figures: a picture of each mode of the design point of largest growth."""
    table, points = results.sensitivities, results.points
    if not len(table):
        yield "sensitivity", sensitivity_bars(table)
        return
    worst = mode_sensitivities(table)["point_id"].iloc[0]
    own = table[table["point_id"] == worst]
    point = points[points["point_id"] == worst].iloc[0]
    title = describe(point, points, results.parameters, results.manifest["units"])
    for number in sorted(own["mode"].unique())[:MOST_PICTURES]:
        mode = own[own["mode"] == number]
        name = f"sensitivity_{in_digits(mode['frequency_hz'].iloc[0])}_hz"
        yield name, sensitivity_bars(mode, title=title)


def agreement(table: pd.DataFrame) -> str:
    """One line on derivatives against reanalysis, where the derivative is said to hold."""
    held = table[~table["near_coalescence"].to_numpy(bool)]
    off = held["disagreement"].dropna()
    flagged = len(table) - len(held)
    text = f"{flagged} of {len(table)} sensitivities near coalescence"
    if not len(off):
        return text
    return (
        f"first order within {100 * off.median():.2g} % of the reanalysis (median; 95 % of them "
        f"within {100 * off.quantile(0.95):.2g} %); {text}"
    )
