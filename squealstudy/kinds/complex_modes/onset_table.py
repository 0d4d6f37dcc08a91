"""First onsets of a grid of many designs: a row a value of one parameter, a column the others'.

Of few designs `design_lines` tells more, a row each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.kinds.complex_modes.design_lines import GRID, MOST_DESIGNS
from squealstudy.screen import grid, notes
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.stability import INTO
from squealstudy.wording import amount, with_unit

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MOST_ROWS, MOST_COLUMNS = 13, 6  # of the table; of more values some are shown
BELOW, NEVER = -np.inf, np.inf  # in place of an onset
RUNS_BELOW_RANGE = "below_range"  # status of an onset


def onset_table(results: ResultTables) -> list[RenderableType]:
    """First onset of each design; nothing where there are few, or too many for a table.

    Those of real roots, which have no track, are not known: such a design has none.
    """
    along = results.along
    if not along or results.design != GRID or results.boundary is not None:
        return []
    onsets = first_onsets(results, along)
    names = [str(name) for name in onsets.index.names]
    if len(onsets) <= MOST_DESIGNS or "onsets" not in results.tables:
        return []
    counts = {name: onsets.index.get_level_values(name).nunique() for name in names}
    down = max(names, key=counts.__getitem__)
    others = [name for name in names if name != down]
    table = onsets.unstack(others) if others else onsets.to_frame("")  # noqa: PD010 - of a grid
    if table.shape[1] > MOST_COLUMNS:
        return []
    every = len(table)
    table = table.iloc[np.unique(np.linspace(0, every - 1, MOST_ROWS).round().astype(int))]
    units, top = results.units, float(results.points[along].max())
    shown = grid(
        f"value:{with_unit(down, units)}",
        *(f"value:{_title(column, others, units, along)}" for column in table.columns),
        rows=(
            [f"{number:.6g}", *(_cell(onset, top, units.get(along, "")) for onset in row)]
            for number, row in zip(table.index, table.to_numpy(float), strict=True)
        ),
    )
    fewer = f"; {len(table)} of {every} values of {down}" if len(table) < every else ""
    columns = f" at each {', '.join(others)}, a column each" if others else ""
    return [
        shown,
        notes(f"least {along} at which a mode turns unstable{columns}{fewer}\n"),
    ]


def first_onsets(results: ResultTables, along: str) -> pd.Series:
    """Least onset by the values of all other varied parameters.

    BELOW where a mode is unstable at the least value; NEVER where all points are solved and surely
    stable; NaN where none is known.
    """
    points = results.points
    names = [n for n in parameter_columns(points, varied=True) if n != along]
    if not names:
        return pd.Series(dtype=float, index=pd.MultiIndex.from_arrays([[]], names=[""]))
    quiet = (points["status"] == "ok") & (points["n_unstable_high"] == 0).fillna(False)
    surely_quiet = quiet.astype(bool).groupby([points[name] for name in names]).all()
    onsets = results.table("onsets")
    into = onsets[(onsets["direction"] == INTO).to_numpy(bool)]
    values = into["onset"].where(into["status"] != RUNS_BELOW_RANGE, BELOW)
    first = values.groupby([into[name] for name in names]).min()
    first = first.reindex(surely_quiet.index)
    return first.where(first.notna() | ~surely_quiet, NEVER)


def _title(column: object, others: list[str], units: dict[str, str], along: str) -> str:
    """The values of the other parameters, or what stands in the only column."""
    if not others:
        return f"first onset {along}"
    values = column if isinstance(column, tuple) else (column,)
    shown = zip(others, map(float, values), strict=True)
    if len(others) == 1:
        return f"{others[0]} {amount(float(values[0]), units.get(others[0], ''))}"
    return ", ".join(amount(number, units.get(name, "")) for name, number in shown)


def _cell(onset: float, top: float, unit: str) -> str:
    if onset == BELOW:
        return "below range"
    if onset == NEVER:
        return f"none up to {amount(top, unit)}"
    return amount(onset, unit) if onset == onset else "-"
