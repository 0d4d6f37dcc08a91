"""What commands print of transient studies: one line a design point, and the modes' energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.run_classes import FAILED, UNDECIDED
from squealstudy.cli import screen
from squealstudy.wording import plural

if TYPE_CHECKING:
    import pandas as pd

MOST_COLUMNS = 2  # parameters with a column of their own
LISTED = 24  # design points listed; all of them are in the tables
PILOT_WORDS = {"torque_rms": "RMS level", "growth_rate": "growth"}


def points(table: pd.DataFrame, parameters: Sequence[str], unit: str = "N m") -> None:
    """Print what became of each design point; `unit` is N m of torques, N of friction forces."""
    what = "torque" if unit == "N m" else "force"
    varied = [p for p in parameters if len(set(table[p])) > 1]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in varied if len(varied) <= MOST_COLUMNS else ["point"]:
        grid.add_column(title, justify="right", overflow="fold", min_width=screen.NARROW)
    grid.add_column("class", no_wrap=True)
    for title in ("growth 1/s", "forecast", f"{what} {unit}", "RMS", "Hz", "mode", "share %"):
        grid.add_column(title, justify="right", overflow="fold", min_width=screen.NARROW)
    moved = bool(table["transfer_to"].any())
    if moved:
        grid.add_column("transfer", no_wrap=True)
    for number, row in enumerate(table.head(LISTED).to_dict("records"), start=1):
        place = [f"{row[p]:.6g}" for p in varied] if len(varied) <= MOST_COLUMNS else [str(number)]
        found = _findings(row)
        grid.add_row(*place, *(found if moved else found[:-1]))
    screen.console.print(grid)
    if len(table) > LISTED:
        screen.console.print(f"{len(table) - LISTED} more in the points table", style="dim")
    screen.console.print(
        "growth: fitted in time, ~ within wide bounds; forecast: of the complex mode; "
        f"{what}{'' if what == 'torque' else ' of friction'} and RMS of its fluctuation, its "
        "leading line (a harmonic where that is loudest), mode and its energy share: over the "
        "last window",
        style="dim",
    )
    if len(varied) > MOST_COLUMNS:
        _legend(table.head(LISTED), varied)
    undecided(table)


def undecided(table: pd.DataFrame) -> None:
    """Print how many runs are too short for a class, and how long they would have to be."""
    until = table.loc[table["class"] == UNDECIDED, "undecided_until"]
    if not len(until):
        return
    known = until[np.isfinite(until)]
    text = f"undecided: {len(until)} of {len(table)} runs are too short to tell what they come to"
    if len(known):
        text += f"; a duration of about {known.max():.2g} s would decide "
        text += "them" if len(known) == len(until) else f"{len(known)} of them"
    if len(known) < len(until):
        text += f"; of {len(until) - len(known)} no duration is known that would"
    screen.console.print(text)


def ended_early(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What runs that stopped once their outcome was known have saved; nothing where none may."""
    found = manifest.get("simulated_time")
    if found is None:
        return []
    share = 100 * found["saved_s"] / found["asked_s"] if found["asked_s"] else 0.0
    text = (
        f"{found['saved_s']:.3g} of {found['asked_s']:.3g} s not simulated ({share:.0f} %): "
        f"{found['settled']} runs had settled, {found['decayed']} had decayed"
    )
    return [("ended early", text)]


