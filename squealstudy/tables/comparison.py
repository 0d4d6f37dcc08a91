"""Predicted instabilities of the frequency domain beside what they do in time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from squealstudy.errors import ResultsError
from squealstudy.root_pairs import partners
from squealstudy.tables.mode_ranking import OVERDAMPED_GROUP, unstable_groups
from squealstudy.wording import SUSTAINED

FREQUENCY_TOLERANCE = 0.01  # relative, between one complex mode of the two studies
SAME_VALUE_REL_TOLERANCE = 1e-6  # relative, between values of a parameter
STABLE = "stable"
OPEN = ("growing", "undecided")  # classes that do not tell yet what remains
MAX_VALUES_IN_MESSAGE = 8  # values of a parameter that a message lists
BOTH, FREQUENCY, TIME = "both", "frequency", "time"  # kinds of rows: who predicts an instability
VIBRATION, UNFOLLOWED = "vibration", "unfollowed"
COLUMNS = (
    {"kind": "str", "track": "int64", "frequency_hz": "f8", "growth_rate": "f8"}
    | {"predicted_frequency_hz": "f8", "predicted_growth_rate": "f8", "fitted_growth_rate": "f8"}
    | {"low": "f8", "high": "f8", "deviation": "f8", "level_share": "f8"}
    | {"expressed": "boolean", "class": "str", "torque_line_hz": "f8", "torque_rms": "f8"}
    | {"freq_point_id": "str", "time_point_id": "str"}
)
OF_THE_RUN = ("class", "torque_line_hz", "torque_rms")


def compare(
    freq_points: pd.DataFrame,
    freq_modes: pd.DataFrame,
    time_points: pd.DataFrame,
    growth: pd.DataFrame,
    freq_parameters: Sequence[str],
    time_parameters: Sequence[str],
    nominal: Mapping[str, float],
) -> pd.DataFrame:
    """Rows of each design point that both studies have: what is predicted, and what vibrates.

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
        The parameters of both studies, then COLUMNS. `kind` says who has the row:

        "both": the frequency study predicts an instability, and the complex modes of the time
        study's own model have one within FREQUENCY_TOLERANCE. "frequency", "time": one of them
        alone. "vibration": a run that vibrates (classes limit_cycle, irregular) though no
        predicted instability has its energy, or one that grows or is undecided where none is
        predicted; `track` is 0 there, and only the columns of the run are known. "unfollowed": the
        same, where the time study's model has unstable modes that the run does not follow (above
        the band, or too many), so that they may have the energy.

        `track` is that of the frequency study: OVERDAMPED_GROUP and FIRST_UNTRACKED_GROUP of
        `mode_ranking` for an overdamped unstable root and a mode without a track, 0 where the
        frequency study has none. `frequency_hz` [Hz] (|lambda|/2 pi) and `growth_rate` [1/s] are
        the frequency study's, `predicted_...` those of the time study's own complex mode, beside
        its fitted growth with 95 % bounds; `deviation` = fitted / growth_rate - 1. `level_share` is
        the share of the sustained vibration's energy (`motion.outcome.complex_shares`), `expressed`
        whether it is a twentieth or more: missing where the run does not tell. `class`,
        `torque_line_hz` [Hz] and `torque_rms` are those of the run.

        `attrs` counts what is compared: ``points``, of them ``failed_frequency`` (left out) and
        ``failed_time``.

    Raises
    ------
    ResultsError
        Where no design points join, or those that do failed in the frequency study.
    """
    joined = join_points(freq_points, time_points, freq_parameters, time_parameters, nominal)
    group = unstable_groups(freq_modes)
    unstable = freq_modes.assign(track=group)[group != 0]
    solved = [(f, t) for f, t in joined if freq_points["status"].iloc[f] == "ok"]
    if not solved:
        raise ResultsError("every design point that both studies have failed in the frequency one")
    names = list(dict.fromkeys([*time_parameters, *freq_parameters]))
    rows = []
    for f, t in solved:
        time, frequency = time_points.iloc[t], freq_points.iloc[f]
        design = {n: float((time if n in time_parameters else frequency)[n]) for n in names}
        predicted = unstable[(unstable["point_id"] == frequency["point_id"]).to_numpy()]
        unstable_growth = growth[(growth["point_id"] == time["point_id"]).to_numpy()]
        unstable_growth = unstable_growth[unstable_growth["unstable"].to_numpy(bool)]
        ids = {"freq_point_id": frequency["point_id"], "time_point_id": time["point_id"]}
        common = design | ids | {name: time[name] for name in OF_THE_RUN}
        instabilities = list(_instabilities(predicted, unstable_growth))
        rows += [
            common | row
            for row in [*instabilities, *_vibration(time, unstable_growth, instabilities)]
        ]
    table = pd.DataFrame(rows, columns=[*names, *COLUMNS]).astype(COLUMNS)
    table["deviation"] = table["fitted_growth_rate"] / table["growth_rate"] - 1.0
    is_decided = table["class"].isin([*SUSTAINED, STABLE])
    table["expressed"] = table["expressed"].where(is_decided)
    table.attrs = {
        "points": len(joined),
        "failed_frequency": len(joined) - len(solved),
        "failed_time": sum(time_points["status"].iloc[t] != "ok" for _, t in solved),
    }
    return table


def _vibration(
    run: pd.Series, followed: pd.DataFrame, instabilities: Sequence[Mapping[str, object]]
) -> list[dict[str, object]]:
    """A row for a run whose motion no predicted instability explains, or none."""
    explained = any(row.get("expressed") is True for row in instabilities)
    unexplained = run["class"] in SUSTAINED and not explained
    unforeseen = run["class"] in OPEN and not instabilities
    if not (unexplained or unforeseen):
        return []
    outside = sum(int(run.get(f"n_unstable_{side}", 0)) for side in ("above", "below"))
    all_followed = int(run["n_unstable"]) + outside <= len(followed)
    return [{"kind": VIBRATION if all_followed else UNFOLLOWED, "track": 0}]


def join_points(
    freq_points: pd.DataFrame,
    time_points: pd.DataFrame,
    freq_parameters: Sequence[str],
    time_parameters: Sequence[str],
    nominal: Mapping[str, float],
    names: tuple[str, str] = ("frequency study", "time study"),
) -> list[tuple[int, int]]:
    """Rows of both points tables that are one design, in the order of the time study.

    Arguments are those of `compare`, and what messages call both; ResultsError where there is none.
    """
    at_nominal = {n: nominal[n] for n in time_parameters if n not in freq_parameters}
    pairs = []
    for t in _rows_at(time_points, at_nominal):
        run = time_points.iloc[t]
        values = {n: run[n] if n in time_parameters else nominal[n] for n in freq_parameters}
        pairs += [(int(f), int(t)) for f in _rows_at(freq_points, values)[:1]]
    if not pairs:
        raise ResultsError(
            f"the two studies have no design point in common; {names[0]}: "
            f"{_values(freq_points, freq_parameters)}; {names[1]}: "
            f"{_values(time_points, time_parameters)}"
            + _nominal_text(freq_parameters, time_parameters, nominal)
        )
    return pairs


def _rows_at(points: pd.DataFrame, values: Mapping[str, float]) -> np.ndarray:
    """Rows of a points table (n,) at which parameters have these values; all without any."""
    table = points[list(values)].to_numpy(dtype=float)
    same = np.isclose(
        table, np.array(list(values.values()), dtype=float), rtol=SAME_VALUE_REL_TOLERANCE, atol=0.0
    )
    return np.flatnonzero(same.all(axis=1))


def _values(points: pd.DataFrame, names: Sequence[str]) -> str:
    """The parameters with their values, in one line."""
    texts = []
    for name in names:
        values = np.unique(points[name].to_numpy(dtype=float))
        listed = ", ".join(f"{v:g}" for v in values[:MAX_VALUES_IN_MESSAGE])
        texts.append(
            f"{name} = {listed}" + (", ..." if len(values) > MAX_VALUES_IN_MESSAGE else "")
        )
    return "; ".join(texts) or "no parameters"


def _nominal_text(
    freq_parameters: Sequence[str], time_parameters: Sequence[str], nominal: Mapping[str, float]
) -> str:
    only_in_one = sorted(set(freq_parameters) ^ set(time_parameters))
    listed = ", ".join(f"{name} = {nominal[name]:g}" for name in only_in_one)
    return f"; what only one of them has must be {listed}" if only_in_one else ""


def _instabilities(predicted: pd.DataFrame, followed: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Rows of one design point: the frequency study's by growth, then those of time alone."""
    predicted = predicted.sort_values("growth_rate", ascending=False, kind="stable")
    predicted_hz = (
        predicted["frequency_hz"].mask(predicted["track"] == OVERDAMPED_GROUP).to_numpy(dtype=float)
    )
    partner = _partners(predicted_hz, followed["frequency_hz"].to_numpy(dtype=float))
    for row, match in zip(predicted.to_dict("records"), partner, strict=True):
        columns = {n: row[n] for n in ("track", "frequency_hz", "growth_rate")}
        if match < 0:
            yield {"kind": FREQUENCY} | columns
            continue
        yield {"kind": BOTH} | columns | _in_time(followed.iloc[match])
    for k in np.setdiff1d(np.arange(len(followed)), partner):
        yield {"kind": TIME, "track": 0} | _in_time(followed.iloc[k])


def _in_time(row: pd.Series) -> dict[str, object]:
    """Cells of a complex mode that a run was watched through."""
    return {
        "predicted_frequency_hz": row["frequency_hz"],
        "predicted_growth_rate": row["growth_rate"],
        "fitted_growth_rate": row["fitted_growth_rate"],
        "low": row["fitted_low"],
        "high": row["fitted_high"],
        "level_share": row["level_share"],
        "expressed": None if pd.isna(row["expressed"]) else bool(row["expressed"]),
    }


def _partners(predicted: np.ndarray, available: np.ndarray) -> np.ndarray:
    """Index into `available` (m,) of the mode nearest to each of `predicted` (n,), -1 for none.

    None is used twice; none for NaN, as of a mode that does not oscillate.
    """
    distance = np.abs(available / predicted[:, None] - 1.0)
    return partners(np.nan_to_num(distance, nan=np.inf), FREQUENCY_TOLERANCE)
