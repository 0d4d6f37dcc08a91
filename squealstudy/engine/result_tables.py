"""Tables of a results directory as pandas frames with units, and the facts of its manifest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.engine.column_types import misfit
from squealstudy.engine.named_tables import NamedTables
from squealstudy.engine.parameter_units import parameter_units
from squealstudy.engine.result_frame import ResultFrame
from squealstudy.engine.result_names import MANIFEST
from squealstudy.engine.store import Store, column_units
from squealstudy.engine.table_rows import Keep, batches, chosen_rows, mode_points, ranked_modes
from squealstudy.engine.track_names import read_track_names
from squealstudy.errors import ResultsError, printable
from squealstudy.study.kind_protocols import ScreenFacts
from squealstudy.study.kinds import screen_of
from squealstudy.study.parameters import onset_parameter
from squealstudy.tables.boundary_map import full_points, full_tables
from squealstudy.tables.mode_ranking import parameter_columns
from squealstudy.tables.point_rows import ROW
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:
    import pandas as pd

POINT_TABLE = "points"
# by kind of study, the former name and today's: docs/reference/words-in-tables.md has them too
RENAMED_COLUMNS = {
    "transient": {"dominant_frequency_hz": "torque_line_hz"},
    "design": {
        "stage": "analysis",
        "role": "origin",
        "meets": "meets_margin",
        "uncoupled_damping": "damping_without_friction",
    },
}


@dataclass(frozen=True)
class ResultTables(NamedTables):
    """The tables of a finished results directory, and what its manifest says of the study.

    Attributes
    ----------
    directory : Path
    manifest : dict
        What the run recorded: the study as run, versions, timings.
    solved : int or None
        Number of design points that the run solved which returned these results; None where they
        were opened from a directory.
    """

    directory: Path
    manifest: dict[str, Any]
    solved: int | None = None

    def with_tables(self, **tables: pd.DataFrame) -> Self:
        """A copy of these results in which the tables of these names are replaced."""
        changed = type(self)(self.directory, self.manifest, self.solved)
        changed._loaded.update(self._loaded | tables)
        return changed

    @cached_property
    def screen(self) -> ScreenFacts:
        """The screen of results of this kind; ResultsError for an unknown kind."""
        try:
            return screen_of(self.kind)
        except KeyError:
            raise ResultsError(
                f"{self.directory}: results of a kind '{self.kind}', which is not known here; "
                "of an extension: squealstudy --extension FILE COMMAND, or import FILE in Python"
            ) from None

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables."""
        return tuple(n for n in self.screen.tables if self._written(n))

    def _written(self, name: str) -> bool:
        """Whether the run wrote this table; runs of earlier versions lack those added since."""
        if name not in self.screen.added_tables or name in self._loaded:
            return True
        return f"{name}.parquet" in self.store.journal.entries

    @cached_property
    def store(self) -> Store:
        """Reader of the results' files, which refuses files that are not as the run wrote them."""
        return Store(self.directory)

    def fact(self, key: str) -> Any:
        """A fact of the manifest; ResultsError where it has none of that name."""
        if self.manifest.get(key) is None:
            raise ResultsError(
                f"{self.directory}: {MANIFEST} says nothing of '{key}': the run is not finished, "
                "or of an earlier version; run the study again"
            )
        return self.manifest[key]

    @cached_property
    def _loaded(self) -> dict[str, pd.DataFrame]:
        return {}

    def table(self, name: str) -> pd.DataFrame:
        """A table by name, read once, with units in ``attrs``.

        Parameters
        ----------
        name : str
            One of `tables`.

        Raises
        ------
        ResultsError
            Where this kind of study has no such table, or it cannot be read.
        """
        if name not in self._loaded:
            if name not in self.tables:
                raise ResultsError(
                    f"{self.directory}: a {self.kind} study has no table '{name}', it has "
                    f"{', '.join(self.tables)}{did_you_mean(name, self.tables)}"
                )
            file = f"{name}.parquet"
            self._expect_fit(name)
            table = self.store.read_table(file).to_pandas(self_destruct=True)
            self._loaded[name] = ResultFrame(with_new_names(table, self.kind))
        table = self._loaded[name]
        if "units" not in table.attrs:
            self._give_units(table, f"{name}.parquet")
        return table

    def _expect_fit(self, name: str) -> pa.Schema:
        """The schema of a table's file; ResultsError where this kind of study has no such table."""
        if name not in self._fits:
            schema, n_rows = self.store.shape_of(f"{name}.parquet")
            why = misfit(schema, self.kind, name, self.units, n_rows)
            if name == self.tables[0] and not n_rows:
                why = why or "it has no row"
            if name == POINT_TABLE and (lost := set(self.parameters) - set(schema.names)):
                why = why or f"the parameter '{printable(min(lost))}' has no column"
            if lacking := sorted(set(self.screen.needs.get(name, ())) - set(schema.names)):
                why = why or f"it has no column '{lacking[0]}'"
            if why:
                raise ResultsError(
                    f"{self.directory / name}.parquet: not a table of a {self.kind} study as this "
                    f"version writes it: {why}; run the study again"
                )
            self._fits[name] = schema
        return self._fits[name]

    @cached_property
    def _fits(self) -> dict[str, pa.Schema]:
        return {}

    def columns(self, name: str) -> list[str]:
        """Names of the columns of a table, without reading it.

        Parameters
        ----------
        name : str
            One of `tables`.

        Raises
        ------
        ResultsError
            Where `table` raises it.
        """
        if name in self._loaded or name not in self.tables:
            return [str(column) for column in self.table(name)]
        return self._expect_fit(name).names

    def batches(self, name: str, columns: Sequence[str]) -> Iterator[pd.DataFrame]:
        """Yield columns of a table, ROWS_PER_BATCH rows at a time, indexed by the rows' numbers.

        `columns` of ``modes`` may include ROW, each mode's row in `points`. Both constants are of
        tables.point_rows.
        """
        plain = [column for column in columns if column != ROW]
        loaded = self._loaded.get(name)
        if loaded is None and name in self.tables:
            self._expect_fit(name)
        for batch in batches(loaded, self.store, f"{name}.parquet", plain):
            if ROW in columns:
                batch = batch.assign(**{ROW: self.point_rows[batch.index]})
            yield batch[list(columns)]

    def rows(self, name: str, columns: Sequence[str], keep: Keep | None = None) -> pd.DataFrame:
        """Read the wanted rows of some columns of a table, indexed by the rows' numbers.

        Parameters
        ----------
        name : str
        columns : sequence of str
            Columns as in `batches`; names that the table does not have are left out.
        keep : callable or None
            Takes a batch of n rows, returns which of them are wanted (n,) of bool; None: all.
        """
        names = {*self.columns(name), ROW}
        return chosen_rows(self.batches(name, [c for c in columns if c in names]), keep)

    @cached_property
    def point_rows(self) -> np.ndarray:
        """Row in `points` (n_modes,) of each mode in `modes`."""
        return mode_points(self.points, self.batches("modes", ["point_id"]))

    def _give_units(self, table: pd.DataFrame, file: str = "") -> pd.DataFrame:
        """The table with ``attrs["units"]``; `file` is its file's name, if the results have one."""
        table.attrs["units"] = column_units(self.manifest, table.columns, file)
        return table

    def ranked(self, where: str | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The points, and those modes that a ranking may count; `where` is a query over points.

        A boundary design is filled up to all nodes of its full grid.
        """
        modes = ranked_modes(self, where)
        if self.boundary is None:
            return self.points, modes
        return full_tables(self.points, modes, self.boundary["axes"], self.boundary["levels"])

    @cached_property
    def nodes(self) -> tuple[pd.DataFrame, np.ndarray | None]:
        """`points` on every node of a boundary design's full grid, and which nodes were solved.

        See tables.boundary_map.full_points. Other designs have `points` itself and None.
        """
        if self.boundary is None:
            return self.points, None
        return full_points(self.points, self.boundary["axes"], self.boundary["levels"])

    @cached_property
    def rankings(self) -> dict[tuple[str, str | None], pd.DataFrame]:
        """Rankings made before, not cut at `top`, by the keys ``by`` and ``where`` of `rank`.

        They are stored because a screen asks for one three times.
        """
        return {}

    @cached_property
    def track_names(self) -> dict[int, tuple[str, bool]]:
        """Most frequent name of each track that `squealstudy rank --names` has named.

        The flag beside it says whether the name changes between design points.
        """
        return read_track_names(self.store)

    def nominal_others(self, along: str) -> dict[str, float]:
        """The other varied parameters at their nominal values, where the design has them."""
        nominal, chosen = self.fact("nominal"), self.points
        fixed: dict[str, float] = {}
        for name in parameter_columns(self.points, varied=True):
            if name == along:
                continue
            at_nominal = chosen[np.isclose(chosen[name], nominal[name], rtol=1e-6, atol=0.0)]
            if len(at_nominal):
                fixed[name], chosen = nominal[name], at_nominal
        return fixed

    def row_of(self, point: str | int) -> int:
        """Row in `points` of a design point; ResultsError where there is no such point.

        `point` is its ``point_id`` or its row; a negative row counts from the end.
        """
        ids = list(self.points["point_id"])
        if isinstance(point, int | np.integer) and -len(ids) <= point < len(ids):
            return int(point) % len(ids)
        if point not in ids:
            raise ResultsError(
                f"{self.directory}: no design point {point!r}; expected a row of points, 0 to "
                f"{len(ids) - 1}, or a point_id such as '{ids[0]}'"
            )
        return ids.index(str(point))

    def history(self, point: str | int) -> pd.DataFrame:
        """Torque (a force in minimal models), contact shares and modal energies over time.

        Parameters
        ----------
        point : str or int
            ``point_id`` of a design point, or its row of `points`, counted from 0 (from the end
            where negative).

        Raises
        ------
        ResultsError
            Where this is no transient study, there is no such point, or its history was not kept.
        """
        if "growth" not in self.tables:
            raise ResultsError(f"{self.directory}: a {self.kind} study has no histories")
        row = self.points.iloc[self.row_of(point)]
        history = self.store.history(str(row["point_id"]), str(row["status"]))
        return self._give_units(history)

    @property
    def n_points(self) -> int:
        """Number of design points, or of what a study without them counts in their place."""
        return int(self.manifest.get("n_points", 0))

    @property
    def kind(self) -> str:
        """The kind of the study, such as ``complex_modes``."""
        return str(self.manifest["kind"])

    @property
    def units(self) -> dict[str, str]:
        """Units of parameters in the tables, and under ``torque`` the unit of ``torque_*`` columns.

        Screens and pictures show a parameter in the unit in which the study file gives it.
        """
        return parameter_units(self.manifest)

    @property
    def parameters(self) -> list[str]:
        """Names of the parameter columns of `points`."""
        return list(self.manifest.get("parameters", []))

    @property
    def swept(self) -> list[str]:
        """Names of the parameters that vary over the design points."""
        return list(self.manifest.get("sweeps", []))

    @property
    def along(self) -> str | None:
        """The parameter of onset thresholds: friction where it is swept, else the first sweep."""
        return onset_parameter(self.swept)

    @property
    def design(self) -> str:
        """Type of the design, ``grid`` or another."""
        return str(self.manifest.get("design", {}).get("type", "grid"))

    @property
    def boundary(self) -> dict[str, Any] | None:
        """Full grid (``axes``, ``levels``) of a boundary design and how much of it was solved."""
        facts: dict[str, Any] | None = self.manifest.get("boundary")
        return facts


def with_new_names(table: pd.DataFrame, kind: str) -> pd.DataFrame:
    """A table of a kind of study with former names of its columns replaced by today's."""
    names = {
        old: new
        for old, new in RENAMED_COLUMNS.get(kind, {}).items()
        if old in table and new not in table
    }
    return table.rename(columns=names) if names else table
