"""The predicted mode of the loudest run or limit cycle, told in a sentence of a report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.tables.comparison import FREQUENCY_TOLERANCE, SAME_VALUE_REL_TOLERANCE
from squealstudy.wording import (
    SUSTAINED,
    in_digits,
    name_where_fastest,
    setting,
    track_number,
)

# relative difference of the frequencies of a squeal and a predicted mode up to which the report
# calls them the same (our choice)
MAX_REL_SHIFT = 0.25

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables


def squeal_text(results: ResultTables, others: Sequence[ResultTables]) -> str:
    """Sentence on the predicted mode of the loudest motion of results; empty where unknown.

    `others` are the results in the same report. Those of complex modes of the same model give the
    mode its name.
    """
    loudest = _of_run(results) if results.kind == "transient" else None
    loudest = _of_cycle(results) if results.kind == "limit_cycles" else loudest
    if loudest is None:
        return ""
    row, heard, predicted, growth = loudest
    if abs(heard / predicted - 1.0) > MAX_REL_SHIFT:
        heard = float(row.get("torque_line_hz", np.nan))  # a motion may repeat after many periods
        if not abs(heard / predicted - 1.0) <= MAX_REL_SHIFT:
            return ""
    settings = [
        setting(name, row[name], results.units.get(name, ""))
        for name in results.swept
        if name in row and pd.notna(row[name])
    ]
    where = f", at {', '.join(settings)}" if settings else ""
    text = f"The squeal at {in_digits(heard)} Hz{where}, is the complex mode predicted at "
    text += f"{in_digits(predicted)} Hz there, with a growth rate of {growth:+.3g} 1/s"
    names = (_name(other, results, row, predicted) for other in others)
    return f"{text}{next(filter(None, names), '')}."


def _of_run(results: ResultTables) -> tuple[pd.Series, float, float, float] | None:
    """The loudest sustained run of results in time, and the predicted mode with most of its energy.

    Returns the row of the run, the frequency of the run [Hz], and the frequency [Hz] and growth
    rate [1/s] of the mode; None without such a run or mode.
    """
    points = results.points
    lasting = points[points["class"].isin(SUSTAINED).to_numpy()]
    if not len(lasting):
        return None
    row = lasting.iloc[int(lasting["torque_rms"].to_numpy(float).argmax())]
    modes = results.table("growth")
    modes = modes[(modes["point_id"] == row["point_id"]).to_numpy()]
    expressed_modes = modes[modes["expressed"].fillna(False).to_numpy(bool)]
    if not len(expressed_modes):
        return None
    mode = expressed_modes.iloc[int(expressed_modes["level_share"].to_numpy(float).argmax())]
    heard = row["frequency_hz"] if pd.notna(row["frequency_hz"]) else row["torque_line_hz"]
    return row, float(heard), float(mode["frequency_hz"]), float(mode["growth_rate"])


def _of_cycle(results: ResultTables) -> tuple[pd.Series, float, float, float] | None:
    """The loudest limit cycle of results, and the predicted mode that leads to it.

    Returns the row of its design, the frequency of the cycle [Hz], and the frequency [Hz] and
    growth rate [1/s] of the mode; None without a cycle.
    """
    verdicts = results.table("verdicts")
    with_level = verdicts[verdicts["cycle_frequency_hz"].notna() & verdicts["torque_rms"].notna()]
    if not len(with_level):
        return None
    mode = with_level.iloc[int(with_level["torque_rms"].to_numpy(float).argmax())]
    (row,) = (
        r for _, r in results.points[results.points["point_id"] == mode["point_id"]].iterrows()
    )
    numbers = ("cycle_frequency_hz", "frequency_hz", "growth_rate")
    heard, predicted, growth = (float(mode[name]) for name in numbers)
    return row, heard, predicted, growth


def _name(modes: ResultTables, motions: ResultTables, row: pd.Series, hertz: float) -> str:
    """Text with the name of a predicted mode, from results of complex modes of the same model.

    `motions` are the results of runs or cycles, `row` the design of the squeal, `hertz` the
    frequency of the mode. Empty where `modes` has no such design, or no track there.
    """
    if modes.kind != "complex_modes" or modes.manifest["model"] != motions.manifest["model"]:
        return ""
    points, is_same_point = modes.points, np.ones(len(modes.points), dtype=bool)
    for name in {*modes.parameters, *motions.parameters}:
        in_motions, in_modes = (
            (column[name] if name in column else results.manifest["nominal"].get(name))
            for column, results in ((row, motions), (points, modes))
        )
        if in_motions is None or in_modes is None:
            return ""
        is_same_point &= np.isclose(
            np.asarray(in_modes, float), in_motions, rtol=SAME_VALUE_REL_TOLERANCE, atol=0
        )
    ids = points.loc[is_same_point, "point_id"]
    mode_rows = modes.modes[modes.modes["point_id"].isin(ids).to_numpy()]
    rel_distance = (mode_rows["frequency_hz"] / hertz - 1.0).abs().to_numpy(float)
    if not len(mode_rows) or rel_distance.min() > FREQUENCY_TOLERANCE:
        return ""
    track = int(mode_rows["track"].iloc[int(rel_distance.argmin())])
    if track <= 0:
        return ""
    name = track_number(track)
    if track in modes.track_names:
        name += f" ({name_where_fastest(modes.track_names[track])})"
    return f": {name} of {modes.manifest['name']}"
