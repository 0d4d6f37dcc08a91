"""Ranking of the assembly's modes by their energy in vibrations that last."""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.tables import mode_ranking
from squealstudy.tables.point_rows import point_codes
from squealstudy.tables.ranking_query import selection
from squealstudy.wording import LASTING, UNDECIDED

CLASS = "class"
SHARES = ("energy_share", "energy_share_low", "energy_share_high", "energy_mean")
LEAST_IN_INTERFACES = 0.995  # of the energy of a mode: more prints as all of it
COLUMNS = (
    {"mode": "int64", "frequency_hz": "f8", "energy_share": "f8", "energy_share_max": "f8"}
    | {"first_share": "f8", "dominant_points": "int64", "gained_points": "int64"}
    | {"lost_points": "int64", "points": "int64", "worst": "str", "worst_torque_rms": "f8"}
    | {"main_component": "str", "main_share": "f8"}
    | {"second_component": "str", "second_share": "f8"}
)


def rank_energy(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    top: int | None = None,
    where: str | None = None,
) -> pd.DataFrame:
    """One row for each assembly mode, that of the largest mean energy share first.

    Parameters
    ----------
    points, modes : DataFrame
        Tables of a transient study. Points that failed, calm down or are undecided do not count.
    top : int or None
        Rows to keep.
    where : str or None
        A condition, as in `tables.mode_ranking.rank_modes`.

    Returns
    -------
    DataFrame
        COLUMNS. `energy_share` and `first_share` (of the mechanical energy, over the last and the
        first window) are means over the `points` that count, 0 where a mode is not sensed;
        `dominant_points`, `gained_points` and `lost_points` say at how many of them the mode leads,
        has taken over, has been taken over from; `worst` is the design of the largest product of
        share and torque RMS, of which `frequency_hz` is; components are those of most elastic
        energy in the mode. `attrs` counts the points that are ``undecided``, of those the query
        holds.

    Raises
    ------
    ResultsError
        For a query that cannot be used, or tables of another kind of study.
    """
    names = transient_parameters(points)
    code = point_codes(points, modes)
    counted, selected = selection(points, modes, code, where)
    lasting = counted & points[CLASS].isin(LASTING).to_numpy(bool)
    rows = np.flatnonzero(selected & lasting[code])
    ranked_modes = modes.iloc[rows].assign(point=code[rows])
    table = _summary(points[lasting], ranked_modes)
    worst = _worst(points, ranked_modes, names).reindex(table.index)
    table["worst"], table["worst_torque_rms"] = worst["worst"], worst["torque_rms"]
    table["frequency_hz"] = worst["frequency_hz"]
    energies = ranked_modes.groupby("mode")[component_columns(ranked_modes)].mean()
    table = table.join(mode_ranking.main_components(energies))
    table = table.sort_values(["energy_share", "mode"], ascending=[False, True])
    ranking = table.reset_index()[list(COLUMNS)].astype(COLUMNS).iloc[:top]
    ranking.attrs["undecided"] = int((counted & (points[CLASS] == UNDECIDED).to_numpy(bool)).sum())
    return ranking


def transient_parameters(points: pd.DataFrame, varied: bool = False) -> list[str]:
    """Parameters of the points table of a transient study; with `varied` those of many values.

    Raises ResultsError where the table has no column "class".
    """
    if CLASS not in points.columns:
        raise ResultsError(f"this is no points table of a transient study: no column '{CLASS}'")
    return mode_ranking.parameter_columns(points, varied)


def component_columns(modes: pd.DataFrame) -> list[str]:
    """Columns of elastic energy shares of components."""
    return [c for c in mode_ranking.energy_columns(modes.columns) if c not in SHARES]


def tells_parts(ranking: pd.DataFrame) -> bool:
    """Whether the energy of ranked modes tells parts apart.

    A family of matrices has no parts; all energy of a lumped model is in its interfaces.
    """
    in_interfaces = (ranking["main_component"] == "interfaces").to_numpy(bool)
    says_nothing = in_interfaces & (ranking["main_share"] >= LEAST_IN_INTERFACES).to_numpy(bool)
    named = (ranking["main_component"] != "").to_numpy(bool)
    return bool((named & ~says_nothing).any())


def _summary(lasting: pd.DataFrame, modes: pd.DataFrame) -> pd.DataFrame:
    """Shares and counts, indexed by mode."""
    n = max(len(lasting), 1)
    by_mode = modes.fillna({"energy_share": 0.0, "first_share": 0.0}).groupby("mode")
    table = pd.DataFrame(index=by_mode.size().index)
    table["energy_share"] = by_mode["energy_share"].sum() / n
    table["energy_share_max"] = by_mode["energy_share"].max()
    table["first_share"] = by_mode["first_share"].sum() / n
    table["points"] = len(lasting)
    counts = {"dominant": "dominant_mode", "gained": "transfer_to", "lost": "transfer_from"}
    for name, column in counts.items():
        n_points = lasting[column].value_counts()
        table[f"{name}_points"] = n_points.reindex(table.index).fillna(0)
    return table


def worst_point(worst: str, points: pd.DataFrame) -> int:
    """Number of the first design point with the settings of `worst`, in the order of `points`."""
    names = [part.rpartition("=")[0] for part in worst.split(", ")]
    rows = points[names].to_dict("records")
    return next(k for k, row in enumerate(rows) if mode_ranking.settings_text(row) == worst)


def _worst(points: pd.DataFrame, modes: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Design and torque RMS (N m) where share x RMS of each mode is largest, indexed by mode."""
    torque = points["torque_rms"].to_numpy()[modes["point"].to_numpy(int)]
    loudness = modes["energy_share"].to_numpy() * torque
    loud = modes.assign(loudness=np.nan_to_num(loudness), torque_rms=torque)
    loudest = loud.sort_values("loudness", kind="stable").drop_duplicates("mode", keep="last")
    worst = loudest.set_index("mode")
    shown = [n for n in names if len(points[n].unique()) > 1]
    designs = points[shown].iloc[worst["point"]].to_dict("records")
    settings = pd.Series(
        [mode_ranking.settings_text(row) for row in designs], index=worst.index, dtype="str"
    )
    return worst.assign(worst=settings)
