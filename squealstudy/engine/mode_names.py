"""Names modes in results by their shapes: at a point, and a track where it grows fastest."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from squealstudy.engine.mode_shapes import expect_complex_modes, point_shapes
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.progress import progress
from squealstudy.shapes.names import AND, name_of

NO_DIAMETERS = -1  # value of n_diameters where no nodal diameters are counted


def mode_names(
    results: ResultTables, tracks: Iterable[int] | None = None, max_points: int | None = None
) -> pd.DataFrame:
    """Names of modes in results, by their shapes.

    Each design point with one of these modes is solved again, as for `Results.shape`.

    Parameters
    ----------
    tracks : iterable of int or None
        Numbers of modes in rankings; None: all tracks that are unstable somewhere.
    max_points : int or None
        Largest number of design points at which a track is named: the one where it grows fastest,
        and others spread evenly over the study. None: no limit. Points where the track is stable
        are left out unless it is stable everywhere.

    Returns
    -------
    DataFrame
        ``point_id``, ``mode``, ``track``, ``name``. For the rotor that moves most:
        ``n_diameters`` (-1 where none is counted), ``diameters_share``, that of this harmonic in
        the motion of the rotor's ring, and ``out_of_plane_share``. For the two real modes that the
        mode is made of: ``first_`` and ``second_real_mode_hz`` [Hz] and ``_share``, and
        ``real_modes_phase`` [deg] between them.

    Raises
    ------
    ResultsError
        Where a track does not exist, or for the reasons of `Results.shape`.
    """
    expect_complex_modes(results)
    modes = results.modes[~results.modes["overdamped"].to_numpy(bool)]
    tracks_there = set(modes.loc[modes["track"] >= 0, "track"])
    if tracks is None:
        tracks = modes.loc[modes["unstable"] & (modes["track"] >= 0), "track"].unique()
    asked_tracks = [int(track) for track in tracks]
    if missing := [track for track in asked_tracks if track not in tracks_there]:
        raise ResultsError(f"{results.directory}: no mode of track {missing[0]}")
    named_modes = [_chosen(modes[modes["track"] == track], max_points) for track in asked_tracks]
    rows = pd.concat([modes.iloc[:0], *named_modes])
    row_of_point = {point_id: row for row, point_id in enumerate(results.points["point_id"])}
    point_rows = rows["point_id"].map(row_of_point).to_numpy()
    name_rows = []
    with progress() as report:
        for done, row in enumerate(np.unique(point_rows)):
            report("names", done, len(np.unique(point_rows)))
            shapes = point_shapes(results, int(row))
            of_point = rows.loc[point_rows == row, ["mode", "track"]]
            for mode, track in of_point.itertuples(index=False):
                shape = shapes.shape(int(mode))
                name = name_of(shape)
                waves = name.waves
                (first_hz, first_share), (second_hz, second_share) = shape.pair
                name_rows.append(
                    {
                        "point_id": results.points["point_id"].iloc[int(row)],
                        "mode": mode,
                        "track": track,
                        "name": name.text,
                        "n_diameters": waves.diameters if waves else NO_DIAMETERS,
                        "diameters_share": waves.share if waves else np.nan,
                        "out_of_plane_share": waves.out_of_plane if waves else np.nan,
                        "first_real_mode_hz": first_hz,
                        "first_real_mode_share": first_share,
                        "second_real_mode_hz": second_hz,
                        "second_real_mode_share": second_share,
                        "real_modes_phase": shape.pair_phase,
                    }
                )
        report("names", len(np.unique(point_rows)), len(np.unique(point_rows)))
    return pd.DataFrame(name_rows, columns=list(COLUMNS)).astype(COLUMNS)


COLUMNS = {"point_id": "str", "mode": "int64", "track": "int64", "name": "str"} | {
    "n_diameters": "int64",
    "diameters_share": "f8",
    "out_of_plane_share": "f8",
    "first_real_mode_hz": "f8",
    "first_real_mode_share": "f8",
    "second_real_mode_hz": "f8",
    "second_real_mode_share": "f8",
    "real_modes_phase": "f8",  # deg
}


def _chosen(modes_of_track: pd.DataFrame, max_points: int | None) -> pd.DataFrame:
    """The modes of a track that are named: unstable ones if there are any, else all.

    If there are more than `max_points`, the one of fastest growth, and others spread evenly.
    """
    modes_of_track = (
        modes_of_track[modes_of_track["unstable"]]
        if modes_of_track["unstable"].any()
        else modes_of_track
    )
    if max_points is None or len(modes_of_track) <= max_points:
        return modes_of_track
    spread = np.linspace(0, len(modes_of_track) - 1, max(max_points - 1, 0)).round().astype(int)
    fastest = modes_of_track["growth_rate"].to_numpy().argmax()
    return modes_of_track.iloc[np.unique(np.append(spread, fastest))]


def track_names(names: pd.DataFrame, modes: pd.DataFrame) -> pd.DataFrame:
    """The name of each track, and where it changes.

    Parameters
    ----------
    names : DataFrame
        Table that `Results.names` returns.
    modes : DataFrame
        Modes table of the same results.

    Returns
    -------
    DataFrame
        A row for each track, indexed by its number: `name` at the point where it grows fastest;
        `n_points`, at how many points it was named; `n_named`, how many of these have this name;
        `changes`, whether any has another (the order of words does not count); `others`, the other
        names with their counts.
    """
    named_modes = names.merge(modes[["point_id", "mode", "growth_rate"]], on=["point_id", "mode"])
    row_of = {}
    named_modes["name"] = _in_one_order(named_modes["name"])
    for track, track_rows in named_modes.groupby("track", sort=False):
        counts = track_rows.groupby("name")["growth_rate"].agg(["size", "max"])
        fastest = counts["max"].idxmax()
        others = counts["size"].drop(fastest).sort_values(ascending=False, kind="stable")
        row_of[track] = {
            "name": fastest,
            "n_points": len(track_rows),
            "n_named": int((track_rows["name"] == fastest).sum()),
            "changes": len(others) > 0,
            "others": ", ".join(f"{name} at {size}" for name, size in others.items()),
        }
    columns = ["name", "n_points", "n_named", "changes", "others"]
    return pd.DataFrame.from_dict(row_of, orient="index", columns=columns).rename_axis("track")


def _in_one_order(names: pd.Series) -> pd.Series:
    """Names, where those with the same words in another order become the most frequent one."""
    words = names.map(lambda name: frozenset(name.split(AND)))
    return names.groupby(words).transform(lambda variants: variants.mode().iloc[0])
