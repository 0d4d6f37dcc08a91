"""The tables of results as attributes; each kind of study has some of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from squealstudy.errors import ResultsError

if TYPE_CHECKING:
    import pandas as pd


class NamedTables:
    """Tables of results; ResultsError for a table that the kind of study does not have.

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
        """One row a design point."""
        return self.table("points")

    @property
    def modes(self) -> pd.DataFrame:
        """One row a complex mode, or an assembly mode of a run in time, of a design point."""
        return self.table("modes")

    @property
    def onsets(self) -> pd.DataFrame:
        """One row for each value of the parameter `along` at which a track becomes (un)stable.

        See kinds.complex_modes.onsets.
        """
        return self.table("onsets")

    @property
    def sensitivities(self) -> pd.DataFrame:
        """One row a parameter, mode and design point of a sensitivity study."""
        return self.table("sensitivities")

    @property
    def growth(self) -> pd.DataFrame:
        """One row a complex mode of a run in time, with its fitted and its predicted growth rate.

        The modes are the unstable ones, or the least stable one without any (column `unstable`).

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
        """One row a window of a run in time whose speed or pressure changes."""
        return self.table("windows")

    @property
    def measurements(self) -> pd.DataFrame:
        """One row a method and knob value of a work-precision study."""
        return self.table("measurements")

    @property
    def errors(self) -> pd.DataFrame:
        """One row a quantity, mode and point of each measurement of a work-precision study."""
        return self.table("errors")

    @property
    def cells(self) -> pd.DataFrame:
        """One row a cell of a method-stability study."""
        return self.table("cells")

    @property
    def verdicts(self) -> pd.DataFrame:
        """One row a mode of a design point in a study of limit cycles: whether it squeals."""
        return self.table("verdicts")

    @property
    def cycles(self) -> pd.DataFrame:
        """One row a limit cycle of a study of limit cycles."""
        return self.table("cycles")

    @property
    def curves(self) -> pd.DataFrame:
        """One row an amplitude of a family of motions, with its growth rate there."""
        return self.table("curves")

    @property
    def branches(self) -> pd.DataFrame:
        """One row a cycle of the branches that were followed over a parameter."""
        return self.table("branches")

    @property
    def borders(self) -> pd.DataFrame:
        """One row a fold or Hopf point that was continued over two parameters."""
        return self.table("borders")

    @property
    def velocities(self) -> pd.DataFrame:
        """One row a named point of a limit cycle."""
        return self.table("velocities")

    @property
    def designs(self) -> pd.DataFrame:
        """One row a design that a design study evaluated."""
        return self.table("designs")

    @property
    def margins(self) -> pd.DataFrame:
        """One row a mode of least damping of a design at an operating point."""
        return self.table("margins")

    @property
    def slopes(self) -> pd.DataFrame:
        """One row a mode and variable of a design study: the effect of a change on its damping."""
        return self.table("slopes")

    @property
    def proof(self) -> pd.DataFrame:
        """One row a check of the chosen design of a design study."""
        return self.table("proof")

    @property
    def variants(self) -> pd.DataFrame:
        """One row an alternative of a design study."""
        return self.table("variants")
