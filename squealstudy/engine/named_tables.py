"""The tables of results as attributes, for Python: `results.modes` is `results.table("modes")`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from squealstudy.errors import ResultsError

if TYPE_CHECKING:
    import pandas as pd


class NamedTables:
    """Tables of results as attributes; each kind of study has some of them.

    Others raise ResultsError.

    Attributes
    ----------
    directory : Path
    """

    directory: Path

    def table(self, name: str) -> pd.DataFrame:
        """A table by name."""
        raise NotImplementedError

    @property
    def points(self) -> pd.DataFrame:
        """One row for each design point."""
        return self.table("points")

    @property
    def modes(self) -> pd.DataFrame:
        """One row for each complex mode of a design point, or assembly mode of a run in time."""
        return self.table("modes")

    @property
    def onsets(self) -> pd.DataFrame:
        """One row for each value of the parameter `along` at which a track becomes (un)stable.

        See kinds.complex_modes.onsets.
        """
        return self.table("onsets")

    @property
    def sensitivities(self) -> pd.DataFrame:
        """One row for each parameter, at each mode of each design point of a sensitivity study."""
        return self.table("sensitivities")

    @property
    def growth(self) -> pd.DataFrame:
        """One row for each complex mode of a run in time: its fitted and predicted growth rate.

        The modes are the unstable ones, or the least stable one where none is unstable (column
        `unstable`).

        Raises ResultsError for other kinds of study, and for a table of an earlier version.
        """
        table = self.table("growth")
        if "unstable" not in table:
            raise ResultsError(
                f"{self.directory}: the growth table is of an earlier version of squealstudy; run "
                "the study again"
            )
        return table

    @property
    def windows(self) -> pd.DataFrame:
        """One row for each window of a run in time whose speed or pressure changes."""
        return self.table("windows")

    @property
    def measurements(self) -> pd.DataFrame:
        """One row for each method at each value of its setting, in a work-precision study."""
        return self.table("measurements")

    @property
    def errors(self) -> pd.DataFrame:
        """One row for each error of a measurement of a work-precision study."""
        return self.table("errors")

    @property
    def cells(self) -> pd.DataFrame:
        """One row for each pair of settings in a map of a method-stability study."""
        return self.table("cells")

    @property
    def verdicts(self) -> pd.DataFrame:
        """One row for each mode of a design point: whether it squeals, by its limit cycles."""
        return self.table("verdicts")

    @property
    def cycles(self) -> pd.DataFrame:
        """One row for each limit cycle of a study of limit cycles."""
        return self.table("cycles")

    @property
    def curves(self) -> pd.DataFrame:
        """One row for each amplitude of motions along one mode: their growth rate."""
        return self.table("curves")

    @property
    def branches(self) -> pd.DataFrame:
        """One row for each cycle of the branches that were followed over a parameter."""
        return self.table("branches")

    @property
    def borders(self) -> pd.DataFrame:
        """One row for each fold or Hopf point that was continued over two parameters."""
        return self.table("borders")

    @property
    def velocities(self) -> pd.DataFrame:
        """One row for each named place of a model in a limit cycle: its velocity there."""
        return self.table("velocities")

    @property
    def designs(self) -> pd.DataFrame:
        """One row for each design that a design study evaluated."""
        return self.table("designs")

    @property
    def margins(self) -> pd.DataFrame:
        """One row for each mode of least damping of a design at an operating point."""
        return self.table("margins")

    @property
    def slopes(self) -> pd.DataFrame:
        """One row for each mode and variable of a design study: how damping changes with it."""
        return self.table("slopes")

    @property
    def proof(self) -> pd.DataFrame:
        """One row for each check that the chosen design of a design study had to pass."""
        return self.table("proof")

    @property
    def variants(self) -> pd.DataFrame:
        """One row for each alternative of a design study, which has a search of its own."""
        return self.table("variants")
