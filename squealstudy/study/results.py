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
from squealstudy.study.manifest import read_manifest
from squealstudy.study.tables import MODES, POINTS

ONSET_PARAMETER = "friction"


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
        if not (directory / POINTS).is_file() or not (directory / MODES).is_file():
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
        """Unstable tracked modes, the most important first; see analysis.ranking.rank_modes."""
        return rank_modes(self.points, self.modes, self.along, by, top, where)

    def _read(self, name: str) -> pd.DataFrame:
        try:
            return pq.read_table(self.directory / name).to_pandas()
        except (OSError, ValueError) as error:
            raise ResultsError(
                f"{self.directory / name}: not a readable table ({error})"
            ) from error
