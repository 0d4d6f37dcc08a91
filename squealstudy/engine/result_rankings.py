"""Rankings and statistics of results: tables computed from those of a results directory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, cast

import pandas as pd

from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.study.sweeps import RANDOM_DESIGNS, SOBOL_INDICES
from squealstudy.wording import GROWING, SUSTAINED, UNDECIDED

if TYPE_CHECKING:
    from squealstudy.engine.kind_screen import KindScreen


@dataclass(frozen=True)
class RankedResults(ResultTables):
    """Results of a study with methods that rank, count and compare them (see `Results`)."""

    @cached_property
    def screen(self) -> KindScreen:
        """The screen of results of this kind; ResultsError for an unknown kind."""
        return cast("KindScreen", super().screen)

    def rank(
        self, by: str = "share", top: int | None = None, where: str | None = None
    ) -> pd.DataFrame:
        """Unstable modes, the most important first, one row each.

        Unstable tracked modes (tables.mode_ranking.rank_modes), or the modes that carry
        the energy of a transient study (tables.energy_ranking.rank_energy), which has no
        choice of `by`.

        Parameters
        ----------
        by : str
            Quantity to sort by: ``share`` of the design points, ``growth``, ``damping`` or
            ``threshold``.
        top : int or None
            At most so many rows; None: all.
        where : str or None
            A pandas query over `points`: only points that satisfy it count.

        Raises
        ------
        ResultsError
            Where this kind of study has no such ranking, `by` is unknown, or the query is wrong.
        """
        table = self.screen.rank(self, by, top, where)
        attrs = dict(table.attrs)
        self._give_units(table)
        table.attrs |= attrs
        return table

    def occurrence(
        self,
        bins_hz: Sequence[float],
        bins: Sequence[float],
        weights: Sequence[float] | None = None,
    ) -> pd.DataFrame:
        """Count the design points that squeal, by bins of frequency and level.

        A study of complex modes counts unstable modes that oscillate; the level is their growth
        rate [1/s]. A transient study counts vibrations that last, at the frequency of the torque's
        strongest line; the level is the RMS of the torque. Runs that still grow or are undecided
        are in no bin: ``attrs["n_undecided"]`` counts them. See tables.occurrence.occurrence.

        Parameters
        ----------
        bins_hz : sequence of float
            Edges of the bins of frequency, ascending, Hz.
        bins : sequence of float
            Edges of the bins of the level, ascending.
        weights : sequence of float or None
            How often each of `points` occurs, on any scale; None: all equally often.

        Raises
        ------
        ResultsError
            Where the study is neither of these, or edges or weights cannot be used.
        """
        from squealstudy.tables.occurrence import occurrence

        points, n_undecided = self.points, 0
        if self.kind == "complex_modes" and self.boundary is None:
            level, flags = "growth_rate", ["unstable", "overdamped"]
            squeals = self.rows(
                "modes",
                ["point_id", "frequency_hz", level, *flags],
                lambda modes: (modes["unstable"] & ~modes["overdamped"]).to_numpy(bool),
            )
        elif self.kind == "transient":
            level, sustained = "torque_rms", points[points["class"].isin(SUSTAINED).to_numpy(bool)]
            loudest_hz = sustained["torque_line_hz"]
            squeals = sustained.assign(frequency_hz=loudest_hz)
            n_undecided = int(points["class"].isin((GROWING, UNDECIDED)).sum())
        else:
            raise ResultsError(
                f"{self.directory}: occurrence is of complex modes or of runs in time at design "
                f"points, this is {self.kind} of a {self.design} design"
            )
        table = occurrence(points, squeals, level, bins_hz, bins, weights)
        table.attrs["n_undecided"] = n_undecided
        return table

    def compare(self, other: ResultTables) -> pd.DataFrame:
        """Compare two studies: the effect of a change, or predictions beside runs in time.

        Two studies of complex modes are compared as before (these results) and after (`other`) a
        change (tables.before_after.paired). Otherwise one study predicts and the other is
        transient, in any order: tables.comparison.compare compares complex modes with runs in time,
        tables.cycle_comparison.compare_cycles limit cycles.

        Parameters
        ----------
        other : Results

        Raises
        ------
        ResultsError
            Where these are not two such studies of one model with common design points.
        """
        from squealstudy.engine.before_after import compare_modes
        from squealstudy.engine.comparison import compare_results

        both_have_onsets = {*self.tables} & {*other.tables} >= {"onsets"}
        return (compare_modes if both_have_onsets else compare_results)(self, other)

    def robust(self, confidence: float = 0.95) -> pd.DataFrame:
        """Probability of instability with its interval, of any mode and of each track.

        Every point of a random design is one draw (tables.robustness.robust_table). Of a
        sobol_indices design only its two independent samples are draws.

        Parameters
        ----------
        confidence : float
            Probability that the interval holds the true one.

        Raises
        ------
        ResultsError
            Where the design is not random, or every point failed.
        """
        if self.design not in RANDOM_DESIGNS or "onsets" not in self.tables:
            raise ResultsError(
                f"{self.directory}: probability of instability needs complex modes of a random "
                f"design ({', '.join(RANDOM_DESIGNS)}), this is {self.kind} of a {self.design} "
                "design"
            )
        from squealstudy.tables.robustness import GROWTH, robust_table
        from squealstudy.tables.sobol import base_rows

        n, d = len(self.points), len(self.swept)
        drawn = base_rows(n, d) if self.design == SOBOL_INDICES else None
        modes = self.rows("modes", GROWTH)
        return self._give_units(robust_table(self.points, modes, drawn, confidence, self.onsets))

    def sobol_indices(self, top: int | None = 8, confidence: float = 0.95) -> pd.DataFrame:
        """First and total Sobol indices of the largest growth rate and of unstable tracks.

        See tables.sobol.sobol_table.

        Parameters
        ----------
        top : int or None
            At most so many tracks; None: all.
        confidence : float
            Probability that an interval holds the true index.

        Raises
        ------
        ResultsError
            Where the design is not ``sobol_indices``, or too many points failed.
        """
        if self.design != SOBOL_INDICES:
            raise ResultsError(
                f"{self.directory}: Sobol indices need a design of type '{SOBOL_INDICES}', "
                f"this is {self.design}"
            )
        from squealstudy.tables.robustness import GROWTH
        from squealstudy.tables.sobol import sobol_table

        modes = self.rows("modes", GROWTH)
        indices = sobol_table(self.points, modes, self.swept, top, confidence, self.onsets)
        return self._give_units(indices)
