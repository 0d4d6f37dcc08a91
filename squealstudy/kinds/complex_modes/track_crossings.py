"""Where tracks turn unstable on a study's lines, and which of them may continue another track."""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.study_tracks import Follower
from squealstudy.modes.judged_roots import damping_ratios
from squealstudy.modes.tracking.labels import Tracks
from squealstudy.modes.tracking.pairing import at_edge, broken
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.tables.mode_ranking import line_codes
from squealstudy.tables.stability import (
    BROKEN,
    FIRST_SEEN,
    LEAVES,
    LEFT_BAND,
    OUT_OF,
    line_crossings,
)


class TrackCrossings:
    """Crossings of tracked modes on the lines of a study along one parameter.

    Parameters
    ----------
    follower : Follower
        Follows the modes of the study between its design points.
    tracks : Tracks
        Tracks of the modes.
    points : DataFrame
        The points' table; points that are not ok do not count.
    along : str
        The parameter along the lines.
    begins : bool
        Whether a line begins at its least value. Lines of a random design do not: their values are
        drawn from a range that begins below.
    """

    def __init__(
        self, follower: Follower, tracks: Tracks, points: pd.DataFrame, along: str, begins: bool
    ) -> None:
        self._follower, self._tracks = follower, tracks
        self._point = tracks.labels.owner
        self._line = line_codes(points, along)
        self._ok = (points["status"] == "ok").to_numpy(bool)
        self._x = points[along].where(self._ok)
        self._begins = begins

    def events(self, zeta: np.ndarray, tolerance: float) -> pd.DataFrame:
        """Crossings of those tracks that are unstable somewhere.

        Parameters
        ----------
        zeta : ndarray (N,)
            Damping ratio of the oscillating modes of all points.
        tolerance : float
            A mode is unstable where its damping ratio is below minus this.

        Returns
        -------
        DataFrame
            As `line_crossings` returns it, with rows of the N modes. A mode "first seen" beside a
            track that ends has the kind "broken" instead. So has a track that ends unstable beside
            one that begins, if no other takes its place: "out", without a row before, and the row
            after is its last. One that leaves the band unstable "leaves" likewise.
            ``low`` and ``high`` are the points of the bracket, -1 if not known.
        """
        ok, track = self._ok[self._point], self._tracks.labels.flat
        unstable = (zeta < -tolerance) & ok
        lams = self._follower.lams
        grows = lams.with_flat(unstable | (damping_ratios(lams.flat) < -tolerance))
        by_line = self._x.groupby(self._line)
        several = (by_line.transform("nunique") > 1).to_numpy()
        start = by_line.transform("min").to_numpy(dtype=float, copy=True)
        if not self._begins:
            start[:] = np.nan
        rows = np.isin(track, track[unstable]) & several[self._point] & ok
        tracked = np.flatnonzero(rows)
        point = self._point[tracked]
        events = line_crossings(
            track[tracked],
            self._line[point],
            self._x.to_numpy()[point],
            start[point],
            zeta[tracked],
            unstable[tracked],
        )
        events["after"] = tracked[events["after"]]
        has_before = events["before"] >= 0
        events.loc[has_before, "before"] = tracked[events.loc[has_before, "before"]]
        rows = events["before"].to_numpy()
        events["low"] = np.where(rows >= 0, self._point[rows], -1)
        events["high"] = self._point[events["after"].to_numpy()]
        point_before, point_after = self._beside()
        for event in np.flatnonzero(events["kind"] == FIRST_SEEN):
            row = int(events["after"].iloc[event])
            if self._at_break(row, point_before):
                events.loc[event, "kind"] = BROKEN
                low, high = int(point_before[self._point[row]]), int(self._point[row])
                events.loc[event, "low"] = low if self._ends_between(high, low, grows) else -1
        ends = self._ends(tracked, unstable, grows, point_after)
        if not len(ends):
            return events
        by_place = ["track", "line", "value"]
        return pd.concat([events, ends]).sort_values(by_place, kind="stable", ignore_index=True)

    def _beside(self) -> tuple[np.ndarray, np.ndarray]:
        """Point that is ok before and after each point on its line, -1 where there is none."""
        x = self._x.to_numpy(float)
        order = np.lexsort((x, self._line))
        order = order[np.isfinite(x[order])]
        follows = np.diff(self._line[order]) == 0
        before, after = np.full((2, len(x)), -1)
        before[order[1:][follows]] = order[:-1][follows]
        after[order[:-1][follows]] = order[1:][follows]
        return before, after

    def _ends(
        self, tracked: np.ndarray, unstable: np.ndarray, grows: Ragged, point_after: np.ndarray
    ) -> pd.DataFrame:
        """Events of tracks that end unstable on a line.

        No other mode may continue them, or they leave the band.
        """
        track, x = self._tracks.labels.flat, self._x.to_numpy(float)
        line = self._line[self._point]
        rows = tracked[np.lexsort((x[self._point[tracked]], line[tracked], track[tracked]))]
        last = np.ones(len(rows), dtype=bool)
        last[:-1] = (np.diff(track[rows]) != 0) | (np.diff(line[rows]) != 0)
        is_first = np.append(True, last[:-1])
        ends = []
        of_end = last & unstable[rows] & (point_after[self._point[rows]] >= 0)
        for place in np.flatnonzero(of_end).tolist():
            row, row_before = int(rows[place]), -1 if is_first[place] else int(rows[place - 1])
            low = int(self._point[row])
            high = int(point_after[low])
            ended = self._broken(low, high)[0]
            if ended[row - self._tracks.labels.starts[low]]:
                what = (BROKEN, OUT_OF) if self._ends_between(low, high, grows) else None
            else:
                what = (LEFT_BAND, LEAVES) if self._leaves(row, row_before, high) else None
            if what:
                ends.append((track[row], line[row], x[high], *what, -1, row, low, high))
        names = ["track", "line", "value", "kind", "direction", "before", "after", "low", "high"]
        return pd.DataFrame(ends, columns=names)

    def _leaves(self, row: int, row_before: int, beside: int) -> bool:
        """Whether a mode is so near to an end of the band that it has left it at a point beside.

        `row_before` is its row at the point before on its line, -1 where there is none.
        """
        lams, labels = self._follower.lams, self._tracks.labels
        point = int(self._point[row])
        _, *rows = np.intersect1d(labels[point], labels[beside], return_indices=True)
        before, after = np.abs(lams[point][rows[0]]), np.abs(lams[beside][rows[1]])
        change = np.abs(np.log(after / before))
        if row_before >= 0:
            own = np.log(np.abs(lams.flat[row]) / np.abs(lams.flat[row_before]))
            change = np.append(change, np.abs(own))
        size = np.abs(lams.flat[[row]])
        return bool(at_edge(size, change.max(initial=0.0), self._follower.band)[0])

    def _ends_between(self, ending: int, beside: int, grows: Ragged) -> bool:
        """Whether no mode that ends growing at one point may be one that grows at a neighbour.

        Each mode that may grow at the neighbour grows at the point under the same number, or is
        stable there and followed without doubt.
        """
        labels, doubtful = self._tracks.labels, self._tracks.ambiguous
        same = np.isin(labels[beside], labels[ending][grows[ending]])
        followed = np.isin(labels[beside], labels[ending]) & ~doubtful[beside]
        return not (grows[beside] & ~same & ~followed).any()

    def _at_break(self, row: int, before: np.ndarray) -> bool:
        """Whether a mode may continue a track that ends at the point `before` its own."""
        point = int(self._point[row])
        other = int(before[point])
        if other < 0:
            return False
        if self._follower.parents[point] == other:  # smaller steps may have told them apart
            return bool(self._tracks.ambiguous.flat[row])
        began = self._broken(other, point)[1]
        return bool(began[row - self._tracks.labels.starts[point]])

    def _broken(self, low: int, high: int) -> tuple[np.ndarray, np.ndarray]:
        """Modes whose tracks end at a point, and begin at the next, and may be one (`broken`)."""
        lams, labels = self._follower.lams, self._tracks.labels
        mode_of_track = {int(track): mode for mode, track in enumerate(labels[high])}
        partner = np.array([mode_of_track.get(int(track), -1) for track in labels[low]], dtype=int)
        return broken(lams[low], lams[high], partner, self._follower.band)
