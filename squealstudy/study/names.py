"""Names of the files of a results directory."""

from __future__ import annotations

POINTS, MODES, GROWTH = "points.parquet", "modes.parquet", "growth.parquet"
HISTORIES, STATES = "histories", "states"
