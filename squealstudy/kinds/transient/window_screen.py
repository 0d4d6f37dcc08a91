"""The screen of runs whose speed or pressure changes: a line for each window."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType

from squealstudy.kinds.transient.answer import heard, level_error
from squealstudy.screen import grid, notes
from squealstudy.wording import (
    QUIET,
    figure,
    in_digits,
    motion_frequency,
    small_percent,
    with_error,
)

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.result_tables import ResultTables

MIN_SLOW_RUN_S = 10.0  # shortest run whose times are shown in seconds; others in milliseconds
MAX_LISTED_WINDOWS = 24


def windows(results: ResultTables, unit: str) -> list[RenderableType]:
    """Table of the windows of a single run, or of the loudest window of each of several runs."""
    table, all_points = results.table("windows"), results.points["point_id"].tolist()
    several = len(set(table["point_id"])) > 1
    if several:
        rms = table["torque_rms"].fillna(-1.0)
        table = table.loc[rms.groupby(table["point_id"], sort=False).idxmax()]
    quantity = "torque" if unit == "N m" else "force"
    slow = bool(table["time_stop"].max() >= MIN_SLOW_RUN_S)
    has_pressure = bool(table["pressure_start"].notna().any())

    has_errors = "torque_rms_low" in table  # results of an earlier version have none

    def cells(row: dict[Hashable, Any]) -> list[str]:
        point_cell = [str(all_points.index(row["point_id"]))] if several else []
        ends = [_span(row, "time", 1.0 if slow else 1e3), _span(row, "sliding_speed", 1.0)]
        ends += [_span(row, "pressure", 1e-5)] if has_pressure else []
        return [
            *point_cell,
            *ends,
            str(row["class"]).replace("_", " "),
            figure(row["torque_mean"]),
            figure(row["torque_rms"]),
            *(
                [small_percent(level_error(row) / (row["torque_rms"] or np.nan))]
                if has_errors
                else []
            ),
            motion_frequency(row["frequency_hz"], row["torque_line_hz"]),
            figure(100 * row["stick_share"], ".0f"),
        ]

    listed = table.head(MAX_LISTED_WINDOWS)
    window_grid = grid(
        *(["point"] if several else []),
        *(f"value:{'s' if slow else 'ms'}", "value:m/s", *(["value:bar"] if has_pressure else [])),
        *("word:class", f"value:{quantity} {unit}", "value:RMS", *["value:+- %"] * has_errors),
        *("value:Hz", "value:stick %"),
        rows=(cells(row) for row in listed.to_dict("records")),
    )
    more = len(table) - len(listed)
    legend = notes(
        f"{more} more in the table windows" if more else "",
        "speed or pressure change: the loudest window of each run, all in the table windows"
        if several
        else "speed or pressure change: what each part of the run does",
        f"RMS: of the {quantity} about a straight line, +-: its error; Hz: of the motion (x2: "
        "loudest at twice that; ~: loudest line of a motion that does not repeat)",
        "quiet: RMS below 1 % of steady sliding's; stick slip: contact begins to stick twice or "
        "more",
    )
    return [window_grid, legend]


def in_words(results: ResultTables, unit: str) -> str:
    """Course of a run whose speed or pressure changes, and where it is loudest; '' for several."""
    table = results.table("windows")
    if not len(table) or len(set(table["point_id"])) > 1:
        return ""
    slow = bool(table["time_stop"].max() >= MIN_SLOW_RUN_S)
    factor, time_unit = (1.0, "s") if slow else (1e3, "ms")
    words = table["class"].astype(str)
    runs_of_words = [
        rows for _, rows in table.groupby((words != words.shift()).cumsum().to_numpy())
    ]
    parts = [
        f"{str(rows['class'].iloc[0]).replace('_', ' ')} to "
        f"{factor * rows['time_stop'].iloc[-1]:.4g} {time_unit}{_frequencies(rows)}"
        for rows in runs_of_words
    ]
    text = f" From {factor * table['time_start'].iloc[0]:.4g} {time_unit} on: {', '.join(parts)}."
    if table["torque_rms"].isna().all():
        return text
    loudest = table.iloc[int(table["torque_rms"].fillna(-1.0).to_numpy().argmax())]
    level = with_error(float(loudest["torque_rms"]), level_error(loudest))
    return (
        f"{text} Loudest from {_span(loudest, 'time', factor)} {time_unit}, at "
        f"{_span(loudest, 'sliding_speed', 1.0)} m/s: RMS {level} {unit}, "
        f"{heard(loudest)}."
    )


def _frequencies(rows: pd.DataFrame) -> str:
    """Frequencies of successive windows of one class, in words; empty for quiet ones.

    From the first to the last, or from the least to the largest where one lies beyond these.
    """
    if rows["class"].iloc[0] == QUIET:
        return ""
    hz = rows["frequency_hz"].to_numpy(float)
    repeating = np.flatnonzero(np.isfinite(hz))
    if not len(repeating):
        return " (no period)"
    repeating_hz = hz[repeating]
    first_last, extremes = (
        (repeating_hz[0], repeating_hz[-1]),
        (repeating_hz.min(), repeating_hz.max()),
    )
    ends = dict.fromkeys(map(in_digits, first_last))
    if set(map(in_digits, extremes)) != set(ends):
        ends = dict.fromkeys(map(in_digits, extremes))
    first, last = int(repeating[0]), int(repeating[-1])
    earlier = "first without a period, then " if first else ""
    between = ", at times without a period" if len(repeating) < last + 1 - first else ""
    later = ", then without a period" if last < len(hz) - 1 else ""
    return f" ({earlier}{' to '.join(ends)} Hz{between}{later})"


def _span(row: Mapping[Hashable, Any] | pd.Series, name: str, factor: float) -> str:
    return f"{factor * row[f'{name}_start']:.4g} to {factor * row[f'{name}_stop']:.4g}"
