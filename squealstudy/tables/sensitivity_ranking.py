"""Sensitivities of one mode, the largest first (figure 7 of Vermot des Roches et al. 2010)."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.wording import in_digits

# relative distance of a mode from the frequency asked for that is no match
MAX_MATCH_REL_DISTANCE = 0.1


def mode_sensitivities(
    sensitivities: pd.DataFrame, frequency_hz: float | None = None, point_id: str | None = None
) -> pd.DataFrame:
    """Rows of one mode of one design point.

    Parameters
    ----------
    sensitivities : DataFrame
        The table of a sensitivity study.
    frequency_hz : float or None
        The mode nearest this; without, the mode of largest growth rate. Over several design
        points, that where the growth rate of this mode is largest.
    point_id : str or None
        The design point; any by default.

    Raises
    ------
    ResultsError
        No mode there, or none within 10 % of the frequency.
    """
    rows = sensitivities
    if point_id is not None:
        rows = rows[rows["point_id"] == point_id]
    if not len(rows):
        raise ResultsError("no mode was chosen there, so there are no sensitivities")
    modes = rows.drop_duplicates(["point_id", "mode"])
    if frequency_hz is not None:
        distance = (modes["frequency_hz"] - frequency_hz).abs()
        nearest = distance.groupby(modes["point_id"]).transform("min")
        modes = modes[(distance == nearest) & (distance <= MAX_MATCH_REL_DISTANCE * frequency_hz)]
        if not len(modes):
            frequencies = sorted({in_digits(f) for f in rows["frequency_hz"]}, key=float)
            raise ResultsError(
                f"no mode near {frequency_hz:g} Hz, there are {', '.join(frequencies)} Hz"
            )
    best = modes.iloc[int(modes["growth_rate"].to_numpy().argmax())]
    is_of_mode = (rows["point_id"] == best["point_id"]) & (rows["mode"] == best["mode"])
    return rows[is_of_mode.to_numpy()]


def rank_sensitivities(mode: pd.DataFrame, top: int | None = None) -> pd.DataFrame:
    """The rows of `mode_sensitivities`, largest change of growth rate for +1 % first."""
    order = np.argsort(-mode["growth_per_percent"].abs().to_numpy(), kind="stable")
    return mode.iloc[order[:top]].reset_index(drop=True)


def parameter_text(row: Mapping[Hashable, Any]) -> str:
    """A parameter, with the frequency of its component mode."""
    name, frequency = str(row["parameter"]), float(row["component_frequency_hz"])
    return f"{name} ({in_digits(frequency)} Hz)" if np.isfinite(frequency) else name


def step_text(row: Mapping[Hashable, Any]) -> str:
    """A step in percent of the value; of damping ratios and from zero as it is."""
    change, nominal = float(row["change"]), float(row["value"])
    if nominal and not str(row["parameter"]).endswith("damping_ratio"):
        return f"{100 * change / abs(nominal):+.3g} %"
    return f"{change:+.3g} {row['unit']}".rstrip()
