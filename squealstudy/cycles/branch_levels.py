"""Levels of the cycles on a branch, with error estimates, for the table of branches.

All cycles of a branch have the number of harmonics that the first one needs. At other values of the
parameter the contact may stick, and levels may be wrong by a fifth. So the error of each cycle of a
small model is estimated (`cycle.series_errors`). If it is beyond the tolerance, the cycle is solved
with as many harmonics as it needs.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from squealstudy.cycles.branch import HOPF, BranchPoint
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.cycle import (
    Cycle,
    CycleLevels,
    Search,
    SeriesErrors,
    cycle_near,
    errors_by_changes,
    series_errors,
)
from squealstudy.cycles.projection import Projection
from squealstudy.errors import ConvergenceError

FEWER_HARMONICS = 1.5  # harmonics of a cycle over those with which it is solved for comparison
# if more harmonics change frequency or contact velocity by more than these relative amounts, they
# have led to another cycle, beyond a fold
MAX_FREQUENCY_CHANGE, MAX_VELOCITY_CHANGE = 0.02, 0.05


class BranchLevel(NamedTuple):
    """A cycle on a branch, with as many harmonics as its level needs.

    Attributes
    ----------
    point : BranchPoint
        The point, with motion, multipliers and residual of more harmonics where it needs more.
    levels : dict
        `ContactOscillator.levels`.
    error : float
        Relative error of the level, as `Cycle.level_error`; NaN where it is not known.
    """

    point: BranchPoint
    levels: dict[str, float]
    error: float


def level_on_branch(contact: ContactOscillator, point: BranchPoint, search: Search) -> BranchLevel:
    """The level of a point on a branch, with more harmonics if it needs more.

    No error is estimated, and no harmonic added, for large models and at Hopf points.
    """
    motion = replace(point.motion, parameter=0.0)
    levels = contact.levels(motion)
    projection = Projection.on_harmonics_of(contact.oscillator, motion)
    if not projection.complete or point.event == HOPF:
        return BranchLevel(point, levels, np.nan)
    error = _level_error(contact, projection, CycleLevels(motion, levels))
    # events stay as they were located on the branch, and so do numbers of harmonics that users
    # chose
    if point.event or search.harmonics is not None or error < search.tolerance:
        return BranchLevel(point, levels, error)
    with suppress(ConvergenceError):
        cycle = cycle_near(contact, projection, motion, search)
        if _is_on_branch(cycle, point, levels) and not cycle.level_error >= error:
            finer = replace(cycle.motion, parameter=point.motion.parameter)
            point = replace(
                point, motion=finer, multipliers=cycle.multipliers, residual=cycle.residual
            )
            return BranchLevel(point, cycle.levels, cycle.level_error)
    return BranchLevel(point, levels, error)


def _level_error(
    contact: ContactOscillator, projection: Projection, cycle_levels: CycleLevels
) -> float:
    """Error of a level, by cycles with fewer and more harmonics; NaN where there are none."""
    motion, by_changes = cycle_levels.motion, SeriesErrors()
    with suppress(ConvergenceError):
        fewer, _ = projection.cycle_near(motion, max(1, round(motion.harmonics / FEWER_HARMONICS)))
        by_changes = errors_by_changes([CycleLevels(fewer, contact.levels(fewer)), cycle_levels])
    judged = series_errors(contact, projection, cycle_levels, by_changes)
    return np.nan if judged is None or np.isinf(judged[0].level) else judged[0].level


def _is_on_branch(cycle: Cycle, point: BranchPoint, levels: dict[str, float]) -> bool:
    """Whether a cycle with more harmonics is the cycle of the point, not one beyond a fold."""
    velocity = levels["contact_velocity"]
    stabilities = {cycle.multipliers.stable, point.multipliers.stable} - {None}
    return (
        len(stabilities) < 2
        and abs(cycle.motion.omega / point.motion.omega - 1.0) < MAX_FREQUENCY_CHANGE
        and abs(cycle.levels["contact_velocity"] - velocity) < MAX_VELOCITY_CHANGE * velocity
    )