def regularisation(found: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """What slopes of friction follow from, and what they err by; nothing where they are given."""
    if found is None:
        return []
    low, high = found["speed"], found["speed_highest"]
    speed = f"{low:.3g} m/s" if low == high else f"{low:.3g} to {high:.3g} m/s"
    text = f"points stick below {speed}"
    if found["automatic"]:
        text += (
            f", {100 * found['share']:g} % of the study's slowest sliding speed of "
            f"{found['slowest_sliding_speed']:.4g} m/s: a slower design point changes every row"
        )
    rows = [("friction", text)]
    pilot = found.get("pilot")
    return rows if pilot is None else [*rows, ("  its error", _pilot(pilot))]


def _pilot(pilot: Mapping[str, Any]) -> str:
    """What one run at twice the slope of friction told."""
    known = pilot.get("errors", {})
    errors = ", ".join(
        f"{word} {_share(known[name])}" for name, word in PILOT_WORDS.items() if name in known
    )
    if pilot["status"] in ("failed", "skipped"):
        return f"not known: {pilot['message']}"
    told = f"{errors or 'no level, no growth to compare'}, by one design point at 2 k_t"
    return told if pilot["status"] == "ok" else f"{told}; undecided: {pilot['message']}"


def _share(error: Mapping[str, float]) -> str:
    """An error in percent; what chance may do where that is more."""
    if error["error"] < error["chance"]:
        return f"below {100 * error['chance']:.2g} % (the bounds of the runs)"
    return f"{100 * error['error']:.2g} %"


def _legend(table: pd.DataFrame, varied: Sequence[str]) -> None:
    """What each point changes of the first, a line a point."""
    first = table.iloc[0]
    rows = []
    for number, row in enumerate(table.to_dict("records"), start=1):
        changed = [f"{p} = {row[p]:.4g}" for p in varied if row[p] != first[p]]
        rows.append((f"point {number}", ", ".join(changed) or "first"))
    screen.console.print()
    screen.facts(rows)


def ranking(table: pd.DataFrame) -> None:
    """Print which assembly modes carry the energy."""
    undecided = table.attrs["undecided"]
    left_out = f"; {plural(undecided, 'undecided run')} left out" if undecided else ""
    if not len(table):
        known = "is known to keep" if undecided else "keeps"
        screen.console.print(f"No design point {known} vibrating{left_out}.")
        return
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("mode", "Hz", "energy %", "most %", "leads at"):
        grid.add_column(title, justify="right", no_wrap=True)
    grid.add_column("energy in", no_wrap=True)
    varied = any(table["worst"])
    if varied:
        grid.add_column("most where", overflow="fold")
    for row in table.to_dict("records"):
        grid.add_row(
            str(row["mode"]),
            in_digits(row["frequency_hz"]),
            f"{100 * row['energy_share']:.1f}",
            f"{100 * row['energy_share_max']:.1f}",
            str(row["dominant_points"]),
            str(row["main_component"]),
            *([str(row["worst"])] if varied else []),
        )
    screen.console.print(grid)
    screen.console.print(
        "energy: share of the mechanical energy, mean over the points that keep vibrating; leads "
        f"at: number of points where it has most{left_out}",
        style="dim",
    )


def _findings(row: dict[Any, Any]) -> list[str]:
    if row["class"] == FAILED:
        why = row["status"] if row["status"] != "ok" else "its energy is not finite"
        return [f"failed: {why}", *[""] * 8]
    transfer = ""
    if row["transfer_to"]:
        transfer = (
            f"{row['transfer_from']} > {row['transfer_to']} at {1e3 * row['transfer_time']:.0f} ms"
        )
    return [
        str(row["class"]),
        _growth(row),
        _number(row["predicted_growth_rate"]),
        _number(row["torque_mean"]),
        _number(row["torque_rms"]),
        in_digits(row["dominant_frequency_hz"]) if _known(row["dominant_frequency_hz"]) else "-",
        str(row["dominant_mode"]) if row["dominant_mode"] else "-",
        f"{100 * row['dominant_share']:.0f}" if _known(row["dominant_share"]) else "-",
        transfer,
    ]


def _growth(row: dict[Any, Any]) -> str:
    """The fitted rate; ~ where its bounds are more than 10 % away."""
    rate = row["growth_rate"]
    wide = row["growth_rate_high"] - row["growth_rate_low"] > 0.2 * abs(rate)
    return f"{'~' if wide else ''}{_number(rate)}"


def _known(value: float) -> bool:
    return value == value


def _number(value: float) -> str:
    return f"{value:.4g}" if _known(value) else "-"
