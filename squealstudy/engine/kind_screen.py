"""Base of the screens that show the results of a kind of study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from squealstudy.errors import ResultsError
from squealstudy.shown_units import as_written
from squealstudy.wording import by_ranges, plural, with_unit

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import RenderableType

    from squealstudy.engine.result_tables import ResultTables
    from squealstudy.screen import Rows

N_RANKING_ROWS = 12  # number of rows of the ranking that a run prints
OF_SEVERAL = {  # forms of outcomes that more than one design point has
    "squeals": "squeal",
    "squeals if kicked": "squeal if kicked",
    "no cycle found": "with no cycle found",
    "limit cycle": "limit cycles",
}


class KindScreen:
    """Texts on the results of one kind of study, whose folder has it in `screen.py` as SCREEN.

    Attributes
    ----------
    tables : tuple of str
        Tables of finished results, by the names of their files without suffix.
    added_tables : tuple of str
        Tables among these that results of earlier versions may lack.
    row_word : str
        Word for what a row of the first table stands for, in the singular.
    unfinished : bool
        Whether results can be read while a later run of the study is not finished.
    needs : mapping of str -> sequence of str
        Columns by table without which nothing can be shown.
    found, sure : tuple of str
        Names of lines of `facts` that a run prints below the findings, and of those on how certain
        these are; other lines are shown only on request.
    """

    tables: tuple[str, ...] = ()
    added_tables: tuple[str, ...] = ()
    row_word: str = "design point"
    unfinished: bool = True
    needs: Mapping[str, Sequence[str]] = MappingProxyType({})
    found: tuple[str, ...] = ()
    sure: tuple[str, ...] = ()

    def __init__(self, tables: tuple[str, ...] = (), row_word: str = "") -> None:
        self.tables, self.row_word = tables or self.tables, row_word or self.row_word

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """The ranking as a table, the most important row first; ResultsError without a ranking."""
        raise ResultsError(f"{results.directory}: a {results.kind} study has no ranking of modes")

    def ranking(
        self,
        results: ResultTables,
        by: str = "share",
        top: int | None = N_RANKING_ROWS,
        where: str | None = None,
    ) -> list[RenderableType]:
        """The ranking with its legend and the number of rows left out; ResultsError like `rank`."""
        from squealstudy.screen import notes

        table = self.rank(results, by, None, where)
        shown = self.listed(results, table.head(top or len(table)), where)
        if top is not None and len(table) > top:
            shown.append(notes(f"{len(table) - top} more in squealstudy rank {results.directory}"))
        return shown

    def listed(
        self, results: ResultTables, table: pd.DataFrame, where: str | None
    ) -> list[RenderableType]:
        """A table that `rank` made, with its legend."""
        return []

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """Findings that a run prints first and a notebook shows; by default the first rows."""
        from squealstudy.screen import grid

        table = results.table(self.tables[0]).head(N_RANKING_ROWS)
        titles = (f"text:{name}" for name in table)
        return [
            grid(*titles, rows=([str(v) for v in row] for row in table.itertuples(index=False)))
        ]

    def verdict(self, results: ResultTables) -> str:
        """Verdict of a study in a sentence: by default the first words of its findings."""
        first_text = next((part for part in self.findings(results) if isinstance(part, str)), "")
        return first_text or f"{plural(results.n_points, self.row_word)}."

    def counted(self, results: ResultTables, words: Sequence[str]) -> str:
        """Text on outcomes of design points, one of `words` each, by ranges of the parameter.

        Where several parameters vary, or there are many ranges, it has the count of each word.
        """
        points, words = results.points, [str(word).replace("_", " ") for word in words]
        varied = [p for p in results.parameters if len(set(points[p].tolist())) > 1]
        ranges_text = words[0] if len(words) == 1 else ""
        if len(varied) == 1:
            (name,) = varied
            ranges_text = by_ranges(name, results.units.get(name, ""), points[name].tolist(), words)
        counts = Counter(words).most_common()
        return ranges_text or ", ".join(
            f"{n} {word if n == 1 else OF_SEVERAL.get(word, word)}" for word, n in counts
        )

    def mapped(
        self, results: ResultTables, words: Sequence[str], letters: Mapping[str, str]
    ) -> list[RenderableType]:
        """A map of design points in letters; [] unless exactly two parameters vary on a grid."""
        from squealstudy.screen import letter_map

        points, units = results.points, results.units
        varied = [p for p in results.parameters if len(set(points[p].tolist())) > 1]
        if len(varied) != 2 or points[varied].isna().to_numpy().any():
            return []
        first, second = varied
        names = with_unit(first, units), with_unit(second, units)
        x, y = ((points[n] * as_written(units.get(n, ""))[1]).tolist() for n in varied)
        return letter_map(names, (x, y), words, letters)

    def next_steps(self, results: ResultTables) -> Rows:
        """Next steps after these findings, each with its command or key."""
        return []

    def facts(self, results: ResultTables) -> Rows:
        """Lines on methods and errors, below the findings."""
        return []
