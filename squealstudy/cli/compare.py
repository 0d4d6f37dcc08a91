"""`squealstudy compare`: what the frequency domain predicts beside what happens in time."""

from __future__ import annotations

import sys
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from rich.table import Table

from squealstudy.analysis.tables.comparison import (
    BOTH,
    COLUMNS,
    UNFOLLOWED,
    VIBRATION,
    compare,
)
from squealstudy.analysis.tables.comparison import FREQUENCY as PREDICTED
from squealstudy.analysis.tables.comparison import TIME as OWN
from squealstudy.analysis.tables.mode_ranking import DIVERGENCE, UNTRACKED
from squealstudy.analysis.tables.run_classes import LEVELLED
from squealstudy.cli import mode_screen, screen
from squealstudy.errors import ResultsError
from squealstudy.models.operating import IN_TIME_ONLY
from squealstudy.study.manifest import outdated
from squealstudy.study.parameters import DAMPING_RATIO, ModeParameter, parse_parameter
from squealstudy.study.results import Results
from squealstudy.study.results_manifest import version_of

FREQUENCY, TIME = "complex_modes", "transient"
LABELS = {DIVERGENCE: "divergence", UNTRACKED: "untracked"}
TITLES = ("mode", "Hz", "growth 1/s", "forecast", "fitted", "95 %", "dev %", "energy %", "lives")
MOTION = 13  # least width of what happens in time: its words stay whole


def compare_command(freq: Path, time: Path, csv: bool) -> None:
    """Print predicted and fitted growth, and which predicted instabilities express themselves.

    Raises
    ------
    ResultsError
        Where the directories are not one study of each kind, of one model, with common points.
    """
    frequency, transient = _in_order(Results.open(freq), Results.open(time))
    for results in (frequency, transient):
        if text := outdated(results.directory, results.manifest):
            screen.warning(f"{text}; run that study again")
    table = compare_results(frequency, transient)
    if csv:
        table.to_csv(sys.stdout, index=False)
        return
    units = frequency.manifest["units"] | transient.manifest["units"]
    show_comparison(
        table, list(table.columns[: list(table.columns).index(next(iter(COLUMNS)))]), units
    )
    for name, results in (("frequency", frequency), ("time", transient)):
        mode_screen.outside_validity(results.points, f"{name} study: ")


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
        transient.growth,
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
    values = model.defaults(version_of(results.manifest)) | results.manifest["nominal"]
    if isinstance(parameter, ModeParameter) and not parameter.component:  # instead of the uniform
        return float(values.get(DAMPING_RATIO, parameter.default))
    return float(values.get(name, parameter.default))


def show_comparison(table: pd.DataFrame, parameters: list[str], units: dict[str, str]) -> None:
    """Print the comparison, one line an instability, and a summary."""
    varied = [n for n in parameters if len(table[n].unique()) > 1]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for name in varied:
        title = f"{name} {units[name]}" if units.get(name) else name
        grid.add_column(title, justify="right", overflow="fold", min_width=screen.NARROW)
    for title in TITLES:
        grid.add_column(title, justify="right", no_wrap=True)
    grid.add_column("in time", min_width=MOTION)  # it gives way first: figures are never cut
    for row in table.to_dict("records"):
        grid.add_row(*(f"{row[n]:.6g}" for n in varied), *_cells(row))
    if len(table):
        screen.console.print(grid)
    screen.console.print(summary(table))
    if not len(table):
        return
    screen.console.print(
        "growth: of the frequency study; forecast: of the time study's own complex mode; fitted: "
        "in time; dev: fitted against growth; energy: share of the vibration that lasts, in the "
        "mode's plane of motion; lives: 5 % or more of it, ? where the run does not tell",
        style="dim",
    )


def summary(table: pd.DataFrame) -> str:
    """What was compared, how much is predicted and expressed, and what vibrates unforeseen."""
    points = table.attrs["points"]
    parts = [f"{_count(points, 'design point')} compared", *_failures(table.attrs)]
    predicted = table[table["kind"].isin([BOTH, PREDICTED]).to_numpy()]
    alone = table[(table["kind"] == OWN).to_numpy()]
    if not len(predicted) and not len(alone):
        parts.append("neither study predicts an instability there")
    if len(predicted):
        number = _count(len(predicted), "predicted instability", "predicted instabilities")
        parts.append(f"{number}, {_lives(predicted)}")
    if len(alone):
        parts.append(f"{len(alone)} more in the time study alone, {_lives(alone)}")
    return "\n".join(["; ".join(parts) + ".", *_unforeseen(table)])


def _failures(counts: Mapping[Hashable, Any]) -> list[str]:
    return [
        f"{counts[f'failed_{name}']} of them failed in the {name} study"
        for name in ("frequency", "time")
        if counts[f"failed_{name}"]
    ]


def _lives(rows: pd.DataFrame) -> str:
    """How many instabilities are in the vibration that lasts."""
    lives, unknown = (
        rows["expressed"].fillna(False).astype(bool),
        int(rows["expressed"].isna().sum()),
    )
    text = f"{int(lives.sum())} express themselves"
    return text + (f", {unknown} cannot be told" if unknown else "")


def _unforeseen(table: pd.DataFrame) -> list[str]:
    """Sentences on motion that no predicted instability explains."""
    rows = table[(table["kind"] == VIBRATION).to_numpy()]
    lasts = rows["class"].isin(LEVELLED).to_numpy(bool)
    others = table[table["kind"].isin([BOTH, PREDICTED, OWN])]
    foreseen = rows["time_point_id"].isin(others["time_point_id"]).to_numpy(bool)
    waits = int((table["kind"] == UNFOLLOWED).sum())
    told = (
        (int((lasts & ~foreseen).sum()), "vibrate in time with no mode predicted"),
        (int((lasts & foreseen).sum()), "vibrate in time otherwise than predicted"),
        (int((~lasts).sum()), "grow or are undecided in time with no mode predicted"),
        (waits, "vibrate while unstable modes are not followed (above the band, or too many)"),
    )
    return [f"{_count(number, 'design point')}: {text}." for number, text in told if number]


def _cells(row: dict[Hashable, Any]) -> list[str]:
    known = row["frequency_hz"] == row["frequency_hz"]
    bounds = f"{row['low']:.4g} to {row['high']:.4g}" if row["low"] == row["low"] else "-"
    lives = "?" if pd.isna(row["expressed"]) else "yes" if row["expressed"] else "no"
    moves = row["kind"] in (VIBRATION, UNFOLLOWED)
    return [
        LABELS.get(int(row["track"]), str(row["track"])) if row["track"] else "-",
        _number(row["frequency_hz"] if known else row["predicted_frequency_hz"], ".0f"),
        _number(row["growth_rate"]),
        _number(row["predicted_growth_rate"]),
        _number(row["fitted_growth_rate"]),
        bounds,
        _number(100 * row["deviation"], "+.1f"),
        _number(100 * row["level_share"], ".0f"),
        "-" if moves else lives,
        _motion(row),
    ]


def _motion(row: dict[Hashable, Any]) -> str:
    """Class, leading line and level of the run; of motion that nothing predicts, that it is."""
    line = _number(row["dominant_frequency_hz"], ".0f")
    text = str(row["class"]) + (f", {line} Hz" if line != "-" else "")
    why = {VIBRATION: "not predicted", UNFOLLOWED: "not followed"}.get(str(row["kind"]))
    return f"{text}, RMS {_number(row['torque_rms'])}: {why}" if why else text


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _number(value: float, form: str = ".4g") -> str:
    return f"{value:{form}}" if value == value else "-"
