"""`squealstudy compare`: what the frequency domain predicts beside what happens in time."""

from __future__ import annotations

import sys
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from rich.table import Table

from squealstudy.analysis.tables.comparison import compare
from squealstudy.cli import screen
from squealstudy.errors import ResultsError
from squealstudy.models.operating import IN_TIME_ONLY
from squealstudy.study.names import GROWTH
from squealstudy.study.parameters import DAMPING_RATIO, ModeParameter, parse_parameter
from squealstudy.study.results import Results

FREQUENCY, TIME = "complex_modes", "transient"
TITLES = ("mode", "Hz", "growth 1/s", "forecast", "fitted", "95 %", "dev %", "energy %", "lives")


def compare_command(freq: Path, time: Path, csv: bool) -> None:
    """Print predicted and fitted growth, and which predicted instabilities express themselves.

    Raises
    ------
    ResultsError
        Where the directories are not one study of each kind, of one model, with common points.
    """
    frequency, transient = _in_order(Results.open(freq), Results.open(time))
    table = compare_results(frequency, transient)
    if csv:
        table.to_csv(sys.stdout, index=False)
        return
    units = frequency.manifest["units"] | transient.manifest["units"]
    show_comparison(table, list(table.columns[: list(table.columns).index("track")]), units)


def compare_results(frequency: Results, transient: Results) -> pd.DataFrame:
    """The comparison of a complex-mode study and a transient study; ResultsError."""
    models = [r.manifest["model"] for r in (frequency, transient)]
    if models[0] != models[1]:
        raise ResultsError(
            f"{frequency.directory} is of model '{models[0]}', {transient.directory} of "
            f"'{models[1]}': expected two studies of one model"
        )
    options = [r.manifest.get("options", {}) for r in (frequency, transient)]
    if options[0] != options[1]:
        odd = sorted(k for k in options[0].keys() | options[1].keys() if _differs(k, *options))
        told = ", ".join(f"{k} {options[0].get(k)} and {options[1].get(k)}" for k in odd)
        raise ResultsError(f"the two studies differ in the options of their model: {told}")
    ours, theirs = (
        [n for n in r.parameters if n not in IN_TIME_ONLY] for r in (frequency, transient)
    )
    nominal = {n: _elsewhere(transient, n) for n in ours if n not in theirs}
    nominal |= {n: _elsewhere(frequency, n) for n in theirs if n not in ours}
    return compare(
        frequency.points,
        frequency.modes,
        transient.points,
        pd.read_parquet(transient.directory / GROWTH),
        ours,
        theirs,
        nominal,
    )


def _differs(key: str, first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    return bool(first.get(key) != second.get(key))


def _in_order(first: Results, second: Results) -> tuple[Results, Results]:
    """The complex-mode study and the transient one, in whichever order they come."""
    kinds = {str(r.manifest["kind"]): r for r in (second, first)}
    if set(kinds) != {FREQUENCY, TIME}:
        told = ", ".join(f"{r.directory} is {r.manifest['kind']}" for r in (first, second))
        raise ResultsError(f"expected results of kinds {FREQUENCY} and {TIME}, but {told}")
    return kinds[FREQUENCY], kinds[TIME]


def _elsewhere(results: Results, name: str) -> float:
    """The value at which a study ran that neither sweeps nor sets the parameter."""
    from squealstudy.models.catalogue import MODELS

    model = MODELS[str(results.manifest["model"])]
    parameter = parse_parameter(name, model)
    if isinstance(parameter, ModeParameter) and not parameter.component:  # instead of the uniform
        values = model.defaults() | results.manifest["nominal"]
        return float(values.get(DAMPING_RATIO, parameter.default))
    return parameter.default


def show_comparison(table: pd.DataFrame, parameters: list[str], units: dict[str, str]) -> None:
    """Print the comparison, one line an instability, and a summary."""
    varied = [n for n in parameters if len(table[n].unique()) > 1]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for name in varied:
        title = f"{name} {units[name]}" if units.get(name) else name
        grid.add_column(title, justify="right", overflow="fold")
    for title in TITLES:
        grid.add_column(title, justify="right", no_wrap=True)
    grid.add_column("in time", no_wrap=True)
    for row in table.to_dict("records"):
        grid.add_row(*(f"{row[n]:.6g}" for n in varied), *_cells(row))
    if len(table):
        screen.console.print(grid)
    screen.console.print(summary(table))
    if not len(table):
        return
    screen.console.print(
        "growth: of the frequency study; forecast: of the time study's own complex mode; fitted: "
        "in time; dev: fitted against growth; energy: share of the last window",
        style="dim",
    )


def summary(table: pd.DataFrame) -> str:
    """How many instabilities were predicted, and how many express themselves."""
    if not len(table):
        return "Neither study predicts an instability at the design points that both have."
    predicted = table[(table["track"] > 0).to_numpy()]
    expressed = predicted["expressed"].fillna(False).to_numpy(bool)
    alone, unknown = len(table) - len(predicted), int(predicted["expressed"].isna().sum())
    points = table["time_point_id"].nunique()
    text = f"{len(predicted)} predicted instabilities at {points} design points, "
    text += f"{int(expressed.sum())} express themselves"
    text += f"; {unknown} cannot be told" if unknown else ""
    return text + (f"; {alone} more in the time study alone" if alone else "")


def _cells(row: dict[Hashable, Any]) -> list[str]:
    known = row["frequency_hz"] == row["frequency_hz"]
    bounds = f"{row['low']:.4g} to {row['high']:.4g}" if row["low"] == row["low"] else "-"
    lives = "-" if pd.isna(row["expressed"]) else "yes" if row["expressed"] else "no"
    dominant = _number(row["dominant_frequency_hz"], ".0f")
    return [
        str(row["track"]) if row["track"] else "-",
        _number(row["frequency_hz"] if known else row["predicted_frequency_hz"], ".0f"),
        _number(row["growth_rate"]),
        _number(row["predicted_growth_rate"]),
        _number(row["fitted_growth_rate"]),
        bounds,
        _number(100 * row["deviation"], "+.1f"),
        _number(100 * row["level_share"], ".0f"),
        lives,
        str(row["class"]) + (f", {dominant} Hz" if dominant != "-" else ""),
    ]


def _number(value: float, form: str = ".4g") -> str:
    return f"{value:{form}}" if value == value else "-"
