"""Limit cycles on a page: the verdict on each mode, the cycles and the branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.colours import FILLS
from squealstudy.explore.packed import packed_exact, packed_single, packed_whole
from squealstudy.explore.points import Content, classes, measure
from squealstudy.tables.run_levels import run_levels
from squealstudy.wording import TORQUE

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MOST_ROWS = 200_000  # rows of each of the tables verdicts, cycles and branches that a page holds
OF_CYCLES = ("torque_rms", "frequency_hz", "contact_velocity", "level_error")
OF_VERDICTS = ("frequency_hz", "growth_rate", "torque_rms", "level_error", "threshold_velocity")
NUMBERS = {
    "verdicts": (*OF_VERDICTS, "kick_velocity"),
    "cycles": OF_CYCLES,
    "branches": (*OF_CYCLES, "value"),
}
WORDS = {"verdicts": ("verdict", "reason"), "cycles": (), "branches": ("along", "cycle_id")}
GROWTH = "max_growth_rate"
# codes of cycles whose stability is not known, and of runs in time; stable cycles have 1, others 0
NOT_KNOWN, RUN_IN_TIME = 2, 3


def cycles_content(results: Results, points: pd.DataFrame) -> tuple[Content, list[Content]]:
    """Verdicts, cycles and branches of some design points, and quantities that a map can show."""
    unit = results.units.get(TORQUE, "N m")
    row_of_id = pd.Series(np.arange(len(points)), index=points["point_id"])
    tables = {name: _of_points(results.table(name), row_of_id) for name in NUMBERS}
    tables["cycles"] = _with_runs(tables["cycles"], tables["verdicts"])
    content: Content = {"unit": unit}
    for name, table in tables.items():
        first_rows = table.head(MOST_ROWS)
        part: Content = {
            "n": len(first_rows),
            "n_all": len(table),
            "row": packed_exact(first_rows["row"]),
        }
        part |= {
            n: packed_single(_numbers(first_rows[n])) for n in NUMBERS[name] if n in first_rows
        }
        part["mode"] = packed_whole(first_rows["mode"].to_numpy())
        part |= {n: first_rows[n].astype(str).tolist() for n in WORDS[name]}
        if "stable" in first_rows:
            states = _states(first_rows["stable"])
            if "by_run" in first_rows:
                states[first_rows["by_run"].to_numpy(bool)] = RUN_IN_TIME
            part["stable"] = packed_whole(states)
        content[name] = part
    words, status = points["verdict"].astype(str).tolist(), points["status"].tolist()
    measures = [classes("verdict", words, status, FILLS)]
    named = {
        "torque_rms": (f"RMS of {of_friction(unit)}", unit),
        "frequency_hz": ("frequency", "Hz"),
    }
    named[GROWTH] = ("fastest growth", "1/s")
    named["threshold_velocity"] = ("kick along unstable cycle", "m/s")
    n = points["n_unstable"]
    for name, (text, column) in named.items():
        if name not in points:  # results of an earlier version
            continue
        values = _numbers(points[name])
        if np.isfinite(values).any():
            measures.append(measure(text, column, values, n if name == GROWTH else None))
    return content, measures


def of_friction(unit: str) -> str:
    """What the columns ``torque_*`` are: a torque, or the friction force of a lumped model."""
    return "torque" if unit == "N m" else "friction force"


def _numbers(column: pd.Series) -> np.ndarray:
    numbers: np.ndarray = column.to_numpy(dtype=float, na_value=np.nan)
    return numbers


def _of_points(table: pd.DataFrame, row_of_id: pd.Series) -> pd.DataFrame:
    """Rows of a table that belong to design points of the page, with the index `row` of these."""
    rows = row_of_id.reindex(table["point_id"]).to_numpy(dtype=float)
    is_shown = np.isfinite(rows)
    return table[is_shown].assign(row=rows[is_shown].astype(int))


def _with_runs(cycles: pd.DataFrame, verdicts: pd.DataFrame) -> pd.DataFrame:
    """Cycles, followed by levels that are known from runs in time only."""
    runs = run_levels(verdicts, cycles)[["row", "mode", "torque_rms", "level_error"]]
    hertz = verdicts.loc[runs.index, "cycle_frequency_hz"]
    runs = runs.assign(frequency_hz=hertz, contact_velocity=np.nan, by_run=True, stable=None)
    if not len(runs):
        return cycles
    return pd.concat([cycles.assign(by_run=False).astype({"stable": object}), runs])


def _states(stable: pd.Series) -> np.ndarray:
    is_known = stable.notna().to_numpy()
    states: np.ndarray = np.full(len(stable), NOT_KNOWN)
    states[is_known] = stable[is_known].astype(bool).astype(int)
    return states
