"""`squealstudy robust`."""

from __future__ import annotations

import sys
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import pandas as pd
from rich.table import Table

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.cli.mode_screen import outside_validity
from squealstudy.cli.screen import console
from squealstudy.study.results import SOBOL_INDICES, Results

LISTED = 12  # tracks where the user does not say


def robust_command(
    path: Path, top: int | None, confidence: float, csv: bool, indices: bool
) -> None:
    """Print probabilities of instability, and Sobol indices where the design is made for them."""
    results = Results.open(path)
    sampled = results.design == SOBOL_INDICES
    kept = top or LISTED
    if csv:
        table = results.sobol_indices(top, confidence) if indices else results.robust(confidence)
        table.to_csv(sys.stdout, index=False)
        return
    if not indices:
        show_probabilities(results.robust(confidence).iloc[: kept + 1], confidence, sampled)
    if indices or sampled:
        if not indices:
            console.print()
        show_indices(results.sobol_indices(kept, confidence), confidence)
    outside_validity(results.points)


def show_probabilities(table: pd.DataFrame, confidence: float, sampled: bool = False) -> None:
    """Print the table of analysis.robust.probability, the first row of any mode.

    `sampled`: its points are the two independent samples of a design for Sobol indices.
    """
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in (
        "mode",
        "Hz",
        "known at",
        "unstable %",
        "interval %",
        "mean",
        "mean +- std",
        "worst 1/s",
    ):
        grid.add_column(title, justify="right", no_wrap=True)
    grid.add_column("worst at", overflow="fold")
    for row in table.to_dict("records"):
        grid.add_row(
            str(row["track"]) if row["quantity"] == "track" else str(row["quantity"]),
            _figure(row["frequency_hz"], 0, unknown=""),
            str(row["points"] - row["unknown_points"]),
            f"{100 * row['probability']:.1f}{_bounds(row)}",
            f"{100 * row['probability_low']:.1f} to {100 * row['probability_high']:.1f}",
            in_digits(row["mean_growth_rate"], 2),
            f"{_figure(row['growth_mean'])} +- {_figure(row['growth_std'])}",
            _figure(row["max_growth_rate"]),
            ", ".join(part.rpartition("=")[2] for part in str(row["at"]).split(", ")),
        )
    console.print(grid)
    for text in _legend(table, confidence, sampled):
        console.print(text, style="dim")


def _legend(table: pd.DataFrame, confidence: float, sampled: bool) -> list[str]:
    """What the columns mean, and what is left out."""
    first = table.iloc[0]
    drawn = "points of the two independent samples" if sampled else "points"
    failed = int(first["failed_points"])
    counted = f"{failed} failed and count neither way" if failed else "none failed"
    texts = [
        f"of {first['points'] + failed} {drawn}, {counted}",
        f"interval: {100 * confidence:g} % (Clopper-Pearson) for independent draws, wide for a "
        "Sobol sequence or Latin hypercube",
        "mean: growth 1/s, zero where not unstable; mean +- std: of the growth rate where the mode "
        "is; any: the fastest mode of each point",
    ]
    if (table["unstable_points_low"] < table["unstable_points_high"]).any():
        texts.append(
            "unstable % in brackets: from points where the mode is unstable whatever its error to "
            "points where it may be"
        )
    if (table["quantity"] == "divergence").any():
        texts.append("divergence: a real root that grows, without oscillation; part of any")
    if table["unknown_points"].any():
        texts.append(
            "known at: elsewhere the mode may stand under another number; unstable % is of the "
            "points where it is known"
        )
    gone = table[(table["quantity"] == "track") & (table["absent_points"] > 0)]
    if len(gone):
        listed = ", ".join(
            f"{n} of {t}" for t, n in zip(gone["track"], gone["absent_points"], strict=True)
        )
        texts.append(
            f"points where a mode has left the band or does not oscillate, not unstable: {listed}"
        )
    names = ", ".join(part.rpartition("=")[0] for part in str(first["at"]).split(", "))
    return [*texts, f"worst at: {names}"] if names else texts


def _bounds(row: dict[Hashable, Any]) -> str:
    """Bounds of a share of points by the errors of the modes, where they differ."""
    low, high = row["unstable_points_low"], row["unstable_points_high"]
    known = row["points"] - row["unknown_points"]
    return f" ({100 * low / known:.1f} to {100 * high / known:.1f})" if low < high else ""


def _figure(value: float, digits: int = 1, unknown: str = "-") -> str:
    return in_digits(value, digits) if value == value else unknown


def show_indices(table: pd.DataFrame, confidence: float) -> None:
    """Print the table of analysis.robust.sobol_table."""
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("growth of", "Hz"):
        grid.add_column(title, justify="right", no_wrap=True)
    grid.add_column("parameter", no_wrap=True)
    for title in ("first", "interval", "total", "interval"):
        grid.add_column(title, justify="right", no_wrap=True)
    before = None
    known = table.dropna(subset=["first", "total"])
    for row in known.to_dict("records"):
        new, hz = row["track"] != before, row["frequency_hz"]
        before = row["track"]
        name = "fastest mode" if row["quantity"] == "largest" else f"mode {row['track']}"
        grid.add_row(
            name if new else "",
            in_digits(hz) if new and hz == hz else "",
            str(row["parameter"]),
            *_index(row["first"], row["first_low"], row["first_high"]),
            *_index(row["total"], row["total_low"], row["total_high"]),
        )
    console.print(grid)
    by_quantity = table.drop_duplicates("track").set_index("track")
    dropped = by_quantity["dropped_groups"]
    console.print(
        f"Sobol indices of the growth rate, {100 * confidence:g} % bootstrap intervals, from "
        f"{by_quantity['groups'].iloc[0]} groups of points",
        style="dim",
    )
    shown = dropped[dropped.index.isin(known["track"]) & (dropped > 0).to_numpy()]
    if len(shown):
        listed = ", ".join(f"{n} of {t or 'the fastest'}" for t, n in shown.items())
        text = f"groups dropped for a failed point or a mode that is not there: {listed}"
        console.print(text, style="dim")
    rare = sorted(set(table["track"]) - set(known["track"]))
    if rare:
        names = ", ".join(map(str, rare))
        console.print(f"modes found at too few points for indices: {names}", style="dim")


def _index(value: float, low: float, high: float) -> tuple[str, str]:
    return f"{value:.3f}", f"{low:.3f} to {high:.3f}"
