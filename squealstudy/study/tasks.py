"""What passes between a run and its workers, whatever is computed at a design point."""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.study.design import Design


@dataclass(frozen=True)
class PointTask:
    """One design point: identity, design, and the cache key of its structure."""

    point_id: str
    design: Design
    prepared_key: str


@dataclass(frozen=True)
class ChunkReport:
    """What comes back from a worker: counts and times only."""

    n_points: int
    n_failed: int
    n_known_working_points: int
    wall_s: float
    peak_mb: float
