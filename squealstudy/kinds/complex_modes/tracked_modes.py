"""Modes of solved design points, followed from point to point, and the onsets on their tracks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from squealstudy.engine.plan import Plan
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.onsets import OnsetSearch
from squealstudy.kinds.complex_modes.outside_band import is_small
from squealstudy.kinds.complex_modes.refinement_budget import RefinementBudget
from squealstudy.kinds.complex_modes.rows import ModeColumns
from squealstudy.kinds.complex_modes.study_tracks import Follower
from squealstudy.modes.tracking.labels import Tracks
from squealstudy.study.parameters import onset_parameter


class Followed(NamedTuple):
    """Tracks, the table of onsets (None without a sweep), and a summary of how they were found.

    `seconds` is the time [s] spent on design points between those of the study, by their purpose.
    """

    tracks: Tracks
    onsets: pd.DataFrame | None
    seconds: dict[str, float]
    summary: dict[str, Any]


def follow_modes(
    plan: Plan,
    columns: ModeColumns,
    points: pd.DataFrame,
    judged: np.ndarray,
    error: np.ndarray,
    workers: Workers,
) -> Followed:
    """Track the modes of all points and find the onsets, as the study's [modes] section says.

    Parameters
    ----------
    plan : Plan
        Plan of the study.
    columns : ModeColumns
        Modes of all points, with shapes.
    points : DataFrame
        The points' table: status and parameters.
    judged : ndarray (N,) complex
        Roots of all points, rad/s, as their stability is judged (`settled`).
    error : ndarray (N,)
        Their estimated errors, rad/s, which give errors of the onsets.
    workers : Workers
        Workers that solve points in between.
    """
    section = plan.study.definition.modes
    follower = Follower(plan, columns, workers)
    summary: dict[str, Any] = {}
    budget = RefinementBudget.of(section, len(plan.tasks), plan.stacked, is_small(plan))
    tracks, summary["tracking"] = follower.follow(section.refine_tracking, budget.tracks)
    along = onset_parameter([sweep.name for sweep in plan.study.sweeps])
    seconds = {"tracking_refinement_s": follower.seconds}
    if along is None:
        return Followed(tracks, None, seconds, summary)
    oscillates = ~columns.overdamped
    search = OnsetSearch(
        plan=plan,
        follower=follower,
        tracks=tracks,
        points=points,
        along=along,
        lam=judged[oscillates],
        error=error[oscillates],
    )
    onsets, summary["onsets"] = search.table(
        section.refine_onsets, budget, summary["tracking"]["extra_points"], workers
    )
    seconds["onset_refinement_s"] = search.seconds
    return Followed(tracks, onsets, seconds, summary)
