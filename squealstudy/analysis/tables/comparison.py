"""Predicted instabilities of the frequency domain beside what they do in time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError

FREQUENCY_TOLERANCE = 0.01  # relative, between one complex mode of the two studies
SAME = 1e-6  # relative, between values of a parameter
FAILED = "failed"  # class of a run that ended early: it tells of growth, not of what remains
NAMED = 8  # values of a parameter that a message lists
COLUMNS = (
    {"track": "int64", "frequency_hz": "f8", "growth_rate": "f8"}
    | {"predicted_frequency_hz": "f8", "predicted_growth_rate": "f8", "fitted_growth_rate": "f8"}
    | {"low": "f8", "high": "f8", "deviation": "f8", "level_share": "f8"}
    | {"expressed": "boolean", "class": "str", "dominant_frequency_hz": "f8"}
    | {"freq_point_id": "str", "time_point_id": "str"}
)


def compare(
    freq_points: pd.DataFrame,
    freq_modes: pd.DataFrame,
    time_points: pd.DataFrame,
    growth: pd.DataFrame,
    freq_parameters: Sequence[str],
    time_parameters: Sequence[str],
    nominal: Mapping[str, float],
) -> pd.DataFrame:
    """One row a predicted instability at each design point that both studies have.

    Points join where all parameters in both lists are equal, and each parameter that only one
    study has is at the value at which the other study ran.

    Parameters
    ----------
    freq_points, freq_modes : DataFrame
        Tables of a complex-mode study.
    time_points, growth : DataFrame
        Tables of a transient study.
    freq_parameters, time_parameters : sequence of str
        Parameter columns of the points tables.
    nominal : mapping of parameter -> value
        For each parameter of one study alone, its value in the other.

    Returns
    -------
    DataFrame
        The parameters of both studies, then COLUMNS: `frequency_hz` [Hz]
        and `growth_rate` [1/s] of the frequency study's unstable track, `predicted_...` of the
        nearest complex mode of the time study's own model within FREQUENCY_TOLERANCE, its fitted
        growth with 95 % bounds, `deviation` = fitted / growth_rate - 1, `expressed` (missing where
        the time study cannot tell). Instabilities that only the time study predicts have track 0
        and NaN in place of the frequency study's values.

    Raises
    ------
    ResultsError
        Where no design points join, or those that do failed in the frequency study.
    """
    joined = _join(freq_points, time_points, freq_parameters, time_parameters, nominal)
    unstable = freq_modes[
        freq_modes["unstable"].to_numpy(bool)
        & ~freq_modes["overdamped"].to_numpy(bool)
        & (freq_modes["track"] > 0).to_numpy()
    ]
    solved = [(f, t) for f, t in joined if freq_points["status"].iloc[f] == "ok"]
    if not solved:
        raise ResultsError("every design point that both studies have failed in the frequency one")
    names = list(dict.fromkeys([*time_parameters, *freq_parameters]))
    rows = []
    for f, t in solved:
        time, frequency = time_points.iloc[t], freq_points.iloc[f]
        design = {n: float((time if n in time_parameters else frequency)[n]) for n in names}
        predicted = unstable[(unstable["point_id"] == frequency["point_id"]).to_numpy()]
        own = growth[(growth["point_id"] == time["point_id"]).to_numpy()]
        own = own[(own["growth_rate"] > 0).to_numpy()]
        ids = {"freq_point_id": frequency["point_id"], "time_point_id": time["point_id"]}
        found = {"class": time["class"], "dominant_frequency_hz": time["dominant_frequency_hz"]}
        rows += [design | ids | found | row for row in _instabilities(predicted, own)]
    table = pd.DataFrame(rows, columns=[*names, *COLUMNS]).astype(COLUMNS)
    table["deviation"] = table["fitted_growth_rate"] / table["growth_rate"] - 1.0
    table["expressed"] = table["expressed"].mask(table["class"] == FAILED)
    return table


def _join(
    freq_points: pd.DataFrame,
    time_points: pd.DataFrame,
    freq_parameters: Sequence[str],
    time_parameters: Sequence[str],
    nominal: Mapping[str, float],
) -> list[tuple[int, int]]:
    """Rows of both points tables that are one design, in the order of the time study."""
    shared = [n for n in freq_parameters if n in time_parameters]
    pairs = []
    here = np.logical_and.reduce(
        [np.ones(len(freq_points), dtype=bool)]
        + [_equal(freq_points[n], nominal[n]) for n in freq_parameters if n not in shared]
    )
    there = np.logical_and.reduce(
        [np.ones(len(time_points), dtype=bool)]
        + [_equal(time_points[n], nominal[n]) for n in time_parameters if n not in shared]
    )
    for t in np.flatnonzero(there):
        same = [_equal(freq_points[n], float(time_points[n].iloc[t])) for n in shared]
        match = np.flatnonzero(np.logical_and.reduce([here, *same]))
        pairs += [(int(match[0]), int(t))] if len(match) else []
    if not pairs:
        raise ResultsError(
            "the two studies have no design point in common; frequency study: "
            f"{_values(freq_points, freq_parameters)}; time study: "
            f"{_values(time_points, time_parameters)}"
            + _nominal_text(freq_parameters, time_parameters, nominal)
        )
    return pairs


def _equal(values: pd.Series, value: float) -> np.ndarray:
    same: np.ndarray = np.isclose(values.to_numpy(dtype=float), value, rtol=SAME, atol=0.0)
    return same


def _values(points: pd.DataFrame, names: Sequence[str]) -> str:
    """The parameters with their values, in one line."""
    texts = []
    for name in names:
        values = np.unique(points[name].to_numpy(dtype=float))
        listed = ", ".join(f"{v:g}" for v in values[:NAMED])
        texts.append(f"{name} = {listed}" + (", ..." if len(values) > NAMED else ""))
    return "; ".join(texts) or "no parameters"


def _nominal_text(
    freq_parameters: Sequence[str], time_parameters: Sequence[str], nominal: Mapping[str, float]
) -> str:
    alone = sorted(set(freq_parameters) ^ set(time_parameters))
    listed = ", ".join(f"{name} = {nominal[name]:g}" for name in alone)
    return f"; what only one of them has must be {listed}" if alone else ""


def _instabilities(predicted: pd.DataFrame, own: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Rows of one design point: the frequency study's by growth, then those of time alone."""
    predicted = predicted.sort_values("growth_rate", ascending=False)
    partner = _partners(predicted["frequency_hz"].to_numpy(), own["frequency_hz"].to_numpy())
    for row, match in zip(predicted.to_dict("records"), partner, strict=True):
        columns = {n: row[n] for n in ("track", "frequency_hz", "growth_rate")}
        if match < 0:
            yield columns
            continue
        yield columns | _in_time(own.iloc[match])
    for k in np.setdiff1d(np.arange(len(own)), partner):
        yield {"track": 0} | _in_time(own.iloc[k])


def _in_time(row: pd.Series) -> dict[str, object]:
    return {
        "predicted_frequency_hz": row["frequency_hz"],
        "predicted_growth_rate": row["growth_rate"],
        "fitted_growth_rate": row["fitted_growth_rate"],
        "low": row["fitted_low"],
        "high": row["fitted_high"],
        "level_share": row["level_share"],
        "expressed": bool(row["expressed"]) if np.isfinite(row["level_share"]) else None,
    }


def _partners(wanted: np.ndarray, available: np.ndarray) -> np.ndarray:
    """Index into `available` (m,) of the mode nearest to each of `wanted` (n,), -1 for none.

    Closest pairs first, none used twice.
    """
    partner = np.full(len(wanted), -1)
    distance = np.abs(available[None, :] / wanted[:, None] - 1.0)
    for place in np.argsort(distance, axis=None, kind="stable"):
        i, j = np.unravel_index(place, distance.shape)
        if distance[i, j] > FREQUENCY_TOLERANCE:
            break
        if partner[i] < 0 and j not in partner:
            partner[i] = j
    return partner
