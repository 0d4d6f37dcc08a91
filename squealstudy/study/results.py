"""Reading results: tables as pandas frames, and the ranking."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from squealstudy.analysis.tables.mode_ranking import point_codes, rank_modes, selection
from squealstudy.analysis.tables.stability import uncertain_points
from squealstudy.errors import ResultsError
from squealstudy.study.design_rules import RANDOM_DESIGNS
from squealstudy.study.kinds import is_of_methods
from squealstudy.study.names import (
    CELLS,
    ERRORS,
    GROWTH,
    MEASUREMENTS,
    MODES,
    ONSETS,
    POINTS,
    SENSITIVITIES,
    onset_parameter,
)
from squealstudy.study.results_manifest import read_manifest
from squealstudy.study.transient.histories import read_history
from squealstudy.wording import plural

SOBOL_INDICES = "sobol_indices"
TABLES = {
    "complex_modes": (POINTS, MODES, ONSETS),
    "transient": (POINTS, MODES, GROWTH),
    "sensitivity": (POINTS, SENSITIVITIES),
    "work_precision": (MEASUREMENTS, ERRORS),
    "method_stability": (CELLS,),
}


@dataclass(frozen=True)
class Results:
    """A finished results directory.

    Attributes
    ----------
    directory : Path
    manifest : dict
        The study as run, versions, timings.
    """

    directory: Path
    manifest: dict[str, Any]

    def __repr__(self) -> str:
        """Directory, kind, model, what varies and how many points there are, on one line."""
        facts = self.manifest
        text = f"{self.kind} of {facts.get('model', 'methods')}"
        rows = "run" if is_of_methods(self.kind) else "point"
        if not is_of_methods(self.kind) and self.swept:
            text += f" over {', '.join(self.swept)}"
        count, failed = facts["n_points"], facts.get("n_failed", 0)
        text += f": {plural(count, rows)}"
        text += f", {failed} failed" if failed else ""
        return f"<Results {str(self.directory)!r}: {text}>"

    @classmethod
    def open(cls, path: str | Path) -> Results:
        """Open a results directory.

        Raises
        ------
        ResultsError
            Missing, not of squealstudy, or not finished.
        """
        directory = Path(path)
        if directory.is_file():
            raise ResultsError(
                f"{directory}: expected a results directory such as results/NAME, got a file"
            )
        if not directory.is_dir():
            raise ResultsError(f"{directory}: no such results directory")
        manifest = read_manifest(directory)
        if manifest is None:
            raise ResultsError(f"{directory}: no manifest.json here, so no results of squealstudy")
        tables = TABLES.get(str(manifest.get("kind")), ())
        stale = is_of_methods(manifest.get("kind")) and manifest.get("status") != "complete"
        if not tables or stale or not all((directory / name).is_file() for name in tables):
            raise ResultsError(
                f"{directory}: the run is not finished; run the study again to go on"
            )
        return cls(directory, manifest)

    @cached_property
    def points(self) -> pd.DataFrame:
        """One row a design point; ResultsError where the study has none."""
        if is_of_methods(self.kind):
            raise ResultsError(f"{self.directory}: a {self.kind} study has no design points")
        return self._read(POINTS)

    @cached_property
    def modes(self) -> pd.DataFrame:
        """One row a complex mode of a design point; ResultsError where the study has none."""
        if is_of_methods(self.kind):
            raise ResultsError(f"{self.directory}: a {self.kind} study has no table of modes")
        if self.kind == "sensitivity":
            raise ResultsError(
                f"{self.directory}: a sensitivity study has no table of modes; 'squealstudy "
                "sensitivity' ranks its parameters"
            )
        return self._read(MODES)

    @cached_property
    def onsets(self) -> pd.DataFrame:
        """One row for each value of the parameter `along` at which a track turns (un)stable.

        See study.complex_modes.onsets. Raises ResultsError where the study has no complex modes.
        """
        if self.kind != "complex_modes":
            raise ResultsError(f"{self.directory}: a {self.kind} study has no table of onsets")
        return self._read(ONSETS)

    @cached_property
    def sensitivities(self) -> pd.DataFrame:
        """One row a parameter, mode and design point of a sensitivity study; else ResultsError."""
        if self.kind != "sensitivity":
            raise ResultsError(f"{self.directory}: a {self.kind} study has no sensitivities")
        return self._read(SENSITIVITIES)

    @cached_property
    def growth(self) -> pd.DataFrame:
        """One row a followed complex mode of a design point, fitted growth beside the predicted.

        These are the unstable ones, or the least stable one where none is (column `unstable`).

        Raises ResultsError where the study is not a transient one, or of an earlier version.
        """
        self._expect_transient("growth table")
        table = self._read(GROWTH)
        if "unstable" not in table:
            raise ResultsError(
                f"{self.directory}: the growth table is of an earlier version of squealstudy; run "
                "the study again"
            )
        return table

    @cached_property
    def measurements(self) -> pd.DataFrame:
        """One row a method and knob value of a work-precision study; else ResultsError."""
        self._expect_kind("work_precision", "measurements")
        return self._read(MEASUREMENTS)

    @cached_property
    def cells(self) -> pd.DataFrame:
        """One row a cell of a method-stability study; else ResultsError."""
        self._expect_kind("method_stability", "cells")
        return self._read(CELLS)

    @cached_property
    def errors(self) -> pd.DataFrame:
        """One row a quantity, mode and point of each measurement; else ResultsError."""
        self._expect_kind("work_precision", "table of errors")
        return self._read(ERRORS)

    def history(self, point: str | int) -> pd.DataFrame:
        """Torque (of minimal models force), contact shares and modal energies over time.

        Parameters
        ----------
        point : str or int
            ``point_id`` of a design point, or its row of `points`, counted from 0 (from the end
            where negative).

        Raises
        ------
        ResultsError
            Where there is no such point, none was kept, or the study is not a transient one.
        """
        self._expect_transient("histories")
        ids = list(self.points["point_id"])
        if isinstance(point, int | np.integer) and -len(ids) <= point < len(ids):
            point = ids[point]
        if point not in ids:
            raise ResultsError(
                f"{self.directory}: no design point {point!r}; expected a row of points, 0 to "
                f"{len(ids) - 1}, or a point_id such as '{ids[0]}'"
            )
        status = str(self.points["status"].iloc[ids.index(point)])
        return read_history(self.directory, str(point), status)

    @property
    def kind(self) -> str:
        """Of the study: a key of TABLES."""
        return str(self.manifest["kind"])

    @property
    def parameters(self) -> list[str]:
        """Parameter columns of `points`."""
        return list(self.manifest["parameters"])

    @property
    def swept(self) -> list[str]:
        """The parameters that vary by design."""
        return list(self.manifest["sweeps"])

    @property
    def along(self) -> str | None:
        """The parameter of onset thresholds: friction where it is swept, else the first sweep."""
        return onset_parameter(self.swept)

    def rank(
        self, by: str = "share", top: int | None = None, where: str | None = None
    ) -> pd.DataFrame:
        """The modes that matter most first.

        Unstable tracked modes (analysis.tables.mode_ranking.rank_modes), or the modes that carry
        the energy of a transient study (analysis.tables.energy_ranking.rank_energy), which has no
        choice of `by`.
        """
        if is_of_methods(self.kind):
            raise ResultsError(f"{self.directory}: a {self.kind} study has no ranking of modes")
        if self.kind == "transient":
            if by != "share":
                raise ResultsError(
                    f"{self.directory}: modes of a transient study are ranked by energy share, "
                    f"not by '{by}'"
                )
            from squealstudy.analysis.tables.energy_ranking import rank_energy

            return rank_energy(self.points, self.modes, top, where)
        table = rank_modes(
            *self._ranked, self.along, by, top, where, self.onsets, self.design in RANDOM_DESIGNS
        )
        return table if self.boundary is None else self._from_solved(table, where)

    def counted_points(self, where: str | None = None) -> int:
        """Number of design points, or nodes of a boundary map, that `rank` is over."""
        points, modes = self._ranked
        return int(selection(points, modes, point_codes(points, modes), where)[0].sum())

    def uncertain_points(self, where: str | None = None) -> int:
        """Number of solved design points at which some mode may be stable or unstable."""
        code = point_codes(self.points, self.modes)
        held, wanted = selection(self.points, self.modes, code, where)
        return uncertain_points(self.modes, code, held[code] & wanted)

    @cached_property
    def _ranked(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Points and modes that count in a ranking: of a boundary design all nodes of its grid."""
        if self.boundary is None:
            return self.points, self.modes
        from squealstudy.analysis.tables.boundary_map import full_tables

        facts = self.boundary
        return full_tables(self.points, self.modes, facts["axes"], facts["levels"])

    def _from_solved(self, table: pd.DataFrame, where: str | None) -> pd.DataFrame:
        """The ranking of a map with what only its solved points tell: worst design and onset."""
        solved = rank_modes(
            self.points, self.modes, self.along, "growth", None, where, self.onsets
        ).set_index("track")
        known = table["track"].isin(solved.index)
        for name in ("at", "threshold", "threshold_kind"):
            table[name] = table["track"].map(solved[name]).where(known, table[name])
        return table

    @property
    def design(self) -> str:
        """Type of the design, ``grid`` or another."""
        return str(self.manifest.get("design", {}).get("type", "grid"))

    @property
    def boundary(self) -> dict[str, Any] | None:
        """Full grid (``axes``, ``levels``) of a boundary design and how much of it was solved."""
        facts: dict[str, Any] | None = self.manifest.get("boundary")
        return facts

    def full_points(self) -> tuple[pd.DataFrame, np.ndarray]:
        """`points` on every node of a boundary design's full grid, and which were solved.

        See analysis.tables.boundary_map.full_points.

        Raises ResultsError where the design is another.
        """
        if self.boundary is None:
            raise ResultsError(f"{self.directory}: a {self.design} design has no boundary map")
        from squealstudy.analysis.tables.boundary_map import full_points

        return full_points(self.points, self.boundary["axes"], self.boundary["levels"])

    def robust(self, confidence: float = 0.95) -> pd.DataFrame:
        """Probability of instability with its interval, of any mode and of each track.

        The points of a random design count as draws (analysis.robust.probability.robust_table);
        of a sobol_indices design its two independent samples alone.

        Raises
        ------
        ResultsError
            Where the design is not random, or every point failed.
        """
        self._expect_random("probability of instability")
        from squealstudy.analysis.robust.probability import robust_table
        from squealstudy.analysis.robust.saltelli import base_rows

        n, d = len(self.points), len(self.swept)
        drawn = base_rows(n, d) if self.design == SOBOL_INDICES else None
        return robust_table(self.points, self.modes, drawn, confidence)

    def sobol_indices(self, top: int | None = 8, confidence: float = 0.95) -> pd.DataFrame:
        """First and total Sobol indices of the largest growth rate and of unstable tracks.

        See analysis.robust.sobol_table.sobol_table.

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
        from squealstudy.analysis.robust.sobol_table import sobol_table

        return sobol_table(self.points, self.modes, self.swept, top, confidence)

    def _expect_random(self, what: str) -> None:
        if self.kind != "complex_modes" or self.design not in RANDOM_DESIGNS:
            kinds = ", ".join(RANDOM_DESIGNS)
            raise ResultsError(
                f"{self.directory}: {what} needs complex modes of a random design ({kinds}), this "
                f"is {self.kind} of a {self.design} design"
            )

    def _expect_transient(self, what: str) -> None:
        self._expect_kind("transient", what)

    def _expect_kind(self, kind: str, what: str) -> None:
        if self.kind != kind:
            raise ResultsError(f"{self.directory}: a {self.kind} study has no {what}")

    def _read(self, name: str) -> pd.DataFrame:
        try:
            return pq.read_table(self.directory / name).to_pandas()
        except (OSError, ValueError) as error:
            raise ResultsError(
                f"{self.directory / name}: not a readable table ({error})"
            ) from error
