"""One line of a study: all tracks along one parameter, everything else fixed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.plots.style import COLOURS, DARK, GREY, Quantity, joined, quantity
from squealstudy.plots.tables import describe, oscillating, slice_points, worst_tracks
from squealstudy.tables.mode_ranking import parameter_columns

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


@dataclass(frozen=True)
class StudyLine:
    """Tables of one line, one row a design point in ascending order.

    Attributes
    ----------
    shown : Quantity
        The parameter along the line.
    x : ndarray (n,)
        Its values as drawn.
    failed : ndarray (n,) of bool
    frequency_hz, growth_rate, damping_ratio : DataFrame (n, n_tracks)
        One column a track, NaN where a track has no mode.
    doubtful : DataFrame (n, n_tracks) of bool
        Ambiguous labels.
    untracked : DataFrame
        Modes without a track, with the point's row as `row`.
    worst : DataFrame
        The row of largest growth of each unstable track, fastest first.
    elsewhere : str
        What is fixed, and why there.
    """

    shown: Quantity
    x: np.ndarray
    failed: np.ndarray
    frequency_hz: pd.DataFrame
    growth_rate: pd.DataFrame
    damping_ratio: pd.DataFrame
    doubtful: pd.DataFrame
    untracked: pd.DataFrame
    worst: pd.DataFrame
    elsewhere: str

    @property
    def unstable_tracks(self) -> list[int]:
        """Tracks that are unstable on the line, fastest growth first."""
        return [int(track) for track in self.worst["track"]]

    def colour(self, track: int) -> str:
        """Its own colour for each of the worst tracks, dark for other unstable ones, else grey."""
        tracks = self.unstable_tracks
        if track not in tracks:
            return GREY
        return COLOURS[tracks.index(track)] if track in tracks[: len(COLOURS)] else DARK


def study_line(results: Results, along: str, fixed: Mapping[str, float] | None = None) -> StudyLine:
    """The line along a parameter; of what `fixed` leaves open, that with most unstable modes.

    Overdamped roots are left out. Raises ResultsError for an unknown parameter or value.
    """
    points, modes, units = results.points, results.modes, results.units
    line, why = slice_points(points, modes, (along,), fixed)
    line = line.sort_values(along, kind="stable")
    shown = quantity(along, points[along], units)
    row = pd.Series(np.arange(len(line)), index=line["point_id"].to_numpy())
    rows = oscillating(modes[modes["point_id"].isin(line["point_id"])])
    rows = rows.assign(row=rows["point_id"].map(row).astype("int64"))
    tracked = rows[(rows["track"] > 0).to_numpy()]
    tracked = tracked.assign(doubtful=tracked["track_ambiguous"].astype(float))

    def wide(name: str) -> pd.DataFrame:
        table = tracked.pivot_table(index="row", columns="track", values=name, aggfunc="first")
        return table.reindex(range(len(line)))

    others = [n for n in parameter_columns(points, varied=True) if n != along]
    return StudyLine(
        shown=shown,
        x=shown.scaled(line[along]),
        failed=(line["status"] != "ok").to_numpy(bool),
        frequency_hz=wide("frequency_hz"),
        growth_rate=wide("growth_rate"),
        damping_ratio=wide("damping_ratio"),
        doubtful=wide("doubtful") == 1.0,
        untracked=rows[(rows["track"] <= 0).to_numpy()],
        worst=worst_tracks(rows),
        elsewhere=joined(describe(line.iloc[0], points, others, units), why, by=", "),
    )
