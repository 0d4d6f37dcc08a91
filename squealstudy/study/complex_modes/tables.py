"""The two tables of a study, built from its chunk files: points and modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.analysis.tracking import Tracks, track
from squealstudy.analysis.tracking_tree import tracking_tree
from squealstudy.errors import ResultsError
from squealstudy.study.chunks import read_chunks
from squealstudy.study.complex_modes.alignment import ShapeAlignment
from squealstudy.study.complex_modes.reference import read_references
from squealstudy.study.complex_modes.rows import SCHEMA
from squealstudy.study.files import write_parquet
from squealstudy.study.names import MODES, POINTS
from squealstudy.study.plan import Plan


def build_tables(plan: Plan, directory: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read all chunks, track the modes, write both tables, return them.

    Raises
    ------
    ResultsError
        Where a point of the plan is in no chunk.
    """
    ids = [task.point_id for task in plan.tasks]
    found = read_chunks(directory, set(ids), SCHEMA)
    missing = sum(i not in found for i in ids)
    if missing:
        raise ResultsError(f"{directory}: {missing} of {len(ids)} design points are not solved")
    rows = [found[i] for i in ids]
    tracks = _track(plan, rows) if plan.study.definition.modes.track else None
    modes = _modes_table(plan, rows, tracks)
    points = _points_table(plan, rows, modes, read_references(directory))
    write_parquet(directory / POINTS, points_arrow(points, plan.study.shown_parameters))
    write_parquet(directory / MODES, modes_arrow(modes))
    return points, modes


def _track(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> Tracks:
    """Track the oscillating modes over the design."""
    lams, shapes = [], []
    alignment = ShapeAlignment(plan)
    for task, row in zip(plan.tasks, rows, strict=True):
        modes = [m for m in row["modes"] if not m["overdamped"]]
        lams.append(np.array([complex(m["re"], m["im"]) for m in modes]))
        vectors = [np.frombuffer(m["shape"], dtype=np.complex64) for m in modes]
        stacked = np.stack(vectors) if vectors else np.zeros((0, 1), dtype=np.complex64)
        shapes.append(alignment.apply(task.prepared_key, stacked))
    parents = tracking_tree(plan.coordinates, plan.grid_shape).tolist()
    return track(parents, lams, shapes, plan.coordinates)


def _modes_table(
    plan: Plan, rows: Sequence[Mapping[str, Any]], tracks: Tracks | None
) -> pd.DataFrame:
    components = list(plan.study.model.components)
    counts = np.array([len(row["modes"]) for row in rows], dtype=int)
    flat = [m for row in rows for m in row["modes"]]
    lam = np.array([complex(m["re"], m["im"]) for m in flat], dtype=complex)
    overdamped = np.array([m["overdamped"] for m in flat], dtype=bool)
    size = np.abs(lam)
    zeta = -lam.real / np.where(size > 0, size, 1.0)
    tolerance = plan.study.definition.modes.stability_tolerance
    label, mac, ambiguous = _labels(rows, tracks)
    energies = np.array([m["energies"] for m in flat]).reshape(len(flat), len(components) + 1)
    table = pd.DataFrame(
        {
            "point_id": np.repeat([row["point_id"] for row in rows], counts),
            "mode": np.array([j + 1 for n in counts for j in range(n)], dtype=np.int32),
            "track": label,
            "track_mac": mac,
            "track_ambiguous": ambiguous,
            "frequency_hz": size / (2 * np.pi),
            "growth_rate": lam.real,
            "damping_ratio": zeta,
            "unstable": zeta < -tolerance,
            "overdamped": overdamped,
            "residual": np.array([m["residual"] for m in flat], dtype=float),
        }
    )
    for name, share in zip([*components, "interfaces"], energies.T, strict=True):
        table[f"energy_{name}"] = share
    return table


def _labels(
    rows: Sequence[Mapping[str, Any]], tracks: Tracks | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Track, MAC and ambiguity of every mode; overdamped roots come last in a point, untracked."""
    labels, macs, doubts = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for i, row in enumerate(rows):
        n = len(row["modes"])
        label, mac, doubt = np.full(n, -1), np.full(n, np.nan), np.zeros(n)
        if tracks is not None:
            m = len(tracks.labels[i])
            label[:m], mac[:m], doubt[:m] = tracks.labels[i], tracks.macs[i], tracks.ambiguous[i]
        labels.append(label)
        macs.append(mac)
        doubts.append(doubt)
    return (
        np.concatenate(labels).astype(np.int32),
        np.concatenate(macs),
        np.concatenate(doubts).astype(bool),
    )


def _points_table(
    plan: Plan,
    rows: Sequence[Mapping[str, Any]],
    modes: pd.DataFrame,
    references: Mapping[str, Mapping[str, Any]],
) -> pd.DataFrame:
    plain = ("point_id", "status", "message", "wall_s")
    points = pd.DataFrame({name: [row[name] for row in rows] for name in plain})
    for parameter in plan.study.shown_parameters:
        points[parameter] = [float(v[parameter]) for v in plan.shown_values]
    sums = modes.groupby("point_id").agg(
        n_modes=("mode", "size"), n_unstable=("unstable", "sum"), n_overdamped=("overdamped", "sum")
    )
    for name in ("n_modes", "n_unstable", "n_overdamped"):
        points[name] = points["point_id"].map(sums[name]).fillna(0).astype(np.int32)
    for name in ("working_point_residual", "open_share"):
        points[name] = np.array([row[name] for row in rows], dtype=float)
    for kind in ("frequency", "damping"):
        values = [references.get(i, {}).get(f"{kind}_error", np.nan) for i in points["point_id"]]
        points[f"reference_{kind}_error"] = np.array(values, dtype=float)
    return points


def points_arrow(points: pd.DataFrame, parameters: Sequence[str]) -> pa.Table:
    """The points table with its explicit schema."""
    schema = pa.schema(
        [(n, pa.string()) for n in ("point_id", "status", "message")]
        + [("wall_s", pa.float64())]
        + [(p, pa.float64()) for p in parameters]
        + [(n, pa.int32()) for n in ("n_modes", "n_unstable", "n_overdamped")]
        + [
            (n, pa.float64())
            for n in (
                "working_point_residual",
                "open_share",
                "reference_frequency_error",
                "reference_damping_error",
            )
        ]
    )
    return pa.Table.from_pandas(points, schema=schema, preserve_index=False)


def modes_arrow(modes: pd.DataFrame) -> pa.Table:
    """The modes table with its explicit schema."""
    types = {
        "point_id": pa.string(),
        "mode": pa.int32(),
        "track": pa.int32(),
        "track_ambiguous": pa.bool_(),
        "unstable": pa.bool_(),
        "overdamped": pa.bool_(),
    }
    schema = pa.schema([(name, types.get(name, pa.float64())) for name in modes.columns])
    return pa.Table.from_pandas(modes, schema=schema, preserve_index=False)
