"""The history of a run as it is in results, and its file."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.engine.result_names import HISTORIES
from squealstudy.motion.kept_rows import SUMMED, joined, row_variances
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.energies import energy_outside, mode_energies

NOTICEABLE_SHARE = 0.01  # least share of the energy, at some row, of a sensed mode with columns


def history_frame(run: Motion, every: int = 1) -> pd.DataFrame:
    """History of a run: torque, contact shares, energies and amplitudes of noticeable modes.

    One of `every` rows is kept; its sums and extremes include all rows since the one kept before.
    """
    history = run.history
    energies = mode_energies(run.sensed_q, run.sensed_v, run.omega)
    columns = {
        name: history[name] for name in ("time", "torque", "normal_force", "stick", "slip", "open")
    }
    if (schedule := run.point.schedule) is not None:
        columns["sliding_speed"] = run.point.speed * schedule.speed_at(run.times)
        if np.isfinite(schedule.pressure):
            columns["pressure"] = schedule.pressure * schedule.pressure_at(run.times)
    columns |= {
        "energy": run.modal_energy,
        "energy_outside": energy_outside(energies, run.modal_energy),
    }
    noticeable = (energies >= NOTICEABLE_SHARE * run.modal_energy[:, None]).any(axis=0) & (
        energies > 0
    ).any(axis=0)
    for k in np.flatnonzero(noticeable):
        mode, omega = run.sensed[k], max(float(run.omega[k]), 1e-300)
        columns[f"energy_mode_{mode}"] = energies[:, k]
        columns[f"amplitude_mode_{mode}"] = np.sqrt(2 * energies[:, k]) / omega
    frame_columns = {name: values[::every] for name, values in columns.items()}
    if "torque_mean" in history:
        frame_columns |= {
            name: joined(history[name], every, reduce) for name, reduce in SUMMED.items()
        }
        frame_columns["torque_rms"] = np.sqrt(row_variances(history, every))
    return pd.DataFrame(frame_columns)


def history_file(point_id: str, frame: pd.DataFrame) -> dict[str, pa.Table]:
    """A history as a table, by its path in the results; all but time is in single precision."""
    single_precision = frame.astype({name: "float32" for name in frame.columns if name != "time"})
    table = pa.Table.from_pandas(single_precision, preserve_index=False)
    return {f"{HISTORIES}/{point_id}.parquet": table}
