"""How many design points between those of a study tracking and onsets may solve.

The budget is a number of points, not of seconds, as tables must not depend on the machine. What is
left unrefined is counted, and told.
"""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.study.sections import ModesSection

# bounds of the budget for doubtful steps of tracks, which is the number of design points
MIN_TRACKING_SOLVES, MAX_TRACKING_SOLVES = 30, 500
SMALL_LEAST = 3_000  # least such budget for models of few coordinates: a point takes a millisecond
ONSETS = 2  # budget for onsets that do not bound stability, over that for tracks
# budget for onsets that bound stability: its least value, and its share of the design points
LEAST_BOUNDS, BOUNDS_SHARE = 20_000, 0.2

UNLIMITED = 10**12  # design points


@dataclass(frozen=True)
class RefinementBudget:
    """Largest numbers of design points that may be solved.

    Attributes
    ----------
    tracks : int
        Points for steps of tracks that are in doubt.
    bounds : int
        Points for onsets at which the first mode on a line turns unstable, or the last one stable.
    onsets : int
        Points for other onsets.
    total : int
        Points in all.
    """

    tracks: int
    bounds: int
    onsets: int
    total: int

    @classmethod
    def of(
        cls, section: ModesSection, points: int, batch: bool = False, small: bool = False
    ) -> RefinementBudget:
        """Budget of a study with this number of design points.

        `batch`: a study in batches, whose onsets cost so little that they are not limited. `small`:
        a model of few coordinates.
        """
        if (chosen := section.refine_points) is not None:
            return cls(chosen, chosen, chosen, chosen)
        tracks = max(
            min(points, MAX_TRACKING_SOLVES), SMALL_LEAST if small else MIN_TRACKING_SOLVES
        )
        if batch:
            return cls(tracks, UNLIMITED, UNLIMITED, UNLIMITED)
        bounds = max(LEAST_BOUNDS, int(BOUNDS_SHARE * points))
        return cls(tracks, bounds, ONSETS * tracks, tracks + bounds + ONSETS * tracks)
