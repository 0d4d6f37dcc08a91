"""Where tracks turn unstable on a study's lines, and which of them may continue another track."""

from __future__ import annotations

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.study_tracks import Follower
from squealstudy.modes.tracking.labels import Tracks
from squealstudy.modes.tracking.pairing import broken
from squealstudy.tables.mode_ranking import line_codes
from squealstudy.tables.stability import BROKEN, FIRST_SEEN, line_crossings


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
            As `line_crossings` returns it, with rows of the N modes; a mode "first seen" beside a
            track that ends has the kind "broken" instead.
        """
        ok, track = self._ok[self._point], self._tracks.labels.flat
        unstable = (zeta < -tolerance) & ok
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
        first = np.flatnonzero(events["kind"] == FIRST_SEEN)
        if len(first):
            at_break = self._at_breaks(events["after"].to_numpy()[first])
            events.loc[events.index[first[at_break]], "kind"] = BROKEN
        return events

    def _at_breaks(self, rows: np.ndarray) -> np.ndarray:
        """Which of the modes (n,), each the first of its track on a line, may continue another."""
        x = self._x.to_numpy(float)
        order = np.lexsort((x, self._line))
        order = order[np.isfinite(x[order])]
        follows = np.diff(self._line[order]) == 0
        before = np.full(len(x), -1)
        before[order[1:][follows]] = order[:-1][follows]
        return np.array([self._at_break(int(row), before) for row in rows], dtype=bool)

    def _at_break(self, row: int, before: np.ndarray) -> bool:
        """Whether a mode may continue a track that ends at the point `before` its own."""
        point = int(self._point[row])
        other = int(before[point])
        if other < 0:
            return False
        if self._follower.parents[point] == other:  # smaller steps may have told them apart
            return bool(self._tracks.ambiguous.flat[row])
        lams, labels = self._follower.lams, self._tracks.labels
        mode_of_track = {int(track): mode for mode, track in enumerate(labels[point])}
        partner = np.array(
            [mode_of_track.get(int(track), -1) for track in labels[other]], dtype=int
        )
        began = broken(lams[other], lams[point], partner, self._follower.band)[1]
        return bool(began[row - labels.starts[point]])
