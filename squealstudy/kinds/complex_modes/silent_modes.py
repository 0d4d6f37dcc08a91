"""Finds modes that one design silences: they grow at another design of a grid, but not at it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.design_lines import DesignLine
from squealstudy.tables.before_after import REL_TOLERANCE
from squealstudy.tables.point_rows import ROW

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

COLUMNS = ["track", "track_ambiguous", "stability"]
STABLE = "stable"


def silent_tracks(
    results: ResultTables, lines: list[DesignLine], table: pd.DataFrame
) -> list[set[int]]:
    """Tracks of `table`, the ranking over all designs, that are surely silent at each design.

    A track is silent if three conditions hold. Each point of the design has all the modes of the
    track's family. These are stable beyond their error, and their numbers are not ambiguous. No
    other mode near in frequency (REL_TOLERANCE) is unstable at this design alone: it might be the
    same mode under another number.
    """
    points = results.points
    if not set(COLUMNS) <= set(results.columns("modes")):  # results of an earlier version
        return [set() for _ in lines]
    tracked = table[(table["track"] > 0).to_numpy(bool)]
    family_of: dict[int, int] = dict(zip(tracked["track"], tracked["family"], strict=True))
    n_modes: dict[int, int] = dict(zip(tracked["family"], tracked["family_modes"], strict=True))
    modes = results.rows("modes", [ROW, *COLUMNS], lambda m: m["track"].isin(family_of).to_numpy())
    modes = modes.assign(family=modes["track"].map(family_of))
    modes["sure"] = (modes["stability"] == STABLE) & ~modes["track_ambiguous"].astype(bool)
    silent: list[set[int]] = []
    for line in lines:
        of_design = [points[name].to_numpy() == number for name, number in line.design.items()]
        is_of_design = np.logical_and.reduce(of_design)
        solved = bool((points["status"][is_of_design] == "ok").all())
        has_knots = results.along in results.manifest.get("knots_between", {})
        by_family = modes[is_of_design[modes[ROW].to_numpy()]].groupby("family")
        stable_families = {
            int(str(family))
            for family, rows in by_family
            if rows["sure"].all()
            and rows[ROW].nunique() == is_of_design.sum()
            and rows.groupby(ROW).size().min() >= n_modes[int(str(family))]
        }
        silent.append(
            {
                track
                for track, family in family_of.items()
                if solved and not has_knots and family in stable_families
                if not _may_be_another(family, line, lines, family_of)
            }
        )
    return silent


def _may_be_another(
    family: int, line: DesignLine, lines: list[DesignLine], family_of: dict[int, int]
) -> bool:
    """Whether a mode near in frequency grows at the design, but not where the family grows."""
    for other in lines:
        growing = [row for track, row in other.modes.items() if family_of.get(track) == family]
        families = {family_of.get(track) for track in other.modes}
        near = (
            abs(float(row["frequency_hz"]) / float(family_row["frequency_hz"]) - 1.0)
            for family_row in growing
            for track, row in line.modes.items()
            if family_of.get(track) not in families
        )
        if any(distance <= REL_TOLERANCE for distance in near):
            return True
    return False
