"""Text of `squealstudy compare`: predictions beside runs in time."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd
from rich.console import RenderableType

from squealstudy.screen import grid, notes
from squealstudy.tables.comparison import BOTH, TIME, UNFOLLOWED, VIBRATION
from squealstudy.tables.comparison import FREQUENCY as PREDICTED
from squealstudy.tables.cycle_comparison import AGREES, CANNOT, DIFFERS, DOUBTFUL, MAX_DEVIATION
from squealstudy.tables.mode_ranking import group_kind
from squealstudy.wording import (
    SUSTAINED,
    figure,
    in_column,
    motion_frequency,
    named_tracks,
    plural,
    track_number,
    with_unit,
)

TITLES = ("mode", "Hz", "growth 1/s", "forecast", "fitted", "95 %", "dev %", "energy %", "lives")
AGREEMENTS = {AGREES: "agree", DOUBTFUL: "doubtful", DIFFERS: "differ", CANNOT: "open"}


def comparison(
    table: pd.DataFrame, names: Mapping[int, tuple[str, bool]] | None = None
) -> list[RenderableType]:
    """The table of `Results.compare` with a line for each instability, and a summary.

    `names` are those of the tracks of the complex-mode study (`Results.track_names`).
    """
    if not len(table):
        return [summary(table)]
    varied = [n for n in table.attrs["parameters"] if len(table[n].unique()) > 1]
    units = table.attrs["units"]
    shown = grid(
        *(f"value:{with_unit(name, units)}" for name in varied),
        *TITLES,
        "text:in time",  # it gives way first: figures are never cut
        rows=(
            [*(in_column(row[n], units.get(n, "")) for n in varied), *_cells(row)]
            for row in table.to_dict("records")
        ),
    )
    legend = notes(
        "growth: of the frequency study; forecast: of the time study's own complex mode; fitted: "
        "in time; dev: fitted against growth",
        "energy: share of the vibration that lasts, in the mode's plane of motion; lives: 5 % or "
        "more of it, ? where the run does not tell",
        *named_tracks(table["track"], names or {}),
    )
    return [summary(table), "", shown, legend]


def cycle_comparison(table: pd.DataFrame) -> list[RenderableType]:
    """The table of `Results.compare` for limit cycles, a line for each design, and a summary."""
    varied = [n for n in table.attrs["parameters"] if len(table[n].unique()) > 1]
    units = table.attrs["units"]
    unit = units.get("torque_rms", "N m")
    columns = (f"RMS {unit}", "in time", "dev %", "Hz", "in time Hz", "dev %", "kick m/s")
    shown = grid(
        *(f"value:{with_unit(name, units)}" for name in varied),
        "word:verdict",
        "word:in time",
        *(f"value:{title}" for title in columns),
        "word:bistable",
        "word:",
        rows=(
            [*(in_column(row[n], units.get(n, "")) for n in varied), *_cycle_cells(row)]
            for row in table.to_dict("records")
        ),
    )
    counts = table["agreement"].value_counts()
    counts_text = ", ".join(f"{counts[n]} {text}" for n, text in AGREEMENTS.items() if n in counts)
    bistable, unknown = int(table["bistable"].sum()), int(table["bistable"].isna().sum())
    text = f"{plural(len(table), 'design point')} compared: {counts_text}; {bistable} bistable"
    text += f", {unknown} cannot be told" if unknown else ""
    legend = notes(
        "RMS, Hz: of the stable cycle nearest in frequency to a run that lasts, else of the "
        "loudest, the design's own run among them; dev: run against it",
        "kick: contact velocity of the unstable cycle; bistable: a stable cycle or a lasting "
        "run beside stable steady sliding, so that a run may do either",
        f"doubtful: levels more than {100 * MAX_DEVIATION:g} % apart: several motions may last, "
        "which of them depends on the start"
        if DOUBTFUL in counts
        else "",
    )
    return [f"{text}.", "", shown, legend]


def _cycle_cells(row: dict[Hashable, Any]) -> list[str]:
    """Cells of a row that compares a limit cycle with a run in time."""
    bistable = "?" if pd.isna(row["bistable"]) else "yes" if row["bistable"] else "no"
    return [
        str(row["verdict"]).replace("_", " "),
        str(row["class"]).replace("_", " "),
        figure(row["predicted_torque_rms"]),
        figure(row["torque_rms"]),
        figure(100 * row["level_deviation"], "+.2f"),
        figure(row["predicted_frequency_hz"], ".1f"),
        motion_frequency(row["frequency_hz"], row["torque_line_hz"], 1),
        figure(100 * row["frequency_deviation"], "+.3f"),
        figure(row["threshold_velocity"]),
        bistable,
        str(row["agreement"]),
    ]


def summary(table: pd.DataFrame) -> str:
    """Sentences on the points compared, instabilities predicted and expressed, and other motion."""
    points = table.attrs["points"]
    parts = [f"{plural(points, 'design point')} compared", *_failures(table.attrs)]
    predicted = table[table["kind"].isin([BOTH, PREDICTED]).to_numpy()]
    only_in_time = table[(table["kind"] == TIME).to_numpy()]
    if not len(predicted) and not len(only_in_time):
        parts.append("neither study predicts an instability there")
    if len(predicted):
        number = plural(len(predicted), "predicted instability", "predicted instabilities")
        parts.append(f"{number}, {_expressed_text(predicted)}")
    if len(only_in_time):
        parts.append(
            f"{len(only_in_time)} more in the time study alone, {_expressed_text(only_in_time)}"
        )
    return "\n".join(["; ".join(parts) + ".", *_unforeseen(table)])


def _failures(counts: Mapping[Hashable, Any]) -> list[str]:
    return [
        f"{counts[f'failed_{name}']} of them failed in the {name} study"
        for name in ("frequency", "time")
        if counts[f"failed_{name}"]
    ]


def _expressed_text(rows: pd.DataFrame) -> str:
    """Text on how many instabilities are in the vibration that lasts."""
    expressed, unknown = (
        rows["expressed"].fillna(False).astype(bool),
        int(rows["expressed"].isna().sum()),
    )
    count = int(expressed.sum())
    text = "1 expresses itself" if count == 1 else f"{count} express themselves"
    return text + (f", {unknown} cannot be told" if unknown else "")


def _unforeseen(table: pd.DataFrame) -> list[str]:
    """Sentences on motion that no predicted instability explains."""
    rows = table[(table["kind"] == VIBRATION).to_numpy()]
    lasts = rows["class"].isin(SUSTAINED).to_numpy(bool)
    others = table[table["kind"].isin([BOTH, PREDICTED, TIME])]
    foreseen = rows["time_point_id"].isin(others["time_point_id"]).to_numpy(bool)
    n_unfollowed = int((table["kind"] == UNFOLLOWED).sum())
    counted_texts = (
        (int((lasts & ~foreseen).sum()), "vibrate in time with no mode predicted"),
        (int((lasts & foreseen).sum()), "vibrate in time otherwise than predicted"),
        (int((~lasts).sum()), "grow or are undecided in time with no mode predicted"),
        (
            n_unfollowed,
            "vibrate while unstable modes are not followed (above the band, or too many)",
        ),
    )
    return [
        f"{plural(number, 'design point')}: {text}." for number, text in counted_texts if number
    ]


def _cells(row: dict[Hashable, Any]) -> list[str]:
    """Cells of a row that compares growth in a run with a complex mode."""
    has_frequency = row["frequency_hz"] == row["frequency_hz"]
    bounds = f"{row['low']:.4g} to {row['high']:.4g}" if row["low"] == row["low"] else "-"
    expressed = "?" if pd.isna(row["expressed"]) else "yes" if row["expressed"] else "no"
    is_motion = row["kind"] in (VIBRATION, UNFOLLOWED)
    return [
        _mode(int(row["track"])),
        figure(row["frequency_hz"] if has_frequency else row["predicted_frequency_hz"], ".0f"),
        figure(row["growth_rate"]),
        figure(row["predicted_growth_rate"]),
        figure(row["fitted_growth_rate"]),
        bounds,
        figure(100 * row["deviation"], "+.1f"),
        figure(100 * row["level_share"], ".0f"),
        "-" if is_motion else expressed,
        _motion(row),
    ]


def _mode(track: int) -> str:
    """Text of a track's number, or of the kind of mode that has none."""
    if track == 0:
        return "-"
    return track_number(track) if track > 0 else group_kind(track)


def _motion(row: dict[Hashable, Any]) -> str:
    """Class and strongest line of a run; its level too if the motion was not predicted."""
    line = figure(row["torque_line_hz"], ".0f")
    text = str(row["class"]) + (f", {line} Hz" if line != "-" else "")
    why = {VIBRATION: "not predicted", UNFOLLOWED: "not followed"}.get(str(row["kind"]))
    return f"{text}, RMS {figure(row['torque_rms'])}: {why}" if why else text
