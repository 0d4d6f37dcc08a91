"""Names of modes of results: by point and mode, and of a track where it grows fastest."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from squealstudy.engine.mode_shapes import expect_complex_modes, point_shapes
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.progress import progress
from squealstudy.shapes.names import AND, name_of

NO_DIAMETERS = -1  # in n_diameters: none is counted


def mode_names(
    results: ResultTables, tracks: Iterable[int] | None = None, max_points: int | None = None
) -> pd.DataFrame:
    """Names of modes of results by their shapes.

    Each design point that has one of them is solved again, as for `Results.shape`.

    Parameters
    ----------
    tracks : iterable of int or None
        Modes by their numbers in rankings; by default all that are unstable somewhere.
    max_points : int or None
        Largest number of design points of a track at which it is named: the one where it grows
        fastest, and others evenly through the study. None names it at all of them. Points where
        it is stable count only if it is unstable nowhere.

    Returns
    -------
    DataFrame
        ``point_id``, ``mode``, ``track``, ``name``; of the rotor that moves most
        ``n_diameters`` (-1 where none is counted), ``diameters_share`` of that harmonic in the
        motion of the ring of the rotor, ``out_of_plane_share``.

    Raises
    ------
    ResultsError
        As `Results.shape`.
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
    """The modes of a track that are named: unstable ones if there are, else all.

    At most `max_points`: the one of fastest growth, and others evenly through the study.
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
        `Results.names`.
    modes : DataFrame
        Of the same results; the name is that of the point at which growth is fastest.

    Returns
    -------
    DataFrame
        A row a track, indexed by it: `name` where it grows fastest; `n_points`, how many were
        named; `n_named`, how many of them have this name; `changes`, whether any has another (the
        order of words does not count); `others`, the other names with their counts.
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
    """Names of the same words in another order replaced by the most frequent of them."""
    words = names.map(lambda name: frozenset(name.split(AND)))
    return names.groupby(words).transform(lambda variants: variants.mode().iloc[0])
