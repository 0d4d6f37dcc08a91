"""How many design points between those of a study tracks and onsets may solve.

A number of points, not of seconds: tables must not depend on the machine. What is left unrefined is
counted, and told.
"""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.study.sections import ModesSection

# for doubtful steps of tracks: as many as design points, within these
MIN_TRACKING_SOLVES, MAX_TRACKING_SOLVES = 30, 500
SMALL_LEAST = 3_000  # least budget of models with few coordinates, whose points take a millisecond
ONSETS = 2  # for onsets that bound no stability, times that
LEAST_BOUNDS, BOUNDS_SHARE = 20_000, 0.2  # for those that do: of the design points, at least

UNLIMITED = 10**12  # design points


@dataclass(frozen=True)
class RefinementBudget:
    """Design points that may be solved, at most.

    Attributes
    ----------
    tracks : int
        For steps of tracks in doubt.
    bounds : int
        For onsets at which the first mode turns unstable on a line, or the last one stable.
    onsets : int
        For other onsets.
    total : int
        In all.
    """

    tracks: int
    bounds: int
    onsets: int
    total: int

    @classmethod
    def of(
        cls, section: ModesSection, points: int, batch: bool = False, small: bool = False
    ) -> RefinementBudget:
        """Budget of a study with this number of design points; onsets of a `batch` cost little.

        `small`: of a model of few coordinates.
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
