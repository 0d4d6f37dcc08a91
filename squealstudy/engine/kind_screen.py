"""What is shown of the results of a kind of study, and what can be asked of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from squealstudy.errors import ResultsError

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import RenderableType

    from squealstudy.engine.results import Results
    from squealstudy.screen import Rows

LISTED = 12  # rows of the ranking that a run prints


class KindScreen:
    """The screen of one kind of study: its folder has one in `screen.py`, named SCREEN.

    Attributes
    ----------
    tables : tuple of str
        Tables of finished results, by the names of their files without ending.
    rows_word : str
        What the first table has a row of.
    unfinished : bool
        Whether results can be read while a later run of the study is not finished.
    """

    tables: tuple[str, ...] = ()
    rows_word: str = "design points"
    unfinished: bool = True

    def __init__(self, tables: tuple[str, ...] = (), rows_word: str = "") -> None:
        self.tables, self.rows_word = tables or self.tables, rows_word or self.rows_word

    def rank(self, results: Results, by: str, top: int | None, where: str | None) -> pd.DataFrame:
        """What matters most, first; ResultsError where there is nothing to rank."""
        raise ResultsError(f"{results.directory}: a {results.kind} study has no ranking of modes")

    def ranking(
        self,
        results: Results,
        by: str = "share",
        top: int | None = LISTED,
        where: str | None = None,
    ) -> list[RenderableType]:
        """The ranking with its legend; ResultsError as `rank`."""
        self.rank(results, by, top, where)
        return []

    def findings(self, results: Results) -> list[RenderableType]:
        """What a run prints first, and a notebook shows; without more the first rows."""
        from squealstudy.screen import grid

        table = results.table(self.tables[0]).head(LISTED)
        titles = (f"text:{name}" for name in table)
        return [
            grid(*titles, rows=([str(v) for v in row] for row in table.itertuples(index=False)))
        ]

    def facts(self, results: Results) -> Rows:
        """Lines on methods and errors beneath the findings."""
        return []
