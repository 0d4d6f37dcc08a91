"""Tracks that are one mode whose number changes between neighbouring design points.

Round a coalescence in the plane of two parameters two modes change places: no numbering holds on
all lines of a grid. Where an onset turns out to be none, for the unstable mode stays so and goes on
under another number, both numbers are of one family.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.tables.stability import INTO

RENUMBERED = "renumbered"  # no onset: the mode is unstable at both ends, under two numbers
BEGUN = ("first_seen", "broken")  # of a track that begins unstable
ENDS = ["point_before", "point_after"]


def linked_tracks(onsets: pd.DataFrame) -> list[tuple[int, int]]:
    """Pairs of tracks between which an unstable mode changes its number.

    Parameters
    ----------
    onsets : DataFrame
        Of a study of complex modes.
    """
    renumbered = onsets[(onsets["status"] == RENUMBERED).to_numpy(bool)]
    begun = onsets[onsets["status"].isin(BEGUN).to_numpy(bool)]
    pairs = []
    for (_, after), rows in renumbered.groupby(ENDS, sort=False):
        into = (rows["direction"] == INTO).to_numpy(bool)
        others = rows[into] if into.any() else begun[(begun["point_after"] == after).to_numpy(bool)]
        hz = others["frequency_hz"].to_numpy(float)
        goes = rows[~into]
        for track, own_hz in zip(goes["track"].tolist(), goes["frequency_hz"], strict=True):
            if len(hz):
                pairs.append((track, int(others["track"].iloc[np.abs(hz - own_hz).argmin()])))
    return pairs


def families(
    tracks: pd.Index, onsets: pd.DataFrame | None, group: np.ndarray, code: np.ndarray
) -> pd.DataFrame:
    """Family of each ranked group of modes.

    Parameters
    ----------
    tracks : Index of int
        Of the ranking: tracks, and numbers below zero that have no family.
    onsets : DataFrame or None
    group, code : ndarray (m,) of int
        Group of each mode (`mode_ranking.unstable_groups`), 0 of stable ones, and its design point.

    Returns
    -------
    DataFrame
        Indexed by `track`: ``family``, the least track of those that are one, or its own;
        ``family_modes``, most unstable modes of the family at one design point; ``family_points``,
        design points at which one of them is unstable.
    """
    least = {int(track): int(track) for track in tracks}
    for one, other in [] if onsets is None else linked_tracks(onsets):
        if one in least and other in least:
            low, high = sorted((least[one], least[other]))
            least = {track: low if of == high else of for track, of in least.items()}
    number = pd.Series(least, dtype="int64", index=tracks)
    rows = np.flatnonzero(group)
    own = pd.DataFrame({"family": number.reindex(group[rows]).to_numpy(), "point": code[rows]})
    own["track"] = group[rows]
    at = own.drop_duplicates().groupby(["family", "point"]).size().groupby(level="family")
    return pd.DataFrame(
        {
            "family": number,
            "family_modes": at.max().reindex(number.to_numpy()).to_numpy(),
            "family_points": at.size().reindex(number.to_numpy()).to_numpy(),
        },
        index=tracks,
    )
