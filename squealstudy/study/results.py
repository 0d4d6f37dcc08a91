"""Reading results: tables as pandas frames, and the ranking."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq

from squealstudy.analysis.ranking import rank_modes
from squealstudy.errors import ResultsError
from squealstudy.study.names import GROWTH, MODES, POINTS
from squealstudy.study.results_manifest import read_manifest
from squealstudy.study.transient.histories import read_history

ONSET_PARAMETER = "friction"
TABLES = {"complex_modes": (POINTS, MODES), "transient": (POINTS, MODES, GROWTH)}


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

    @classmethod
    def open(cls, path: str | Path) -> Results:
        """Open a results directory.

        Raises
        ------
        ResultsError
            Missing, not of squealstudy, or not finished.
        """
        directory = Path(path)
        if not directory.is_dir():
            raise ResultsError(f"{directory}: no such results directory")
        manifest = read_manifest(directory)
        if manifest is None:
            raise ResultsError(f"{directory}: no manifest.json here, so no results of squealstudy")
        tables = TABLES.get(str(manifest.get("kind")), ())
        if not tables or not all((directory / name).is_file() for name in tables):
            raise ResultsError(
                f"{directory}: the run is not finished; run the study again to go on"
            )
        return cls(directory, manifest)

    @cached_property
    def points(self) -> pd.DataFrame:
        """One row a design point."""
        return self._read(POINTS)

    @cached_property
    def modes(self) -> pd.DataFrame:
        """One row a complex mode of a design point."""
        return self._read(MODES)

    @cached_property
    def growth(self) -> pd.DataFrame:
        """One row an unstable complex mode of a design point, fitted growth beside it.

        Raises ResultsError where the study is not a transient one.
        """
        self._expect_transient("growth table")
        return self._read(GROWTH)

    def history(self, point_id: str) -> pd.DataFrame:
        """Torque, contact shares and modal energies of one design point over time.

        Raises ResultsError where none was kept, or the study is not a transient one.
        """
        self._expect_transient("histories")
        return read_history(self.directory, point_id)

    @property
    def kind(self) -> str:
        """``complex_modes`` or ``transient``."""
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
        if ONSET_PARAMETER in self.swept:
            return ONSET_PARAMETER
        return self.swept[0] if self.swept else None

    def rank(
        self, by: str = "share", top: int | None = None, where: str | None = None
    ) -> pd.DataFrame:
        """The modes that matter most first.

        Unstable tracked modes (analysis.ranking.rank_modes), or the modes that carry the energy
        of a transient study (analysis.transient_ranking.rank_energy), which has no choice of `by`.
        """
        if self.kind == "transient":
            if by != "share":
                raise ResultsError(
                    f"{self.directory}: modes of a transient study are ranked by energy share, "
                    f"not by '{by}'"
                )
            from squealstudy.analysis.transient_ranking import rank_energy

            return rank_energy(self.points, self.modes, top, where)
        return rank_modes(self.points, self.modes, self.along, by, top, where)

    def _expect_transient(self, what: str) -> None:
        if self.kind != "transient":
            raise ResultsError(f"{self.directory}: a {self.kind} study has no {what}")

    def _read(self, name: str) -> pd.DataFrame:
        try:
            return pq.read_table(self.directory / name).to_pandas()
        except (OSError, ValueError) as error:
            raise ResultsError(
                f"{self.directory / name}: not a readable table ({error})"
            ) from error
