"""Comparison of predicted limit cycles with the motions of runs in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.tables.comparison import OF_THE_RUN, OPEN, STABLE, join_points
from squealstudy.wording import IF_KICKED, NO_CYCLE, SQUEALS, SUSTAINED

AGREES, DOUBTFUL, DIFFERS, CANNOT = "agrees", "doubtful", "differs", "open"  # verdict and run
MAX_DEVIATION = 0.2  # relative, of levels beyond their errors: other motion lasts than was found
LOUDER_RATIO = 1.02  # a design's level above its stable cycles by this ratio is none of theirs
COLUMNS = (
    {"verdict": "str", "bistable": "boolean", "n_stable": "int64"}
    | {"predicted_torque_rms": "f8", "predicted_frequency_hz": "f8", "threshold_velocity": "f8"}
    | {"class": "str", "torque_rms": "f8", "frequency_hz": "f8", "torque_line_hz": "f8"}
    | {"level_deviation": "f8", "level_deviation_error": "f8", "frequency_deviation": "f8"}
    | {"agreement": "str"}
    | {"cycle_id": "str", "cycles_point_id": "str", "time_point_id": "str"}
)


def compare_cycles(
    points: pd.DataFrame,
    cycles: pd.DataFrame,
    time_points: pd.DataFrame,
    parameters: Sequence[str],
    time_parameters: Sequence[str],
    nominal: Mapping[str, float],
) -> pd.DataFrame:
    """One row for each design point that both studies have: verdict and level beside a run's.

    Points are joined as in `tables.comparison.compare`.

    Returns
    -------
    DataFrame
        The parameters of both studies, then COLUMNS. `bistable`: a stable cycle or a lasting run
        was found beside steady sliding without an unstable mode; missing where that is undecided.
        The predicted cycle is, of the stable ones, that nearest in frequency to a run that lasts
        (to its loudest line where the motion does not repeat), else the loudest; a run whose level
        the design has is one of them, without an id. `level_deviation` and
        `frequency_deviation` are run / predicted - 1, of runs that last; `level_deviation_error`
        what the bounds of the run's level and the error of the cycle's leave open, NaN where one
        of them cannot be told. `agreement`: ``differs`` where a design of verdict squeals stays
        silent, or one without a cycle vibrates; ``open`` where verdict or run is undecided;
        ``doubtful`` where both vibrate, but the levels are apart by more than MAX_DEVIATION beyond
        their errors: several motions may last. A design that squeals if kicked agrees with both
        silence and vibration: it depends on the start.

    Raises
    ------
    ResultsError
        Studies without a common design point.
    """
    names = list(dict.fromkeys([*time_parameters, *parameters]))
    distinct_cycles = cycles[
        (cycles["same_as"] == "").to_numpy(bool) & cycles["stable"].fillna(False)
    ]
    rows = []
    for k, t in join_points(
        points, time_points, parameters, time_parameters, nominal, ("limit cycles", "time study")
    ):
        design, run = points.iloc[k], time_points.iloc[t]
        stable = distinct_cycles[(distinct_cycles["point_id"] == design["point_id"]).to_numpy()]
        values = {n: float((run if n in time_parameters else design)[n]) for n in names}
        ids = {"cycles_point_id": design["point_id"], "time_point_id": run["point_id"]}
        rows.append(values | ids | _verdict(design, len(stable)) | _levels(design, stable, run))
        agreement = _agreement(str(design["verdict"]), str(run["class"]))
        if agreement == AGREES and _is_apart(rows[-1]):
            agreement = DOUBTFUL
        rows[-1]["agreement"] = agreement
    return pd.DataFrame(rows, columns=[*names, *COLUMNS]).astype(COLUMNS)


def _verdict(design: pd.Series, n_stable: int) -> dict[str, object]:
    """Cells on what limit cycles predict for a design."""
    ok = design["status"] == "ok"
    verdict = str(design["verdict"]) if ok else str(design["status"])
    quiet = ok and int(design["n_unstable"]) == 0 and not bool(design["unstable_outside"])
    bistable: object = quiet and (n_stable > 0 or verdict == IF_KICKED)
    if not ok or (not bistable and verdict not in (SQUEALS, NO_CYCLE)):
        bistable = None
    return {
        "verdict": verdict,
        "bistable": bistable,
        "n_stable": n_stable,
        "threshold_velocity": design["threshold_velocity"],
    }


def _is_apart(row: Mapping[str, Any]) -> bool:
    """Whether levels differ so much that the run is no motion that was found."""
    deviation = abs(float(row["level_deviation"]))
    return deviation > MAX_DEVIATION + np.nan_to_num(float(row["level_deviation_error"]))


def _with_run(stable: pd.DataFrame, design: pd.Series) -> pd.DataFrame:
    """The stable cycles of a design, and the run whose level it has where that is louder."""
    level = float(design.get("torque_rms", np.nan))
    if not level > LOUDER_RATIO * stable["torque_rms"].max() and (len(stable) or not level > 0.0):
        return stable
    hz = float(design.get("frequency_hz", np.nan))
    hz = hz if np.isfinite(hz) else float(design.get("torque_line_hz", np.nan))
    if not np.isfinite(hz):
        return stable
    run = {"cycle_id": "", "frequency_hz": hz, "torque_rms": level}
    run["level_error"] = float(design.get("level_error", np.nan))
    return pd.DataFrame([*stable.to_dict("records"), run])


def _levels(design: pd.Series, stable: pd.DataFrame, run: pd.Series) -> dict[str, object]:
    """Cells on the level and frequency of a run beside the cycle nearest to it."""
    row: dict[str, object] = {name: run[name] for name in OF_THE_RUN}
    line = float(run["torque_line_hz"])
    run_hz = float(run.get("frequency_hz", np.nan))  # earlier versions have none
    row["frequency_hz"] = run_hz
    row |= {"predicted_torque_rms": np.nan, "predicted_frequency_hz": np.nan, "cycle_id": ""}
    row |= dict.fromkeys(("level_deviation", "level_deviation_error"), np.nan)
    row["frequency_deviation"] = np.nan
    lasts = run["class"] in SUSTAINED
    hz, level = run_hz if np.isfinite(run_hz) else line, float(run["torque_rms"])
    motions = _with_run(stable, design)
    if not len(motions):
        return row
    if lasts and np.isfinite(hz):
        cycle = motions.iloc[int(np.nanargmin(np.abs(motions["frequency_hz"] / hz - 1.0)))]
    else:
        cycle = motions.iloc[int(np.argmax(motions["torque_rms"]))]
    row["cycle_id"] = cycle["cycle_id"]
    row["predicted_torque_rms"] = cycle["torque_rms"]
    row["predicted_frequency_hz"] = cycle["frequency_hz"]
    if lasts:
        predicted = float(cycle["torque_rms"])
        row["level_deviation"] = level / predicted - 1.0
        bounds = (float(run.get(f"torque_rms_{end}", np.nan)) for end in ("low", "high"))
        own_error = max(abs(bound - level) for bound in bounds) / predicted
        ratio_error = level / predicted * float(cycle.get("level_error", np.nan))
        row["level_deviation_error"] = own_error + ratio_error
        row["frequency_deviation"] = hz / float(cycle["frequency_hz"]) - 1.0
    return row


def _agreement(verdict: str, run: str) -> str:
    """Whether a run agrees with the verdict on its design."""
    if run in OPEN or run not in (*SUSTAINED, STABLE):
        return CANNOT
    if verdict == IF_KICKED:
        return AGREES
    if verdict not in (SQUEALS, NO_CYCLE):
        return CANNOT
    return AGREES if (verdict == SQUEALS) == (run in SUSTAINED) else DIFFERS
