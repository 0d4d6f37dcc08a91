"""Finds tracks that are one mode, so that a ranking does not count the mode twice.

The number of a mode may change between neighbouring design points. Around a coalescence in the
plane of two parameters two modes change places: no numbering is right on all lines of a grid. Two
tracks are of one family in two cases. An apparent onset is none, as the unstable mode continues
under the other number. Or two modes near in frequency exchange their growth between neighbouring
points, and a label there is ambiguous. Modes that are followed without doubt are of different
families.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

import numpy as np
import pandas as pd

from squealstudy.modes.tracking.tree import cross_edges, tracking_tree
from squealstudy.tables.stability import INTO, REFINED_ONSETS

RENUMBERED = "renumbered"  # no onset: the mode is unstable at both ends, under two numbers
NOT_LOCATED = "failed"  # an onset whose refinement failed: somewhere between both ends
BEGINS_UNSTABLE = ("first_seen", "broken")  # status of onsets of tracks that begin unstable
ENDS = ["point_before", "point_after"]  # columns of the points between which an onset lies
MAX_REL_FREQUENCY_GAP = 0.02  # largest relative distance of two modes that may be exchanged
MAX_CELLS = 10**8  # most points times squared tracks for which exchanges are sought


def linked_tracks(onsets: pd.DataFrame) -> list[tuple[int, int]]:
    """Pairs of tracks between which an unstable mode changes its number.

    Parameters
    ----------
    onsets : DataFrame
        Onsets of a study of complex modes.
    """
    renumbered = onsets[(onsets["status"] == RENUMBERED).to_numpy(bool)]
    begins = onsets["status"].isin(BEGINS_UNSTABLE) & (onsets["direction"] == INTO)
    begins_unstable = onsets[begins.to_numpy(bool)]
    pairs = []
    for (_, after), rows in renumbered.groupby(ENDS, sort=False):
        into = (rows["direction"] == INTO).to_numpy(bool)
        beginning = (
            rows[into]
            if into.any()
            else begins_unstable[(begins_unstable["point_after"] == after).to_numpy(bool)]
        )
        hz = beginning["frequency_hz"].to_numpy(float)
        ending = rows[~into]
        for track, track_hz in zip(ending["track"].tolist(), ending["frequency_hz"], strict=True):
            if len(hz):
                pairs.append((track, int(beginning["track"].iloc[np.abs(hz - track_hz).argmin()])))
    return pairs


def neighbours(points: pd.DataFrame, names: Sequence[str]) -> np.ndarray:
    """Rows (e, 2) of solved points that are neighbours on a line of a grid.

    All parameters but one are equal on a line. Failed points are skipped, as tracks skip them.
    """
    pairs = [np.zeros((0, 2), dtype=int)]
    solved = np.flatnonzero((points["status"] == "ok").to_numpy(bool))
    points = points.iloc[solved]
    for name in names:
        others = [n for n in names if n != name]
        line = points.groupby(others, dropna=False).ngroup() if others else 0 * points.index
        order = np.lexsort((points[name].to_numpy(float), np.asarray(line)))
        same = np.diff(np.asarray(line)[order]) == 0
        pairs.append(solved[np.column_stack([order[:-1][same], order[1:][same]])])
    return np.vstack(pairs)


def scattered_neighbours(points: pd.DataFrame, names: Sequence[str]) -> np.ndarray:
    """Rows (e, 2) of neighbouring solved points of a random design.

    Each point is paired with its parent in the tree along which tracks run, and with its nearest
    points.
    """
    solved = np.flatnonzero((points["status"] == "ok").to_numpy(bool))
    x = points[list(names)].to_numpy(dtype=float)[solved]
    parents = tracking_tree(x)
    joined = np.flatnonzero(parents >= 0)
    edges = [np.column_stack([parents[joined], joined]), cross_edges(x, parents)]
    both_solved: np.ndarray = solved[np.vstack(edges)]
    return both_solved


def exchanged_tracks(
    modes: pd.DataFrame, code: np.ndarray, edges: np.ndarray, tracks: Sequence[int]
) -> Iterator[tuple[int, int]]:
    """Pairs of tracks that exchange their growth between two points, where one is ambiguous.

    Parameters
    ----------
    modes : DataFrame
        Modes, with ``track``, ``track_ambiguous``, ``unstable``, ``frequency_hz``.
    code : ndarray (m,) of int
        Number of the design point of each mode.
    edges : ndarray (e, 2) of int
        Numbers of neighbouring points.
    tracks : sequence of int
        Tracks that are unstable somewhere.
    """
    count = int(edges.max(initial=-1)) + 1
    if count * len(tracks) ** 2 > MAX_CELLS:
        return
    hz, grows, doubtful = {}, {}, {}
    number, unstable = modes["track"].to_numpy(), modes["unstable"].to_numpy(bool)
    ambiguous = modes["track_ambiguous"].to_numpy(bool)
    for track in tracks:
        rows = np.flatnonzero((number == track) & (code < count))
        hz[track] = np.full(count, np.nan)
        hz[track][code[rows]] = modes["frequency_hz"].to_numpy(float)[rows]
        grows[track] = np.zeros(count, dtype=bool)
        grows[track][code[rows]] = unstable[rows]
        doubtful[track] = np.zeros(count, dtype=bool)
        doubtful[track][code[rows]] = ambiguous[rows]
    a, b = edges.T
    for track_a, track_b in combinations(tracks, 2):
        near_in_frequency = np.abs(hz[track_a] - hz[track_b]) < MAX_REL_FREQUENCY_GAP * hz[track_a]
        grows_a, grows_b = grows[track_a], grows[track_b]
        exchange = (grows_a[a] & grows_b[b] & ~grows_a[b] & ~grows_b[a]) | (
            grows_b[a] & grows_a[b] & ~grows_b[b] & ~grows_a[a]
        )
        is_ambiguous = doubtful[track_a] | doubtful[track_b]
        if (
            exchange
            & near_in_frequency[a]
            & near_in_frequency[b]
            & (is_ambiguous[a] | is_ambiguous[b])
        ).any():
            yield track_a, track_b


def same_mode_pairs(
    tracks: Iterable[int],
    onsets: pd.DataFrame | None,
    modes: pd.DataFrame,
    code: np.ndarray,
    points: pd.DataFrame,
    names: Sequence[str],
    scattered: bool,
) -> list[tuple[int, int]]:
    """Pairs of unstable tracks that are one mode, by `linked_tracks` and `exchanged_tracks`.

    `names` are the parameters of the points. If these are `scattered`, as in a random design, their
    neighbours are those of `scattered_neighbours`, else those on the lines of a grid.
    """
    tracked = [int(number) for number in tracks if number > 0]
    linked = [] if onsets is None else linked_tracks(onsets)
    if len(tracked) < 2 or not modes["track_ambiguous"].to_numpy(bool).any():
        return linked
    edges = (scattered_neighbours if scattered else neighbours)(points, names)
    return [*linked, *exchanged_tracks(modes, code, edges, tracked)]


def pairs_growing_together(onsets: pd.DataFrame | None) -> list[tuple[int, int]]:
    """Pairs of tracks that are unstable together somewhere between two neighbouring points.

    One track turns unstable before the other is stable again, by more than the errors of the two
    onsets. There are two unstable modes, although no solved point has both.
    """
    if onsets is None or "error_estimate" not in onsets:  # results of an earlier version
        return []
    refined = onsets[onsets["status"].isin(REFINED_ONSETS).to_numpy(bool)]
    pairs: list[tuple[int, int]] = []
    for _, rows in refined.groupby(ENDS, sort=False):
        begins = (rows["direction"] == INTO).to_numpy(bool)
        if begins.any() and not begins.all():
            tracks, onset = rows["track"].to_numpy(), rows["onset"].to_numpy(float)
            error = rows["error_estimate"].to_numpy(float)  # NaN (unknown) is no overlap
            overlap = (onset + error)[begins, None] < (onset - error)[~begins]
            pairs += [
                (int(tracks[begins][i]), int(tracks[~begins][j])) for i, j in np.argwhere(overlap)
            ]
    return pairs


def family_numbers(tracks: Iterable[int], pairs: Sequence[tuple[int, int]]) -> dict[int, int]:
    """Family of each track: the least number among the tracks that `pairs` connect with it."""
    family_of = {int(track): int(track) for track in tracks}
    for track_a, track_b in pairs:
        if track_a in family_of and track_b in family_of:
            low, high = sorted((family_of[track_a], family_of[track_b]))
            family_of = {
                track: low if family_there == high else family_there
                for track, family_there in family_of.items()
            }
    return family_of


def families(
    tracks: pd.Index,
    pairs: Sequence[tuple[int, int]],
    group: np.ndarray,
    code: np.ndarray,
    together: Sequence[tuple[int, int]] = (),
) -> pd.DataFrame:
    """Family of each row of the ranking, with how many modes and design points it has.

    Parameters
    ----------
    tracks : Index of int
        Tracks of the ranking, and numbers below zero, which have no family.
    pairs : sequence of (int, int)
        Tracks that are one mode (`linked_tracks`, `exchanged_tracks`).
    group, code : ndarray (m,) of int
        Group of each mode (`mode_ranking.unstable_groups`; 0 for stable modes), and number of its
        design point.
    together : sequence of (int, int)
        Tracks that are unstable together between design points (`pairs_growing_together`).

    Returns
    -------
    DataFrame
        Indexed by `track`. ``family`` is the least number of the tracks that are one mode;
        ``family_modes`` is the largest number of unstable modes of the family at one place;
        ``family_points`` is the number of design points at which the family is unstable.
    """
    number = pd.Series(family_numbers(tracks, pairs), dtype="int64", index=tracks)
    rows = np.flatnonzero(group)
    of_family = pd.DataFrame(
        {"family": number.reindex(group[rows]).to_numpy(), "point": code[rows]}
    )
    of_family["track"] = group[rows]
    modes_at_point = (
        of_family.drop_duplicates().groupby(["family", "point"]).size().groupby(level="family")
    )
    largest_count = modes_at_point.max()
    for track, other in together:
        family = number.get(track, 0)
        if family in largest_count.index and track != other and number.get(other, -1) == family:
            largest_count[family] = max(largest_count[family], 2)
    return pd.DataFrame(
        {
            "family": number,
            "family_modes": largest_count.reindex(number.to_numpy()).to_numpy(),
            "family_points": modes_at_point.size().reindex(number.to_numpy()).to_numpy(),
        },
        index=tracks,
    )
